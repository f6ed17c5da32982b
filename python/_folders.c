/* Jobs on folders: their results are files, which apsm/__init__.py reads. */
#include "_apsm.h"

#include <string.h>

/* ---- run, of one part or of several ---- */

/* What `run` and `joint` are given beside their own words. */
typedef struct folder_job {
    apsm_run_settings settings;
    PyObject *inputs, *options;
    int threads, overwrite, resume;
    const char **paths;
    const char *(*set)[2];
} folder_job;

static bool take_job(folder_job *j, call *c)
{
    j->settings.overwrite = j->overwrite != 0;
    j->settings.resume = j->resume != 0;
    j->paths = py_texts(j->inputs, &j->settings.n_inputs);
    if (!j->paths || !py_options(j->options, &j->set, &j->settings.n_set)) return false;
    j->settings.inputs = j->paths;
    j->settings.set = (const char *const(*)[2])j->set;
    return call_begin(c, j->threads, 0);
}

static void free_job(folder_job *j, call *c)
{
    PyMem_Free(j->paths);
    PyMem_Free(j->set);
    call_end(c);
}

/* run_files(folder, inputs, options, threads, overwrite, resume, log, progress) */
static PyObject *py_run_files(PyObject *self, PyObject *args)
{
    (void)self;
    folder_job j = { 0 };
    call c = { 0 };
    apsm_run *run = NULL;
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "sO!O!ippOO", &j.settings.folder, &PyList_Type, &j.inputs,
                          &PyList_Type, &j.options, &j.threads, &j.overwrite, &j.resume, &c.log,
                          &c.progress))
        return NULL;
    if (take_job(&j, &c)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_run_open(c.ctx, &j.settings, &run);
        if (status == APSM_OK) status = apsm_run_all(run);
        apsm_run_close(run);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    free_job(&j, &c);
    return result;
}

/* run_joint(folder, inputs, options, threads, overwrite, resume, log, progress, parts, align,
 * shared) */
static PyObject *py_run_joint(PyObject *self, PyObject *args)
{
    (void)self;
    folder_job j = { 0 };
    apsm_joint_settings joint = { 0 };
    call c = { 0 };
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "sO!O!ippOOzzz", &j.settings.folder, &PyList_Type, &j.inputs,
                          &PyList_Type, &j.options, &j.threads, &j.overwrite, &j.resume, &c.log,
                          &c.progress, &joint.parts, &joint.align, &joint.shared))
        return NULL;
    if (take_job(&j, &c)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_joint_run(c.ctx, &j.settings, &joint);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    free_job(&j, &c);
    return result;
}

/* change(folder, "add" or "exclude", inputs or names, options, threads, log, progress) */
static PyObject *py_change(PyObject *self, PyObject *args)
{
    (void)self;
    folder_job j = { 0 };
    const char *what;
    call c = { 0 };
    apsm_run *run = NULL;
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "ssO!O!iOO", &j.settings.folder, &what, &PyList_Type, &j.inputs,
                          &PyList_Type, &j.options, &j.threads, &c.log, &c.progress))
        return NULL;
    if (take_job(&j, &c)) {
        const bool adds = strcmp(what, "add") == 0;
        const size_t n = j.settings.n_inputs;
        apsm_status status;
        if (!adds) j.settings.n_inputs = 0;
        Py_BEGIN_ALLOW_THREADS status = apsm_run_open(c.ctx, &j.settings, &run);
        if (status == APSM_OK)
            status = adds ? apsm_run_add(run) : apsm_run_exclude(run, n, j.paths);
        apsm_run_close(run);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    free_job(&j, &c);
    return result;
}

/* ---- new shapes ---- */

static apsm_status fit_files(call *c, const apsm_fit_settings *s, const char *parts,
                             apsm_fit_totals *n)
{
    if (apsm_joint_is(c->ctx, s->model)) return apsm_joint_fit(c->ctx, s, parts, n);
    const apsm_status status = apsm_fit_run(c->ctx, s, n);
    return status == APSM_OK ? apsm_fit_report_write(c->ctx, s->folder) : status;
}

/* fit_files(model, inputs, folder, landmarks, labels, reflect_match, exclude, parts, hand, extent,
 * aligned, force, overwrite, threads, log, progress) -> (good, review, refused, failed) */
