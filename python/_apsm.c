/* _apsm: the library for Python, by the limited API: one module for every Python from 3.11 on.  It
 * moves arrays and errors across; what a user sees is apsm/__init__.py.  Numbers come in as buffers
 * and go out as bytes of doubles (d) or 32-bit integers (I), whose shape the caller knows.  Here
 * are jobs on arrays; those on folders are in _folders.c. */
#include "_apsm.h"

#include <stdlib.h>
#include <string.h>

/* ---- run: shapes as arrays ---- */

static apsm_status add_mesh(apsm_run *run, const char *name, int reflect, PyObject *vertices,
                            PyObject *faces)
{
    Py_buffer V, F;
    size_t nv, nf;
    if (!py_view(vertices, sizeof(double), 3, &V, &nv)) return APSM_ERR_ARG;
    if (!py_view(faces, sizeof(uint32_t), 3, &F, &nf)) {
        PyBuffer_Release(&V);
        return APSM_ERR_ARG;
    }
    const apsm_status status = apsm_run_add_mesh(run, name, reflect != 0, nv, V.buf, nf, F.buf);
    PyBuffer_Release(&V);
    PyBuffer_Release(&F);
    return status;
}

static apsm_status add_volume(apsm_run *run, const char *name, int reflect, PyObject *tuple)
{
    PyObject *labels;
    Py_buffer L;
    size_t n;
    unsigned long long size[3];
    apsm_volume v = { 0 };
    if (!PyArg_ParseTuple(tuple, "O(KKK)(ddd)(ddd)(ddddddddd)", &labels, &size[0], &size[1],
                          &size[2], &v.spacing[0], &v.spacing[1], &v.spacing[2], &v.origin[0],
                          &v.origin[1], &v.origin[2], &v.direction[0], &v.direction[1],
                          &v.direction[2], &v.direction[3], &v.direction[4], &v.direction[5],
                          &v.direction[6], &v.direction[7], &v.direction[8]))
        return APSM_ERR_ARG;
    if (!py_view(labels, sizeof(int32_t), 1, &L, &n)) return APSM_ERR_ARG;
    for (int k = 0; k < 3; k++) v.n[k] = (size_t)size[k];
    v.label = L.buf;
    apsm_status status = APSM_ERR_ARG;
    if (size[0] > 0 && size[1] > 0 && size[2] > 0 && n / size[0] / size[1] == size[2] &&
        n == size[0] * size[1] * size[2])
        status = apsm_run_add_volume(run, name, reflect != 0, &v);
    else
        PyErr_SetString(PyExc_ValueError, "labels do not have the size that is given");
    PyBuffer_Release(&L);
    return status;
}

/* (name, reflect, vertices, faces) or (name, reflect, volume, None). */
static bool add_shape(call *c, apsm_run *run, PyObject *tuple)
{
    const char *name;
    int reflect;
    PyObject *first, *faces;
    if (!PyArg_ParseTuple(tuple, "spOO", &name, &reflect, &first, &faces)) return false;
    const apsm_status status = faces == Py_None ? add_volume(run, name, reflect, first)
                                                : add_mesh(run, name, reflect, first, faces);
    /* call_fine gives Ctrl-C back: only at the end. */
    return !PyErr_Occurred() && (status == APSM_OK || call_fine(c, status));
}

static PyObject *names_of(const apsm_run *run)
{
    PyObject *list = PyList_New(0);
    for (size_t i = 0; list && i < apsm_run_shapes(run); i++) {
        PyObject *name = PyUnicode_FromString(apsm_run_shape_name(run, i));
        if (!name || PyList_Append(list, name) != 0) Py_CLEAR(list);
        Py_XDECREF(name);
    }
    return list;
}

static PyObject *reasons_of(const apsm_run *run, size_t i)
{
    PyObject *list = PyList_New(0);
    const char *text;
    for (size_t k = 0; list && (text = apsm_run_review(run, i, k)); k++) {
        PyObject *reason = py_text(text);
        if (!reason || PyList_Append(list, reason) != 0) Py_CLEAR(list);
        Py_XDECREF(reason);
    }
    return list;
}

/* Of every shape (certified, reasons, to_world, mesh). */
static PyObject *shapes_of(const apsm_run *run)
{
    PyObject *list = PyList_New(0);
    for (size_t i = 0; list && i < apsm_run_shapes(run); i++) {
        double M[16];
        apsm_run_to_world(run, i, M);
        PyObject *one =
            Py_BuildValue("(NNNN)", PyBool_FromLong(apsm_run_is_certified(run, i)),
                          reasons_of(run, i), py_doubles(M, 16), py_mesh(apsm_run_mesh(run, i)));
        if (!one || PyList_Append(list, one) != 0) Py_CLEAR(list);
        Py_XDECREF(one);
    }
    return list;
}

