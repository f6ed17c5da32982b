/* calibration.json of a model folder: what left-out shapes say about the model, so that a load need
 * not ask them again.  "of" is the SHA-256 of all that the figures were made from; figures of
 * another model are no figures. */
#include "fit/calibration_file.h"

#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "folder/names.h"

static const char *const names[FIT_CALIBRATION] = {
    "modes",     "noise",          "smooth",        "reach",    "band_20",       "band_50",
    "band_80",   "band_landmarks", "mahalanobis",   "residual", "residual_most", "size_least",
    "size_most", "distance",       "distance_most", "pose"
};

/* ---- what it is made from ---- */

static void add(apsm_sha256 *sha, size_t n, const double *x)
{
    apsm_sha256_add(sha, x, n * sizeof *x);
}

void fit_calibration_of(const apsm_fit_model *m, char hex[65])
{
    const apsm_shape_model *s = &m->model;
    const apsm_mesh *mesh = &m->cohort.shape[0].mesh;
    const size_t D = 3 * s->J;
    const double sizes[] = { (double)s->I,
                             (double)s->J,
                             (double)s->modes,
                             (double)mesh->nv,
                             (double)mesh->nf,
                             (double)m->options.align.align,
                             (double)m->options.optimize.fidelity.fidelity_modes,
                             m->calibration.distance,
                             m->calibration.distance_most };
    unsigned char digest[32];
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    add(&sha, sizeof sizes / sizeof *sizes, sizes);
    add(&sha, D, s->mean);
    add(&sha, s->modes * D, s->mode);
    add(&sha, s->modes, s->variance);
    add(&sha, s->I * s->modes, s->score);
    add(&sha, D, m->T);
    add(&sha, 3 * mesh->nv, mesh->V);
    apsm_sha256_add(&sha, mesh->F, 3 * mesh->nf * sizeof *mesh->F);
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, hex);
}

/* ---- reading ---- */

bool fit_calibration_makes_sense(const fit_calibration *c)
{
    double x[FIT_CALIBRATION];
    memcpy(x, c, sizeof x);
    for (size_t k = 0; k < FIT_CALIBRATION; k++)
        if (!isfinite(x[k])) return false;
    return c->noise > 0 && c->smooth >= 0 && c->reach > 0 && c->modes >= 0 && c->mahalanobis > 0 &&
           c->residual >= 0;
}

/* false: it is no calibration of this model. */
static bool take(const json_t *root, const char *of, size_t modes, fit_calibration *c)
{
    double x[FIT_CALIBRATION];
    const char *made_of = json_string_value(json_object_get(root, "of"));
    if (json_integer_value(json_object_get(root, "version")) != CALIBRATION_VERSION || !made_of ||
        strcmp(made_of, of) != 0)
        return false;
    for (size_t k = 0; k < FIT_CALIBRATION; k++) {
        const json_t *number = json_object_get(root, names[k]);
        if (!json_is_number(number)) return false;
        x[k] = json_number_value(number);
    }
    memcpy(c, x, sizeof x);
    return fit_calibration_makes_sense(c) && c->modes <= (double)modes;
}

apsm_status fit_calibration_read(apsm_context *ctx, apsm_fit_model *m)
{
    char of[65];
    json_t *root = NULL;
    fit_calibration c = { 0 };
    char *path = apsm_path_join(m->path, FOLDER_CALIBRATION);
    if (!path) return APSM_ERR_MEMORY;
    fit_calibration_of(m, of);
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path)) {
        status = apsm_json_read(ctx, path, &root);
        if (status == APSM_OK && take(root, of, m->model.modes, &c))
            m->calibration = c;
        else
            apsm_log(ctx, APSM_LOG_INFO, "%s: is not of this model as it is now; calibrated again",
                     path);
    }
    json_decref(root);
    free(path);
    return status == APSM_ERR_MEMORY ? status : APSM_OK;
}

/* ---- writing ---- */

static json_t *json_calibration(const fit_calibration *c, const char *of)
{
    double x[FIT_CALIBRATION];
    json_t *root = json_pack("{s:s, s:i, s:s}", "format", FORMAT_CALIBRATION, "version",
                             CALIBRATION_VERSION, "of", of);
    memcpy(x, c, sizeof x);
    for (size_t k = 0; k < FIT_CALIBRATION; k++)
        if (json_object_set_new(root, names[k], json_real(x[k])) != 0) {
            json_decref(root);
            return NULL;
        }
    return root;
}

apsm_status fit_calibration_write(apsm_context *ctx, const char *path, const fit_calibration *c,
                                  const char *of)
{
    json_t *root = json_calibration(c, of);
    const apsm_status status = apsm_json_write(ctx, path, root);
    json_decref(root);
    return status;
}