static PyObject *py_fit_files(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_fit_options options = apsm_fit_defaults();
    apsm_fit_settings s = { .options = &options, .options_size = sizeof options };
    apsm_fit_totals n = { 0 };
    const char *parts;
    int aligned, force, overwrite, threads;
    PyObject *inputs, *result = NULL;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "sO!szzzzziipppiOO", &s.model, &PyList_Type, &inputs, &s.folder,
                          &s.landmarks, &s.labels, &s.reflect_match, &s.exclude, &parts,
                          &options.hand, &options.extent, &aligned, &force, &overwrite, &threads,
                          &c.log, &c.progress))
        return NULL;
    options.aligned = aligned != 0;
    options.force = force != 0;
    s.overwrite = overwrite != 0;
    const char **paths = py_texts(inputs, &s.n_inputs);
    s.inputs = paths;
    if (paths && call_begin(&c, threads, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = fit_files(&c, &s, parts, &n);
        Py_END_ALLOW_THREADS if (call_fine(&c, status)) result =
            Py_BuildValue("(nnnn)", (Py_ssize_t)n.good, (Py_ssize_t)n.review, (Py_ssize_t)n.refused,
                          (Py_ssize_t)n.failed);
    }
    PyMem_Free(paths);
    call_end(&c);
    return result;
}

/* ---- answers ---- */

/* test(folder, formula, of, on, subjects, within, out, permutations, bootstraps, seed, unequal,
 * stop_risk, threads, log); without formula: asymmetry */
static PyObject *py_test(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_test_settings s = { 0 };
    unsigned long long permutations, bootstraps, seed;
    int threads, unequal;
    PyObject *result = NULL;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "szzzzzsKKKpdiO", &s.folder, &s.formula, &s.of, &s.on, &s.subjects,
                          &s.within, &s.out, &permutations, &bootstraps, &seed, &unequal,
                          &s.stop_risk, &threads, &c.log))
        return NULL;
    s.permutations = (size_t)permutations;
    s.bootstraps = (size_t)bootstraps;
    s.unequal = unequal != 0;
    if (call_begin(&c, threads, seed)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status =
            s.formula ? apsm_statistics_test(c.ctx, &s) : apsm_statistics_asymmetry(c.ctx, &s);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    call_end(&c);
    return result;
}

/* What measure, norm, predict and landmarks are given; each takes what it needs. */
typedef struct answer {
    const char *kind, *folder, *what, *subjects, *more, *out;
    const char **files;
    size_t n;
    int aligned;
} answer;

static apsm_status norm(call *c, const answer *a)
{
    const apsm_norm_settings s = { a->folder, a->n, a->files, a->subjects, a->what, a->out };
    const apsm_status status = apsm_statistics_norm(c->ctx, &s);
    return status == APSM_OK ? apsm_norm_report_write(c->ctx, a->folder, a->out) : status;
}

static apsm_status measure(call *c, const answer *a)
{
    const apsm_measure_settings s = { a->folder, a->what, a->n, a->files, a->subjects, a->out };
    return apsm_statistics_measure(c->ctx, &s);
}

static apsm_status predict(call *c, const answer *a)
{
    const apsm_predict_settings s = { a->folder, a->what, a->subjects, a->n,
                                      a->files,  a->more, a->out };
    return apsm_statistics_predict(c->ctx, &s);
}

static apsm_status landmarks(call *c, const answer *a)
{
    const apsm_landmark_settings s = { a->folder, a->what, a->out, a->aligned != 0 };
    return apsm_statistics_landmarks(c->ctx, &s);
}

static apsm_status answer_it(call *c, const answer *a)
{
    if (strcmp(a->kind, "measure") == 0) return measure(c, a);
    if (strcmp(a->kind, "norm") == 0) return norm(c, a);
    return strcmp(a->kind, "predict") == 0 ? predict(c, a) : landmarks(c, a);
}

/* answer(kind, folder, what, files, subjects, more, out, aligned, seed, threads, log) */
static PyObject *py_answer(PyObject *self, PyObject *args)
{
    (void)self;
    answer a = { 0 };
    PyObject *files, *result = NULL;
    unsigned long long seed;
    int threads;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "sszO!zzspKiO", &a.kind, &a.folder, &a.what, &PyList_Type, &files,
                          &a.subjects, &a.more, &a.out, &a.aligned, &seed, &threads, &c.log))
        return NULL;
    a.files = py_texts(files, &a.n);
    if (a.files && call_begin(&c, threads, seed)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = answer_it(&c, &a);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    PyMem_Free(a.files);
    call_end(&c);
    return result;
}

