/* Where a shape has been cut off: by the edge of an image, or by a saw.  Then it ends in a plane,
 * and just below that end it is about as wide as farther below:
 *
 *   width(d) = sum of area n.n_f over the faces less than d radii below the end in direction n
 *            = area of the section there (divergence theorem)
 *   cut:       width(0.02) >= 0.65 width(d) for d up to 0.1 and width(0.3) >= width(0.02) / 2
 *
 * A round end has 0.2 for 0.65.  The last condition leaves out plates.  Blunt ends of bones and
 * menisci reach 0.7, but are no planes: of the faces that lie in the plane, those that look its way
 * within 18 degrees, the heights have a root mean square of 0.007 radii and more.  Cut faces have
 * 0.004 at most, as masks of coarse voxels 0.006; and a share of 0.5 of the width, or more, looks
 * the plane's way within 10 degrees.  Smoothing rounds the edges of masks.
 *
 * The radius of a long thin bone says little of its ends.  So the first two depths are at most 0.13
 * and 0.65 times the end's own size, the root of its width; and where what lies in the plane is
 * more than 2.5 times as long as it is wide, as on the side of a bowed shaft, 0.8 takes the place
 * of 0.65. */
#include <math.h>
#include <string.h>

#include "align/align.h"
#include "align/icp.h"
#include "geometry/affine.h"
#include "geometry/face.h"

enum { CANDIDATES = 1500, NARROWER = 3, BETWEEN = 4 };

static const double thick = 0.02, depth = 0.1, deeper = 0.3; /* in radii */
static const double own_depth = 0.65;                        /* in roots of the width */
static const double compact = 2.5;      /* length by width of what lies in a plane */
static const double narrow_share = 0.8; /* in place of least_share for what is longer */
static const double least_share = 0.65, least_behind = 0.5;
static const double rough_share = 0.42;    /* for the few points of the cloud */
static const double cosine_flat = 0.95;    /* of faces that say where the plane is: 18 degrees */
static const double cosine_other = 0.8660; /* a second cut looks another way by 30 degrees */
static const double roughest = 0.006;      /* root mean square of heights, in radii */
static const double cosine_even = 0.9848;  /* 10 degrees */
static const double least_even = 0.4;      /* of the width: that looks the plane's way so closely */
/* More than this share of the surface in planes: the shape is like that, a box, and not cut. */
static const double most_flat = 0.2;

typedef struct depths {
    double thick, depth, deeper; /* lengths */
} depths;

/* The widths so far. */
typedef struct flatness {
    double end, width, behind;
    double seen, n[3], x[3], xx[9]; /* of the faces in the plane: area, sums of area times normal,
                                       place and its products */
} flatness;

/* Adds a piece of surface at x, with normal m, at height z over the end in direction n. */
static void add_piece(const double n[3], const double x[3], const double m[3], double z,
                      double area, const depths *d, flatness *f)
{
    const double cosine = vec3_dot(n, m);
    if (z >= -d->deeper) f->behind += area * cosine;
    if (z >= -d->depth) f->width += area * cosine;
    if (z < -d->thick) return;
    f->end += area * cosine;
    if (cosine < cosine_flat) return;
    f->seen += area;
    vec3_add_scaled(f->x, area, x);
    vec3_add_scaled(f->n, area, m);
    for (size_t k = 0; k < 9; k++) f->xx[k] += area * x[k / 3] * x[k % 3];
}

/* The largest n.x of N points. */
static double end_of(size_t N, const double *x, const double n[3])
{
    double end = -INFINITY;
    for (size_t i = 0; i < N; i++) end = fmax(end, vec3_dot(n, x + 3 * i));
    return end;
}

/* By the points of the cloud; false if some lie beyond the plane. */
static bool may_be_cut(const apsm_cloud *cloud, const double plane[4])
{
    const depths d = { thick * cloud->radius, depth * cloud->radius, deeper * cloud->radius };
    const double end = end_of(cloud->n, cloud->x, plane);
    flatness f = { 0 };
    if (end > plane[3] + thick * cloud->radius) return false;
    for (size_t i = 0; i < cloud->n; i++) {
        const double *x = cloud->x + 3 * i, z = vec3_dot(plane, x) - end;
        add_piece(plane, x, cloud->normal + 3 * i, z, cloud->w[i], &d, &f);
    }
    return f.end >= rough_share * f.width;
}

static void middle_of(const apsm_mesh *mesh, size_t f, double x[3])
{
    const double *a = mesh->V + 3 * mesh->F[3 * f], *b = mesh->V + 3 * mesh->F[3 * f + 1],
                 *c = mesh->V + 3 * mesh->F[3 * f + 2];
    for (size_t k = 0; k < 3; k++) x[k] = (a[k] + b[k] + c[k]) / 3.0;
}

static flatness measure(const apsm_mesh *mesh, const double plane[4], const depths *d)
{
    flatness f = { 0 };
    const double end = end_of(mesh->nv, mesh->V, plane), least = -fmax(d->deeper, d->depth);
    for (size_t i = 0; i < mesh->nf; i++) {
        double m[3], x[3];
        middle_of(mesh, i, x);
        const double z = vec3_dot(plane, x) - end;
        if (!(z >= least)) continue;
        const double area = 0.5 * face_normal(mesh, i, m);
        add_piece(plane, x, m, z, area, d, &f);
    }
    return f;
}