static PyObject *figures_of(const apsm_run *run)
{
    static const char *const names[] = { "variances",      "compactness",
                                         "generalization", "generalization_standard_error",
                                         "specificity",    "specificity_standard_error",
                                         "surface_mean",   "surface_p95",
                                         "surface_max" };
    PyObject *dict = PyDict_New();
    for (size_t k = 0; dict && k < sizeof names / sizeof *names; k++) {
        size_t n = 0;
        const double *x = apsm_figures_get(apsm_run_figures(run), names[k], &n);
        if (!py_set(dict, names[k], py_doubles(x, n))) Py_CLEAR(dict);
    }
    return dict;
}

static PyObject *result_of(const apsm_run *run)
{
    size_t J = 0;
    const double *P = apsm_run_particles(run, &J);
    const size_t I = apsm_run_shapes(run);
    const apsm_shape_model *m = apsm_run_model(run);
    const size_t modes = apsm_model_modes(m);
    PyObject *dict = PyDict_New();
    if (dict && py_set(dict, "names", names_of(run)) && py_set(dict, "shapes", shapes_of(run)) &&
        py_set(dict, "template", PyLong_FromSize_t(apsm_run_template(run))) &&
        py_set(dict, "J", PyLong_FromSize_t(J)) &&
        py_set(dict, "particles", py_doubles(P, I * J * 3)) &&
        py_set(dict, "mean", py_doubles(apsm_model_mean(m), J * 3)) &&
        py_set(dict, "modes", py_doubles(apsm_model_mode(m), modes * J * 3)) &&
        py_set(dict, "variances", py_doubles(apsm_model_variance(m), modes)) &&
        py_set(dict, "scores", py_doubles(apsm_model_score(m), I * modes)) &&
        py_set(dict, "figures", figures_of(run)))
        return dict;
    Py_XDECREF(dict);
    return NULL;
}

static bool run_job(call *c, apsm_run *run, PyObject *shapes)
{
    for (Py_ssize_t i = 0; i < PyList_Size(shapes); i++)
        if (!add_shape(c, run, PyList_GetItem(shapes, i))) return false;
    apsm_status status;
    Py_BEGIN_ALLOW_THREADS status = apsm_run_all(run);
    Py_END_ALLOW_THREADS return call_fine(c, status);
}

/* run(shapes, options, threads, log, progress) -> dict */
static PyObject *py_run(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *shapes, *options, *result = NULL;
    int threads;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "OOiOO", &shapes, &options, &threads, &c.log, &c.progress))
        return NULL;
    if (!PyList_Check(shapes) || !PyList_Check(options)) {
        PyErr_SetString(PyExc_TypeError, "shapes and options are lists");
        return NULL;
    }
    const char *(*set)[2] = NULL;
    apsm_run *run = NULL;
    apsm_run_settings settings = { 0 };
    if (py_options(options, &set, &settings.n_set) && call_begin(&c, threads, 0)) {
        settings.set = (const char *const(*)[2])set;
        const apsm_status opened = apsm_run_open(c.ctx, &settings, &run);
        if ((opened == APSM_OK || call_fine(&c, opened)) && run_job(&c, run, shapes))
            result = result_of(run);
        apsm_run_close(run);
    }
    PyMem_Free(set);
    call_end(&c);
    return result;
}

/* ---- models of folders, fits ---- */

static void free_model(PyObject *capsule)
{
    apsm_fit_model_free(PyCapsule_GetPointer(capsule, "apsm_fit_model"));
}

/* fit_load(path) -> model */
static PyObject *py_fit_load(PyObject *self, PyObject *args)
{
    (void)self;
    const char *path;
    apsm_fit_model *model = NULL;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "s", &path) || !call_begin(&c, 1, 0)) return NULL;
    PyObject *capsule = NULL;
    if (call_fine(&c, apsm_fit_model_load(c.ctx, path, &model)))
        capsule = PyCapsule_New(model, "apsm_fit_model", free_model);
    call_end(&c);
    return capsule;
}