/* compare(a, b, out, threads, log) */
static PyObject *py_compare(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_compare_settings s = { .overwrite = true };
    apsm_comparison comparison;
    int threads;
    PyObject *result = NULL;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "sssiO", &s.a, &s.b, &s.folder, &threads, &c.log)) return NULL;
    if (call_begin(&c, threads, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_models_compare(c.ctx, &s, &comparison);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    call_end(&c);
    return result;
}

/* ---- what a folder is, and others' files ---- */

static void add_line(void *list, const char *line)
{
    PyGILState_STATE gil = PyGILState_Ensure();
    PyObject *text = py_text(line);
    if (!text || PyList_Append(list, text) != 0) PyErr_Clear();
    Py_XDECREF(text);
    PyGILState_Release(gil);
}

static void no_line(void *list, const char *line)
{
    (void)list, (void)line;
}

/* verify(folder, threads) -> lines of disagreement */
static PyObject *py_verify(PyObject *self, PyObject *args)
{
    (void)self;
    const char *folder;
    int threads;
    apsm_verification found;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "si", &folder, &threads)) return NULL;
    PyObject *lines = PyList_New(0);
    if (!lines || !call_begin(&c, threads, 0)) {
        Py_CLEAR(lines);
    } else {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status =
            apsm_run_verify(c.ctx, folder, add_line, no_line, lines, &found);
        Py_END_ALLOW_THREADS if (!call_fine(&c, status)) Py_CLEAR(lines);
    }
    call_end(&c);
    return lines;
}

/* report(folder, threads, log) */
static PyObject *py_report(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_run_settings settings = { 0 };
    apsm_run *run = NULL;
    int threads;
    PyObject *result = NULL;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "siO", &settings.folder, &threads, &c.log)) return NULL;
    if (call_begin(&c, threads, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_run_open(c.ctx, &settings, &run);
        if (status == APSM_OK) status = apsm_run_report(run);
        apsm_run_close(run);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    call_end(&c);
    return result;
}

/* export(model, to, path, modes, sd, overwrite, log) */
static PyObject *py_export(PyObject *self, PyObject *args)
{
    (void)self;
    apsm_export_settings s = { 0 };
    unsigned long long modes;
    int overwrite;
    PyObject *sd, *result = NULL;
    Py_buffer at;
    call c = { 0 };
    if (!PyArg_ParseTuple(args, "sssKOpO", &s.model, &s.format, &s.path, &modes, &sd, &overwrite,
                          &c.log) ||
        !py_view(sd, sizeof(double), 1, &at, &s.n_sd))
        return NULL;
    s.modes = (size_t)modes;
    s.sd = at.buf;
    s.overwrite = overwrite != 0;
    if (call_begin(&c, 1, 0)) {
        apsm_status status;
        Py_BEGIN_ALLOW_THREADS status = apsm_export_model(c.ctx, &s);
        Py_END_ALLOW_THREADS result = call_none(&c, status);
    }
    PyBuffer_Release(&at);
    call_end(&c);
    return result;
}

PyMethodDef apsm_folder_methods[] = {
    { "answer", py_answer, METH_VARARGS, "measure, norm, predict, landmarks" },
    { "change", py_change, METH_VARARGS, "a model that grows or shrinks" },
    { "compare", py_compare, METH_VARARGS, "the same anatomy in two models" },
    { "export", py_export, METH_VARARGS, "a model for other programs" },
    { "fit_files", py_fit_files, METH_VARARGS, "files by a finished model" },
    { "report", py_report, METH_VARARGS, "the page of a model folder" },
    { "run_files", py_run_files, METH_VARARGS, "a model of files, in a folder" },
    { "run_joint", py_run_joint, METH_VARARGS, "a model of several parts, in a folder" },
    { "test", py_test, METH_VARARGS, "a test of a term of a formula" },
    { "verify", py_verify, METH_VARARGS, "whether a folder is what was made" },
    { NULL, NULL, 0, NULL },
};
