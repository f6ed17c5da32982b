/* The report of contours: all curves in the plane that shows most of them, the mean, modes, and
 * what speaks against whom. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/contour_job.h"
#include "files/files.h"
#include "folder/names.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "report/page.h"

enum { N = CONTOUR_POINTS, SHOWN_MODES = 6, DATA_VERSION = 1 };
static const double flat =
    1e-9; /* of the size: such curves lie in the plane z = 0 of their files */

/* Rows: the directions to the right and up. */
static void choose_plane(const contour_job *j, double axes[6])
{
    double c[3] = { 0 }, A[9] = { 0 }, U[9], s[3], V[9];
    const size_t n = j->c.I * N;
    for (size_t k = 0; k < 3 * n; k++) c[k % 3] += j->c.Q[k] / (double)n;
    for (size_t k = 0; k < n; k++) {
        double d[3];
        vec3_sub(j->c.Q + 3 * k, c, d);
        for (size_t x = 0; x < 9; x++) A[x] += d[x / 3] * d[x % 3] / (double)n;
    }
    memset(axes, 0, 6 * sizeof *axes);
    axes[0] = axes[4] = 1;
    if (A[8] <= flat * (A[0] + A[4])) return;
    apsm_svd3(A, U, s, V);
    for (size_t a = 0; a < 2; a++)
        for (size_t x = 0; x < 3; x++) axes[3 * a + x] = U[3 * x + a];
}

/* n points as [right, up, ...], to a thousandth of a thousandth of the size. */
static json_t *flattened(const double axes[6], double size, size_t n, const double *X)
{
    json_t *list = json_array();
    const double unit = size * 1e-6;
    for (size_t k = 0; k < 2 * n; k++) {
        const double x = vec3_dot(axes + 3 * (k % 2), X + 3 * (k / 2));
        json_array_append_new(list, json_real(unit > 0 ? round(x / unit) * unit : x));
    }
    if (json_array_size(list) == 2 * n) return list;
    json_decref(list);
    return NULL;
}

static double size_of(const contour_job *j)
{
    double most = 0;
    for (size_t k = 0; k < 3 * j->c.I * N; k++) most = fmax(most, fabs(j->c.Q[k]));
    return most;
}

static json_t *json_shapes(const contour_job *j, const double axes[6], double size)
{
    json_t *list = json_array();
    for (size_t i = 0; i < j->c.I; i++) {
        const double *rival = &j->c.rival[i];
        json_array_append_new(
            list, json_pack("{s:s, s:o, s:o, s:f, s:f, s:o, s:f, s:o}", "name", j->names[i],
                            "curve", flattened(axes, size, N, j->c.Q + 3 * i * N), "particles",
                            flattened(axes, size, j->c.J, j->c.P + 3 * i * j->c.J), "mean",
                            j->mean[i], "max", j->most[i], "rival",
                            apsm_json_number_or_null(isfinite(*rival) ? *rival : NAN), "off",
                            j->most[i] / contour_spacing(j, i), "reasons", contour_reasons(j, i)));
    }
    if (json_array_size(list) == j->c.I) return list;
    json_decref(list);
    return NULL;
}

/* Displacements of the mean curve and of its particles by one standard deviation. */
static json_t *json_mode(const contour_job *j, const double axes[6], double size, size_t k)
{
    const apsm_shape_model *m = &j->model;
    const size_t D = 3 * m->J;
    double X[3 * N], Y[3 * N], *p = malloc(2 * D * sizeof *p);
    if (!p) return NULL;
    double *d = p + D;
    for (size_t x = 0; x < D; x++) {
        d[x] = sqrt(m->variance[k]) * m->mode[k * D + x];
        p[x] = m->mean[x] + d[x];
    }
    contour_rebuild(&j->c, m->mean, X);
    contour_rebuild(&j->c, p, Y);
    for (size_t x = 0; x < 3 * N; x++) Y[x] -= X[x];
    json_t *mode =
        json_pack("{s:f, s:o, s:o}", "variance", m->variance[k], "curve",
                  flattened(axes, size, N, Y), "particles", flattened(axes, size, m->J, d));
    free(p);
    return mode;
}

static json_t *json_modes(const contour_job *j, const double axes[6], double size)
{
    const size_t n = j->model.modes < SHOWN_MODES ? j->model.modes : SHOWN_MODES;
    json_t *list = json_array();
    for (size_t k = 0; k < n; k++) json_array_append_new(list, json_mode(j, axes, size, k));
    if (json_array_size(list) == n) return list;
    json_decref(list);
    return NULL;
}

static json_t *compose(const contour_job *j, const char *title)
{
    double axes[6], X[3 * N];
    const double size = size_of(j);
    choose_plane(j, axes);
    contour_rebuild(&j->c, j->model.mean, X);
    return json_pack("{s:s, s:i, s:s, s:s, s:b, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "format",
                     "apsm-contours", "version", DATA_VERSION, "apsm", APSM_VERSION, "title", title,
                     "closed", j->closed, "template", j->names[j->template_index], "mean",
                     flattened(axes, size, N, X), "mean_particles",
                     flattened(axes, size, j->model.J, j->model.mean), "shapes",
                     json_shapes(j, axes, size), "modes", json_modes(j, axes, size), "variances",
                     apsm_json_vector(j->model.modes, j->model.variance), "generalization",
                     apsm_json_vector(j->e.n_generalization, j->e.generalization), "specificity",
                     apsm_json_vector(j->e.n_specificity, j->e.specificity));
}

apsm_status contour_write_page(const contour_job *j)
{
    pack bytes = { 0 };
    char *title = page_title(j->folder), *path = contour_path(j, FOLDER_REPORT);
    apsm_status status = APSM_ERR_MEMORY;
    if (title && path) {
        json_t *root = compose(j, title);
        status = page_write(j->ctx, path, root, &bytes);
        json_decref(root);
    }
    pack_free(&bytes);
    free(title);
    free(path);
    return status;
}