static PyObject *fit_result(const apsm_fit *f)
{
    PyObject *d = PyDict_New();
    const bool there = f->verdict != APSM_FIT_REFUSED;
    if (!d || !py_set(d, "verdict", PyUnicode_FromString(apsm_fit_verdict_text(f->verdict))) ||
        !py_set(d, "reason", py_text(f->reason)) ||
        !py_set(d, "mirrored", PyBool_FromLong(f->mirrored)) ||
        !py_set(d, "J", PyLong_FromSize_t(f->J))) {
        Py_XDECREF(d);
        return NULL;
    }
    if (!there) return d;
    if (py_set(d, "world", py_doubles(f->world, 3 * f->J)) &&
        py_set(d, "original", py_doubles(f->original, 3 * f->J)) &&
        py_set(d, "scores", py_doubles(f->score, f->modes)) &&
        py_set(d, "sd", py_doubles(f->sd, f->J)) && py_set(d, "to_world", py_doubles(f->M, 16)) &&
        py_set(d, "mesh", py_mesh(&f->mesh)) &&
        py_set(d, "mahalanobis", PyFloat_FromDouble(f->mahalanobis)) &&
        py_set(d, "tail", PyFloat_FromDouble(f->tail)) &&
        py_set(d, "observed_share", PyFloat_FromDouble(f->observed_share)) &&
        py_set(d, "surface_mean",
               PyFloat_FromDouble(f->has_distance ? f->distance.two_way.mean : Py_NAN)) &&
        py_set(d, "surface_max",
               PyFloat_FromDouble(f->has_distance ? f->distance.two_way.max : Py_NAN)))
        return d;
    Py_DECREF(d);
    return NULL;
}

/* What is fitted: a surface (x, F), points x, or landmarks x with their places on the mean. */
typedef struct fit_input {
    const char *name, *kind;
    Py_buffer x, other;
    size_t n, m;
    apsm_fit_options options;
} fit_input;

static apsm_status fit_any(call *c, const apsm_fit_model *model, const fit_input *in, apsm_fit *fit)
{
    apsm_mesh mesh = { 0 };
    if (strcmp(in->kind, "points") == 0)
        return apsm_fit_points(c->ctx, model, in->name, in->n, in->x.buf, &in->options, fit);
    if (strcmp(in->kind, "landmarks") == 0)
        return apsm_fit_landmarks(c->ctx, model, in->name, in->n, in->other.buf, in->x.buf,
                                  &in->options, fit);
    mesh.nv = in->n, mesh.V = in->x.buf;
    mesh.nf = in->m, mesh.F = in->other.buf;
    return apsm_fit_surface(c->ctx, model, in->name, &mesh, &in->options, fit);
}

static bool view_fit(fit_input *in, PyObject *x, PyObject *other)
{
    const bool landmarks = strcmp(in->kind, "landmarks") == 0;
    if (!py_view(x, sizeof(double), 3, &in->x, &in->n)) return false;
    if (py_view(other, landmarks ? sizeof(double) : sizeof(uint32_t), 3, &in->other, &in->m)) {
        if (!landmarks || in->n == in->m) return true;
        PyErr_SetString(PyExc_ValueError,
                        "as many landmarks are needed on the mean as on the shape");
        PyBuffer_Release(&in->other);
    }
    PyBuffer_Release(&in->x);
    return false;
}

/* fit(model, name, kind, x, other, hand, extent, aligned, force, log) -> dict */
static PyObject *py_fit(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *capsule, *x, *other, *result = NULL;
    int aligned, force;
    apsm_fit fit = { 0 };
    fit_input in = { .options = apsm_fit_defaults() };
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "OssOOiippO", &capsule, &in.name, &in.kind, &x, &other,
                          &in.options.hand, &in.options.extent, &aligned, &force, &c.log))
        return NULL;
    const apsm_fit_model *model = PyCapsule_GetPointer(capsule, "apsm_fit_model");
    if (!model || !view_fit(&in, x, other)) return NULL;
    in.options.aligned = aligned != 0;
    in.options.force = force != 0;
    if (call_begin(&c, 1, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = fit_any(&c, model, &in, &fit);
        Py_END_ALLOW_THREADS if (call_fine(&c, status)) result = fit_result(&fit);
        apsm_fit_free(&fit);
    }
    PyBuffer_Release(&in.x);
    PyBuffer_Release(&in.other);
    call_end(&c);
    return result;
}

/* fit_save(model, path): the model in one file. */
static PyObject *py_fit_save(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *capsule, *result = NULL;
    const char *path;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "Os", &capsule, &path)) return NULL;
    const apsm_fit_model *model = PyCapsule_GetPointer(capsule, "apsm_fit_model");
    if (!model) return NULL;
    if (call_begin(&c, 1, 0)) result = call_none(&c, apsm_fit_model_write(c.ctx, model, path));
    call_end(&c);
    return result;
}

