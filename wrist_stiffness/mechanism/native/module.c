/* What Python sees: arrays of 64-bit floats in, arrays filled, a status or a place back. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

#include "wrist.h"

enum { MOST_BUFFERS = 20 };

/* Views of the first `count` arguments; None is a null pointer. */
typedef struct {
    Py_buffer view[MOST_BUFFERS];
    int count;
} Buffers;

static void release(Buffers *all) {
    while (all->count) {
        Py_buffer *view = all->view + --all->count;
        if (view->obj) PyBuffer_Release(view);
    }
}

/* Whether a buffer holds doubles 'd', 64-bit integers 'q' or bytes 'b'. */
static int holds(const Py_buffer *view, char kind) {
    const char *format = view->format ? view->format : "B";
    const int one = 1;
    const char own_order = *(const char *)&one ? '<' : '>';
    if (kind == 'b') return view->itemsize == 1;
    if (*format == '=' || *format == '@' || *format == own_order) format++;
    return view->itemsize == 8 && !format[1] &&
           (kind == 'd' ? *format == 'd' : *format == 'q' || *format == 'l');
}

/* Take arrays, one for each letter of `kinds`; `sizes` says how many bytes each must have at least,
 * those filled are marked in `filled` by their place. */
static int take(Buffers *all, PyObject *const *args, const Py_ssize_t *sizes, const char *kinds,
                unsigned filled) {
    const int count = (int)strlen(kinds);
    for (all->count = 0; all->count < count; all->count++) {
        Py_buffer *view = all->view + all->count;
        view->obj = 0;
        view->buf = 0;
        if (args[all->count] == Py_None) continue;
        const int writable = filled >> all->count & 1 ? PyBUF_WRITABLE : 0;
        const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | writable;
        if (PyObject_GetBuffer(args[all->count], view, flags)) {
            view->obj = 0;
            release(all);
            return -1;
        }
        if (!holds(view, kinds[all->count])) {
            PyErr_Format(PyExc_TypeError, "array %d holds another type", all->count++);
            release(all);
            return -1;
        }
        if (view->len < sizes[all->count]) {
            PyErr_Format(PyExc_ValueError, "array %d has %zd bytes, %zd are needed", all->count,
                         view->len, sizes[all->count]);
            all->count++;
            release(all);
            return -1;
        }
    }
    return 0;
}

static int counted(Py_ssize_t given, Py_ssize_t wanted) {
    if (given == wanted) return 0;
    PyErr_Format(PyExc_TypeError, "%zd arguments, not %zd", given, wanted);
    return -1;
}

static Py_ssize_t parts_size(long m) {
    return sizeof(Parts) + m * (sizeof(Sector) + m * sizeof(double));
}

static int reach(const Mechanism *k, const double theta[2], Configuration *at) {
    const int status = forward(k, theta, at);
    return status ? status : in_domain(k, at);
}

static int sectors(PyObject *number, long *m) {
    *m = PyLong_AsLong(number);
    if (*m >= 0 && *m <= MOST_SECTORS) return 0;
    if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "%ld sectors", *m);
    return -1;
}

/* Mechanism, angles (n, 2); configurations (n, 66), statuses (n).  Returns the first status that is
 * not OK. */
static PyObject *forward_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    if (counted(count, 4)) return 0;
    const Py_ssize_t n = PyObject_Length(args[3]);
    if (n < 0) return 0;
    const Py_ssize_t sizes[] = {sizeof(Mechanism), 2 * n * sizeof(double),
                                n * sizeof(Configuration), n};
    Buffers b;
    if (take(&b, args, sizes, "dddb", 3u << 2)) return 0;
    const double *theta = b.view[1].buf;
    Configuration *at = b.view[2].buf;
    unsigned char *statuses = b.view[3].buf;
    int first = OK;
    for (Py_ssize_t i = 0; i < n; i++) {
        const int status = reach(b.view[0].buf, theta + 2 * i, at + i);
        statuses[i] = (unsigned char)status;
        if (!first) first = status;
    }
    release(&b);
    return PyLong_FromLong(first);
}

