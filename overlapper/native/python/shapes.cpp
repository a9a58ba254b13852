#include <cfloat>
#include <limits>
#include <sstream>

#include "geometry/polytope.h"
#include "python/arrays.h"

namespace overlapper::python {
namespace {

template <class T>
nb::object wrap(const T& value) {
  return nb::cast(value);
}

template <class... Types>
bool try_shapes(nb::handle value, Shape& shape, std::variant<Types...>*) {
  return ((nb::isinstance<Types>(value) && (shape = nb::cast<Types>(value), true)) || ...);
}

bool is_shape(nb::handle value, Shape& shape) { return try_shapes(value, shape, static_cast<Shape*>(nullptr)); }

}  // namespace

nb::object to_python(const Shape& shape) {
  return std::visit([](const auto& s) { return wrap(s); }, shape);
}

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
  const std::vector<Vec3> points = to_rows(value, name);
  return unlocked([&] { return make_hull(points); });
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

namespace {

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
std::string repr(const RoundedHull& h) {
  return "RoundedHull(" + std::to_string(h.core.data->vertices.size()) + " vertices, " +
         std::to_string(h.core.data->planes.size()) + " facets, radius=" + number(h.radius) + ")";
}
std::string repr(const Ellipsoid& e) { return "Ellipsoid(half_axes=" + text(e.half_axes) + ")"; }
std::string repr(const Shape& shape) {
  return std::visit([](const auto& s) { return repr(s); }, shape);
}

/// Divided by its length; as given if that is 1 but for a rounding, so that what is read back is the same body.
Quaternion unit(Quaternion given) {
  const auto length = [](Quaternion q) { return std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w); };
  if (std::abs(length(given) - 1) <= 2 * DBL_EPSILON) return given;
  const Quaternion q = in_range(given);
  const double l = length(q);
  return {q.x / l, q.y / l, q.z / l, q.w / l};
}

std::string repr(const Placed& p) {
  const Quaternion q = unit(p.orientation);
  return "Placed(" + repr(p.shape) + ", position=" + text(p.position) +
         ", orientation=" + tuple_text({q.x, q.y, q.z, q.w}) + ")";
}

template <class T>
Vec3 world_origin(const T& shape) {
  const HullData* hull = polytope_of(Shape(shape));
  return hull ? hull->origin : Vec3{};
}

/// What all shapes share: measures, printing, copies that are the same object.
template <class T>
void define_common(nb::class_<T>& cls) {
  cls.def_prop_ro("volume", [](const T& s) { return volume(Shape(s)); }, "Volume in m³; infinite for a half-space.");
  array_property(
      cls, "centroid", [](const T& s) { return to_numpy(centroid(Shape(s)) + world_origin(s)); },
      "(3,) centre of volume in the shape's frame; the nearest boundary point to the origin for a half-space.");
  array_property(
      cls, "bounds", [](const T& s) { return to_numpy(bounds(make_placed(s, {}, {}))); },
      "(2, 3) lower and upper corner of the box around the bare shape; infinite where a half-space is.");
  cls.def("__repr__", [](const T& s) { return repr(s); });
  cls.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  cls.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
}

/// Pickles a shape as the arguments of its constructor.
template <class T, class Arguments>
void define_pickle(nb::class_<T>& cls, Arguments arguments) {
  cls.def(
      "__reduce__",
      [arguments](nb::handle self) { return nb::make_tuple(self.type(), arguments(nb::cast<const T&>(self))); },
      nb::sig("def __reduce__(self) -> tuple[type, tuple[object, ...]]"));
}

nb::object triples(const std::vector<std::array<int, 3>>& rows) {
  return nb::cast(to_numpy(std::span<const int>(rows.data()->data(), 3 * rows.size())), nb::rv_policy::move);
}

/// A hull travels as it was built, so that indices into its facets mean the same in another process.
nb::tuple hull_state(const Hull& hull) {
  const HullData& d = *hull.data;
  return nb::make_tuple(
      nb::cast(to_numpy(d.origin), nb::rv_policy::move), nb::cast(to_numpy(d.vertices), nb::rv_policy::move),
      nb::cast(halfspace_rows(d.planes), nb::rv_policy::move),
      nb::cast(to_numpy(std::span<const int>(d.ring)), nb::rv_policy::move),
      nb::cast(to_numpy(std::span<const int>(d.ring_start)), nb::rv_policy::move),
      nb::cast(to_numpy(d.corners), nb::rv_policy::move), triples(d.triangles), triples(d.facet_corners));
}

bool equal(nb::handle a, nb::handle b) {
  return nb::cast<bool>(nb::module_::import_("numpy").attr("array_equal")(a, b));
}

/// Only the surface is taken from a state: all else is made anew, and must be what is there.
Hull hull_from_state(nb::handle given) {
  constexpr const char* kNoHull = "state must be that of a hull";
  if (!nb::isinstance<nb::tuple>(given) || nb::len(given) != 8) throw nb::value_error(kNoHull);
  const nb::tuple state = nb::borrow<nb::tuple>(given);
  const std::vector<std::int64_t> flat = to_indices(state[6], "triangles");
  if (flat.size() % 3 != 0) throw nb::value_error(kNoHull);
  std::vector<std::array<int, 3>> triangles;
  constexpr std::int64_t kMost = std::numeric_limits<int>::max();
  const auto index = [&](std::int64_t i) { return i >= 0 && i <= kMost ? static_cast<int>(i) : -1; };
  for (size_t i = 0; i < flat.size(); i += 3)
    triangles.push_back({index(flat[i]), index(flat[i + 1]), index(flat[i + 2])});
  const Vec3 origin = to_vec3(state[0], "origin");
  const std::vector<Vec3> corners = to_rows(state[5], "corners");
  const Hull hull = unlocked([&] { return hull_of_surface(origin, corners, triangles); });
  const nb::tuple anew = hull_state(hull);
  for (size_t i = 0; i < 8; ++i)
    if (!equal(state[i], anew[i])) throw nb::value_error(kNoHull);
  return hull;
}

void define_shape_types(nb::module_& m) {
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

  nb::class_<Ellipsoid> ellipsoid(m, "Ellipsoid", R"(An ellipsoid about the origin with half axes (m) along x, y, z.

All points with (x / a)² + (y / b)² + (z / c)² <= 1. With equal half axes it answers as the sphere does. With a box, a
hull or a half-space, it is measured as a ball is, of which it is the image; with other round bodies, between polytopes,
as closely as `tolerance` asks.)");
  ellipsoid.def(
      "__init__",
      [](Ellipsoid* self, nb::handle half_axes) {
        new (self) Ellipsoid(make_ellipsoid(to_vec3(half_axes, "half_axes")));
      },
      "half_axes"_a.none(), nb::sig("def __init__(self, half_axes: numpy.typing.ArrayLike) -> None"));
  array_property(ellipsoid, "half_axes", [](const Ellipsoid& e) { return to_numpy(e.half_axes); }, "(3,) m");
  define_common(ellipsoid);
  define_pickle(ellipsoid, [](const Ellipsoid& e) {
    return nb::make_tuple(nb::make_tuple(e.half_axes.x, e.half_axes.y, e.half_axes.z));
  });

  nb::class_<Capsule> capsule(
      m, "Capsule",
      R"(All points within `radius` (m) of a segment of `length` (m) along local z, about the origin.

As in pybullet, `length` lies between the centres of the caps; it may be 0.)");
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
                             R"(The closed half-space { x : normal · x <= offset }.

`normal` may have any length but 0. The half-space is what the two say as given, without rounding; the attributes
`normal` and `offset` are both divided by the length, which rounds.)");
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
  array_property(
      half, "given_normal", [](const HalfSpace& h) { return to_numpy(h.given_normal); },
      "(3,) as given, of any length");
  half.def_prop_ro(
      "given_offset", [](const HalfSpace& h) { return h.given_offset; }, "As given, along the normal as given.");
  define_common(half);
  define_pickle(half, [](const HalfSpace& h) {
    const Vec3 n = h.given_normal;
    return nb::make_tuple(nb::make_tuple(n.x, n.y, n.z), h.given_offset);
  });