/* ---- models and particles of others ---- */

/* Particles P (I x J x 3) and meshes of one frame, from (name, vertices, faces) each. */
typedef struct foreign {
    size_t I, J;
    const char **names;
    const double *P;
    apsm_mesh *meshes; /* own their arrays */
} foreign;

static void foreign_free(foreign *f)
{
    for (size_t i = 0; f->meshes && i < f->I; i++) apsm_mesh_free(&f->meshes[i]);
    PyMem_Free(f->meshes);
    PyMem_Free(f->names);
}

static bool copy_mesh(PyObject *vertices, PyObject *faces, apsm_mesh *mesh)
{
    Py_buffer V, F;
    size_t nv, nf;
    bool good = false;
    if (!py_view(vertices, sizeof(double), 3, &V, &nv)) return false;
    if (py_view(faces, sizeof(uint32_t), 3, &F, &nf)) {
        const apsm_mesh given = { .nv = nv, .nf = nf, .V = V.buf, .F = F.buf };
        good = apsm_mesh_copy(&given, mesh) == APSM_OK;
        if (!good) PyErr_NoMemory();
        PyBuffer_Release(&F);
    }
    PyBuffer_Release(&V);
    return good;
}

static bool take_foreign(PyObject *shapes, const Py_buffer *P, foreign *f)
{
    f->I = (size_t)PyList_Size(shapes);
    f->P = P->buf;
    f->J = f->I ? (size_t)P->len / sizeof(double) / 3 / f->I : 0;
    f->names = PyMem_Calloc(f->I + 1, sizeof *f->names);
    f->meshes = PyMem_Calloc(f->I + 1, sizeof *f->meshes);
    if (!f->names || !f->meshes) return PyErr_NoMemory() != NULL;
    for (size_t i = 0; i < f->I; i++) {
        PyObject *vertices, *faces;
        if (!PyArg_ParseTuple(PyList_GetItem(shapes, (Py_ssize_t)i), "sOO", &f->names[i], &vertices,
                              &faces) ||
            !copy_mesh(vertices, faces, &f->meshes[i]))
            return false;
    }
    if (f->J * f->I * 3 * sizeof(double) == (size_t)P->len && f->J > 0) return true;
    PyErr_SetString(PyExc_ValueError, "particles are (shapes, particles, 3)");
    return false;
}

static apsm_status import_all(call *c, const apsm_run_settings *settings, const foreign *f,
                              size_t template_index)
{
    apsm_run *run = NULL;
    apsm_status status = apsm_run_open(c->ctx, settings, &run);
    double *to_world = calloc(16 * f->I, sizeof *to_world);
    if (status == APSM_OK && !to_world) status = APSM_ERR_MEMORY;
    for (size_t k = 0; to_world && k < f->I; k++)
        for (size_t d = 0; d < 4; d++) to_world[16 * k + 5 * d] = 1;
    const apsm_import input = { .I = f->I,
                                .J = f->J,
                                .names = f->names,
                                .P = f->P,
                                .meshes = f->meshes,
                                .to_world = to_world,
                                .template_index = template_index };
    if (status == APSM_OK) status = apsm_run_import(run, &input);
    free(to_world);
    apsm_run_close(run);
    return status;
}

/* save(folder, shapes, particles, template, options, threads, log, progress): a model
 * folder of particles and meshes in one frame. */
static PyObject *py_save(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *shapes, *particles, *options, *result = NULL;
    const char *(*set)[2] = NULL;
    Py_buffer P;
    size_t n, template_index;
    int threads;
    foreign f = { 0 };
    apsm_run_settings settings = { 0 };
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "sO!OnO!iOO", &settings.folder, &PyList_Type, &shapes, &particles,
                          (Py_ssize_t *)&template_index, &PyList_Type, &options, &threads, &c.log,
                          &c.progress) ||
        !py_view(particles, sizeof(double), 3, &P, &n))
        return NULL;
    if (take_foreign(shapes, &P, &f) && py_options(options, &set, &settings.n_set) &&
        call_begin(&c, threads, 0)) {
        apsm_status status;
        settings.set = (const char *const(*)[2])set;
        Py_BEGIN_ALLOW_THREADS status = import_all(&c, &settings, &f, template_index);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    PyMem_Free(set);
    foreign_free(&f);
    PyBuffer_Release(&P);
    call_end(&c);
    return result;
}

