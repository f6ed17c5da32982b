/* _apsm: the library for Python, by the limited API: one module for every Python from 3.11 on.  It
 * moves arrays and errors across; what a user sees is apsm/__init__.py.  Numbers come in as buffers
 * and go out as bytes of doubles (d) or 32-bit integers (I), whose shape the caller knows. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include <apsm.h>

/* ---- messages, progress, Ctrl-C ---- */

/* One call of the library: who listens, and whether Python wants it to end. */
typedef struct call {
    apsm_context *ctx;
    PyObject *log, *progress; /* borrowed; None: nobody */
    volatile int stop;
    PyObject *error; /* what a listener raised; owned */
} call;

/* An exception stops the job, and is raised when it has ended. */
static void raised(call *c)
{
    PyObject *type, *value, *trace;
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    c->stop = 1;
    Py_XDECREF(c->error);
    c->error = value;
    Py_XDECREF(type);
    Py_XDECREF(trace);
}

static void on_log(void *user, apsm_log_level level, const char *text)
{
    call *c = user;
    PyGILState_STATE gil = PyGILState_Ensure();
    PyObject *result =
        PyObject_CallFunction(c->log, "Os", level == APSM_LOG_WARNING ? Py_True : Py_False, text);
    if (!result) raised(c);
    Py_XDECREF(result);
    PyGILState_Release(gil);
}

static void on_progress(void *user, const apsm_progress *p)
{
    call *c = user;
    PyGILState_STATE gil = PyGILState_Ensure();
    if (PyErr_CheckSignals() != 0) raised(c);
    if (c->progress != Py_None && !c->stop) {
        PyObject *result = PyObject_CallFunction(c->progress, "snn", p->stage, (Py_ssize_t)p->done,
                                                 (Py_ssize_t)p->total);
        if (!result) raised(c);
        Py_XDECREF(result);
    }
    PyGILState_Release(gil);
}

static bool begin(call *c, int threads, unsigned long long seed)
{
    c->ctx = apsm_context_new();
    if (!c->ctx) {
        PyErr_NoMemory();
        return false;
    }
    apsm_context_set_threads(c->ctx, threads > 0 ? threads : 1);
    apsm_context_set_seed(c->ctx, seed);
    if (c->log != Py_None) apsm_context_set_log(c->ctx, on_log, c);
    apsm_context_set_progress(c->ctx, on_progress, c);
    apsm_context_set_interrupt(c->ctx, &c->stop);
    return true;
}

/* Raises apsm.Error(line, status) for a failure; true if there was none. */
static bool fine(call *c, apsm_status status)
{
    if (c->error) {
        PyErr_SetObject((PyObject *)Py_TYPE(c->error), c->error);
        return false;
    }
    if (status == APSM_OK) return true;
    if (status == APSM_ERR_MEMORY) {
        PyErr_NoMemory();
        return false;
    }
    PyObject *module = PyImport_ImportModule("apsm");
    PyObject *type = module ? PyObject_GetAttrString(module, "Error") : NULL;
    const char *line = apsm_error_text(c->ctx);
    PyObject *args =
        Py_BuildValue("(ss)", *line ? line : apsm_status_text(status), apsm_status_text(status));
    if (type && args) PyErr_SetObject(type, args);
    Py_XDECREF(module);
    Py_XDECREF(type);
    Py_XDECREF(args);
    return false;
}

static void end(call *c)
{
    apsm_context_free(c->ctx);
    Py_XDECREF(c->error);
}

/* ---- arrays ---- */

static PyObject *doubles(const double *x, size_t n)
{
    if (!x) Py_RETURN_NONE;
    return PyBytes_FromStringAndSize((const char *)x, (Py_ssize_t)(n * sizeof *x));
}

static PyObject *mesh_of(const apsm_mesh *mesh)
{
    if (!mesh) Py_RETURN_NONE;
    return Py_BuildValue("(NN)", doubles(mesh->V, 3 * mesh->nv),
                         PyBytes_FromStringAndSize((const char *)mesh->F,
                                                   (Py_ssize_t)(3 * mesh->nf * sizeof *mesh->F)));
}

