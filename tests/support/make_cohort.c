/* One half of make_synthetic: writes a cohort of synthetic anatomies (anatomy.h) whose
 * correspondence is known:
 *
 *   make_synthetic KIND OUT_DIR [OPTION VALUE...]
 *
 * OUT_DIR/shapes/KIND_NN.ply (or .nrrd) is what a modeller gets, OUT_DIR/truth/KIND_NN.ply the same
 * shapes on one triangulation.  Options: count, seed, strength (of the variation, 1), rough
 * (size of bumps that no other shape has, relative to the variation; 0.25 is much), turn (largest,
 * degrees), size (standard deviation of log size), mirror (every so many-th shape is mirrored and
 * called KIND_NN_L), cut (1: cut flat at 0 to 35 % of the height), open (above so much of the
 * height and more the surface is missing: open, shapes and truth alike, at the same place of all),
 * paint (1: with open, shapes are closed and OUT_DIR/constraints/KIND_NN.json says what counts),
 * mess (level of mesh_mess.h, for masks of mesh_mask.h), coarse, fine (the meshes' grids, relative
 * to the truth's, are drawn from fine to coarse), landmarks (so many true ones, to
 * OUT_DIR/landmarks.csv), noise (standard deviation of what they are moved by, on shapes other than
 * the first), x, y, z (write masks with this spacing), mixed (spacings differ by up to this
 * factor), crop (voxels of the mask lost beyond the borders of its image), tunnels (as many tunnels
 * through masks, and strands across their gaps, as up to this). */
#include <stdio.h>
#include <stdlib.h>

#include "anatomy.h"
#include "apsm/context.h"
#include "apsm/formats.h"
#include "files/files.h"
#include "geometry/clip.h"
#include "make_cohort.h"
#include "mesh_mask.h"
#include "mesh_mess.h"
#include "option_words.h"

enum {
    COUNT,
    SEED,
    STRENGTH,
    TURN,
    SIZE,
    MIRROR,
    CUT,
    MESS,
    COARSE,
    FINE,
    X,
    Y,
    Z,
    MIXED,
    CROP,
    ROUGH,
    TUNNELS,
    OPEN,
    LANDMARKS,
    NOISE,
    PAINT,
    OPTIONS
};
static const char *const names[OPTIONS] = { "count",  "seed",    "strength", "turn",      "size",
                                            "mirror", "cut",     "mess",     "coarse",    "fine",
                                            "x",      "y",       "z",        "mixed",     "crop",
                                            "rough",  "tunnels", "open",     "landmarks", "noise",
                                            "paint" };

typedef struct job {
    apsm_context *ctx;
    anatomy_kind kind;
    const char *folder;
    double v[OPTIONS];
    apsm_mesh template_mesh;
    apsm_writer *landmarks; /* NULL: none are wanted */
    apsm_mesh whole; /* with paint: of which template_mesh is the part where below is positive */
    double *below;
} job;

static apsm_status write_mask(const job *j, const char *path, const apsm_mesh *mesh,
                              apsm_random *rng)
{
    double spacing[3];
    for (int c = 0; c < 3; c++) {
        const double factor = pow(j->v[MIXED], 2 * apsm_random_uniform(rng) - 1);
        spacing[c] = j->v[X + c] * factor;
    }
    apsm_volume volume = mesh_mask(mesh, spacing);
    if (j->v[MESS] > 0) mask_mess(&volume, mesh, rng, (int)j->v[MESS]);
    if (j->v[TUNNELS] > 0)
        for (size_t k = apsm_random_below(rng, (size_t)j->v[TUNNELS]) + 1; k > 0; k--)
            mask_tunnel(&volume, mesh, rng, k % 3 == 0);
    if (j->v[CROP] >= 0) mask_crop(&volume, (size_t)j->v[CROP]);
    const apsm_status status = apsm_write_volume(j->ctx, path, &volume);
    apsm_volume_free(&volume);
    return status;
}

