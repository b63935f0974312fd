/* Where the records of an unpacked MCAP chunk begin: `_walk` of `mcap_chunk.py`, compiled. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

enum { OPCODE_MESSAGE = 5, HEAD = 9 };

/* Opcode, then the length of the content, least byte first. */
static uint64_t length_at(const unsigned char *head) {
    uint64_t length = 0;
    for (int i = HEAD - 1; i > 0; i--) length = length << 8 | head[i];
    return length;
}

/* Records; places of messages, to be filled.  Returns how many of these there are, a list of opcode,
 * begin and end of the content of each other record, and where the walk ended: behind the last byte
 * where all is well. */
static PyObject *walk(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    Py_buffer data, places;
    if (given != 2) return PyErr_Format(PyExc_TypeError, "%zd arguments, not 2", given);
    if (PyObject_GetBuffer(args[0], &data, PyBUF_SIMPLE)) return 0;
    if (PyObject_GetBuffer(args[1], &places, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE)) {
        PyBuffer_Release(&data);
        return 0;
    }
    PyObject *others = PyList_New(0), *found = 0;
    const unsigned char *bytes = data.buf;
    const Py_ssize_t room = places.len / (Py_ssize_t)sizeof(int64_t), total = data.len;
    Py_ssize_t position = 0, count = 0;
    while (others && total - position >= HEAD && bytes[position]) {
        const uint64_t length = length_at(bytes + position);
        const int opcode = bytes[position];
        const int fits = length <= (uint64_t)(total - position - HEAD);
        const Py_ssize_t content = position + HEAD;
        if (!fits) break;
        if (opcode == OPCODE_MESSAGE) {
            if (count == room) break;
            const int64_t place = position;
            memcpy((char *)places.buf + count++ * sizeof place, &place, sizeof place);
        } else {
            PyObject *other = Py_BuildValue("inn", opcode, content, content + (Py_ssize_t)length);
            if (!other || PyList_Append(others, other)) Py_CLEAR(others);
            Py_XDECREF(other);
        }
        position = content + (Py_ssize_t)length;
    }
    if (others) found = Py_BuildValue("nNn", count, others, position);
    PyBuffer_Release(&places);
    PyBuffer_Release(&data);
    return found;
}

static PyMethodDef METHODS[] = {
    {"walk", (PyCFunction)(void (*)(void))walk, METH_FASTCALL, "Find the records of a chunk."},
    {0, 0, 0, 0},
};

static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT, "_records", "Records of an MCAP chunk.", -1, METHODS, 0, 0, 0, 0,
};

PyMODINIT_FUNC PyInit__records(void) { return PyModule_Create(&MODULE); }
