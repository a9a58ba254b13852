#include <cstddef>

#include "python/arrays.h"
// Needs Python.h before it.
#include <structmember.h>

namespace overlapper::python {
namespace {

/// Calls a function of nanobind, whose own type has no attributes. This type has: inspect, pydoc and pickle read them.
struct Function {
  PyObject_HEAD vectorcallfunc call;
  PyObject *core, *attributes;
};

Function* as_function(PyObject* self) { return reinterpret_cast<Function*>(self); }

PyObject* call(PyObject* self, PyObject* const* arguments, size_t count, PyObject* names) {
  return PyObject_Vectorcall(as_function(self)->core, arguments, count, names);
}

void destroy(PyObject* self) {
  PyTypeObject* type = Py_TYPE(self);
  Py_CLEAR(as_function(self)->core);
  Py_CLEAR(as_function(self)->attributes);
  PyObject_Free(self);
  Py_DECREF(type);
}

/// The name, with which a function is pickled and shown.
PyObject* name(PyObject* self, PyObject*) { return PyObject_GetAttrString(self, "__name__"); }
PyObject* shown(PyObject* self) {
  const nanobind::object of = nanobind::steal(name(self, nullptr));
  return of.is_valid() ? PyUnicode_FromFormat("<function %U>", of.ptr()) : nullptr;
}

/// A class may hold the function, which has no `self`. pydoc takes what has __get__ for a function.
PyObject* get(PyObject* self, PyObject*, PyObject*) {
  Py_INCREF(self);
  return self;
}

/// `_signature` of the function reads the signature, so that nothing is imported for it before.
PyObject* signature(PyObject* self, void*) {
  return PyObject_CallMethod(self, "_signature", "O", as_function(self)->core);
}

PyTypeObject* function_type() {
  static PyMemberDef members[] = {
      {"__vectorcalloffset__", T_PYSSIZET, offsetof(Function, call), READONLY, nullptr},
      {"__dictoffset__", T_PYSSIZET, offsetof(Function, attributes), READONLY, nullptr},
      {nullptr, 0, 0, 0, nullptr},
  };
  static PyMethodDef methods[] = {
      {"__reduce__", name, METH_NOARGS, nullptr},
      {nullptr, nullptr, 0, nullptr},
  };
  static PyGetSetDef computed[] = {
      {"__signature__", signature, nullptr, nullptr, nullptr},
      {"__dict__", PyObject_GenericGetDict, nullptr, nullptr, nullptr},
      {nullptr, nullptr, nullptr, nullptr, nullptr},
  };
  static PyType_Slot slots[] = {
      {Py_tp_call, reinterpret_cast<void*>(PyVectorcall_Call)},
      {Py_tp_dealloc, reinterpret_cast<void*>(destroy)},
      {Py_tp_descr_get, reinterpret_cast<void*>(get)},
      {Py_tp_repr, reinterpret_cast<void*>(shown)},
      {Py_tp_members, members},
      {Py_tp_methods, methods},
      {Py_tp_getset, computed},
      {0, nullptr},
  };
  static PyType_Spec spec{"overlapper.function", sizeof(Function), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_VECTORCALL,
                          slots};
  return reinterpret_cast<PyTypeObject*>(PyType_FromSpec(&spec));
}

}  // namespace

void define_function(nanobind::module_& m) {
  const nanobind::object type = nanobind::steal(reinterpret_cast<PyObject*>(function_type()));
  if (!type.is_valid()) nanobind::raise_python_error();
  m.def(
      "function",
      [type](const nanobind::object& core) {
        PyObject* made = PyType_GenericAlloc(reinterpret_cast<PyTypeObject*>(type.ptr()), 0);
        if (!made) nanobind::raise_python_error();
        as_function(made)->call = &call;
        as_function(made)->core = nanobind::object(core).release().ptr();
        return nanobind::steal(made);
      },
      "core"_a, nanobind::sig("def function(core: typing.Any) -> typing.Any"),
      "Calls a function of the core. Attributes can be set.");
}

}  // namespace overlapper::python
