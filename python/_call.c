/* A call of the library from Python: its messages, progress, failures, Ctrl-C; arrays in and out.
 */
#include "_apsm.h"

#include <string.h>

/* ---- Ctrl-C: while the library works, Python would only note it ---- */

static volatile int *stopping; /* of the innermost call of the main thread */
static unsigned long main_thread;

void call_main_thread_is_this(void)
{
    main_thread = PyThread_get_thread_ident();
}

static void on_interrupt(int number)
{
    (void)number;
    if (stopping) *stopping = 2;
}

static void guard(call *c)
{
    struct sigaction own = { .sa_handler = on_interrupt };
    c->was_main = PyThread_get_thread_ident() == main_thread;
    if (!c->was_main || sigaction(SIGINT, NULL, &c->before) != 0) return;
    if (c->before.sa_handler == SIG_IGN || c->before.sa_handler == SIG_DFL) return;
    c->outer = stopping;
    stopping = &c->stop;
    c->guards = sigaction(SIGINT, &own, NULL) == 0;
}

/* Gives Ctrl-C back; whether it came meanwhile. */
static bool unguard(call *c)
{
    if (!c->guards) return false;
    c->guards = false;
    stopping = c->outer;
    sigaction(SIGINT, &c->before, NULL);
    return c->stop == 2;
}

/* ---- listeners ---- */

/* An exception stops the job, and is raised when it has ended. */
static void raised(call *c)
{
    PyObject *type, *value, *trace;
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    if (!c->stop) c->stop = 1;
    Py_XDECREF(c->error);
    c->error = value;
    Py_XDECREF(type);
    Py_XDECREF(trace);
}

static void on_log(void *user, apsm_log_level level, const char *text)
{
    call *c = user;
    PyGILState_STATE gil = PyGILState_Ensure();
    PyObject *result = PyObject_CallFunction(
        c->log, "ON", level == APSM_LOG_WARNING ? Py_True : Py_False, py_text(text));
    if (!result) raised(c);
    Py_XDECREF(result);
    PyGILState_Release(gil);
}

static void on_progress(void *user, const apsm_progress *p)
{
    call *c = user;
    PyGILState_STATE gil = PyGILState_Ensure();
    if (PyErr_CheckSignals() != 0) raised(c);
    if (c->progress && c->progress != Py_None && !c->stop) {
        PyObject *result = PyObject_CallFunction(c->progress, "snn", p->stage, (Py_ssize_t)p->done,
                                                 (Py_ssize_t)p->total);
        if (!result) raised(c);
        Py_XDECREF(result);
    }
    PyGILState_Release(gil);
}

bool call_begin(call *c, int threads, unsigned long long seed)
{
    c->ctx = apsm_context_new();
    if (!c->ctx) {
        PyErr_NoMemory();
        return false;
    }
    apsm_context_set_threads(c->ctx, threads > 0 ? threads : 1);
    apsm_context_set_seed(c->ctx, seed);
    if (c->log && c->log != Py_None) apsm_context_set_log(c->ctx, on_log, c);
    apsm_context_set_progress(c->ctx, on_progress, c);
    apsm_context_set_interrupt(c->ctx, &c->stop);
    guard(c);
    return true;
}

bool call_fine(call *c, apsm_status status)
{
    const bool interrupted = unguard(c);
    if (interrupted) PyErr_SetInterrupt();
    if (interrupted && PyErr_CheckSignals() != 0) return false;
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
    PyObject *args = Py_BuildValue("(Ns)", py_text(*line ? line : apsm_status_text(status)),
                                   apsm_status_text(status));
    if (type && args) PyErr_SetObject(type, args);
    Py_XDECREF(module);
    Py_XDECREF(type);
    Py_XDECREF(args);
    return false;
}

void call_end(call *c)
{
    unguard(c);
    apsm_context_free(c->ctx);
    Py_XDECREF(c->error);
}

PyObject *call_none(call *c, apsm_status status)
{
    if (!call_fine(c, status)) return NULL;
    Py_RETURN_NONE;
}

/* ---- arrays ---- */

PyObject *py_text(const char *text)
{
    return PyUnicode_DecodeUTF8(text, (Py_ssize_t)strlen(text), "replace");
}

PyObject *py_doubles(const double *x, size_t n)
{
    if (!x) Py_RETURN_NONE;
    return PyBytes_FromStringAndSize((const char *)x, (Py_ssize_t)(n * sizeof *x));
}

PyObject *py_mesh(const apsm_mesh *mesh)
{
    if (!mesh) Py_RETURN_NONE;
    return Py_BuildValue("(NN)", py_doubles(mesh->V, 3 * mesh->nv),
                         PyBytes_FromStringAndSize((const char *)mesh->F,
                                                   (Py_ssize_t)(3 * mesh->nf * sizeof *mesh->F)));
}

bool py_view(PyObject *object, size_t size, size_t group, Py_buffer *buffer, size_t *n)
{
    if (PyObject_GetBuffer(object, buffer, PyBUF_SIMPLE) != 0) return false;
    *n = (size_t)buffer->len / (size * group);
    if ((size_t)buffer->len == *n * size * group) return true;
    PyBuffer_Release(buffer);
    PyErr_SetString(PyExc_ValueError, "an array has not the length that it should have");
    return false;
}

bool py_set(PyObject *dict, const char *key, PyObject *value)
{
    const bool ok = value && PyDict_SetItemString(dict, key, value) == 0;
    Py_XDECREF(value);
    return ok;
}

const char **py_texts(PyObject *list, size_t *n)
{
    *n = (size_t)PyList_Size(list);
    const char **texts = PyMem_Malloc((*n + 1) * sizeof *texts);
    if (!texts) PyErr_NoMemory();
    for (size_t k = 0; texts && k < *n; k++)
        texts[k] = PyUnicode_AsUTF8AndSize(PyList_GetItem(list, (Py_ssize_t)k), NULL);
    if (texts && !PyErr_Occurred()) return texts;
    PyMem_Free(texts);
    return NULL;
}

bool py_options(PyObject *list, const char *(**set)[2], size_t *n)
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