  nb::class_<Hull> hull(m, "Hull",
                        R"(The convex hull of (n, 3) points (m).

Interior, duplicate and coplanar points are welcome; coplanar triangles become one facet. Raises
ValueError for fewer than four points, for points that are not finite and for points in one plane.)");
  hull.def(
      "__init__",
      [](Hull* self, nb::handle vertices) {
        const std::vector<Vec3> points = to_rows(vertices, "vertices");
        new (self) Hull(unlocked([&] { return make_hull(points); }));
      },
      "vertices"_a.none(), nb::sig("def __init__(self, vertices: numpy.typing.ArrayLike) -> None"));
  array_property(
      hull, "vertices", [](const Hull& h) { return to_numpy(h.data->vertices, h.data->origin); },
      "(n, 3) the corners only, m; without those that mere rounding lifts off a facet");
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
  array_property(
      hull, "corners", [](const Hull& h) { return to_numpy(h.data->corners, h.data->origin); },
      "(n, 3) all corners of the hull of the points as given, without rounding, m");
  array_property(
      hull, "triangles", [](const Hull& h) { return to_numpy(h.data->triangles); },
      "(k, 3) indices of the corners of its surface before coplanar triangles are merged, counter-clockwise from "
      "outside.");
  define_common(hull);
  hull.def("__getstate__", &hull_state, nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  hull.def(
      "__setstate__", [](Hull& self, nb::handle state) { new (&self) Hull(hull_from_state(state)); },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

void define_rounded_hull(nb::module_& m) {
  nb::class_<RoundedHull> rounded(m, "RoundedHull",
                                  R"(All points within `radius` (m) of the convex hull of (n, 3) points (m).

The Minkowski sum of the hull and a ball: what Bullet collides with where a convex mesh has a margin. ValueError as
for Hull and Sphere. Method "paper" does not take it; more than two bodies that overlap, it among them, have
no certificate, and neither does it with an ellipsoid that it overlaps.)");
  rounded.def(
      "__init__",
      [](RoundedHull* self, nb::handle vertices, nb::handle radius) {
        const std::vector<Vec3> points = to_rows(vertices, "vertices");
        const double of_ball = to_double(radius, "radius");
        new (self) RoundedHull(unlocked([&] { return make_rounded_hull(points, of_ball); }));
      },
      "vertices"_a.none(), "radius"_a.none(),
      nb::sig("def __init__(self, vertices: numpy.typing.ArrayLike, radius: float) -> None"));
  rounded.def_prop_ro("core", [](const RoundedHull& h) { return h.core; }, "The hull that is rounded.");
  rounded.def_ro("radius", &RoundedHull::radius, "m");
  define_common(rounded);
  rounded.def(
      "__getstate__", [](const RoundedHull& h) { return nb::make_tuple(hull_state(h.core), h.radius); },
      nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  rounded.def(
      "__setstate__",
      [](RoundedHull& self, nb::handle state) {
        if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 2)
          throw nb::value_error("state must be that of a rounded hull");
        const double radius = make_sphere(to_double(state[1], "radius")).radius;
        new (&self) RoundedHull{hull_from_state(state[0]), radius};
      },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

void define_placed(nb::module_& m) {
  nb::class_<Placed> placed(m, "Placed",
                            R"(A shape and where it is in the world.

position is (3,) in m; orientation is a quaternion (x, y, z, w) as in pybullet, of any length but 0. The body is turned
by what the numbers say as given, M(q) / |q|² without rounding; the attribute `orientation` is divided by the length,
which rounds.)");
  placed.def(
      "__init__",
      [](Placed* self, nb::handle shape, nb::handle position, nb::handle orientation) {
        new (self)
            Placed(make_placed(to_shape(shape, "shape"), to_vec3(position, "position"), to_quaternion(orientation)));
      },
      "shape"_a.none(), "position"_a.none() = nb::make_tuple(0.0, 0.0, 0.0),
      "orientation"_a.none() = nb::make_tuple(0.0, 0.0, 0.0, 1.0),
      nb::sig(
          "def __init__(self, shape: Box | Sphere | Capsule | Cylinder | Ellipsoid | Hull | RoundedHull | HalfSpace | "
          "numpy.typing.ArrayLike, position: "
          "numpy.typing.ArrayLike = (0, 0, 0), orientation: numpy.typing.ArrayLike = (0, 0, 0, 1)) -> None"));
  placed.def_prop_ro(
      "shape", [](const Placed& p) { return to_python(p.shape); },
      nb::sig("def shape(self) -> Box | Sphere | Capsule | Cylinder | Ellipsoid | Hull | RoundedHull | HalfSpace"));
  array_property(placed, "position", [](const Placed& p) { return to_numpy(p.position); }, "(3,) m");
  array_property(
      placed, "orientation", [](const Placed& p) { return to_numpy(unit(p.orientation)); },
      "(4,) unit quaternion x, y, z, w");
  array_property(
      placed, "given_orientation", [](const Placed& p) { return to_numpy(p.orientation); },
      "(4,) x, y, z, w as given, of any length");
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
        return nb::make_tuple(
            self.type(), nb::make_tuple(self.attr("shape"), self.attr("position"), self.attr("given_orientation")));
      },
      nb::sig("def __reduce__(self) -> tuple[type, tuple[object, ...]]"));
  placed.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  placed.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
}

}  // namespace

void define_shapes(nb::module_& m) {
  define_shape_types(m);
  define_rounded_hull(m);
  define_placed(m);
}

}  // namespace overlapper::python