/* Parts, configurations (n, 66), wrenches (n, 6), screws in both limbs (n, 6) and openings (n, m) or
 * None, contact states (n, m) to begin with; twists (n, 6), forces (n, m); m.  Returns the first status
 * that is not OK.  Where the state to begin with was wrong one sample before, that sample's serves. */
static PyObject *respond_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    long m;
    if (counted(count, 10) || sectors(args[9], &m)) return 0;
    const Py_ssize_t n = PyObject_Length(args[7]), real = sizeof(double);
    if (n < 0) return 0;
    const Py_ssize_t six = 6 * n * real, row = n * m * real;
    const Py_ssize_t sizes[] = {parts_size(m), n * (Py_ssize_t)sizeof(Configuration), six, six, six,
                                row, n * m, six, row};
    Buffers b;
    if (take(&b, args, sizes, "ddddddbdd", 7u << 6)) return 0;
    const Configuration *at = b.view[1].buf;
    const double *wrench = b.view[2].buf, *limb_1 = b.view[3].buf, *limb_2 = b.view[4].buf;
    const double *opening = b.view[5].buf;
    unsigned char *closed = b.view[6].buf;
    double *twist = b.view[7].buf, *force = b.view[8].buf;
    int status = OK, misled = 0;
    unsigned char guess[MOST_SECTORS];
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t i = 0; i < n && !status; i++, closed += m) {
        memcpy(guess, closed, (size_t)m);
        if (misled) memcpy(closed, closed - m, (size_t)m);
        status = respond(b.view[0].buf, (int)m, at + i, wrench + 6 * i, limb_1 ? limb_1 + 6 * i : 0,
                         limb_2 ? limb_2 + 6 * i : 0, opening ? opening + m * i : 0, closed,
                         twist + 6 * i, force + m * i);
        misled = memcmp(guess, closed, (size_t)m) != 0;
    }
    Py_END_ALLOW_THREADS
    release(&b);
    return PyLong_FromLong(status);
}

/* Flexibilities (n, m, m), openings (n, t, m), contact states (n, t, m) to begin with, forces
 * (n, t, m); n, t, m.  Returns the place of the first problem without an answer, else n t. */
static PyObject *settle_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    long m;
    if (counted(count, 7) || sectors(args[6], &m)) return 0;
    const Py_ssize_t n = PyLong_AsSsize_t(args[4]), t = PyLong_AsSsize_t(args[5]);
    if (PyErr_Occurred()) return 0;
    const Py_ssize_t real = sizeof(double);
    const Py_ssize_t sizes[] = {n * m * m * real, n * t * m * real, n * t * m, n * t * m * real};
    Buffers b;
    if (take(&b, args, sizes, "ddbd", 3u << 2)) return 0;
    const double *a = b.view[0].buf, *gap = b.view[1].buf;
    unsigned char *closed = b.view[2].buf;
    double *force = b.view[3].buf;
    Py_ssize_t i = 0;
    Py_BEGIN_ALLOW_THREADS
    for (; i < n * t; i++)
        if (settle_matrix(a + i / t * m * m, (int)m, gap + i * m, closed + i * m, force + i * m))
            break;
    Py_END_ALLOW_THREADS
    release(&b);
    return PyLong_FromSsize_t(i);
}

/* Flexibilities (n, m, m), openings (n, t, m), contact states (n, m), forces (n, t, m), of which
 * only those of closed sectors are written; n, t, m.  Returns as above, but for samples. */
