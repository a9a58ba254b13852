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

/// Whether it is a mesh of trimesh, which is not imported: without it there is no such mesh.
bool is_mesh(nb::handle value) {
  const nb::object trimesh = nb::module_::import_("sys").attr("modules").attr("get")("trimesh");
  return nb::isinstance(value, nb::getattr(trimesh, "Trimesh", nb::tuple()));
}

bool is_body(nb::handle value) {
  Shape shape;
  return nb::isinstance<Placed>(value) || is_shape(value, shape);
}

}  // namespace

nb::object to_python(const Shape& shape) {
  return ask(shape, [](const auto& s) { return wrap(s); });
}

Shape to_shape(nb::handle value, const std::string& name) {
  Shape shape;
  if (is_shape(value, shape)) return shape;
  if (nb::isinstance<Placed>(value))
    throw nb::type_error((name + " must be a bare shape, it is already placed").c_str());
  const bool is_sequence =
      PySequence_Check(value.ptr()) && nb::hasattr(value, "__len__");  // a PointCloud has no length
  const bool array_like = is_sequence || nb::hasattr(value, "__array__");
  if (!array_like || nb::isinstance<nb::str>(value) || nb::isinstance<nb::bytes>(value)) {
    if (is_mesh(value))
      return nb::cast<Hull>(
          nb::module_::import_("overlapper.polytopes.decomposition").attr("hull_of_mesh")(value, name));
    const std::string type = nb::cast<std::string>(value.type().attr("__name__"));
    const std::string hint = nb::hasattr(value, "vertices") ? ": Hull(mesh.vertices) makes a shape of a mesh" : "";
    throw nb::type_error(
        (name + " must be a shape, an (n, 3) array of points or a trimesh.Trimesh, not " + type + hint).c_str());
  }
  if (nb::isinstance<nb::sequence>(value) && nb::len(value) > 0 && is_body(value[0]))
    throw nb::type_error((name + " must be one shape, not a list of shapes: overlap(*shapes) takes a list").c_str());
  const std::vector<Vec3> points = to_rows(value, name);
  return unlocked([&] { return make_hull(points); });
}

Placed to_placed(nb::handle value, const std::string& name) {
  if (nb::isinstance<Placed>(value)) return nb::cast<Placed>(value);
  return make_placed(to_shape(value, name), {}, {});
}

template <class... Kinds>
static std::string names(const std::variant<Kinds...>*) {
  std::string text;
  ((text += (text.empty() ? "" : " | ") + std::string(Kinds::kName)), ...);
  return text;
}

std::string any_shape() { return names(static_cast<const Shape*>(nullptr)); }

std::string any_solid() { return any_shape() + " | numpy.typing.ArrayLike | trimesh.Trimesh"; }

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

std::string text(double value) { return number(value); }

/// Equality by fields.
template <class S>
std::string repr(const S& shape) {
  std::string arguments;
  const auto add = [&](const auto& field) {
    arguments += (arguments.empty() ? "" : ", ") + std::string(field.name) + "=" + text(shape.*field.member);
  };
  std::apply([&](const auto&... field) { (add(field), ...); }, S::fields());
  return std::string(S::kName) + "(" + arguments + ")";
}
std::string counts(const Hull& h) {
  return std::to_string(h.data->vertices.size()) + " vertices, " + std::to_string(h.data->planes.size()) + " facets";
}
std::string repr(const Hull& h) { return "Hull(" + counts(h) + ")"; }
std::string repr(const RoundedHull& h) {
  return "RoundedHull(" + counts(h.core) + ", radius=" + number(h.radius) + ")";
}
std::string repr(const HalfSpace& h) {
  return "HalfSpace(normal=" + text(h.plane.normal) + ", offset=" + number(h.plane.offset) + ")";
}
std::string repr(const Shape& shape) {
  return ask(shape, [](const auto& s) { return repr(s); });
}

/// Divided by its length; as given if the length is 1 to rounding, so that a body read back keeps its bits.
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

