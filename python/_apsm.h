/* _apsm.h -- what the pieces of the module share: a call of the library with its messages, progress
 * and Ctrl-C, and arrays across the border. */
#ifndef APSM_PYTHON_H
#define APSM_PYTHON_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>

#include <apsm.h>

/* One call of the library: who listens, and whether Python wants it to end. */
typedef struct call {
    apsm_context *ctx;
    PyObject *log, *progress; /* borrowed; None or NULL: nobody */
    volatile int stop;
    PyObject *error;         /* what a listener raised; owned */
    struct sigaction before; /* who had Ctrl-C, if this call has it */
    volatile int *outer;     /* of a call around this one */
    bool guards, was_main;
} call;

/* False with an exception if there is no memory.  After it call_end, whatever happens. */
bool call_begin(call *c, int threads, unsigned long long seed);
/* Raises what a listener raised, KeyboardInterrupt, or apsm.Error(line, status); true: no failure.
 */
bool call_fine(call *c, apsm_status status);
void call_end(call *c);
/* None, or NULL with the exception of call_fine. */
PyObject *call_none(call *c, apsm_status status);
/* To be called once, by the thread that gets signals. */
void call_main_thread_is_this(void);

PyObject *py_text(const char *text);             /* str, also of cut or foreign UTF-8 */
PyObject *py_doubles(const double *x, size_t n); /* bytes; None for NULL */
PyObject *py_mesh(const apsm_mesh *mesh);        /* (bytes, bytes); None for NULL */
/* A flat buffer of things of `size` bytes, a multiple of `group` of them; released by the caller.
 */
bool py_view(PyObject *object, size_t size, size_t group, Py_buffer *buffer, size_t *n);
/* Sets the key to value, which it takes; false: an exception. */
bool py_set(PyObject *dict, const char *key, PyObject *value);
/* A list of str as malloc'ed pointers (PyMem_Free), which live as long as the list. */
const char **py_texts(PyObject *list, size_t *n);
/* Pairs of str; the same. */
bool py_options(PyObject *list, const char *(**set)[2], size_t *n);

extern PyMethodDef apsm_folder_methods[]; /* of _folders.c; ends in NULL */

#endif