/* certify(shapes, particles, template, path, threads, log): the verdict as a JSON file. */
static PyObject *py_certify(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *shapes, *particles, *result = NULL;
    const char *path;
    Py_buffer P;
    size_t n, certified, template_index;
    int threads;
    foreign f = { 0 };
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "O!OnsiO", &PyList_Type, &shapes, &particles,
                          (Py_ssize_t *)&template_index, &path, &threads, &c.log) ||
        !py_view(particles, sizeof(double), 3, &P, &n))
        return NULL;
    if (take_foreign(shapes, &P, &f) && call_begin(&c, threads, 0)) {
        apsm_status status;
        const apsm_certify_input in = { f.I, f.J, f.names, f.P, f.meshes, template_index };
        Py_BEGIN_ALLOW_THREADS status = apsm_certify_particles(c.ctx, &in, path, &certified);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    foreign_free(&f);
    PyBuffer_Release(&P);
    call_end(&c);
    return result;
}

static PyObject *shapes_of_foreign(const apsm_foreign_model *m)
{
    PyObject *list = PyList_New(0);
    for (size_t i = 0; list && i < m->I; i++) {
        PyObject *one = Py_BuildValue("(sN)", m->names[i], py_mesh(&m->meshes[i]));
        if (!one || PyList_Append(list, one) != 0) Py_CLEAR(list);
        Py_XDECREF(one);
    }
    return Py_BuildValue("(NNnN)", list, py_doubles(m->P, m->I * m->J * 3), (Py_ssize_t)m->J,
                         PyBool_FromLong(m->of_shapes));
}

/* read_statismo(path, J, log) -> ([(name, mesh)], particles, J, of_shapes) */
static PyObject *py_read_statismo(PyObject *self, PyObject *args)
{
    (void)self;
    const char *path;
    Py_ssize_t J;
    apsm_foreign_model m = { 0 };
    PyObject *result = NULL;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "snO", &path, &J, &c.log)) return NULL;
    if (call_begin(&c, 1, 0) && call_fine(&c, apsm_read_statismo(c.ctx, path, (size_t)J, &m)))
        result = shapes_of_foreign(&m);
    apsm_foreign_model_free(&m);
    call_end(&c);
    return result;
}

/* ---- warps ---- */

/* warp(template particles, particles, points) -> bytes */
static PyObject *py_warp(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *from, *to, *points, *result = NULL;
    Py_buffer P0 = { 0 }, P = { 0 }, X = { 0 };
    apsm_warp_points_input in = { 0 };
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "OOO", &from, &to, &points) ||
        !py_view(from, sizeof(double), 3, &P0, &in.J))
        return NULL;
    const bool viewed = py_view(to, sizeof(double), 3 * (in.J ? in.J : 1), &P, &in.I);
    if (viewed && py_view(points, sizeof(double), 3, &X, &in.n) && call_begin(&c, 1, 0)) {
        in.P0 = P0.buf, in.P = P.buf, in.X = X.buf;
        result = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)(3 * in.I * in.n * sizeof(double)));
        double *Y = result ? (double *)(void *)PyBytes_AsString(result) : NULL;
        apsm_status status = APSM_ERR_MEMORY;
        Py_BEGIN_ALLOW_THREADS if (Y) status = apsm_warp_points(c.ctx, &in, Y);
        Py_END_ALLOW_THREADS if (!call_fine(&c, status))
        {
            Py_XDECREF(result);
            result = NULL;
        }
    }
    PyBuffer_Release(&X);
    PyBuffer_Release(&P);
    PyBuffer_Release(&P0);
    call_end(&c);
    return result;
}

static PyMethodDef methods[] = {
    { "certify", py_certify, METH_VARARGS, "the verdict on particles" },
    { "fit", py_fit, METH_VARARGS, "a shape by a finished model" },
    { "fit_load", py_fit_load, METH_VARARGS, "a finished model, to fit shapes" },
    { "fit_save", py_fit_save, METH_VARARGS, "that model in one file" },
    { "read_statismo", py_read_statismo, METH_VARARGS,
      "shapes of a model of Scalismo or Statismo" },
    { "run", py_run, METH_VARARGS, "a model of shapes in memory" },
    { "save", py_save, METH_VARARGS, "a model folder of particles and meshes" },
    { "warp", py_warp, METH_VARARGS, "points as particles carry them" },
    { NULL, NULL, 0, NULL },
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "apsm._apsm", NULL, -1, methods, NULL, NULL, NULL, NULL
};

PyMODINIT_FUNC PyInit__apsm(void)
{
    PyObject *made = PyModule_Create(&module);
    call_main_thread_is_this();
    if (made && PyModule_AddFunctions(made, apsm_folder_methods) != 0) Py_CLEAR(made);
    return made;
}
