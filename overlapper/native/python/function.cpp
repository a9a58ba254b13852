#include <cstddef>
#include <cstring>

#include "python/arrays.h"
// Needs Python.h before it.
#include <structmember.h>

namespace overlapper::python {
namespace {

/// Calls a function or a method of nanobind, whose own types have no attributes. These types have: inspect, pydoc and
/// pickle read them.
struct Function {
  PyObject_HEAD vectorcallfunc call;
  PyObject *core, *attributes;
};

Function* as_function(PyObject* self) { return reinterpret_cast<Function*>(self); }

/// The Python function that says in one sentence which argument is wrong.
PyObject* explanation = nullptr;

/// Whether nanobind has refused the arguments. Its message lists types over several lines and names no argument.
bool arguments_refused(PyObject* error) {
  const nb::object text = nb::steal(PyObject_Str(error));
  const char* const said = text.is_valid() ? PyUnicode_AsUTF8(text.ptr()) : nullptr;
  if (!said) PyErr_Clear();
  return said && std::strstr(said, "(): incompatible function arguments");
}

/// Raises the present error again, in one sentence if nanobind has refused the arguments of `called`.
void explain(PyObject* called, PyObject* const* arguments, size_t count, PyObject* names) {
  nb::python_error error;
  if (!explanation || !error.matches(PyExc_TypeError) || !arguments_refused(error.value().ptr()))
    return error.restore();
  const Py_ssize_t positional = PyVectorcall_NARGS(count);
  nb::list given;
  nb::dict named;
  for (Py_ssize_t i = 0; i < positional; ++i) given.append(nb::borrow(arguments[i]));
  for (Py_ssize_t i = 0; names && i < PyTuple_GET_SIZE(names); ++i)
    named[nb::borrow(PyTuple_GET_ITEM(names, i))] = nb::borrow(arguments[positional + i]);
  PyObject* parts[] = {called, given.ptr(), named.ptr()};
  const nb::object sentence = nb::steal(PyObject_Vectorcall(explanation, parts, 3, nullptr));
  if (sentence.is_valid()) PyErr_SetObject(PyExc_TypeError, sentence.ptr());
}

PyObject* call(PyObject* self, PyObject* const* arguments, size_t count, PyObject* names) {
  PyObject* const core = as_function(self)->core;
  PyObject* const result = PyObject_Vectorcall(core, arguments, count, names);
  if (!result) explain(core, arguments, count, names);
  return result;
}

/// How nanobind makes an object of any of its classes.
vectorcallfunc make_object = nullptr;

PyObject* construct(PyObject* self, PyObject* const* arguments, size_t count, PyObject* names) {
  PyObject* const result = make_object(self, arguments, count, names);
  if (!result) explain(self, arguments, count, names);
  return result;
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
  const nb::object of = nb::steal(name(self, nullptr));
  return of.is_valid() ? PyUnicode_FromFormat("<function %U>", of.ptr()) : nullptr;
}

/// A class may hold a function, which has no `self`. pydoc takes what has __get__ for a function.
PyObject* get(PyObject* self, PyObject*, PyObject*) {
  Py_INCREF(self);
  return self;
}

PyObject* bind(PyObject* self, PyObject* object, PyObject*) {
  return object ? PyMethod_New(self, object) : get(self, nullptr, nullptr);
}

/// `_signature` of the function reads the signature, so that nothing is imported for it before.
PyObject* signature(PyObject* self, void*) {
  return PyObject_CallMethod(self, "_signature", "O", as_function(self)->core);
}

nb::object type_of(bool method) {
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
  PyType_Slot slots[] = {
      {Py_tp_call, reinterpret_cast<void*>(PyVectorcall_Call)},
      {Py_tp_dealloc, reinterpret_cast<void*>(destroy)},
      {Py_tp_descr_get, reinterpret_cast<void*>(method ? bind : get)},
      {Py_tp_repr, reinterpret_cast<void*>(shown)},
      {Py_tp_members, members},
      {Py_tp_methods, methods},
      {Py_tp_getset, computed},
      {0, nullptr},
  };
  const unsigned long kind = method ? Py_TPFLAGS_METHOD_DESCRIPTOR : 0;
  PyType_Spec spec{method ? "overlapper.method" : "overlapper.function", sizeof(Function), 0,
                   static_cast<unsigned>(Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_VECTORCALL | kind), slots};
  nb::object type = nb::steal(PyType_FromSpec(&spec));
  if (!type.is_valid()) nb::raise_python_error();
  return type;
}

void define_callable(nb::module_& m, const char* name, bool method, nb::sig signature) {
  m.def(
      name,
      [type = type_of(method)](const nb::object& core) {
        PyObject* made = PyType_GenericAlloc(reinterpret_cast<PyTypeObject*>(type.ptr()), 0);
        if (!made) nb::raise_python_error();
        as_function(made)->call = &call;
        as_function(made)->core = nb::object(core).release().ptr();
        return nb::steal(made);
      },
      "core"_a, signature, "Calls the core. Attributes can be set, and refused arguments are explained.");
}

}  // namespace

void define_function(nb::module_& m) {
  define_callable(m, "function", false, nb::sig("def function(core: typing.Any) -> typing.Any"));
  define_callable(m, "method", true, nb::sig("def method(core: typing.Any) -> typing.Any"));
  m.def(
      "explain_constructor",
      [](const nb::type_object& type) {
        vectorcallfunc& of_type = reinterpret_cast<PyTypeObject*>(type.ptr())->tp_vectorcall;
        if (of_type == &construct) return;
        make_object = of_type, of_type = &construct;
      },
      "type"_a, nb::sig("def explain_constructor(type: type) -> None"),
      "Refused arguments of the class are explained.");
  m.def(
      "explain_with", [](const nb::object& said_by) { explanation = nb::object(said_by).release().ptr(); }, "said_by"_a,
      nb::sig("def explain_with(said_by: collections.abc.Callable[[typing.Any, list[typing.Any], dict[str, "
              "typing.Any]], str]) -> None"),
      "Sets the function that says which argument is wrong, from what was called and its arguments.");
}

}  // namespace overlapper::python
