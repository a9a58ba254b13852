#pragma once

#include "python/arrays.h"

/// Frames in the form in which pybullet returns them.
namespace overlapper::python {

/// The items of a list or a tuple.
struct Items {
  explicit Items(nb::handle given)
      : list(nb::steal(PySequence_Fast(given.ptr(), "frames must be pairs of sequences of numbers"))) {
    if (!list.is_valid()) throw nb::python_error();
  }
  size_t size() const { return nb::len(list); }
  nb::handle operator[](size_t i) const {
    PyObject* const item = PyTuple_Check(list.ptr()) ? PyTuple_GetItem(list.ptr(), Py_ssize_t(i))
                                                     : PyList_GetItem(list.ptr(), Py_ssize_t(i));
    if (!item) throw nb::python_error();
    return item;
  }
  nb::object list;
};

template <size_t n>
void read(nb::handle given, std::array<double, n>& numbers) {
  const Items items(given);
  if (items.size() != n) fail("frames", "must have positions of 3 numbers and quaternions of 4");
  for (size_t i = 0; i < n; ++i) {
    numbers[i] = PyFloat_AsDouble(items[i].ptr());
    if (numbers[i] == -1 && PyErr_Occurred()) throw nb::python_error();
  }
}

/// A frame in the world, with its quaternion as given.
struct Frame {
  Vec3 position;
  Quaternion orientation;
};

inline Frame to_frame(nb::handle given) {
  const Items pair(given);
  if (pair.size() < 2) fail("frames", "must have a position and a quaternion each");
  std::array<double, 3> p{};
  std::array<double, 4> q{};
  read(pair[0], p);
  read(pair[1], q);
  return {{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
}

inline Vec3 vector_part(Quaternion q) { return {q.x, q.y, q.z}; }

inline Vec3 rotated(Quaternion q, Vec3 v) {
  const Vec3 axis = vector_part(q), twice = 2 * cross(axis, v);
  return v + q.w * twice + cross(axis, twice);
}

/// The rotation by `b`, then by `a`.
inline Quaternion operator*(Quaternion a, Quaternion b) {
  const Vec3 v = vector_part(a), u = vector_part(b), product = a.w * u + b.w * v + cross(v, u);
  return {product.x, product.y, product.z, a.w * b.w - dot(v, u)};
}

}  // namespace overlapper::python