/* A flat buffer of things of `size` bytes, a multiple of `group` of them. */
static bool view(PyObject *object, size_t size, size_t group, Py_buffer *buffer, size_t *n)
{
    if (PyObject_GetBuffer(object, buffer, PyBUF_SIMPLE) != 0) return false;
    *n = (size_t)buffer->len / (size * group);
    if ((size_t)buffer->len == *n * size * group) return true;
    PyBuffer_Release(buffer);
    PyErr_SetString(PyExc_ValueError, "an array has not the length that it should have");
    return false;
}

static bool set_item(PyObject *dict, const char *key, PyObject *value)
{
    const bool ok = value && PyDict_SetItemString(dict, key, value) == 0;
    Py_XDECREF(value);
    return ok;
}

/* ---- run: shapes as arrays ---- */

static apsm_status add_mesh(apsm_run *run, const char *name, int reflect, PyObject *vertices,
                            PyObject *faces)
{
    Py_buffer V, F;
    size_t nv, nf;
    if (!view(vertices, sizeof(double), 3, &V, &nv)) return APSM_ERR_ARG;
    if (!view(faces, sizeof(uint32_t), 3, &F, &nf)) {
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
    if (!view(labels, sizeof(int32_t), 1, &L, &n)) return APSM_ERR_ARG;
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
    return !PyErr_Occurred() && fine(c, status);
}

/* Pairs of texts to what the library takes; *set is malloc'ed. */
static bool take_options(PyObject *list, const char *(**set)[2], size_t *n)
{
    *n = (size_t)PyList_Size(list);
    *set = PyMem_Malloc((*n + 1) * sizeof **set);
    if (!*set) {
        PyErr_NoMemory();
        return false;
    }
    for (size_t k = 0; k < *n; k++)
        if (!PyArg_ParseTuple(PyList_GetItem(list, (Py_ssize_t)k), "ss", &(*set)[k][0],
                              &(*set)[k][1]))
            return false;
    return true;
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
        PyObject *reason = PyUnicode_FromString(text);
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
                          reasons_of(run, i), doubles(M, 16), mesh_of(apsm_run_mesh(run, i)));
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
        if (!set_item(dict, names[k], doubles(x, n))) Py_CLEAR(dict);
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
    if (dict && set_item(dict, "names", names_of(run)) &&
        set_item(dict, "shapes", shapes_of(run)) &&
        set_item(dict, "template", PyLong_FromSize_t(apsm_run_template(run))) &&
        set_item(dict, "J", PyLong_FromSize_t(J)) &&
        set_item(dict, "particles", doubles(P, I * J * 3)) &&
        set_item(dict, "mean", doubles(apsm_model_mean(m), J * 3)) &&
        set_item(dict, "modes", doubles(apsm_model_mode(m), modes * J * 3)) &&
        set_item(dict, "variances", doubles(apsm_model_variance(m), modes)) &&
        set_item(dict, "scores", doubles(apsm_model_score(m), I * modes)) &&
        set_item(dict, "figures", figures_of(run)))
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
    Py_END_ALLOW_THREADS return fine(c, status);
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
    if (take_options(options, &set, &settings.n_set) && begin(&c, threads, 0)) {
        settings.set = (const char *const(*)[2])set;
        if (fine(&c, apsm_run_open(c.ctx, &settings, &run)) && run_job(&c, run, shapes))
            result = result_of(run);
        apsm_run_close(run);
    }
    PyMem_Free(set);
    end(&c);
    return result;
}

/* ---- run_files: the job in a folder ---- */