/* How long what lies in the plane is: that of a strip with the same second moments. */
static double length_of(const flatness *f)
{
    double S[9], U[9], s[3], V[9];
    for (size_t k = 0; k < 9; k++)
        S[k] = (f->xx[k] - f->x[k / 3] * f->x[k % 3] / f->seen) / f->seen;
    apsm_svd3(S, U, s, V);
    return sqrt(12.0 * s[0]);
}

/* Not widening with depth, as round ends do and, where they are long and narrow, sides of bowed
 * shafts. */
static bool is_end(const apsm_mesh *mesh, const double plane[4], const depths *d, const flatness *f)
{
    const double length = length_of(f);
    const double share = length * length > compact * f->seen ? narrow_share : least_share;
    double widest = f->width;
    if (f->end < share * widest || f->behind < least_behind * f->end) return false;
    for (int k = 1; k < BETWEEN; k++) {
        const double at = d->thick * pow(d->depth / d->thick, (double)k / BETWEEN);
        widest = fmax(widest, measure(mesh, plane, &(depths){ at, at, 0.0 }).width);
    }
    return f->end >= share * widest;
}

/* By all faces. */
static bool ends_in(const apsm_mesh *mesh, double radius, const double plane[4], flatness *f)
{
    depths d = { thick * radius, depth * radius, deeper * radius };
    if (end_of(mesh->nv, mesh->V, plane) > plane[3] + thick * radius) return false;
    *f = measure(mesh, plane, &d);
    for (int k = 0; k < NARROWER && own_depth * sqrt(fmax(f->width, 0.0)) < d.depth; k++) {
        d.depth = own_depth * sqrt(fmax(f->width, 0.0));
        d.thick = d.depth * thick / depth;
        *f = measure(mesh, plane, &d);
    }
    return f->seen > 0.0 && is_end(mesh, plane, &d, f);
}

/* Whether what lies in the plane is as flat as a plane: width is the end's. */
static bool is_flat(const apsm_mesh *mesh, double radius, const double plane[4], double width)
{
    double even = 0.0, seen = 0.0, square = 0.0;
    for (size_t i = 0; i < mesh->nf; i++) {
        double m[3], x[3];
        middle_of(mesh, i, x);
        const double z = vec3_dot(plane, x) - plane[3];
        if (fabs(z) > thick * radius) continue;
        const double area = 0.5 * face_normal(mesh, i, m), cosine = vec3_dot(plane, m);
        if (cosine < cosine_flat) continue;
        seen += area;
        square += area * z * z;
        if (cosine >= cosine_even) even += area;
    }
    return even >= least_even * width && sqrt(square / seen) <= roughest * radius;
}

/* The same; plane: n, offset, in (of one face) and out (of the faces in it): for both it must hold.
 */
static bool is_cut(const apsm_mesh *mesh, double radius, double plane[4], double *flat)
{
    flatness f;
    if (!ends_in(mesh, radius, plane, &f)) return false;
    vec3_normalise(f.n);
    for (size_t a = 0; a < 3; a++) plane[a] = f.n[a];
    plane[3] = vec3_dot(f.n, f.x) / f.seen;
    *flat = f.end;
    return ends_in(mesh, radius, plane, &f) && is_flat(mesh, radius, plane, *flat);
}

static bool is_new(const apsm_cloud *cloud, const double n[3])
{
    for (size_t c = 0; c < cloud->cuts; c++)
        if (vec3_dot(cloud->cut[c], n) > cosine_other) return false;
    return true;
}

void apsm_cloud_find_cuts(const apsm_mesh *mesh, apsm_cloud *cloud)
{
    const size_t every = (mesh->nf + CANDIDATES - 1) / CANDIDATES;
    double sum = 0.0;
    cloud->cuts = 0;
    for (size_t i = 0; i < mesh->nf; i += every) {
        double plane[4], x[3], flat;
        face_normal(mesh, i, plane);
        middle_of(mesh, i, x);
        plane[3] = vec3_dot(plane, x);
        if (!is_new(cloud, plane) || !may_be_cut(cloud, plane)) continue;
        if (!is_cut(mesh, cloud->radius, plane, &flat)) continue;
        sum += flat;
        if (cloud->cuts == APSM_MOST_CUTS || sum > most_flat * apsm_mesh_area(mesh)) {
            cloud->cuts = 0;
            return;
        }
        for (size_t a = 0; a < 4; a++) cloud->cut[cloud->cuts][a] = plane[a];
        cloud->cuts++;
    }
}

void apsm_cloud_keep_cuts(const apsm_borders *borders, apsm_cloud *cloud)
{
    size_t kept = 0;
    if (!borders->known) return;
    for (size_t c = 0; c < cloud->cuts; c++) {
        double most = -1.0;
        for (size_t b = 0; b < borders->n; b++)
            most = fmax(most, vec3_dot(borders->normal[b], cloud->cut[c]));
        if (most < cosine_other) continue;
        memmove(cloud->cut[kept++], cloud->cut[c], sizeof cloud->cut[c]);
    }
    cloud->cuts = kept;
}
