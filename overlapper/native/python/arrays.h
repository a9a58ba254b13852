#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <array>
#include <span>
#include <string>
#include <vector>

#include "overlap/overlap.h"
#include "shapes/shape.h"

/// Conversions between numpy and the core.
namespace overlapper::python {

namespace nb = nanobind;
using namespace nb::literals;

using Vector = nb::ndarray<nb::numpy, const double, nb::ndim<1>>;
using Matrix = nb::ndarray<nb::numpy, const double, nb::ndim<2>>;
using Matrices = nb::ndarray<nb::numpy, const double, nb::ndim<3>>;
using Indices = nb::ndarray<nb::numpy, const int, nb::ndim<1>>;
using IndexMatrix = nb::ndarray<nb::numpy, const int, nb::ndim<2>>;

/// The result of `compute`; other Python threads run meanwhile.
template <class Compute>
decltype(auto) unlocked(Compute compute) {
  const nb::gil_scoped_release release;
  return compute();
}

/// Moves a vector into a numpy array, which frees it.
template <class Array, class T>
Array to_numpy(std::vector<T> values, std::initializer_list<size_t> shape) {
  auto* owned = new std::vector<T>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return Array(owned->data(), shape, owner);
}

inline Vector to_numpy(Vec3 v) { return to_numpy<Vector>(std::vector<double>{v.x, v.y, v.z}, {3}); }

inline Vector to_numpy(Quaternion q) { return to_numpy<Vector>(std::vector<double>{q.x, q.y, q.z, q.w}, {4}); }

inline Matrix to_numpy(std::span<const Vec3> rows) {
  std::vector<double> values;
  values.reserve(3 * rows.size());
  for (Vec3 v : rows) values.insert(values.end(), {v.x, v.y, v.z});
  return to_numpy<Matrix>(std::move(values), {rows.size(), 3});
}

inline Indices to_numpy(std::span<const int> values) {
  return to_numpy<Indices>(std::vector<int>(values.begin(), values.end()), {values.size()});
}

/// Rows of points, with `origin` added.
inline Matrix to_numpy(std::span<const Vec3> rows, Vec3 origin) {
  std::vector<Vec3> moved;
  moved.reserve(rows.size());
  for (Vec3 v : rows) moved.push_back(v + origin);
  return to_numpy(std::span<const Vec3>(moved));
}

inline IndexMatrix to_numpy(std::span<const std::array<int, 3>> rows) {
  std::vector<int> values;
  values.reserve(3 * rows.size());
  for (const auto& row : rows) values.insert(values.end(), row.begin(), row.end());
  return to_numpy<IndexMatrix>(std::move(values), {rows.size(), 3});
}

inline Matrix to_numpy(const Mat3& m) { return to_numpy(std::vector<Vec3>{m.row0, m.row1, m.row2}); }

inline Matrix to_numpy(const Bounds& box) { return to_numpy(std::vector<Vec3>{box.lower, box.upper}); }

/// Rows [normal, -offset], so that normal · x + b <= 0 inside: scipy's form.
inline Matrix halfspace_rows(std::span<const Plane> planes) {
  std::vector<double> values;
  for (const Plane& p : planes) values.insert(values.end(), {p.normal.x, p.normal.y, p.normal.z, -p.offset});
  return to_numpy<Matrix>(std::move(values), {planes.size(), 4});
}

inline nb::list polygons(std::span<const int> ring, std::span<const int> ring_start) {
  nb::list list;
  for (size_t f = 0; f + 1 < ring_start.size(); ++f)
    list.append(nb::cast(to_numpy(ring.subspan(ring_start[f], ring_start[f + 1] - ring_start[f]))));
  return list;
}

using Doubles = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

[[noreturn]] inline void fail(const std::string& name, const std::string& reason) {
  throw nb::value_error((name + " " + reason).c_str());
}

/// Whether a value is text, or has text in its rows. `float` and numpy would read a number from it.
inline bool has_text(nb::handle value) {
  if (nb::isinstance<nb::str>(value) || nb::isinstance<nb::bytes>(value)) return true;
  if (nb::isinstance<nb::list>(value) || nb::isinstance<nb::tuple>(value)) {
    for (nb::handle each : value)
      if (has_text(each)) return true;
    return false;
  }
  if (!nb::hasattr(value, "dtype") || !nb::hasattr(value.attr("dtype"), "kind")) return false;
  const nb::object kind = value.attr("dtype").attr("kind");
  return kind.equal(nb::str("U")) || kind.equal(nb::str("S"));
}

/// Any array_like as contiguous doubles. `expected` describes the required shape, for the message.
inline Doubles to_doubles(nb::handle value, const std::string& name, const std::string& expected) {
  // An array of this kind is taken as it is, because a call of numpy takes longer than all other work on few poses.
  Doubles as_it_is;
  if (nb::ndarray_check(value) && nb::try_cast(value, as_it_is, false)) return as_it_is;
  if (has_text(value)) fail(name, "must be " + expected);
  try {
    return nb::cast<Doubles>(nb::module_::import_("numpy").attr("ascontiguousarray")(value, "dtype"_a = "float64"));
  } catch (nb::python_error& error) {
    if (!error.matches(PyExc_ValueError) && !error.matches(PyExc_TypeError)) throw;
    fail(name, "must be " + expected);
  }
}

inline std::string shape_text(const Doubles& array) {
  std::string text = "(";
  for (size_t i = 0; i < array.ndim(); ++i) text += (i ? ", " : "") + std::to_string(array.shape(i));
  return text + (array.ndim() == 1 ? ",)" : ")");
}

inline Vec3 to_vec3(nb::handle value, const std::string& name) {
  const Doubles array = to_doubles(value, name, "three numbers");
  if (array.ndim() != 1 || array.shape(0) != 3)
    fail(name, "must be three numbers, not an array of shape " + shape_text(array));
  return {array.data()[0], array.data()[1], array.data()[2]};
}

/// Four numbers, or a rotation of scipy.
inline Quaternion to_quaternion(nb::handle value) {
  const nb::object numbers = nb::hasattr(value, "as_quat") ? value.attr("as_quat")() : nb::borrow(value);
  const Doubles array = to_doubles(numbers, "orientation", "a quaternion (x, y, z, w)");
  if (array.ndim() != 1 || array.shape(0) != 4)
    fail("orientation", "must be a quaternion (x, y, z, w), not an array of shape " + shape_text(array));
  return {array.data()[0], array.data()[1], array.data()[2], array.data()[3]};
}

/// The pose of a homogeneous matrix, given by rows.
std::pair<Vec3, Quaternion> matrix_pose(std::span<const double, 16> matrix, const std::string& name);
/// The unit quaternion of a rotation.
Quaternion rotation_quaternion(const Mat3& rotation);

inline double to_double(nb::handle value, const std::string& name) {
  if (nb::isinstance<nb::str>(value) || nb::isinstance<nb::bytes>(value)) fail(name, "must be a number");
  try {
    return nb::cast<double>(value.type().is(nb::handle((PyObject*)&PyFloat_Type))
                                ? nb::borrow(value)
                                : nb::module_::import_("builtins").attr("float")(value));
  } catch (nb::python_error& error) {
    if (!error.matches(PyExc_ValueError) && !error.matches(PyExc_TypeError)) throw;
    fail(name, "must be a number");
  }
}

/// Whole numbers of any width, in one dimension or in rows. The copy keeps other threads from changing them.
inline std::vector<std::int64_t> to_indices(nb::handle value, const std::string& name, int columns = 0) {
  const std::string expected = columns
                                   ? "must be an array of whole numbers of shape (p, " + std::to_string(columns) + ")"
                                   : "must be an array of whole numbers";
  const auto in_shape = [&](const auto& rows) {
    return columns ? rows.ndim() == 2 && rows.shape(1) == static_cast<size_t>(columns) : rows.ndim() == 1;
  };
  nb::ndarray<const std::int64_t, nb::c_contig, nb::device::cpu> wide;
  nb::ndarray<const std::int32_t, nb::c_contig, nb::device::cpu> narrow;
  if (nb::ndarray_check(value)) {
    if (nb::try_cast(value, wide, false) && in_shape(wide)) return {wide.data(), wide.data() + wide.size()};
    if (nb::try_cast(value, narrow, false) && in_shape(narrow)) return {narrow.data(), narrow.data() + narrow.size()};
  }
  nb::object array;
  try {
    const nb::module_ numpy = nb::module_::import_("numpy");
    array = numpy.attr("asarray")(value);
    // numpy gives an empty list a floating-point type.
    if (nb::cast<size_t>(array.attr("size")) == 0) array = array.attr("astype")("int64");
    array = array.attr("astype")("int64", "order"_a = "C", "casting"_a = "same_kind");
  } catch (nb::python_error& error) {
    if (!error.matches(PyExc_ValueError) && !error.matches(PyExc_TypeError) && !error.matches(PyExc_OverflowError))
      throw;
    fail(name, expected);
  }
  const auto rows = nb::cast<nb::ndarray<const std::int64_t, nb::c_contig, nb::device::cpu>>(array);
  if (!in_shape(rows) && rows.size() > 0) fail(name, expected);
  return {rows.data(), rows.data() + rows.size()};
}

inline std::vector<Vec3> to_rows(nb::handle value, const std::string& name) {
  const std::string expected = "an array of numbers of shape (n, 3)";
  const Doubles array = to_doubles(value, name, expected);
  if (array.ndim() != 2 || array.shape(1) != 3)
    fail(name, "must be " + expected + ", not of shape " + shape_text(array));
  std::vector<Vec3> rows(array.shape(0));
  for (size_t i = 0; i < rows.size(); ++i)
    rows[i] = {array.data()[3 * i], array.data()[3 * i + 1], array.data()[3 * i + 2]};
  return rows;
}

/// A read-only property that makes a new array on each access.
template <class Class, class Getter>
void array_property(Class& cls, const char* name, Getter getter, const char* doc) {
  cls.def_prop_ro(name, getter, nb::rv_policy::move, doc);
}

/// A shape as given, or the hull of an (n, 3) array. TypeError or ValueError naming the argument.
Shape to_shape(nb::handle value, const std::string& name);
nb::object to_python(const Shape& shape);
/// The type of any shape in signatures.
std::string any_shape();
/// The type of the argument of to_shape() in signatures.
std::string any_solid();
/// The same, at the origin unless it is a Placed.
Placed to_placed(nb::handle value, const std::string& name);
/// "auto" or "paper".
Method to_method(nb::handle value);
/// A tolerance between 0 and 1.
double to_tolerance(nb::handle given);

/// A number of threads; None stands for one per processor.
int to_threads(nb::handle given);
/// A number as printed in a repr.
std::string number(double value);

void define_shapes(nb::module_& m);
void define_overlaps(nb::module_& m);
void define_batch(nb::module_& m);
void define_poses(nb::module_& m);
void define_shape_arrays(nb::module_& m);
void define_forces(nb::module_& m);
void define_function(nb::module_& m);
void define_motion(nb::module_& m);

}  // namespace overlapper::python