static PyObject *hold_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    long m;
    if (counted(count, 7) || sectors(args[6], &m)) return 0;
    const Py_ssize_t n = PyLong_AsSsize_t(args[4]), t = PyLong_AsSsize_t(args[5]);
    if (PyErr_Occurred()) return 0;
    const Py_ssize_t real = sizeof(double);
    const Py_ssize_t sizes[] = {n * m * m * real, n * t * m * real, n * m, n * t * m * real};
    Buffers b;
    if (take(&b, args, sizes, "ddbd", 1u << 3)) return 0;
    const double *a = b.view[0].buf, *gap = b.view[1].buf;
    const unsigned char *closed = b.view[2].buf;
    double *force = b.view[3].buf;
    Py_ssize_t i = 0;
    Py_BEGIN_ALLOW_THREADS
    for (; i < n; i++)
        if (hold_matrix(a + i * m * m, (int)m, (int)t, gap + i * t * m, closed + i * m,
                        force + i * t * m))
            break;
    Py_END_ALLOW_THREADS
    release(&b);
    return PyLong_FromSsize_t(i);
}

/* Surfaces (n, 2), compliances (n, 2), axes (n, 2, 2) or None, budgets (n); forces (n, 2), feet
 * (n + 1, 2), of which the first is where they stand. */
static PyObject *slip_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    if (counted(count, 6)) return 0;
    const Py_ssize_t n = PyObject_Length(args[3]), real = sizeof(double);
    if (n < 0) return 0;
    const Py_ssize_t sizes[] = {2 * n * real, 2 * n * real, 4 * n * real, n * real, 2 * n * real,
                                2 * (n + 1) * real};
    Buffers b;
    if (take(&b, args, sizes, "dddddd", 3u << 4)) return 0;
    Py_BEGIN_ALLOW_THREADS
    slip((long)n, b.view[0].buf, b.view[1].buf, b.view[2].buf, b.view[3].buf, b.view[4].buf,
         b.view[5].buf);
    Py_END_ALLOW_THREADS
    release(&b);
    Py_RETURN_NONE;
}

/* Mechanism, parts, angles (n, 2), loads (n, 6), which of them are in U (n), contact state (m),
 * which are wanted (n); twists (n, 6), configurations (n, 66), contact states (n, m), statuses (n);
 * m.  The contact state goes from sample to sample. */
static PyObject *predict_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    long m;
    if (counted(count, 12) || sectors(args[11], &m)) return 0;
    const Py_ssize_t n = PyObject_Length(args[4]), real = sizeof(double);
    if (n < 0) return 0;
    const Py_ssize_t sizes[] = {sizeof(Mechanism), parts_size(m), 2 * n * real, 6 * n * real, n, m,
                                n, 6 * n * real, n * sizeof(Configuration), n * m, n};
    Buffers b;
    if (take(&b, args, sizes, "ddddbbbddbb", 1u << 5 | 15u << 7)) return 0;
    const double *theta = b.view[2].buf, *load = b.view[3].buf;
    const unsigned char *in_u = b.view[4].buf, *wanted = b.view[6].buf;
    unsigned char *closed = b.view[5].buf, *states = b.view[9].buf, *statuses = b.view[10].buf;
    double *twist = b.view[7].buf;
    Configuration *at = b.view[8].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t i = 0; i < n; i++) {
        if (wanted && !wanted[i]) continue;
        statuses[i] = (unsigned char)predict(b.view[0].buf, b.view[1].buf, (int)m, theta + 2 * i,
                                             load + 6 * i, in_u[i], closed, twist + 6 * i, at + i);
        for (long j = 0; j < m; j++) states[i * m + j] = closed[j];
    }
    Py_END_ALLOW_THREADS
    release(&b);
    Py_RETURN_NONE;
}

/* Mechanism, parts, task, safety, commands (n, 2), their stamps (n), loads (n, 6), which are in U (n),
 * which are wanted (n), shares (n), the correction held so far (2), contact state (m), the correction
 * applied so far (2) and when (1); answers (n, 86), contact states (n, m); supervisor, its stamps (2),
 * whether it held each load for known (n); m, where to begin and to end.  Ends at the first command
 * that it cannot serve and returns its place; a command that is not wanted leaves nothing held.
 * Without safety it searches, without a task it applies what was searched.  What is applied begins
 * each row, also of a command that is not wanted.  A supervisor writes loads and shares before they
 * are used. */