/* run_files(folder, inputs, options, threads, overwrite, resume, log, progress) */
static PyObject *py_run_files(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *inputs, *options;
    int threads, overwrite, resume;
    call c = { 0 };
    apsm_run_settings settings = { 0 };
    if (!PyArg_ParseTuple(args, "sO!O!ippOO", &settings.folder, &PyList_Type, &inputs, &PyList_Type,
                          &options, &threads, &overwrite, &resume, &c.log, &c.progress))
        return NULL;
    const char *(*set)[2] = NULL;
    apsm_run *run = NULL;
    bool ok = false;
    settings.overwrite = overwrite != 0;
    settings.resume = resume != 0;
    settings.n_inputs = (size_t)PyList_Size(inputs);
    const char **paths = PyMem_Malloc((settings.n_inputs + 1) * sizeof *paths);
    for (size_t k = 0; paths && k < settings.n_inputs; k++)
        paths[k] = PyUnicode_AsUTF8AndSize(PyList_GetItem(inputs, (Py_ssize_t)k), NULL);
    settings.inputs = paths;
    if (paths && !PyErr_Occurred() && take_options(options, &set, &settings.n_set) &&
        begin(&c, threads, 0)) {
        apsm_status status;
        settings.set = (const char *const(*)[2])set;
        Py_BEGIN_ALLOW_THREADS status = apsm_run_open(c.ctx, &settings, &run);
        if (status == APSM_OK) status = apsm_run_all(run);
        apsm_run_close(run);
        Py_END_ALLOW_THREADS ok = fine(&c, status);
    } else if (!PyErr_Occurred()) {
        PyErr_NoMemory();
    }
    PyMem_Free(paths);
    PyMem_Free(set);
    end(&c);
    if (!ok) return NULL;
    Py_RETURN_NONE;
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
    call c = { .log = Py_None, .progress = Py_None };
    if (!PyArg_ParseTuple(args, "s", &path) || !begin(&c, 1, 0)) return NULL;
    PyObject *capsule = NULL;
    if (fine(&c, apsm_fit_model_load(c.ctx, path, &model)))
        capsule = PyCapsule_New(model, "apsm_fit_model", free_model);
    end(&c);
    return capsule;
}

static PyObject *fit_result(const apsm_fit *f)
{
    PyObject *d = PyDict_New();
    const bool there = f->verdict != APSM_FIT_REFUSED;
    if (!d || !set_item(d, "verdict", PyUnicode_FromString(apsm_fit_verdict_text(f->verdict))) ||
        !set_item(d, "reason", PyUnicode_FromString(f->reason)) ||
        !set_item(d, "mirrored", PyBool_FromLong(f->mirrored)) ||
        !set_item(d, "J", PyLong_FromSize_t(f->J))) {
        Py_XDECREF(d);
        return NULL;
    }
    if (!there) return d;
    if (set_item(d, "world", doubles(f->world, 3 * f->J)) &&
        set_item(d, "original", doubles(f->original, 3 * f->J)) &&
        set_item(d, "scores", doubles(f->score, f->modes)) &&
        set_item(d, "sd", doubles(f->sd, f->J)) && set_item(d, "to_world", doubles(f->M, 16)) &&
        set_item(d, "mesh", mesh_of(&f->mesh)) &&
        set_item(d, "mahalanobis", PyFloat_FromDouble(f->mahalanobis)) &&
        set_item(d, "tail", PyFloat_FromDouble(f->tail)) &&
        set_item(d, "observed_share", PyFloat_FromDouble(f->observed_share)) &&
        set_item(d, "surface_mean",
                 PyFloat_FromDouble(f->has_distance ? f->distance.two_way.mean : Py_NAN)) &&
        set_item(d, "surface_max",
                 PyFloat_FromDouble(f->has_distance ? f->distance.two_way.max : Py_NAN)))
        return d;
    Py_DECREF(d);
    return NULL;
}

