#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>

#include "minkowski.h"
#include "overlap.h"
#include "shape.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace overlapper;

namespace {

using Vector = nb::ndarray<nb::numpy, const double, nb::ndim<1>>;
using Matrix = nb::ndarray<nb::numpy, const double, nb::ndim<2>>;
using Indices = nb::ndarray<nb::numpy, const int, nb::ndim<1>>;
using IndexMatrix = nb::ndarray<nb::numpy, const int, nb::ndim<2>>;

// ------------------------------------------------------------------------------------------------------- numpy, both ways

/// Hands a vector over to numpy, which frees it.
template <class Array, class T>
Array to_numpy(std::vector<T> values, std::initializer_list<size_t> shape) {
  auto* owned = new std::vector<T>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return Array(owned->data(), shape, owner);
}

Vector to_numpy(Vec3 v) { return to_numpy<Vector>(std::vector<double>{v.x, v.y, v.z}, {3}); }

Matrix to_numpy(std::span<const Vec3> rows) {
  std::vector<double> values;
  values.reserve(3 * rows.size());
  for (Vec3 v : rows) values.insert(values.end(), {v.x, v.y, v.z});
  return to_numpy<Matrix>(std::move(values), {rows.size(), 3});
}

Indices to_numpy(std::span<const int> values) {
  return to_numpy<Indices>(std::vector<int>(values.begin(), values.end()), {values.size()});
}

Matrix to_numpy(const Bounds& box) { return to_numpy(std::vector<Vec3>{box.lower, box.upper}); }

/// Rows [normal, -offset], so that normal · x + b <= 0 inside: scipy's form.
Matrix halfspace_rows(std::span<const Plane> planes) {
  std::vector<double> values;
  for (const Plane& p : planes) values.insert(values.end(), {p.normal.x, p.normal.y, p.normal.z, -p.offset});
  return to_numpy<Matrix>(std::move(values), {planes.size(), 4});
}

nb::list polygons(std::span<const int> ring, std::span<const int> ring_start) {
  nb::list list;
  for (size_t f = 0; f + 1 < ring_start.size(); ++f)
    list.append(nb::cast(to_numpy(ring.subspan(ring_start[f], ring_start[f + 1] - ring_start[f]))));
  return list;
}

using Doubles = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

[[noreturn]] void fail(const std::string& name, const std::string& reason) {
  throw nb::value_error((name + " " + reason).c_str());
}

/// Any array_like as contiguous doubles. `expected` describes the shape wanted, for the message.
Doubles to_doubles(nb::handle value, const std::string& name, const std::string& expected) {
  try {
    return nb::cast<Doubles>(nb::module_::import_("numpy").attr("ascontiguousarray")(value, "dtype"_a = "float64"));
  } catch (nb::python_error& error) {
    if (!error.matches(PyExc_ValueError) && !error.matches(PyExc_TypeError)) throw;
    fail(name, "must be " + expected);
  }
}

std::string shape_text(const Doubles& array) {
  std::string text = "(";
  for (size_t i = 0; i < array.ndim(); ++i) text += (i ? ", " : "") + std::to_string(array.shape(i));
  return text + (array.ndim() == 1 ? ",)" : ")");
}

Vec3 to_vec3(nb::handle value, const std::string& name) {
  const Doubles array = to_doubles(value, name, "three numbers");
  if (array.ndim() != 1 || array.shape(0) != 3)
    fail(name, "must be three numbers, not an array of shape " + shape_text(array));
  return {array.data()[0], array.data()[1], array.data()[2]};
}

Quaternion to_quaternion(nb::handle value) {
  const Doubles array = to_doubles(value, "orientation", "a quaternion (x, y, z, w)");
  if (array.ndim() != 1 || array.shape(0) != 4)
    fail("orientation", "must be a quaternion (x, y, z, w), not an array of shape " + shape_text(array));
  return {array.data()[0], array.data()[1], array.data()[2], array.data()[3]};
}

double to_double(nb::handle value, const std::string& name) {
  try {
    return nb::cast<double>(value.type().is(nb::handle((PyObject*)&PyFloat_Type))
                                ? nb::borrow(value)
                                : nb::module_::import_("builtins").attr("float")(value));
  } catch (nb::python_error& error) {
    if (!error.matches(PyExc_ValueError) && !error.matches(PyExc_TypeError)) throw;
    fail(name, "must be a number");
  }
}

std::vector<Vec3> to_rows(nb::handle value, const std::string& name) {
  const std::string expected = "an array of numbers of shape (n, 3)";
  const Doubles array = to_doubles(value, name, expected);
  if (array.ndim() != 2 || array.shape(1) != 3)
    fail(name, "must be " + expected + ", not of shape " + shape_text(array));
  std::vector<Vec3> rows(array.shape(0));
  for (size_t i = 0; i < rows.size(); ++i)
    rows[i] = {array.data()[3 * i], array.data()[3 * i + 1], array.data()[3 * i + 2]};
  return rows;
}

/// A read-only property that makes a new array each time it is asked for.
template <class Class, class Getter>
void array_property(Class& cls, const char* name, Getter getter, const char* doc) {
  cls.def_prop_ro(name, getter, nb::rv_policy::move, doc);
}

// --------------------------------------------------------------------------------------------------------------- shapes

template <class T>
nb::object wrap(const T& value) {
  return nb::cast(value);
}

nb::object to_python(const Shape& shape) {
  return std::visit([](const auto& s) { return wrap(s); }, shape);
}

template <class... Types>
bool try_shapes(nb::handle value, Shape& shape, std::variant<Types...>*) {
  return ((nb::isinstance<Types>(value) && (shape = nb::cast<Types>(value), true)) || ...);
}

bool is_shape(nb::handle value, Shape& shape) { return try_shapes(value, shape, static_cast<Shape*>(nullptr)); }

Shape to_shape(nb::handle value, const std::string& name) {
  Shape shape;
  if (is_shape(value, shape)) return shape;
  if (nb::isinstance<Placed>(value))
    throw nb::type_error((name + " must be a bare shape, it is already placed").c_str());
  const bool array_like = PySequence_Check(value.ptr()) || nb::hasattr(value, "__array__");
  if (!array_like || nb::isinstance<nb::str>(value) || nb::isinstance<nb::bytes>(value))
    throw nb::type_error((name + " must be a shape or an (n, 3) array of points, not " +
                          nb::cast<std::string>(value.type().attr("__name__")))
                             .c_str());
  return make_hull(to_rows(value, name));
}

Placed to_placed(nb::handle value, const std::string& name) {
  if (nb::isinstance<Placed>(value)) return nb::cast<Placed>(value);
  return make_placed(to_shape(value, name), {}, {});
}

std::string number(double value) {
  std::ostringstream text;
  text.precision(6);
  text << value;
  return text.str();
}

std::string tuple_text(std::initializer_list<double> values) {
  std::string text = "(";
  for (double v : values) text += (text.size() > 1 ? ", " : "") + number(v);
  return text + ")";
}

std::string text(Vec3 v) { return tuple_text({v.x, v.y, v.z}); }

std::string repr(const Sphere& s) { return "Sphere(radius=" + number(s.radius) + ")"; }
std::string repr(const Box& b) { return "Box(half_extents=" + text(b.half_extents) + ")"; }
std::string repr(const Capsule& c) {
  return "Capsule(radius=" + number(c.radius) + ", length=" + number(c.length) + ")";
}
std::string repr(const Cylinder& c) {
  return "Cylinder(radius=" + number(c.radius) + ", length=" + number(c.length) + ")";
}
std::string repr(const Hull& h) {
  return "Hull(" + std::to_string(h.data->vertices.size()) + " vertices, " + std::to_string(h.data->planes.size()) +
         " facets)";
}
std::string repr(const HalfSpace& h) {
  return "HalfSpace(normal=" + text(h.plane.normal) + ", offset=" + number(h.plane.offset) + ")";
}
std::string repr(const Shape& shape) {
  return std::visit([](const auto& s) { return repr(s); }, shape);
}
std::string repr(const Placed& p) {
  return "Placed(" + repr(p.shape) + ", position=" + text(p.position) +
         ", orientation=" + tuple_text({p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w}) + ")";
}

Vec3 world_origin(const Hull& hull) { return hull.data->origin; }

/// What all shapes share: measures, printing, copies that are the same object.
template <class T>
void define_common(nb::class_<T>& cls) {
  cls.def_prop_ro("volume", [](const T& s) { return volume(Shape(s)); }, "Volume in m³; infinite for a half-space.");
  array_property(
      cls, "centroid",
      [](const T& s) {
        if constexpr (std::is_same_v<T, Hull>) return to_numpy(centroid(s) + world_origin(s));
        else return to_numpy(centroid(Shape(s)));
      },
      "(3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.");
  array_property(
      cls, "bounds", [](const T& s) { return to_numpy(bounds(make_placed(s, {}, {}))); },
      "(2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.");
  cls.def("__repr__", [](const T& s) { return repr(s); });
  cls.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  cls.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
}

Vec3 shifted(Vec3 v, Vec3 by) { return v + by; }

/// Pickles a shape as the arguments of its constructor.
template <class T, class Arguments>
void define_pickle(nb::class_<T>& cls, Arguments arguments) {
  cls.def(
      "__reduce__",
      [arguments](nb::handle self) { return nb::make_tuple(self.type(), arguments(nb::cast<const T&>(self))); },
      nb::sig("def __reduce__(self) -> tuple[type, tuple[object, ...]]"));
}

/// A hull travels as it was built, so that indices into its facets mean the same in another process.
nb::tuple hull_state(const Hull& hull) {
  const HullData& d = *hull.data;
  return nb::make_tuple(nb::cast(to_numpy(d.origin), nb::rv_policy::move),
                        nb::cast(to_numpy(d.vertices), nb::rv_policy::move),
                        nb::cast(halfspace_rows(d.planes), nb::rv_policy::move),
                        nb::cast(to_numpy(std::span<const int>(d.ring)), nb::rv_policy::move),
                        nb::cast(to_numpy(std::span<const int>(d.ring_start)), nb::rv_policy::move));
}

Hull hull_from_state(nb::tuple state) {
  auto data = std::make_shared<HullData>();
  data->origin = to_vec3(state[0], "origin");
  data->vertices = to_rows(state[1], "vertices");
  const Doubles planes = to_doubles(state[2], "planes", "an array of shape (k, 4)");
  for (size_t i = 0; i < planes.shape(0); ++i) {
    const double* row = planes.data() + 4 * i;
    data->planes.push_back({{row[0], row[1], row[2]}, -row[3]});
  }
  const auto integers = [](nb::handle value) {
    const auto array = nb::cast<nb::ndarray<const int, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(value);
    return std::vector<int>(array.data(), array.data() + array.shape(0));
  };
  data->ring = integers(state[3]);
  data->ring_start = integers(state[4]);
  const HullMeasures measures = measure(*data);
  data->volume = measures.volume;
  data->centroid = measures.centroid;
  return {std::move(data)};
}

void define_shapes(nb::module_& m) {
  nb::class_<Sphere> sphere(m, "Sphere", "A ball of the given radius (m) about the origin.");
  sphere.def(
      "__init__", [](Sphere* self, nb::handle radius) { new (self) Sphere(make_sphere(to_double(radius, "radius"))); },
      "radius"_a.none(), nb::sig("def __init__(self, radius: float) -> None"));
  sphere.def_ro("radius", &Sphere::radius, "m");
  define_common(sphere);
  define_pickle(sphere, [](const Sphere& s) { return nb::make_tuple(s.radius); });

  nb::class_<Box> box(m, "Box", "A box about the origin with half extents (m) along x, y, z.");
  box.def(
      "__init__",
      [](Box* self, nb::handle half_extents) { new (self) Box(make_box(to_vec3(half_extents, "half_extents"))); },
      "half_extents"_a.none(), nb::sig("def __init__(self, half_extents: numpy.typing.ArrayLike) -> None"));
  array_property(box, "half_extents", [](const Box& b) { return to_numpy(b.half_extents); }, "(3,) m");
  define_common(box);
  define_pickle(box, [](const Box& b) {
    return nb::make_tuple(nb::make_tuple(b.half_extents.x, b.half_extents.y, b.half_extents.z));
  });

  nb::class_<Capsule> capsule(
      m, "Capsule",
      "All points within `radius` (m) of a segment of `length` (m) along local z, about the origin.\n\n"
      "As in pybullet, `length` lies between the centres of the caps; it may be 0.");
  capsule.def(
      "__init__",
      [](Capsule* self, nb::handle radius, nb::handle length) {
        new (self) Capsule(make_capsule(to_double(radius, "radius"), to_double(length, "length")));
      },
      "radius"_a.none(), "length"_a.none(), nb::sig("def __init__(self, radius: float, length: float) -> None"));
  capsule.def_ro("radius", &Capsule::radius, "m");
  capsule.def_ro("length", &Capsule::length, "m, between the centres of the caps");
  define_common(capsule);
  define_pickle(capsule, [](const Capsule& c) { return nb::make_tuple(c.radius, c.length); });

  nb::class_<Cylinder> cylinder(m, "Cylinder",
                                "A cylinder of `radius` (m) and `length` (m) along local z, about the origin.");
  cylinder.def(
      "__init__",
      [](Cylinder* self, nb::handle radius, nb::handle length) {
        new (self) Cylinder(make_cylinder(to_double(radius, "radius"), to_double(length, "length")));
      },
      "radius"_a.none(), "length"_a.none(), nb::sig("def __init__(self, radius: float, length: float) -> None"));
  cylinder.def_ro("radius", &Cylinder::radius, "m");
  cylinder.def_ro("length", &Cylinder::length, "m");
  define_common(cylinder);
  define_pickle(cylinder, [](const Cylinder& c) { return nb::make_tuple(c.radius, c.length); });

  nb::class_<HalfSpace> half(m, "HalfSpace",
                             "The closed half-space { x : normal · x <= offset }.\n\n"
                             "`normal` may have any length but 0; both it and `offset` are divided by it.");
  half.def(
      "__init__",
      [](HalfSpace* self, nb::handle normal, nb::handle offset) {
        new (self) HalfSpace(make_half_space(to_vec3(normal, "normal"), to_double(offset, "offset")));
      },
      "normal"_a.none(), "offset"_a.none(),
      nb::sig("def __init__(self, normal: numpy.typing.ArrayLike, offset: float) -> None"));
  array_property(
      half, "normal", [](const HalfSpace& h) { return to_numpy(h.plane.normal); }, "(3,) unit, out of the solid");
  half.def_prop_ro("offset", [](const HalfSpace& h) { return h.plane.offset; }, "m along the unit normal");
  define_common(half);
  define_pickle(half, [](const HalfSpace& h) {
    const Vec3 n = h.plane.normal;
    return nb::make_tuple(nb::make_tuple(n.x, n.y, n.z), h.plane.offset);
  });

  nb::class_<Hull> hull(
      m, "Hull",
      "The convex hull of (n, 3) points (m).\n\n"
      "Interior, duplicate and coplanar points are welcome; coplanar triangles become one facet. Raises\n"
      "ValueError for fewer than four points, for points that are not finite and for points in one plane.");
  hull.def(
      "__init__", [](Hull* self, nb::handle vertices) { new (self) Hull(make_hull(to_rows(vertices, "vertices"))); },
      "vertices"_a.none(), nb::sig("def __init__(self, vertices: numpy.typing.ArrayLike) -> None"));
  array_property(
      hull, "vertices",
      [](const Hull& h) {
        std::vector<Vec3> vertices;
        for (Vec3 v : h.data->vertices) vertices.push_back(shifted(v, h.data->origin));
        return to_numpy(vertices);
      },
      "(n, 3) the corners only, m");
  hull.def_prop_ro(
      "facets", [](const Hull& h) { return polygons(h.data->ring, h.data->ring_start); },
      nb::sig("def facets(self) -> list[numpy.typing.NDArray[numpy.int32]]"),
      "Indices of the vertices around each facet, counter-clockwise from outside.");
  array_property(
      hull, "halfspaces",
      [](const Hull& h) {
        std::vector<Plane> planes = h.data->planes;
        for (Plane& p : planes) p.offset += dot(p.normal, h.data->origin);
        return halfspace_rows(planes);
      },
      "(k, 4) rows [n, b], one per facet: n · x + b <= 0 inside, n unit (scipy's form).");
  define_common(hull);
  hull.def("__getstate__", &hull_state, nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  hull.def(
      "__setstate__", [](Hull& self, nb::tuple state) { new (&self) Hull(hull_from_state(state)); },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

void define_placed(nb::module_& m) {
  nb::class_<Placed> placed(
      m, "Placed",
      "A shape and where it is in the world.\n\n"
      "position is (3,) in m; orientation is a quaternion (x, y, z, w) as in pybullet, of any length but 0.");
  placed.def(
      "__init__",
      [](Placed* self, nb::handle shape, nb::handle position, nb::handle orientation) {
        new (self)
            Placed(make_placed(to_shape(shape, "shape"), to_vec3(position, "position"), to_quaternion(orientation)));
      },
      "shape"_a.none(), "position"_a.none() = nb::make_tuple(0.0, 0.0, 0.0),
      "orientation"_a.none() = nb::make_tuple(0.0, 0.0, 0.0, 1.0),
      nb::sig("def __init__(self, shape: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | "
              "numpy.typing.ArrayLike, position: "
              "numpy.typing.ArrayLike = (0, 0, 0), orientation: numpy.typing.ArrayLike = (0, 0, 0, 1)) -> None"));
  placed.def_prop_ro(
      "shape", [](const Placed& p) { return to_python(p.shape); },
      nb::sig("def shape(self) -> Box | Sphere | Capsule | Cylinder | Hull | HalfSpace"));
  array_property(placed, "position", [](const Placed& p) { return to_numpy(p.position); }, "(3,) m");
  array_property(
      placed, "orientation",
      [](const Placed& p) {
        return to_numpy<Vector>(std::vector<double>{p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w},
                                {4});
      },
      "(4,) unit quaternion x, y, z, w");
  placed.def_prop_ro("volume", [](const Placed& p) { return volume(p.shape); }, "m³; infinite for a half-space");
  array_property(
      placed, "centroid", [](const Placed& p) { return to_numpy(p.pose * centroid(p.shape)); }, "(3,) in the world, m");
  array_property(
      placed, "bounds", [](const Placed& p) { return to_numpy(bounds(p)); },
      "(2, 3) lower and upper corner of the box around it in the world, m");
  placed.def("__repr__", [](const Placed& p) { return repr(p); });
  placed.def(
      "__reduce__",
      [](nb::handle self) {
        return nb::make_tuple(self.type(),
                              nb::make_tuple(self.attr("shape"), self.attr("position"), self.attr("orientation")));
      },
      nb::sig("def __reduce__(self) -> tuple[type, tuple[object, ...]]"));
  placed.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  placed.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
}

// -------------------------------------------------------------------------------------------------------------- overlaps

const char* status_name(Status status) {
  return status == Status::kSeparated ? "separated" : status == Status::kTouching ? "touching" : "overlapping";
}

Method to_method(const std::string& name) {
  if (name == "auto") return Method::kAuto;
  if (name == "paper") return Method::kPaper;
  fail("method", "must be 'auto' or 'paper', not '" + name + "'");
}

bool solid(const Overlap& o) { return o.status() == Status::kOverlapping; }

Matrix empty_rows(size_t columns) { return to_numpy<Matrix>(std::vector<double>{}, {0, columns}); }

Matrix to_numpy(const Mat3& m) { return to_numpy(std::vector<Vec3>{m.row0, m.row1, m.row2}); }

std::vector<Placed> to_bodies(nb::args shapes) {
  std::vector<Placed> bodies;
  for (size_t i = 0; i < shapes.size(); ++i)
    bodies.push_back(to_placed(shapes[i], "shapes[" + std::to_string(i) + "]"));
  return bodies;
}

Overlap make_overlap(std::vector<Placed> bodies, double tolerance, Method method) {
  const nb::gil_scoped_release release;
  return Overlap(std::move(bodies), tolerance, method);
}

/// Computes what the properties are about to read while other Python threads run.
const Overlap& measured(const Overlap& o) {
  if (solid(o)) {
    const nb::gil_scoped_release release;
    o.quantities();
  }
  return o;
}

IndexMatrix triangles(const Surface& surface) {
  std::vector<int> indices;
  for (size_t f = 0; f + 1 < surface.ring_start.size(); ++f) {
    const auto ring = surface.facet(static_cast<int>(f));
    for (size_t i = 1; i + 1 < ring.size(); ++i) indices.insert(indices.end(), {ring[0], ring[i], ring[i + 1]});
  }
  const size_t rows = indices.size() / 3;
  return to_numpy<IndexMatrix>(std::move(indices), {rows, 3});
}

/// A property that is None for three or more bodies, or when `given` says so.
template <class Getter, class Given>
void contact_property(nb::class_<Overlap>& cls, const char* name, Given given, Getter getter, const nb::sig& sig,
                      const char* doc) {
  cls.def_prop_ro(
      name,
      [given, getter](const Overlap& o) -> nb::object {
        if (!o.pair() || !given(o)) return nb::none();
        return nb::cast(getter(o.contact()), nb::rv_policy::move);
      },
      sig, doc);
}

std::string repr(const Overlap& o) {
  std::string text = "Overlap(" + std::string(status_name(o.status()));
  if (solid(o))
    text += ", volume=" + number(o.quantities().volume) + " ± " + number(o.quantities().volume_error) + " m³";
  if (o.pair() && solid(o)) text += ", depth=" + number(o.contact().depth) + " m";
  if (o.pair() && o.status() == Status::kSeparated) text += ", distance=" + number(o.contact().distance) + " m";
  return text + ", " + std::to_string(o.bodies().size()) + " bodies)";
}

void define_contact(nb::class_<Overlap>& cls) {
  const auto always = [](const Overlap&) { return true; };
  const auto apart = [](const Overlap& o) { return !solid(o); };
  using Contact = Overlap::Contact;
  const nb::sig vector_or_none_normal("def normal(self) -> numpy.typing.NDArray[numpy.float64] | None");
  contact_property(
      cls, "normal", always, [](const Contact& c) { return to_numpy(c.normal); }, vector_or_none_normal,
      "(3,) unit, from b to a as pybullet's contactNormalOnB: moving a by depth * normal separates an overlapping\n"
      "pair. Also given for pairs that touch or are apart. None for three or more bodies.");
  contact_property(
      cls, "depth", always, [](const Contact& c) { return c.depth; }, nb::sig("def depth(self) -> float | None"),
      "m, the least translation that separates the pair; 0 unless overlapping. None for three or more bodies.");
  contact_property(
      cls, "distance", always, [](const Contact& c) { return c.distance; },
      nb::sig("def distance(self) -> float | None"),
      "m between the nearest points; 0 unless separated. None for three or more bodies.");
  contact_property(
      cls, "witness_a", apart, [](const Contact& c) { return to_numpy(c.witness_a); },
      nb::sig("def witness_a(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(3,) the point of a nearest to b, with witness_a - witness_b = distance * normal. None if overlapping.");
  contact_property(
      cls, "witness_b", apart, [](const Contact& c) { return to_numpy(c.witness_b); },
      nb::sig("def witness_b(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(3,) the point of b nearest to a. None if overlapping.");
  contact_property(
      cls, "separating_plane", apart,
      [](const Contact& c) {
        const Vec3 n = c.separating.normal;
        return to_numpy<Vector>(std::vector<double>{n.x, n.y, n.z, -c.separating.offset}, {4});
      },
      nb::sig("def separating_plane(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(4,) [n, b] with n · x + b >= 0 on a and <= 0 on b, n the unit normal. None if overlapping.");
}

void define_measures(nb::class_<Overlap>& cls) {
  cls.def_prop_ro(
      "volume", [](const Overlap& o) { return solid(o) ? measured(o).quantities().volume : 0.0; },
      "m³, the best estimate; 0 unless overlapping.");
  cls.def_prop_ro(
      "volume_error",
      [](const Overlap& o) { return solid(o) ? measured(o).quantities().volume_error : o.touching_volume(); },
      "m³, certified: the true volume is within volume ± volume_error. For polyhedra it bounds the rounding: every "
      "plane\n"
      "moved by 16 half-ulps of the coordinates' magnitude, times the area. For smooth shapes it is half the distance "
      "of an\n"
      "outer and an inner polytope, plus that. A pair that touches may hide a volume of rounding size. 0 if "
      "separated.");
  cls.def_prop_ro(
      "area", [](const Overlap& o) { return solid(o) ? measured(o).quantities().area : 0.0; },
      "m², of the surface of the common polytope; 0 unless overlapping.");
  cls.def_prop_ro(
      "centroid",
      [](const Overlap& o) -> nb::object {
        return solid(o) ? nb::cast(to_numpy(measured(o).quantities().centroid), nb::rv_policy::move) : nb::none();
      },
      nb::sig("def centroid(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(3,) centre of the common volume, m; None unless overlapping.");
  array_property(
      cls, "inertia",
      [](const Overlap& o) {
        return solid(o) ? to_numpy(measured(o).quantities().inertia) : to_numpy(Mat3{{}, {}, {}});
      },
      "(3, 3) inertia tensor about the centroid at unit density, world axes, m⁵ (trimesh's moment_inertia); zeros "
      "unless overlapping.");
  array_property(
      cls, "gradient",
      [](const Overlap& o) {
        std::vector<double> values;
        for (const auto& row : o.gradient()) values.insert(values.end(), row.begin(), row.end());
        return to_numpy<Matrix>(std::move(values), {o.bodies().size(), 6});
      },
      "(m, 6) d volume / d (translation, rotation vector about the body's own position) of each body, world axes: the "
      "area vector\n"
      "of the facets that the body owns, and its moment. m² and m³; zeros unless overlapping.");
}

void define_surface(nb::class_<Overlap>& cls) {
  array_property(
      cls, "vertices", [](const Overlap& o) { return solid(o) ? to_numpy(o.surface().vertices) : empty_rows(3); },
      "(n, 3) corners of the common polytope, m; empty unless overlapping.");
  array_property(
      cls, "faces",
      [](const Overlap& o) {
        return solid(o) ? triangles(o.surface()) : to_numpy<IndexMatrix>(std::vector<int>{}, {0, 3});
      },
      "(k, 3) the facets as triangles, counter-clockwise from outside: indices into vertices.");
  cls.def_prop_ro(
      "facets",
      [](const Overlap& o) { return solid(o) ? polygons(o.surface().ring, o.surface().ring_start) : nb::list(); },
      nb::sig("def facets(self) -> list[numpy.typing.NDArray[numpy.int32]]"),
      "Indices of the vertices around each facet, counter-clockwise from outside.");
  array_property(
      cls, "halfspaces", [](const Overlap& o) { return solid(o) ? halfspace_rows(o.surface().planes) : empty_rows(4); },
      "(f, 4) rows [n, b], one per facet: n · x + b <= 0 inside, n unit (scipy's form).");
  array_property(
      cls, "owner",
      [](const Overlap& o) {
        return to_numpy(std::span<const int>(solid(o) ? o.surface().owner : std::vector<int>{}));
      },
      "(f,) which of the shapes each facet belongs to.");
  cls.def_prop_ro(
      "patch",
      [](const Overlap& o) {
        nb::list list;
        if (solid(o))
          for (const auto& polygon : o.surface().patch) list.append(nb::cast(to_numpy(polygon), nb::rv_policy::move));
        return list;
      },
      nb::sig("def patch(self) -> list[numpy.typing.NDArray[numpy.float64]]"),
      "Closed polygons (k, 3) along the ridges where the owner changes, the first point not repeated. For a pair they "
      "go\n"
      "counter-clockwise around a's part of the surface; for more bodies, around the part of each.");
  cls.def_prop_ro(
      "bounds",
      [](const Overlap& o) -> nb::object {
        if (!solid(o)) return nb::none();
        const auto& vertices = o.surface().vertices;
        Bounds box{vertices[0], vertices[0]};
        for (Vec3 v : vertices) box = {min(box.lower, v), max(box.upper, v)};
        return nb::cast(to_numpy(box), nb::rv_policy::move);
      },
      nb::sig("def bounds(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(2, 3) lower and upper corner of the box around the common polytope; None unless overlapping.");
}

void define_overlap(nb::module_& m) {
  nb::class_<Overlap> cls(
      m, "Overlap",
      "What two or more convex shapes share. True only if they overlap.\n\n"
      "Immutable; each quantity is computed when first asked for. SI units, world coordinates. For smooth shapes the\n"
      "polytope contains the common set and could shrink into it by the fraction `tolerance`.");
  cls.def_prop_ro(
      "status", [](const Overlap& o) { return status_name(o.status()); },
      nb::sig("def status(self) -> typing.Literal['separated', 'touching', 'overlapping']"),
      "'touching' if rounding cannot tell whether the common set has an inside.");
  cls.def("__bool__", [](const Overlap& o) { return solid(o); });
  cls.def_prop_ro(
      "shapes",
      [](const Overlap& o) {
        nb::list list;
        for (const Placed& p : o.bodies()) list.append(nb::cast(p));
        return nb::tuple(list);
      },
      nb::sig("def shapes(self) -> tuple[Placed, ...]"), "The bodies in the order given.");
  cls.def_prop_ro("tolerance", &Overlap::tolerance);
  cls.def_prop_ro(
      "method", [](const Overlap& o) { return o.method() == Method::kAuto ? "auto" : "paper"; },
      nb::sig("def method(self) -> typing.Literal['auto', 'paper']"));
  cls.def_prop_ro(
      "facets_touched", [](const Overlap& o) { return solid(o) ? o.region().facets_touched : 0; },
      "How many planes of the shapes took part in building the polytope.");
  define_measures(cls);
  define_surface(cls);
  define_contact(cls);
  cls.def("__repr__", [](const Overlap& o) { return repr(o); });
  cls.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  cls.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
  cls.def(
      "__reduce__",
      [](nb::handle self) {
        const nb::object again =
            nb::module_::import_("functools")
                .attr("partial")(nb::module_::import_("overlapper._core").attr("overlap"),
                                 "tolerance"_a = self.attr("tolerance"), "method"_a = self.attr("method"));
        return nb::make_tuple(again, self.attr("shapes"));
      },
      nb::sig("def __reduce__(self) -> tuple[object, tuple[Placed, ...]]"));
}

std::pair<Placed, Placed> relative_pair(nb::handle a, nb::handle b) {
  const Placed placed_a = to_placed(a, "a"), placed_b = to_placed(b, "b");
  const Vec3 reference = placed_a.pose.translation;
  return {placed_a.seen_from(reference), placed_b.seen_from(reference)};
}

double union_ratio(nb::handle a, nb::handle b, double tolerance) {
  const Overlap common = make_overlap({to_placed(a, "a"), to_placed(b, "b")}, tolerance, Method::kAuto);
  if (!solid(common)) return 0;
  const double shared = measured(common).quantities().volume;
  const double both = volume(common.bodies()[0].shape) + volume(common.bodies()[1].shape) - shared;
  return std::min(1.0, shared / both);
}

void define_functions(nb::module_& m) {
  m.def(
      "overlap",
      [](nb::args shapes, double tolerance, const std::string& method) {
        return make_overlap(to_bodies(shapes), tolerance, to_method(method));
      },
      "shapes"_a, "tolerance"_a = 1e-3, "method"_a = "auto",
      nb::sig("def overlap(*shapes: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | "
              "numpy.typing.ArrayLike, "
              "tolerance: float = 0.001, method: typing.Literal['auto', 'paper'] = 'auto') -> Overlap"),
      "The common set of two or more convex shapes.\n\n"
      "Each is a Placed, a bare shape, or an (n, 3) array of points, which stands for their hull. `tolerance`, between "
      "0 and 1,\n"
      "is the fraction by which the polytope may have to shrink to fit inside smooth shapes; polyhedra are exact "
      "whatever it is.\n"
      "No overlap is an answer, not an error. Raises ValueError if the common set is unbounded.\n\n"
      "method 'auto' grows the hull of the dual points about a point well inside, in a frame in which the common set "
      "is round.\n"
      "method 'paper' is that of Tereshchenko, Chevokin and Fisunenko, 'Algorithm for finding the domain intersection "
      "of a set of\n"
      "polytopes' (ICCS 2013), step for step and with what it loses: GJK with witness points gives a common point; on "
      "a boundary\n"
      "it is shifted by a minimal step (2^-26 of the smaller polytope) along one of 26 directions; the hull of the "
      "dual points of\n"
      "all face planes, the dual of that hull's faces, and their hull follow; more than two bodies pairwise by divide "
      "and conquer.\n"
      "It departs from the text in tessellating smooth shapes from inside, in replacing half-spaces by large boxes, "
      "and in\n"
      "deciding by exact signs inside its hulls. Where no shift lands inside, it says 'touching'.");
  m.def(
      "distance",
      [](nb::handle a, nb::handle b) {
        const auto [p, q] = relative_pair(a, b);
        return std::max(0.0, distance(p, q).distance);
      },
      "a"_a, "b"_a,
      nb::sig("def distance(a: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | numpy.typing.ArrayLike, "
              "b: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | numpy.typing.ArrayLike) -> float"),
      "Distance (m) of the nearest points of two shapes; 0 if they touch or overlap.");
  m.def(
      "penetration_depth",
      [](nb::handle a, nb::handle b) {
        const auto [p, q] = relative_pair(a, b);
        return std::max(0.0, penetration(p, q).depth);
      },
      "a"_a, "b"_a,
      nb::sig("def penetration_depth(a: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | "
              "numpy.typing.ArrayLike, "
              "b: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | numpy.typing.ArrayLike) -> float"),
      "Length (m) of the least translation that separates two shapes; 0 if they do not overlap. Positive where "
      "pybullet's contact\n"
      "distance is negative. Raises ValueError for two half-spaces.");
  m.def(
      "iou", [](nb::handle a, nb::handle b, double tolerance) { return union_ratio(a, b, tolerance); }, "a"_a, "b"_a,
      "tolerance"_a = 1e-3,
      nb::sig("def iou(a: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | numpy.typing.ArrayLike, "
              "b: Box | Sphere | Capsule | Cylinder | Hull | HalfSpace | Placed | numpy.typing.ArrayLike, tolerance: "
              "float = 0.001) -> float"),
      "Intersection over union of two shapes: common volume over the volume of their union, from 0 to 1.");
}

// ---------------------------------------------------------------------------------------------------- one crossing a step

std::vector<Placed> place_all(nb::list shapes, nb::handle positions, nb::handle orientations) {
  const Doubles p = to_doubles(positions, "positions", "an array of shape (k, 3)");
  const Doubles q = to_doubles(orientations, "orientations", "an array of shape (k, 4)");
  const size_t k = shapes.size();
  if (p.ndim() != 2 || p.shape(0) != k || p.shape(1) != 3)
    fail("positions", "must have the shape (k, 3), one row per shape");
  if (q.ndim() != 2 || q.shape(0) != k || q.shape(1) != 4)
    fail("orientations", "must have the shape (k, 4), one row per shape");
  std::vector<Placed> placed;
  placed.reserve(k);
  for (size_t i = 0; i < k; ++i) {
    const double *x = p.data() + 3 * i, *r = q.data() + 4 * i;
    placed.push_back(make_placed(to_shape(shapes[i], "shapes[" + std::to_string(i) + "]"), {x[0], x[1], x[2]},
                                 {r[0], r[1], r[2], r[3]}));
  }
  return placed;
}

bool meet(const Bounds& a, const Bounds& b) {
  for (int i = 0; i < 3; ++i)
    if (a.lower[i] > b.upper[i] || b.lower[i] > a.upper[i]) return false;
  return true;
}

/// A half-space meets a box where the box's lowest corner is in it; its own box says nothing.
bool meet(const Placed& half_space, const Bounds& box) {
  const Plane plane = half_space.pose * std::get<HalfSpace>(half_space.shape).plane;
  const Vec3 n = plane.normal;
  const Vec3 lowest{n.x > 0 ? box.lower.x : box.upper.x, n.y > 0 ? box.lower.y : box.upper.y,
                    n.z > 0 ? box.lower.z : box.upper.z};
  return signed_distance(plane, lowest) <= 0;
}

/// Sweep along x: boxes sorted by their lower side, each tested against those that begin before it ends.
std::vector<int> meeting_pairs(const std::vector<Placed>& placed) {
  std::vector<Bounds> box;
  for (const Placed& p : placed) box.push_back(bounds(p));
  std::vector<int> order, open;
  for (int i = 0; i < static_cast<int>(placed.size()); ++i) (bounded(placed[i].shape) ? order : open).push_back(i);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return box[a].lower.x < box[b].lower.x; });
  std::vector<std::array<int, 2>> pairs;
  for (size_t i = 0; i < order.size(); ++i)
    for (size_t j = i + 1; j < order.size() && box[order[j]].lower.x <= box[order[i]].upper.x; ++j)
      if (meet(box[order[i]], box[order[j]]))
        pairs.push_back({std::min(order[i], order[j]), std::max(order[i], order[j])});
  for (int h : open)
    for (int i : order)
      if (meet(placed[h], box[i])) pairs.push_back({std::min(h, i), std::max(h, i)});
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> flat;
  for (const auto& pair : pairs) flat.insert(flat.end(), pair.begin(), pair.end());
  return flat;
}

nb::list overlap_pairs(nb::list shapes, nb::handle positions, nb::handle orientations, nb::handle pairs,
                       double tolerance, const std::string& method_name) {
  const std::vector<Placed> placed = place_all(shapes, positions, orientations);
  const Method method = to_method(method_name);
  const auto index = nb::cast<nb::ndarray<const int, nb::c_contig, nb::device::cpu>>(
      nb::module_::import_("numpy").attr("ascontiguousarray")(pairs, "dtype"_a = "int32"));
  if (index.ndim() != 2 || index.shape(1) != 2) fail("pairs", "must have the shape (p, 2)");
  std::vector<Overlap> overlaps;
  overlaps.reserve(index.shape(0));
  for (size_t i = 0; i < 2 * index.shape(0); ++i)
    if (index.data()[i] < 0 || index.data()[i] >= static_cast<int>(placed.size()))
      fail("pairs", "must index the shapes");
  {
    const nb::gil_scoped_release release;
    for (size_t i = 0; i < index.shape(0); ++i)
      overlaps.emplace_back(std::vector<Placed>{placed[index.data()[2 * i]], placed[index.data()[2 * i + 1]]},
                            tolerance, method);
  }
  nb::list list;
  for (Overlap& o : overlaps) list.append(nb::cast(std::move(o)));
  return list;
}

void define_batch(nb::module_& m) {
  m.def(
      "candidate_pairs",
      [](nb::list shapes, nb::handle positions, nb::handle orientations) {
        std::vector<int> flat = meeting_pairs(place_all(shapes, positions, orientations));
        const size_t rows = flat.size() / 2;
        return to_numpy<IndexMatrix>(std::move(flat), {rows, 2});
      },
      nb::rv_policy::move, "shapes"_a, "positions"_a, "orientations"_a,
      nb::sig("def candidate_pairs(shapes: list[Box | Sphere | Capsule | Cylinder | Hull | HalfSpace], positions: "
              "numpy.typing.ArrayLike, "
              "orientations: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.int32]"),
      "(p, 2) indices i < j, sorted, of the shapes whose boxes in the world meet. A half-space meets a box that "
      "reaches into it;\n"
      "two half-spaces are no pair.");
  m.def("overlap_pairs", &overlap_pairs, "shapes"_a, "positions"_a, "orientations"_a, "pairs"_a, "tolerance"_a = 1e-3,
        "method"_a = "auto",
        nb::sig("def overlap_pairs(shapes: list[Box | Sphere | Capsule | Cylinder | Hull | HalfSpace], positions: "
                "numpy.typing.ArrayLike, "
                "orientations: numpy.typing.ArrayLike, pairs: numpy.typing.ArrayLike, tolerance: float = 0.001, "
                "method: typing.Literal['auto', 'paper'] = 'auto') -> list[Overlap]"),
        "overlap() of each pair (p, 2) of the shapes at positions (k, 3) and orientations (k, 4), in one call.");
}

}  // namespace

NB_MODULE(_core, m) {
  // A test runner that keeps tracebacks alive at exit is not a leak of ours.
  nb::set_leak_warnings(false);
  m.doc() = "Convex shapes and the polytopes they share.";
  define_shapes(m);
  define_placed(m);
  define_overlap(m);
  define_functions(m);
  define_batch(m);
}