static PyObject *correct_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    long m;
    if (counted(count, 22) || sectors(args[19], &m)) return 0;
    const Py_ssize_t n = PyObject_Length(args[7]), real = sizeof(double);
    const Py_ssize_t begin = PyLong_AsSsize_t(args[20]), end = PyLong_AsSsize_t(args[21]);
    if (PyErr_Occurred()) return 0;
    const Py_ssize_t sizes[] = {sizeof(Mechanism), parts_size(m), sizeof(Task), sizeof(Safety),
                                2 * n * real, 8 * n, 6 * n * real, n, n, n * real, 2 * real, m,
                                2 * real, 8, n * sizeof(Corrected), n * m, sizeof(Supervisor), 16, n};
    Buffers b;
    if (take(&b, args, sizes, "dddddqdbbddbdqdbdqb", 511u << 10 | 1u << 6 | 1u << 7 | 1u << 9))
        return 0;
    const Mechanism *k = b.view[0].buf;
    const Task *task = b.view[2].buf;
    const Safety *safety = b.view[3].buf;
    const double *command = b.view[4].buf;
    const int64_t *stamp = b.view[5].buf;
    double *load = b.view[6].buf, *share = b.view[9].buf, *held = b.view[10].buf;
    double *applied = b.view[12].buf;
    unsigned char *in_u = b.view[7].buf, *closed = b.view[11].buf, *states = b.view[15].buf;
    const unsigned char *wanted = b.view[8].buf;
    Corrected *out = b.view[14].buf;
    Supervisor *judging = task ? b.view[16].buf : 0;
    int64_t *at_ns = b.view[17].buf;
    unsigned char *known = b.view[18].buf;
    Py_ssize_t i = begin < 0 ? 0 : begin;
    Py_BEGIN_ALLOW_THREADS
    for (; i < end && i < n; i++) {
        Configuration desired;
        Reading reading;
        if (judging) {
            const Rules *rules = &judging->rules;
            judging->belief.judged = 0.0;
            if (!wanted[i] || reach(k, command + 2 * i, &desired)) break;
            if (!rules->follow &&
                read_load(k, &judging->scales, &desired, load + 6 * i, in_u[i], &reading)) break;
            begin_judging(rules, &judging->belief, stamp[i], at_ns);
            if (!rules->follow) {
                judge(rules, &judging->scales, &judging->belief, command + 2 * i, &reading, at_ns,
                      load + 6 * i);
                in_u[i] = 0;
            }
            judging->belief.judged = 1.0;
            if (at_ns[1] == stamp[i]) held[0] = held[1] = 0.0;
        } else if (task && wanted[i] && reach(k, command + 2 * i, &desired)) {
            break;
        }
        if (task) {
            if (wanted[i] && correct(k, b.view[1].buf, (int)m, task, &desired, load + 6 * i, in_u[i],
                                     held, closed, out + i)) break;
            for (int motor = 0; motor < 2; motor++)
                held[motor] = wanted[i] ? out[i].delta[motor] : 0.0;
            for (long j = 0; j < m; j++) states[i * m + j] = closed[j];
        }
        if (judging) {
            share[i] = share_of(&judging->rules, &judging->scales, &judging->belief, out[i].jacobian,
                                out[i].delta);
            known[i] = (unsigned char)holds_in_full(&judging->belief);
        }
        if (safety) {
            apply_safely(k, safety, command + 2 * i, stamp[i], share[i], wanted[i] ? out + i : 0,
                         applied, b.view[13].buf);
            for (int motor = 0; motor < 2; motor++) out[i].delta[motor] = applied[motor];
        }
    }
    Py_END_ALLOW_THREADS
    release(&b);
    return PyLong_FromSsize_t(i);
}