static apsm_status write_shape(const job *j, const char *name, apsm_mesh *mesh, apsm_random *rng)
{
    char path[1024];
    const bool mask = j->v[X] > 0;
    snprintf(path, sizeof path, "%s/shapes/%s.%s", j->folder, name, mask ? "nrrd" : "ply");
    if (mask) return write_mask(j, path, mesh, rng);
    if (j->v[MESS] > 0) mess_up(mesh, rng, (int)j->v[MESS]);
    return apsm_write_mesh(j->ctx, path, mesh);
}

/* Vertices of the truth's one triangulation, spread over their list. */
static void write_landmarks(const job *j, size_t i, const char *name, const apsm_mesh *truth)
{
    apsm_random rng = apsm_random_stream((uint64_t)j->v[SEED], APSM_STREAM_TEST, 2000 + i, 2);
    const size_t n = (size_t)j->v[LANDMARKS];
    for (size_t l = 0; l < n && j->landmarks; l++) {
        const double *x = truth->V + 3 * (l * truth->nv / n);
        apsm_writer_printf(j->landmarks, "%s,L%zu", name, l + 1);
        for (size_t c = 0; c < 3; c++) {
            const double moved = j->v[NOISE] * apsm_random_normal(&rng);
            apsm_writer_printf(j->landmarks, ",");
            apsm_writer_number(j->landmarks, x[c] + (i > 0 ? moved : 0));
        }
        apsm_writer_printf(j->landmarks, "\n");
    }
}

static apsm_status write_truth(const job *j, const char *name, const anatomy_map *map,
                               apsm_mesh *mesh)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/truth/%s.ply", j->folder, name);
    APSM_TRY(apsm_mesh_copy(&j->template_mesh, mesh));
    anatomy_apply(map, mesh);
    return apsm_write_mesh(j->ctx, path, mesh);
}

/* The whole shape, and what of it counts. */
static apsm_status write_paint(const job *j, const char *name, const anatomy_map *map,
                               apsm_mesh *mesh)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/constraints/%s.json", j->folder, name);
    APSM_TRY(apsm_mesh_copy(&j->whole, mesh));
    anatomy_apply(map, mesh);
    FILE *file = fopen(path, "w");
    if (!file) return APSM_ERR_IO;
    fputs("{\"free_form_constraints\": {\"field\": {\"points\": [", file);
    for (size_t v = 0; v < mesh->nv; v++)
        fprintf(file, "%s[%.9g, %.9g, %.9g]", v ? ", " : "", mesh->V[3 * v], mesh->V[3 * v + 1],
                mesh->V[3 * v + 2]);
    fputs("], \"scalars\": [", file);
    for (size_t v = 0; v < mesh->nv; v++) fprintf(file, "%s%d", v ? ", " : "", j->below[v] > 0);
    fputs("]}}}\n", file);
    return fclose(file) == 0 ? APSM_OK : APSM_ERR_IO;
}

/* Heights and grids have a stream of their own: a cohort cut or coarse has the shapes it has whole.
 */