/// Members of all shape classes: measures, printing, copies that are the same object.
template <class T>
void define_common(nb::class_<T>& cls) {
  cls.def_prop_ro("volume", [](const T& s) { return s.volume(); }, "Volume in m³; infinite for a half-space.");
  array_property(
      cls, "centroid", [](const T& s) { return to_numpy(s.centroid() + data_origin(s)); },
      "(3,) centre of volume in the shape's frame, m. For a half-space: the boundary point nearest to the origin.");
  array_property(
      cls, "bounds", [](const T& s) { return to_numpy(bounds(make_placed(s, {}, {}))); },
      "(2, 3) lower and upper corner of the bounding box in the shape's frame, m; infinite for a half-space.");
  cls.def("__repr__", [](const T& s) { return repr(s); });
  cls.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  cls.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
}

nb::object to_argument(double value) { return nb::cast(value); }
nb::object to_argument(Vec3 v) { return nb::make_tuple(v.x, v.y, v.z); }
void read(nb::handle given, const char* name, double& value) { value = to_double(given, name); }
void read(nb::handle given, const char* name, Vec3& value) { value = to_vec3(given, name); }
const char* type_of(double) { return "float"; }
const char* type_of(Vec3) { return "numpy.typing.ArrayLike"; }

template <class S>
using Fields = decltype(S::fields());

template <size_t>
using Handle = nb::handle;

/// The class of a kind of shape. Its fields are the arguments of its make() and the state of a pickle.
template <class S, size_t... I>
nb::class_<S> class_of(nb::module_& m, std::index_sequence<I...>) {
  nb::class_<S> cls(m, S::kName, S::kAbout);
  constexpr Fields<S> fields = S::fields();
  std::string signature = "def __init__(self";
  ((signature += std::string(", ") + std::get<I>(fields).name + ": " + type_of(S().*std::get<I>(fields).member)), ...);
  signature += ") -> None";
  cls.def(
      "__init__",
      [](S* self, Handle<I>... given) {
        std::tuple values{S().*std::get<I>(S::fields()).member...};
        (read(given, std::get<I>(S::fields()).name, std::get<I>(values)), ...);
        new (self) S(std::apply(S::make, values));
      },
      nb::arg(std::get<I>(fields).name).none()..., nb::sig(signature.c_str()));
  cls.def(
      "__reduce__",
      [](nb::handle self) {
        const S& shape = nb::cast<const S&>(self);
        return nb::make_tuple(self.type(), nb::make_tuple(to_argument(shape.*std::get<I>(S::fields()).member)...));
      },
      nb::sig("def __reduce__(self) -> tuple[type, tuple[object, ...]]"));
  return cls;
}
template <class S>
nb::class_<S> class_of(nb::module_& m) {
  return class_of<S>(m, std::make_index_sequence<std::tuple_size_v<Fields<S>>>());
}

template <class S>
void define_attribute(nb::class_<S>& cls, const Field<S, double>& field) {
  const auto member = field.member;
  cls.def_prop_ro(field.name, [member](const S& s) { return s.*member; }, field.about);
}
template <class S>
void define_attribute(nb::class_<S>& cls, const Field<S, Vec3>& field) {
  const auto member = field.member;
  array_property(cls, field.name, [member](const S& s) { return to_numpy(s.*member); }, field.about);
}

/// A kind of shape that its fields define completely.
template <class S>
void define(nb::module_& m, const S*) {
  nb::class_<S> cls = class_of<S>(m);
  std::apply([&](const auto&... field) { (define_attribute(cls, field), ...); }, S::fields());
  define_common(cls);
}

nb::object triples(const std::vector<std::array<int, 3>>& rows) {
  return nb::cast(to_numpy(std::span<const int>(rows.data()->data(), 3 * rows.size())), nb::rv_policy::move);
}

/// A pickled hull keeps its facets, so that their indices mean the same in another process.
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

