/* npz: NumPy's arrays in one file, which is a zip of .npy files.  The same model gives the same
 * bytes: the date in the zip is always that where its time begins. */
#include <minizip/zip.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "exchange/exporting.h"
#include "files/point_formats.h"

enum { EPOCH = 0x00210000, LEVEL = 6, PIECE = 1 << 16 }; /* 1980-01-01, as the zip counts */

static bool put(zipFile zip, const void *bytes, size_t n)
{
    const char *at = bytes;
    for (; n > 0; n -= n < PIECE ? n : PIECE, at += PIECE)
        if (zipWriteInFileInZip(zip, at, (unsigned)(n < PIECE ? n : PIECE)) != ZIP_OK) return false;
    return true;
}

static bool begin_array(zipFile zip, const char *name, const char *descr, size_t axes,
                        const size_t *shape)
{
    char file[64], head[APSM_NPY_HEADER];
    const zip_fileinfo info = { .dosDate = EPOCH };
    snprintf(file, sizeof file, "%s.npy", name);
    if (zipOpenNewFileInZip64(zip, file, &info, NULL, 0, NULL, 0, NULL, Z_DEFLATED, LEVEL, 1) !=
        ZIP_OK)
        return false;
    return put(zip, head, apsm_npy_header(descr, axes, shape, head));
}

/* Little-endian, whatever the machine. */
static bool put_doubles(zipFile zip, size_t n, const double *x)
{
    unsigned char bytes[8 * 512];
    for (size_t k = 0; k < n;) {
        size_t used = 0;
        for (; k < n && used < sizeof bytes; k++) {
            uint64_t bits;
            memcpy(&bits, &x[k], sizeof bits);
            for (int b = 0; b < 8; b++) bytes[used++] = (unsigned char)(bits >> (8 * b));
        }
        if (!put(zip, bytes, used)) return false;
    }
    return true;
}

static bool put_array(zipFile zip, const char *name, size_t axes, const size_t *shape,
                      const double *x)
{
    size_t n = 1;
    for (size_t a = 0; a < axes; a++) n *= shape[a];
    return begin_array(zip, name, "<f8", axes, shape) && put_doubles(zip, n, x) &&
           zipCloseFileInZip(zip) == ZIP_OK;
}

static bool put_faces(zipFile zip, const apsm_mesh *mesh)
{
    bool good = begin_array(zip, "faces", "<u4", 2, (const size_t[]){ mesh->nf, 3 });
    for (size_t k = 0; good && k < 3 * mesh->nf; k++) {
        const uint32_t v = mesh->F[k];
        const unsigned char bytes[4] = { (unsigned char)v, (unsigned char)(v >> 8),
                                         (unsigned char)(v >> 16), (unsigned char)(v >> 24) };
        good = put(zip, bytes, sizeof bytes);
    }
    return good && zipCloseFileInZip(zip) == ZIP_OK;
}

/* Modes of the vertices at one standard deviation; y (nv x 3) is scratch. */
static bool put_modes(zipFile zip, const exporting *e, double *y)
{
    const size_t nv = e->dense.mean.nv;
    bool good = begin_array(zip, "modes", "<f8", 3, (const size_t[]){ e->modes, nv, 3 });
    for (size_t k = 0; good && k < e->modes; k++) {
        dense_model_mode(&e->dense, k, y);
        good = put_doubles(zip, 3 * nv, y);
    }
    return good && zipCloseFileInZip(zip) == ZIP_OK;
}

/* UTF-8 of fixed length, filled with zero bytes. */
static bool put_names(zipFile zip, const model_folder *m)
{
    static const char zeros[64];
    size_t longest = 1;
    char descr[32];
    for (size_t i = 0; i < m->I; i++)
        if (strlen(m->names[i]) > longest) longest = strlen(m->names[i]);
    snprintf(descr, sizeof descr, "|S%zu", longest);
    bool good = begin_array(zip, "names", descr, 1, &m->I);
    for (size_t i = 0; good && i < m->I; i++) {
        size_t length = strlen(m->names[i]);
        good = put(zip, m->names[i], length);
        for (; good && length < longest; length += sizeof zeros)
            good =
                put(zip, zeros, longest - length < sizeof zeros ? longest - length : sizeof zeros);
    }
    return good && zipCloseFileInZip(zip) == ZIP_OK;
}

/* The scores of the modes that are written; work (I x modes). */
static bool put_scores(zipFile zip, const exporting *e, double *work)
{
    const apsm_shape_model *m = &e->dense.folder.model;
    for (size_t i = 0; i < m->I; i++)
        memcpy(work + i * e->modes, m->score + i * m->modes, e->modes * sizeof *work);
    return put_array(zip, "scores", 2, (const size_t[]){ m->I, e->modes }, work);
}

static bool put_all(zipFile zip, const exporting *e, double *work)
{
    const model_folder *m = &e->dense.folder;
    const apsm_mesh *mean = &e->dense.mean;
    const size_t K = e->modes, J = m->J;
    return put_array(zip, "mean", 2, (const size_t[]){ mean->nv, 3 }, mean->V) &&
           put_faces(zip, mean) && put_modes(zip, e, work) &&
           put_array(zip, "variances", 1, &K, m->model.variance) && put_scores(zip, e, work) &&
           put_names(zip, m) &&
           put_array(zip, "particles", 3, (const size_t[]){ m->I, J, 3 }, m->P) &&
           put_array(zip, "particle_mean", 2, (const size_t[]){ J, 3 }, m->model.mean) &&
           put_array(zip, "particle_modes", 3, (const size_t[]){ K, J, 3 }, m->model.mode);
}

static apsm_status write_zip(const exporting *e, const char *temp, double *work)
{
    const char *path = e->settings->path;
    zipFile zip = zipOpen64(temp, APPEND_STATUS_CREATE);
    bool good = zip && put_all(zip, e, work);
    if (zip && zipClose(zip, NULL) != ZIP_OK) good = false;
    if (good) return apsm_replace_file(e->ctx, temp, path);
    unlink(temp);
    return apsm_fail(e->ctx, APSM_ERR_IO, "%s: cannot be written; is the disk full?", path);
}

apsm_status export_npz(exporting *e)
{
    const char *path = e->settings->path;
    const size_t length = strlen(path) + 32, nv3 = 3 * e->dense.mean.nv,
                 scores = e->dense.folder.I * e->modes;
    apsm_writer *probe; /* says why a file cannot be made, which the zip does not */
    APSM_TRY(apsm_writer_open(e->ctx, path, &probe));
    apsm_writer_abort(probe);
    char *temp = malloc(length);
    double *work = malloc((nv3 > scores ? nv3 : scores) * sizeof *work);
    apsm_status status = APSM_ERR_MEMORY;
    if (temp && work) {
        snprintf(temp, length, "%s.%ld.tmp", path, (long)getpid());
        status = write_zip(e, temp, work);
    }
    free(temp);
    free(work);
    return status == APSM_ERR_MEMORY ? apsm_fail(e->ctx, status, "%s: out of memory", path)
                                     : status;
}