static apsm_status make_one(const job *j, size_t i)
{
    char name[64];
    apsm_mesh mesh;
    apsm_random rng = apsm_random_stream((uint64_t)j->v[SEED], APSM_STREAM_TEST, 1000 + i, 1);
    const size_t every = (size_t)j->v[MIRROR];
    const anatomy_spread spread = { .strength = j->v[STRENGTH],
                                    .rough = j->v[ROUGH],
                                    .size = j->v[SIZE],
                                    .turn = j->v[TURN],
                                    .mirrored = every > 0 && i % every == every - 1 };
    const anatomy_map map = anatomy_draw(j->kind, (uint64_t)j->v[SEED], i, &spread);
    const anatomy_extent *e = &map.extent;
    const double height = apsm_random_uniform(&rng) * 0.35, grid = apsm_random_uniform(&rng);
    const double cut = j->v[CUT] > 0 ? e->lo[2] + height * (e->hi[2] - e->lo[2]) : -INFINITY;
    snprintf(name, sizeof name, "%s_%02zu%s", anatomy_name(j->kind), i,
             spread.mirrored ? "_L" : "");
    APSM_TRY(write_truth(j, name, &map, &mesh));
    write_landmarks(j, i, name, &mesh);
    if (j->v[CUT] > 0 || j->v[COARSE] != 1 || j->v[FINE] != 1) {
        const double coarser = j->v[FINE] * pow(j->v[COARSE] / j->v[FINE], grid);
        apsm_mesh_free(&mesh);
        APSM_TRY(anatomy_template(j->ctx, j->kind, coarser, cut, &mesh));
        anatomy_apply(&map, &mesh);
    }
    if (j->v[PAINT] > 0) {
        apsm_mesh_free(&mesh);
        APSM_TRY(write_paint(j, name, &map, &mesh));
    }
    const apsm_status status = write_shape(j, name, &mesh, &rng);
    apsm_mesh_free(&mesh);
    return status;
}

static apsm_status make_folder(const job *j, const char *name)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", j->folder, name);
    return apsm_make_folder(j->ctx, path);
}

/* Takes away what lies above a share of the template's height. */
static apsm_status open_template(job *j)
{
    apsm_mesh *m = &j->whole;
    double lo[3], hi[3];
    *m = j->template_mesh;
    j->template_mesh = (apsm_mesh){ 0 };
    j->below = malloc(m->nv * sizeof *j->below);
    if (!j->below) return APSM_ERR_MEMORY;
    apsm_mesh_bounds(m, lo, hi);
    for (size_t v = 0; v < m->nv; v++)
        j->below[v] = lo[2] + j->v[OPEN] * (hi[2] - lo[2]) - m->V[3 * v + 2];
    return apsm_mesh_clip_field(m, j->below, &j->template_mesh);
}

static apsm_status open_landmarks(job *j)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/landmarks.csv", j->folder);
    if (!(j->v[LANDMARKS] > 0)) return APSM_OK;
    APSM_TRY(apsm_writer_open(j->ctx, path, &j->landmarks));
    apsm_writer_printf(j->landmarks, "shape,name,x,y,z\n");
    return APSM_OK;
}

static apsm_status make_all(job *j)
{
    APSM_TRY(make_folder(j, "shapes"));
    APSM_TRY(make_folder(j, "truth"));
    if (j->v[PAINT] > 0) APSM_TRY(make_folder(j, "constraints"));
    APSM_TRY(anatomy_template(j->ctx, j->kind, 1, -INFINITY, &j->template_mesh));
    if (j->v[OPEN] < 1) APSM_TRY(open_template(j));
    APSM_TRY(open_landmarks(j));
    apsm_status status = APSM_OK;
    for (size_t i = 0; i < (size_t)j->v[COUNT] && status == APSM_OK; i++) status = make_one(j, i);
    if (j->landmarks && status == APSM_OK) return apsm_writer_commit(j->landmarks);
    apsm_writer_abort(j->landmarks);
    return status;
}

bool is_cohort(const char *word)
{
    return anatomy_find(word) != ANATOMY_KINDS;
}

int make_cohort(apsm_context *ctx, int argc, char **argv)
{
    job j = { .ctx = ctx,
              .kind = anatomy_find(argv[1]),
              .folder = argv[2],
              .v = { [COUNT] = 10,
                     [STRENGTH] = 1,
                     [COARSE] = 1,
                     [FINE] = 1,
                     [MIXED] = 1,
                     [CROP] = -1,
                     [OPEN] = 1 } };
    if (!option_words(argc - 3, argv + 3, OPTIONS, names, j.v)) return 2;
    const apsm_status status = make_all(&j);
    apsm_mesh_free(&j.template_mesh);
    apsm_mesh_free(&j.whole);
    free(j.below);
    if (status != APSM_OK) fprintf(stderr, "make_synthetic: %s\n", apsm_error_text(ctx));
    return status != APSM_OK;
}
