/* Particle sets by the extension of their file. */
#include "apsm/particles.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "apsm/formats.h"
#include "files/particles_file.h"
#include "files/point_formats.h"

typedef apsm_status (*read_fn)(apsm_context *, const char *, size_t *, double **);
typedef apsm_status (*write_fn)(apsm_context *, const char *, size_t, const double *);

static apsm_status read_npy(apsm_context *ctx, const char *path, size_t *n, double **P)
{
    size_t I;
    APSM_TRY(apsm_npy_read(ctx, path, &I, n, P));
    if (I == 0) return APSM_OK;
    free(*P);
    *P = NULL;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: holds %zu shapes, not one; 'apsm convert' with --to makes files of them",
                     path, I);
}

static apsm_status write_npy(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    return apsm_npy_write(ctx, path, 0, n, P);
}

typedef struct format {
    const char *extension;
    read_fn read;
    write_fn write;
} format;

static const format formats[] = {
    { ".particles", apsm_particles_read, apsm_particles_write },
    { ".lpts", apsm_particles_read, apsm_particles_write },
    { ".wpts", apsm_particles_read, apsm_particles_write },
    { ".csv", apsm_points_csv_read, apsm_points_csv_write },
    { ".npy", read_npy, write_npy },
    { ".mrk.json", apsm_markups_read, apsm_markups_write },
    { ".vtk", apsm_read_mesh_points, apsm_write_mesh_points },
    { ".vtp", apsm_read_mesh_points, apsm_write_mesh_points },
};

static const format *format_of(const char *path)
{
    const size_t length = strlen(path);
    for (size_t k = 0; k < sizeof formats / sizeof *formats; k++) {
        const size_t end = strlen(formats[k].extension);
        if (length >= end && strcasecmp(path + length - end, formats[k].extension) == 0)
            return &formats[k];
    }
    return NULL;
}

const char *apsm_points_extension(const char *path)
{
    const format *f = format_of(path);
    return f ? f->extension : NULL;
}

static apsm_status refuse_unknown(apsm_context *ctx, const char *path)
{
    return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                     "%s: not a format of particles; use .particles, .lpts, .wpts, .csv, .npy, "
                     ".mrk.json, .vtk or .vtp",
                     path);
}

/* P: rows x 3, of shapes with n particles each. */
static apsm_status check_points(apsm_context *ctx, const char *path, size_t rows, size_t n,
                                const double *P)
{
    if (rows == 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: holds no particles; make it anew", path);
    for (size_t k = 0; k < 3 * rows; k++)
        if (!isfinite(P[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: coordinate %zu of particle %zu of shape %zu is not finite", path,
                             k % 3, k / 3 % n, k / 3 / n);
    return APSM_OK;
}

apsm_status apsm_points_read_cohort(apsm_context *ctx, const char *path, size_t *I, size_t *n,
                                    double **P)
{
    const format *f = format_of(path);
    *I = *n = 0;
    *P = NULL;
    if (!f) return refuse_unknown(ctx, path);
    APSM_TRY(f->read == read_npy ? apsm_npy_read(ctx, path, I, n, P) : f->read(ctx, path, n, P));
    const bool three_axes = *I > 0;
    const apsm_status status = check_points(ctx, path, (three_axes ? *I : 1) * *n, *n, *P);
    if (status == APSM_OK) return APSM_OK;
    free(*P);
    *P = NULL;
    *I = *n = 0;
    return status;
}

apsm_status apsm_points_read(apsm_context *ctx, const char *path, size_t *n, double **P)
{
    const format *f = format_of(path);
    *n = 0;
    *P = NULL;
    if (!f) return refuse_unknown(ctx, path);
    apsm_status status = f->read(ctx, path, n, P);
    if (status == APSM_OK) status = check_points(ctx, path, *n, *n, *P);
    if (status == APSM_OK) return APSM_OK;
    free(*P);
    *P = NULL;
    *n = 0;
    return status;
}

apsm_status apsm_points_write(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    const format *f = format_of(path);
    if (!f) return refuse_unknown(ctx, path);
    APSM_TRY(check_points(ctx, path, n, n, P));
    return f->write(ctx, path, n, P);
}

apsm_status apsm_points_write_cohort(apsm_context *ctx, const char *path, size_t I, size_t n,
                                     const double *P)
{
    const format *f = format_of(path);
    if (!f || f->write != write_npy)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED, "%s: only .npy holds several shapes", path);
    APSM_TRY(check_points(ctx, path, I * n, n, P));
    return apsm_npy_write(ctx, path, I, n, P);
}