/* Mechanism, scales, angles (n, 2), loads (n, 6), which of them are in U (n); readings (n, 11),
 * statuses (n).  Returns the first status that is not OK. */
static PyObject *read_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    if (counted(count, 7)) return 0;
    const Py_ssize_t n = PyObject_Length(args[4]), real = sizeof(double);
    if (n < 0) return 0;
    const Py_ssize_t sizes[] = {sizeof(Mechanism), sizeof(Scales), 2 * n * real, 6 * n * real, n,
                                n * sizeof(Reading), n};
    Buffers b;
    if (take(&b, args, sizes, "ddddbdb", 3u << 5)) return 0;
    const double *theta = b.view[2].buf, *load = b.view[3].buf;
    const unsigned char *in_u = b.view[4].buf;
    Reading *out = b.view[5].buf;
    unsigned char *statuses = b.view[6].buf;
    int first = OK;
    for (Py_ssize_t i = 0; i < n; i++) {
        Configuration at;
        int status = reach(b.view[0].buf, theta + 2 * i, &at);
        if (!status) status = read_load(b.view[0].buf, b.view[1].buf, &at, load + 6 * i, in_u[i], out + i);
        statuses[i] = (unsigned char)status;
        if (!first) first = statuses[i];
    }
    release(&b);
    return PyLong_FromLong(first);
}

/* Twists (n, 6) to positions and quaternions (n, 7). */
static PyObject *pose_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    const Py_ssize_t sizes[] = {0, 0};
    Buffers b;
    if (counted(count, 2) || take(&b, args, sizes, "dd", 2u)) return 0;
    const Py_ssize_t n = b.view[0].len / (Py_ssize_t)(6 * sizeof(double));
    const double *twist = b.view[0].buf;
    double *pose = b.view[1].buf;
    if (b.view[1].len < n * 7 * (Py_ssize_t)sizeof(double)) {
        release(&b);
        PyErr_SetString(PyExc_ValueError, "too few rows for the poses");
        return 0;
    }
    for (Py_ssize_t i = 0; i < n; i++) pose_of_twist(twist + 6 * i, pose + 7 * i);
    release(&b);
    Py_RETURN_NONE;
}

/* Mechanism, configurations (n, 66), twists (n, 6), variance by size and of a step; (n, 6, 6). */
static PyObject *covariance_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    Buffers b;
    if (counted(count, 6)) return 0;
    const double of_size = PyFloat_AsDouble(args[4]), of_step = PyFloat_AsDouble(args[5]);
    if (PyErr_Occurred()) return 0;
    Py_ssize_t sizes[] = {sizeof(Mechanism), 0, 0, 0};
    if (take(&b, args, sizes, "dddd", 1u << 3)) return 0;
    const Py_ssize_t n = b.view[1].len / (Py_ssize_t)sizeof(Configuration);
    const Py_ssize_t six = 6 * sizeof(double);
    if (b.view[2].len < n * six || b.view[3].len < 6 * n * six) {
        release(&b);
        PyErr_SetString(PyExc_ValueError, "too few rows for the covariances");
        return 0;
    }
    const Configuration *at = b.view[1].buf;
    const double *twist = b.view[2].buf;
    double *out = b.view[3].buf;
    for (Py_ssize_t i = 0; i < n; i++)
        table_covariance(b.view[0].buf, at + i, twist + 6 * i, of_size, of_step, out + 36 * i);
    release(&b);
    Py_RETURN_NONE;
}

/* Twists (n, 6) to rotations (n, 3, 3) and shifts (n, 3). */
static PyObject *exp_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    const Py_ssize_t real = sizeof(double);
    if (counted(count, 3)) return 0;
    const Py_ssize_t n = PyObject_Length(args[2]);
    if (n < 0) return 0;
    const Py_ssize_t sizes[] = {6 * n * real, 9 * n * real, 3 * n * real};
    Buffers b;
    if (take(&b, args, sizes, "ddd", 6u)) return 0;
    const double *twist = b.view[0].buf;
    double *rotation = b.view[1].buf, *shift = b.view[2].buf;
    for (Py_ssize_t i = 0; i < n; i++) exp_twist(twist + 6 * i, rotation + 9 * i, shift + 3 * i);
    release(&b);
    Py_RETURN_NONE;
}