/* fit(model, name, vertices, faces, aligned, force) -> dict */
static PyObject *py_fit(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *capsule, *vertices, *faces, *result = NULL;
    const char *name;
    int aligned, force;
    Py_buffer V, F;
    apsm_mesh mesh = { 0 };
    apsm_fit fit = { 0 };
    call c = { .log = Py_None, .progress = Py_None };
    if (!PyArg_ParseTuple(args, "OsOOpp", &capsule, &name, &vertices, &faces, &aligned, &force))
        return NULL;
    const apsm_fit_model *model = PyCapsule_GetPointer(capsule, "apsm_fit_model");
    if (!model || !view(vertices, sizeof(double), 3, &V, &mesh.nv)) return NULL;
    if (!view(faces, sizeof(uint32_t), 3, &F, &mesh.nf)) {
        PyBuffer_Release(&V);
        return NULL;
    }
    apsm_fit_options options = apsm_fit_defaults();
    options.aligned = aligned != 0;
    options.force = force != 0;
    mesh.V = V.buf;
    mesh.F = F.buf;
    if (begin(&c, 1, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_fit_surface(c.ctx, model, name, &mesh, &options, &fit);
        Py_END_ALLOW_THREADS if (fine(&c, status)) result = fit_result(&fit);
        apsm_fit_free(&fit);
    }
    PyBuffer_Release(&V);
    PyBuffer_Release(&F);
    end(&c);
    return result;
}

/* ---- statistics ---- */

/* test(folder, formula, of, on, subjects, within, out, permutations, bootstraps, seed, threads,
 * log) */
static PyObject *py_test(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_test_settings s = { 0 };
    unsigned long long permutations, bootstraps, seed;
    int threads, unequal;
    call c = { .progress = Py_None };
    if (!PyArg_ParseTuple(args, "szzzzzsKKKpdiO", &s.folder, &s.formula, &s.of, &s.on, &s.subjects,
                          &s.within, &s.out, &permutations, &bootstraps, &seed, &unequal,
                          &s.stop_risk, &threads, &c.log) ||
        !begin(&c, threads, seed))
        return NULL;
    s.permutations = (size_t)permutations;
    s.bootstraps = (size_t)bootstraps;
    s.unequal = unequal != 0;
    apsm_status status;
    Py_BEGIN_ALLOW_THREADS status =
        s.formula ? apsm_statistics_test(c.ctx, &s) : apsm_statistics_asymmetry(c.ctx, &s);
    Py_END_ALLOW_THREADS const bool ok = fine(&c, status);
    end(&c);
    if (!ok) return NULL;
    Py_RETURN_NONE;
}

/* ---- exchange ---- */

/* export(model, to, path, modes, sd, overwrite, log) */
static PyObject *py_export(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_export_settings s = { 0 };
    unsigned long long modes;
    int overwrite;
    PyObject *sd;
    Py_buffer at;
    call c = { .progress = Py_None };
    if (!PyArg_ParseTuple(args, "sssKOpO", &s.model, &s.format, &s.path, &modes, &sd, &overwrite,
                          &c.log) ||
        !view(sd, sizeof(double), 1, &at, &s.n_sd))
        return NULL;
    s.modes = (size_t)modes;
    s.sd = at.buf;
    s.overwrite = overwrite != 0;
    bool ok = false;
    if (begin(&c, 1, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_export_model(c.ctx, &s);
        Py_END_ALLOW_THREADS ok = fine(&c, status);
    }
    PyBuffer_Release(&at);
    end(&c);
    if (!ok) return NULL;
    Py_RETURN_NONE;
}

/* warp(template particles, particles, points) -> bytes */
static PyObject *py_warp(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *from, *to, *points, *result = NULL;
    Py_buffer P0 = { 0 }, P = { 0 }, X = { 0 };
    apsm_warp_points_input in = { 0 };
    call c = { .log = Py_None, .progress = Py_None };
    if (!PyArg_ParseTuple(args, "OOO", &from, &to, &points) ||
        !view(from, sizeof(double), 3, &P0, &in.J))
        return NULL;
    const bool viewed = view(to, sizeof(double), 3 * (in.J ? in.J : 1), &P, &in.I);
    if (viewed && view(points, sizeof(double), 3, &X, &in.n) && begin(&c, 1, 0)) {
        in.P0 = P0.buf, in.P = P.buf, in.X = X.buf;
        result = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)(3 * in.I * in.n * sizeof(double)));
        double *Y = result ? (double *)(void *)PyBytes_AsString(result) : NULL;
        apsm_status status = APSM_ERR_MEMORY;
        Py_BEGIN_ALLOW_THREADS if (Y) status = apsm_warp_points(c.ctx, &in, Y);
        Py_END_ALLOW_THREADS if (!fine(&c, status))
        {
            Py_XDECREF(result);
            result = NULL;
        }
    }
    PyBuffer_Release(&X);
    PyBuffer_Release(&P);
    PyBuffer_Release(&P0);
    end(&c);
    return result;
}

static PyMethodDef methods[] = {
    { "export", py_export, METH_VARARGS, "a model for other programs" },
    { "warp", py_warp, METH_VARARGS, "points as particles carry them" },
    { "run", py_run, METH_VARARGS, "a model of shapes in memory" },
    { "run_files", py_run_files, METH_VARARGS, "a model of files, in a folder" },
    { "fit_load", py_fit_load, METH_VARARGS, "a finished model, to fit shapes" },
    { "fit", py_fit, METH_VARARGS, "a shape by a finished model" },
    { "test", py_test, METH_VARARGS, "a test of a term of a formula" },
    { NULL, NULL, 0, NULL },
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "apsm._apsm", NULL, -1, methods, NULL, NULL, NULL, NULL
};

PyMODINIT_FUNC PyInit__apsm(void)
{
    return PyModule_Create(&module);
}