/// Takes only the surface from a state. All else is computed again, and must equal the state.
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
  const Hull hull(unlocked([&] { return hull_of_surface(origin, corners, triangles); }));
  const nb::tuple anew = hull_state(hull);
  for (size_t i = 0; i < 8; ++i)
    if (!equal(state[i], anew[i])) throw nb::value_error(kNoHull);
  return hull;
}

void define(nb::module_& m, const HalfSpace*) {
  nb::class_<HalfSpace> half = class_of<HalfSpace>(m);
  array_property(
      half, "normal", [](const HalfSpace& h) { return to_numpy(h.plane.normal); },
      "(3,) unit vector out of the solid.");
  half.def_prop_ro("offset", [](const HalfSpace& h) { return h.plane.offset; }, "Offset along the unit normal, m.");
  array_property(
      half, "given_normal", [](const HalfSpace& h) { return to_numpy(h.given_normal); },
      "(3,) normal as given, of any length.");
  half.def_prop_ro(
      "given_offset", [](const HalfSpace& h) { return h.given_offset; }, "Offset as given, for the normal as given.");
  define_common(half);
}

void define(nb::module_& m, const Hull*) {
  nb::class_<Hull> hull(m, Hull::kName, Hull::kAbout);
  hull.def(
      "__init__",
      [](Hull* self, nb::handle vertices) {
        const std::vector<Vec3> points = to_rows(vertices, "vertices");
        new (self) Hull(unlocked([&] { return make_hull(points); }));
      },
      "vertices"_a.none(), nb::sig("def __init__(self, vertices: numpy.typing.ArrayLike) -> None"));
  array_property(
      hull, "vertices", [](const Hull& h) { return to_numpy(h.data->vertices, h.data->origin); },
      "(n, 3) vertices of the hull, m, without those that only rounding errors lift off a facet.");
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
      "(n, 3) all vertices of the exact hull of the given points, m.");
  array_property(
      hull, "triangles", [](const Hull& h) { return to_numpy(h.data->triangles); },
      "(k, 3) triangles of the surface before coplanar triangles are merged: indices into corners, counter-clockwise "
      "from outside.");
  define_common(hull);
  hull.def("__getstate__", &hull_state, nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  hull.def(
      "__setstate__", [](Hull& self, nb::handle state) { new (&self) Hull(hull_from_state(state)); },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

void define(nb::module_& m, const RoundedHull*) {
  nb::class_<RoundedHull> rounded(m, RoundedHull::kName, RoundedHull::kAbout);
  rounded.def(
      "__init__",
      [](RoundedHull* self, nb::handle vertices, nb::handle radius) {
        const std::vector<Vec3> points = to_rows(vertices, "vertices");
        const double of_ball = to_double(radius, "radius");
        new (self) RoundedHull(unlocked([&] { return make_rounded_hull(points, of_ball); }));
      },
      "vertices"_a.none(), "radius"_a.none(),
      nb::sig("def __init__(self, vertices: numpy.typing.ArrayLike, radius: float) -> None"));
  rounded.def_prop_ro("core", [](const RoundedHull& h) { return h.core; }, "The hull inside, before rounding.");
  rounded.def_ro("radius", &RoundedHull::radius, "Radius of the rounding, m.");
  define_common(rounded);
  rounded.def(
      "__getstate__", [](const RoundedHull& h) { return nb::make_tuple(hull_state(h.core), h.radius); },
      nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  rounded.def(
      "__setstate__",
      [](RoundedHull& self, nb::handle state) {
        if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 2)
          throw nb::value_error("state must be that of a rounded hull");
        const double radius = Sphere::make(to_double(state[1], "radius")).radius;
        new (&self) RoundedHull{hull_from_state(state[0]), radius};
      },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

/// The pose of a position and an orientation, or of a matrix in the place of the position.
std::pair<Vec3, Quaternion> to_pose(nb::handle position, nb::handle orientation) {
  const Quaternion q = to_quaternion(orientation);
  const Doubles p = to_doubles(position, "position", "three numbers or a matrix of shape (4, 4)");
  if (p.ndim() == 1 && p.shape(0) == 3) return {{p.data()[0], p.data()[1], p.data()[2]}, q};
  if (p.ndim() != 2 || p.shape(0) != 4 || p.shape(1) != 4)
    fail("position", "must be three numbers or a matrix of shape (4, 4), not an array of shape " + shape_text(p));
  if (!unturned(q) || q.w != 1) fail("orientation", "must be left out if the position is a matrix");
  return matrix_pose(std::span<const double, 16>(p.data(), 16), "position");
}

void define_placed(nb::module_& m) {
  nb::class_<Placed> placed(m, "Placed",
                            R"(A shape and where it is in the world.

Parameters
----------
shape : shape, (n, 3) array_like or trimesh.Trimesh
    A shape without a pose, or points in m, which stand for their convex hull. Or a closed convex mesh in m.
position : (3,) or (4, 4) array_like, default (0, 0, 0)
    Position of the shape's origin, m. Or a homogeneous matrix, as in trimesh: a rotation, and a position in m.
orientation : (4,) array_like or scipy.spatial.transform.Rotation, default (0, 0, 0, 1)
    Quaternion x, y, z, w as in pybullet, of any length but 0. The exact rotation is M(q) / |q|² for the quaternion as
    given. The attribute `orientation` is divided by the length, which rounds. A matrix takes no orientation.

Raises
------
ValueError
    If an argument has the wrong shape, a pose is not finite, or a matrix scales, shears or reflects by more than 1e-6.
    If a mesh is not closed or not convex.

Examples
--------
>>> from overlapper import Placed, Sphere
>>> Placed(Sphere(0.5), position=(0, 0, 1)).bounds.tolist()
[[-0.5, -0.5, 0.5], [0.5, 0.5, 1.5]]
>>> Placed(Sphere(0.5), [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]).position.tolist()
[0.0, 0.0, 2.0])");
  placed.def(
      "__init__",
      [](Placed* self, nb::handle shape, nb::handle position, nb::handle orientation) {
        const auto [p, q] = to_pose(position, orientation);
        new (self) Placed(make_placed(to_shape(shape, "shape"), p, q));
      },
      "shape"_a.none(), "position"_a.none() = nb::make_tuple(0.0, 0.0, 0.0),
      "orientation"_a.none() = nb::make_tuple(0.0, 0.0, 0.0, 1.0),
      nb::sig(("def __init__(self, shape: " + any_solid() +
               ", position: numpy.typing.ArrayLike = (0, 0, 0), "
               "orientation: numpy.typing.ArrayLike = (0, 0, 0, 1)) -> None")
                  .c_str()));
  placed.def_prop_ro(
      "shape", [](const Placed& p) { return to_python(p.shape); },
      nb::sig(("def shape(self) -> " + any_shape()).c_str()));
  array_property(
      placed, "position", [](const Placed& p) { return to_numpy(p.position); }, "(3,) position in the world, m.");
  array_property(
      placed, "orientation", [](const Placed& p) { return to_numpy(unit(p.orientation)); },
      "(4,) unit quaternion x, y, z, w.");
  array_property(
      placed, "given_orientation", [](const Placed& p) { return to_numpy(p.orientation); },
      "(4,) quaternion x, y, z, w as given, of any length.");
  placed.def_prop_ro(
      "volume", [](const Placed& p) { return volume(p.shape); }, "Volume in m³; infinite for a half-space.");
  array_property(
      placed, "centroid", [](const Placed& p) { return to_numpy(p.pose * centroid(p.shape)); },
      "(3,) centre of volume in the world, m.");
  array_property(
      placed, "bounds", [](const Placed& p) { return to_numpy(bounds(p)); },
      "(2, 3) lower and upper corner of the bounding box in the world, m.");
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

template <class... Kinds>
void define_each(nb::module_& m, const std::variant<Kinds...>*) {
  (define(m, static_cast<const Kinds*>(nullptr)), ...);
}

}  // namespace

void define_shapes(nb::module_& m) {
  define_each(m, static_cast<const Shape*>(nullptr));
  define_placed(m);
}

}  // namespace overlapper::python