/* Rotations (n, 3, 3) and shifts (n, 3) to twists (n, 6).  Returns the first status that is not OK. */
static PyObject *log_of(PyObject *self, PyObject *const *args, Py_ssize_t count) {
    const Py_ssize_t real = sizeof(double);
    if (counted(count, 3)) return 0;
    const Py_ssize_t n = PyObject_Length(args[2]);
    if (n < 0) return 0;
    const Py_ssize_t sizes[] = {9 * n * real, 3 * n * real, 6 * n * real};
    Buffers b;
    if (take(&b, args, sizes, "ddd", 4u)) return 0;
    const double *rotation = b.view[0].buf, *shift = b.view[1].buf;
    double *twist = b.view[2].buf;
    int status = OK;
    for (Py_ssize_t i = 0; i < n && !status; i++)
        status = log_motion(rotation + 9 * i, shift + 3 * i, twist + 6 * i);
    release(&b);
    return PyLong_FromLong(status);
}

#define FAST(name, function, text) \
    {name, (PyCFunction)(void (*)(void))function, METH_FASTCALL, text}

static PyMethodDef METHODS[] = {
    FAST("forward", forward_of, "Fill the configurations of n poses in the domain."),
    FAST("respond", respond_of, "Fill twists, forces and contact states at n configurations."),
    FAST("settle", settle_of, "Fill contact states and forces of n times t problems."),
    FAST("hold", hold_of, "Fill the forces that hold the sectors of n samples closed."),
    FAST("slip", slip_of, "Fill forces and feet of bristles at n samples."),
    FAST("predict", predict_of, "Fill twists and configurations of n samples in their order."),
    FAST("correct", correct_of, "Fill the corrections of n commands in their order."),
    FAST("read_load", read_of, "Fill what n loads say of a payload."),
    FAST("pose_of_twist", pose_of, "Fill positions and quaternions of n twists."),
    FAST("table_covariance", covariance_of, "Fill the covariances of n predictions."),
    FAST("exp_twist", exp_of, "Fill rotations and shifts of n twists."),
    FAST("log_motion", log_of, "Fill the twists of n motions; not 0 where one turns too far."),
    {0, 0, 0, 0},
};

static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT, "_native", "The wrist's formulas, compiled.", -1, METHODS, 0, 0, 0, 0,
};

PyMODINIT_FUNC PyInit__native(void) {
    PyObject *module = PyModule_Create(&MODULE);
    if (module) {
        PyModule_AddIntConstant(module, "MECHANISM", sizeof(Mechanism) / sizeof(double));
        PyModule_AddIntConstant(module, "PARTS", sizeof(Parts) / sizeof(double));
        PyModule_AddIntConstant(module, "TASK", sizeof(Task) / sizeof(double));
        PyModule_AddIntConstant(module, "SAFETY", sizeof(Safety) / sizeof(double));
        PyModule_AddIntConstant(module, "CONFIGURATION", sizeof(Configuration) / sizeof(double));
        PyModule_AddIntConstant(module, "CORRECTED", sizeof(Corrected) / sizeof(double));
        PyModule_AddIntConstant(module, "SCALES", sizeof(Scales) / sizeof(double));
        PyModule_AddIntConstant(module, "SUPERVISOR", sizeof(Supervisor) / sizeof(double));
        PyModule_AddIntConstant(module, "READING", sizeof(Reading) / sizeof(double));
        PyModule_AddIntConstant(module, "MOST_SECTORS", MOST_SECTORS);
    }
    return module;
}
