#include <algorithm>
#include <cmath>

#include "distance/gjk.h"
#include "distance/penetration.h"
#include "methods/half_spaces_alone.h"
#include "overlap/centroid_gradient.h"
#include "overlap/depth_gradient.h"
#include "overlap/overlap.h"
#include "overlap/second_derivatives.h"
#include "overlap/shape_gradient.h"
#include "overlap/vertex_gradient.h"
#include "python/arrays.h"
#include "shapes/canonical_order.h"

namespace overlapper::python {
namespace {

const char* status_name(Status status) {
  return status == Status::kSeparated ? "separated" : status == Status::kTouching ? "touching" : "overlapping";
}

bool solid(const Overlap& o) { return o.status() == Status::kOverlapping; }

Matrix empty_rows(size_t columns) { return to_numpy<Matrix>(std::vector<double>{}, {0, columns}); }

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

/// The type of the argument of to_placed() in signatures.
std::string any_body() { return any_solid() + " | Placed"; }

/// True if the answer takes so few microseconds that releasing the interpreter lock would double them.
bool quick(const Shape& shape) { return !smooth(shape) && facets(shape) <= 64; }

/// Constructs the result in memory of Python.
nb::object overlap_of_pair(nb::handle type, const Placed& a, const Placed& b) {
  nb::object answer = nb::inst_alloc(type);
  const auto build = [&] { new (nb::inst_ptr<Overlap>(answer)) Overlap(a, b, 1e-3, Method::kAuto); };
  if (quick(a.shape) && quick(b.shape)) {
    build();
  } else {
    const nb::gil_scoped_release release;
    build();
  }
  nb::inst_mark_ready(answer);
  return answer;
}

/// The result of `compute` for such bodies; other Python threads run meanwhile unless it is quick.
template <class Compute>
decltype(auto) computed_of(std::span<const Placed> bodies, Compute compute) {
  if (std::ranges::all_of(bodies, [](const Placed& body) { return quick(body.shape); })) return compute();
  return unlocked(compute);
}

/// An answer of an overlap, which may have to be computed first.
template <class Answer>
Answer computed(const Overlap& o, Answer (Overlap::*ask)() const) {
  return computed_of(o.bodies(), [&]() -> Answer { return (o.*ask)(); });
}

/// Computes the values of the properties to be read, while other Python threads run.
const Overlap& measured(const Overlap& o) {
  if (solid(o) && !o.measured_at_once()) {
    const nb::gil_scoped_release release;
    o.volume();
  }
  return o;
}

IndexMatrix triangles(const Boundary& boundary) {
  std::vector<int> indices;
  for (size_t f = 0; f + 1 < boundary.ring_start.size(); ++f) {
    const auto ring = boundary.facet(static_cast<int>(f));
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
        return nb::cast(getter(computed(o, &Overlap::contact)), nb::rv_policy::move);
      },
      sig, doc);
}

/// The same for a property of the patch.
template <class Getter, class Given>
void patch_property(nb::class_<Overlap>& cls, const char* name, Given given, Getter getter, const nb::sig& sig,
                    const char* doc) {
  cls.def_prop_ro(
      name,
      [given, getter](const Overlap& o) -> nb::object {
        if (!o.pair() || !given(o)) return nb::none();
        return nb::cast(getter(computed(o, &Overlap::patch)), nb::rv_policy::move);
      },
      sig, doc);
}

std::string repr(const Overlap& o) {
  std::string text = "Overlap(" + std::string(status_name(o.status()));
  if (solid(o)) text += ", volume=" + number(o.volume()) + " ± " + number(o.volume_error()) + " m³";
  if (o.pair() && solid(o)) text += ", depth=" + number(computed(o, &Overlap::contact).depth) + " m";
  if (o.pair() && o.status() == Status::kSeparated)
    text += ", distance=" + number(computed(o, &Overlap::contact).distance) + " m";
  return text + ", " + std::to_string(o.bodies().size()) + " bodies)";
}

void define_contact(nb::class_<Overlap>& cls) {
  const auto always = [](const Overlap&) { return true; };
  const auto apart = [](const Overlap& o) { return !solid(o); };
  const nb::sig vector_or_none_normal("def normal(self) -> numpy.typing.NDArray[numpy.float64] | None");
  contact_property(
      cls, "normal", always, [](const Contact& c) { return to_numpy(c.normal); }, vector_or_none_normal,
      R"((3,) unit vector from b to a, as pybullet's contactNormalOnB. Moving a by depth * normal separates an overlapping
pair. Pairs that touch or are separated have a normal, too. None for three or more bodies.)");
  contact_property(
      cls, "depth", always, [](const Contact& c) { return c.depth; }, nb::sig("def depth(self) -> float | None"),
      "m, length of the shortest translation that separates the pair; 0 unless overlapping. None for three or more "
      "bodies.");
  const auto of_depth = [&](const char* name, auto part, const nb::sig& sig, const char* doc) {
    cls.def_prop_ro(
        name,
        [part](const Overlap& o) -> nb::object {
          if (!o.pair()) return nb::none();
          const DepthGradient found = computed_of(o.bodies(), [&] { return depth_gradient(o); });
          const auto& rows = found.*part;
          const size_t width = sizeof rows[0] / sizeof(double);
          const auto* first = reinterpret_cast<const double*>(rows.data());
          return nb::cast(to_numpy<Matrix>(std::vector<double>(first, first + 2 * width), {2, width}),
                          nb::rv_policy::move);
        },
        sig, doc);
  };
  of_depth(
      "depth_gradient", &DepthGradient::pose,
      nb::sig("def depth_gradient(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((2, 6) d depth / d (translation, rotation vector about the body's own position) of a and of b: the unit vector out of
each body, and its moment at the point where the bodies touch once a is moved by depth * normal. 1 and m; zeros unless
overlapping, None for three or more bodies. Where the bodies touch with a face or along an edge, rotations have one-sided
derivatives, and one of the points that touch counts. Where two normals have the same depth, the one of `normal` counts.)");
  of_depth(
      "depth_shape_gradient", &DepthGradient::shape,
      nb::sig("def depth_shape_gradient(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((2, 3) d depth / d (size) of a and of b, by the numbers of `shape_gradient`: half extents, radius and length, half axes, or
the offset of a half-space. Without unit; zeros unless overlapping, None for three or more bodies. NaN for hulls.)");
  contact_property(
      cls, "distance", always, [](const Contact& c) { return c.distance; },
      nb::sig("def distance(self) -> float | None"),
      "m, between the nearest points; 0 unless separated. None for three or more bodies.");
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
      "volume", [](const Overlap& o) { return measured(o).volume(); }, "m³, the best estimate; 0 unless overlapping.");
  cls.def_prop_ro(
      "volume_error", [](const Overlap& o) { return computed(o, &Overlap::volume_error); },
      R"(m³, certified: the true volume is within volume ± volume_error.

For polyhedra and formulas it bounds the rounding errors: every plane is moved by 16 half-ulps of the coordinates'
magnitude, times the area. For slices it is the remainder of the series, the rounding errors of their lines, and the sum
of the area vectors, which is zero for a closed surface. For other curved shapes it is the volume between an outer and an
inner polytope, plus rounding errors. A pair that touches may have a volume of the size of rounding errors. For method
'paper' it is the difference from the volume of 'auto', plus the error bound of 'auto'. 0 if separated.)");
  cls.def_prop_ro(
      "widened", [](const Overlap& o) { return measured(o).widened(); },
      R"(True if double arithmetic could not bound the relative error of the volume by 1e-12. Volume, centroid, area,
inertia and gradient were then computed again in double-double arithmetic, from the shapes as given.)");
  cls.def_prop_ro(
      "area", [](const Overlap& o) { return measured(o).area(); },
      "m², of the surface of the common set; 0 unless overlapping.");
  cls.def_prop_ro(
      "centroid",
      [](const Overlap& o) -> nb::object {
        return solid(o) ? nb::cast(to_numpy(measured(o).centroid()), nb::rv_policy::move) : nb::none();
      },
      nb::sig("def centroid(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(3,) centre of the common volume, m; None unless overlapping.");
  array_property(
      cls, "inertia",
      [](const Overlap& o) { return solid(o) ? to_numpy(computed(o, &Overlap::inertia)) : to_numpy(Mat3{{}, {}, {}}); },
      "(3, 3) inertia tensor about the centroid at unit density, world axes, m⁵ (trimesh's moment_inertia); zeros "
      "unless overlapping.");
  array_property(
      cls, "gradient",
      [](const Overlap& o) {
        std::vector<double> values;
        for (const auto& row : computed(o, &Overlap::gradient)) values.insert(values.end(), row.begin(), row.end());
        return to_numpy<Matrix>(std::move(values), {o.bodies().size(), 6});
      },
      R"((m, 6) d volume / d (translation, rotation vector about the body's own position) of each body, world axes: the area vector
of the facets that the body owns, and its moment. m² and m³; zeros unless overlapping.)");
}

/// A list with an array for each hull: the derivatives by its vertices, or the bounds of their errors.
nb::list by_vertices(const Overlap& o, Wanted wanted) {
  nb::list list;
  for (VertexGradient& each : computed_of(o.bodies(), [&] { return vertex_gradients(o, wanted); })) {
    const size_t count = each.by_vertex.size();
    std::vector<double>& errors = wanted.centroid ? each.centroid_error : each.error;
    if (count == 0) {
      list.append(nb::none());
    } else if (wanted.errors) {
      list.append(nb::cast(to_numpy<Vector>(std::move(errors), {count}), nb::rv_policy::move));
    } else if (wanted.centroid) {
      const auto* first = reinterpret_cast<const double*>(each.centroid.data());
      list.append(nb::cast(to_numpy<Matrices>(std::vector<double>(first, first + 9 * count), {count, 3, 3}),
                           nb::rv_policy::move));
    } else {
      list.append(nb::cast(to_numpy(each.by_vertex), nb::rv_policy::move));
    }
  }
  return list;
}

void define_hessian(nb::class_<Overlap>& cls) {
  array_property(
      cls, "hessian",
      [](const Overlap& o) {
        if (!o.pair() && !polyhedral(o.bodies()))
          fail("hessian", "exists for every pair, but for three or more bodies only if none is round");
        const size_t width = 6 * o.bodies().size();
        return to_numpy<Matrix>(computed_of(o.bodies(), [&] { return pose_hessian(o); }), {width, width});
      },
      R"((6 m, 6 m) second derivatives of the volume by the numbers of `gradient`, in its order: a translation, and a rotation
vector about the body's own position, of each body. The matrix is symmetric. The volume after a small motion x of all bodies is
volume + gradient.ravel() @ x + x @ hessian @ x / 2. NaN where a face of one body lies in the plane of a face of another body,
where round surfaces coincide, and where surfaces touch along a line. Where surfaces touch at a point, or an edge lies in the
plane of a face, it is one of two one-sided values. m, m² and m³; zeros unless overlapping.

Raises
------
ValueError
    If there are three or more bodies, and one of them is round.)");
}

/// A (bodies, 3, columns) array of the derivatives of the centroid.
template <class T>
Matrices by_coordinates(const Overlap& o, std::vector<CentroidGradient> (*of)(const Overlap&),
                        T CentroidGradient::* part) {
  std::vector<double> values;
  for (const CentroidGradient& each : computed_of(o.bodies(), [&] { return of(o); })) {
    const auto* first = reinterpret_cast<const double*>(&(each.*part));
    values.insert(values.end(), first, first + sizeof(T) / sizeof(double));
  }
  return to_numpy<Matrices>(std::move(values), {o.bodies().size(), 3, sizeof(T) / sizeof(double) / 3});
}

void define_centroid_gradient(nb::class_<Overlap>& cls) {
  array_property(
      cls, "centroid_gradient",
      [](const Overlap& o) { return by_coordinates(o, centroid_gradient, &CentroidGradient::pose); },
      R"((m, 3, 6) d centroid / d (translation, rotation vector about the body's own position) of each body, world axes. Row j of
a body has the derivatives of coordinate j. 1 and m. The translations of all bodies add up to the identity. Where faces of
boxes, hulls and half-spaces lie in one plane, derivatives are one-sided, as those of `gradient`. NaN for a pair with a round
body if surfaces coincide, or touch along a line, and for contacts so shallow that rounding hides where surfaces cross. NaN also
for three or more bodies with a round body. Zeros unless overlapping. `errors.centroid_gradient` bounds the errors.)");
  array_property(
      cls, "centroid_shape_gradient",
      [](const Overlap& o) { return by_coordinates(o, centroid_gradient, &CentroidGradient::shape); },
      R"((m, 3, 3) d centroid / d (size) of each body, by the numbers of `shape_gradient`: half extents, radius and length, half
axes, or the offset of a half-space, then zeros. Row j of a body has the derivatives of coordinate j. Without unit. NaN for
hulls, for the length 0 of a capsule, and where `centroid_gradient` is NaN. Hulls have `centroid_vertex_gradients`. Zeros unless
overlapping. `errors.centroid_shape_gradient` bounds the errors.)");
}

void define_centroid_vertex_gradients(nb::class_<Overlap>& cls) {
  cls.def_prop_ro(
      "centroid_vertex_gradients", [](const Overlap& o) { return by_vertices(o, {.errors = false, .centroid = true}); },
      nb::sig("def centroid_vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]"),
      R"(For each body, the (k, 3, 3) d centroid / d (position of a vertex), world axes, without unit, of the rows of
`Hull.vertices`, or of `RoundedHull.core.vertices`; None for other bodies. Row j of a vertex has the derivatives of coordinate j.
The vertices of a body have the sum centroid_gradient[i, :, :3]. Facets of more than three corners count as in
`vertex_gradients`. NaN for three or more bodies with a round body, and for rounded hulls where `centroid_gradient` is NaN. Zeros
unless overlapping. `errors.centroid_vertex_gradients` bounds the errors.)");
}

void define_shape_gradient(nb::class_<Overlap>& cls) {
  array_property(
      cls, "shape_gradient",
      [](const Overlap& o) {
        return to_numpy(std::span<const Vec3>(computed_of(o.bodies(), [&] { return shape_gradient(o); })));
      },
      R"((m, 3) d volume / d (half extents) of each box, m². For a half-space, d volume / d (offset along its unit normal), then
zeros. For round bodies: d volume / d radius of a sphere or a rounded hull, then zeros; d volume / d (radius, length) of a
capsule or a cylinder, then zero; d volume / d (half axes) of an ellipsoid. It is the integral over the common surface of
the speed at which the surface moves out. Where faces of two bodies lie in one plane, the volume has two one-sided
derivatives, and the area counts for either body. For groups with a round body, it is that of an enclosing polytope. NaN for
hulls, which have `vertex_gradients`, and for the length 0 of a capsule. NaN also for the few pairs with an ellipsoid that
cannot be sliced. Zeros unless overlapping. `errors.shape_gradient` bounds the errors.)");
  cls.def_prop_ro(
      "vertex_gradients", [](const Overlap& o) { return by_vertices(o, {}); },
      nb::sig("def vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]"),
      R"(For each body, the (k, 3) d volume / d (position of a vertex), world axes, m², of the rows of `Hull.vertices`, or of
`RoundedHull.core.vertices`; None for other bodies. The vertices of a body have the sum gradient[i, :3]. A facet of more than
three corners counts as a fan of triangles from its first corner. The volume has other one-sided derivatives there, as a
vertex that leaves the facet may fold it in another way. For groups with a round body, it is that of an enclosing polytope, and
NaN for rounded hulls. NaN also for the few rounded hulls that cannot be sliced. Zeros unless overlapping.
`errors.vertex_gradients` bounds the errors.)");
}

/// The error bounds of an overlap.
struct ErrorsOf {
  Errors errors;
  bool solid;
  std::optional<ContactErrors> contact;  ///< only for a pair
  Overlap overlap;                       ///< for bounds that are computed on demand
};

std::string repr(const ErrorsOf& e) {
  std::string text = "Errors(volume=" + number(e.errors.volume) + " m³, area=" + number(e.errors.area) + " m²";
  if (e.solid) text += ", centroid=" + number(e.errors.centroid) + " m";
  if (e.contact) text += ", depth=" + number(e.contact->depth) + " m, distance=" + number(e.contact->distance) + " m";
  return text + ")";
}

nb::object of_contact(const ErrorsOf& e, double ContactErrors::* error) {
  return e.contact ? nb::object(nb::float_(*e.contact.*error)) : nb::none();
}

nb::object if_solid(const ErrorsOf& e, double error) { return e.solid ? nb::object(nb::float_(error)) : nb::none(); }

void define_errors(nb::module_& m) {
  nb::class_<ErrorsOf> cls(m, "Errors",
                           R"(Error bounds of the quantities of an Overlap, in the same units. They are certified.

Each quantity is computed in a second way, with bounds of its rounding errors. The error bound is the difference of the
two results, plus the bound of the second way.)");
  cls.def_prop_ro("volume", [](const ErrorsOf& e) { return e.errors.volume; }, "m³, the same as `volume_error`.");
  cls.def_prop_ro("area", [](const ErrorsOf& e) { return e.errors.area; }, "m².");
  cls.def_prop_ro(
      "centroid", [](const ErrorsOf& e) { return if_solid(e, e.errors.centroid); },
      nb::sig("def centroid(self) -> float | None"),
      "m, largest distance of the true centroid. None unless overlapping.");
  cls.def_prop_ro("inertia", [](const ErrorsOf& e) { return e.errors.inertia; }, "m⁵, for each entry.");
  cls.def_prop_ro(
      "vertices",
      [](const ErrorsOf& e) { return if_solid(e, e.solid ? computed(e.overlap, &Overlap::vertices_error) : 0); },
      nb::sig("def vertices(self) -> float | None"),
      R"(m, largest distance between the hull of the vertices and the common set (Hausdorff distance). None unless
overlapping. Computed on the first access, which draws the common polytope.)");
  array_property(
      cls, "gradient",
      [](const ErrorsOf& e) {
        std::vector<double> values;
        for (const auto& [force, moment] : e.errors.gradient)
          values.insert(values.end(), {force, force, force, moment, moment, moment});
        return to_numpy<Matrix>(std::move(values), {e.errors.gradient.size(), 6});
      },
      R"((m, 6) m² and m³. Each bounds the length of the error of three entries, and so the error of each entry.

Where facets of two bodies lie in one plane, the volume has two one-sided derivatives, and the gradient may be either.
The error bound is then as large as the facet. Where surfaces are nearly tangent, rounding errors move the border between
them much farther than their own size.)");
  array_property(
      cls, "shape_gradient",
      [](const ErrorsOf& e) {
        return to_numpy(
            std::span<const Vec3>(computed_of(e.overlap.bodies(), [&] { return shape_gradient_errors(e.overlap); })));
      },
      "(m, 3) m², for each entry. NaN where there is no derivative. Computed on each access.");
  const auto of_centroid = [](auto part) {
    return [part](const ErrorsOf& e) { return by_coordinates(e.overlap, centroid_gradient_errors, part); };
  };
  array_property(cls, "centroid_gradient", of_centroid(&CentroidGradient::pose),
                 R"((m, 3, 6) 1 and m, for each entry. NaN where there is no derivative. Infinite for bodies that touch,
and where the error of the volume is as large as the volume. Computed on each access.

Where facets of two bodies lie in one plane, derivatives are one-sided, and the bound is as large as both sides are apart.)");
  array_property(cls, "centroid_shape_gradient", of_centroid(&CentroidGradient::shape),
                 "(m, 3, 3) without unit, for each entry, as `centroid_gradient`. Computed on each access.");
  cls.def_prop_ro(
      "vertex_gradients", [](const ErrorsOf& e) { return by_vertices(e.overlap, {.errors = true, .centroid = false}); },
      nb::sig("def vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]"),
      R"(For each body, (k,) m²: bounds of the lengths of the errors of the rows; None for other bodies than hulls and rounded
hulls. Computed on each access.)");
  cls.def_prop_ro(
      "centroid_vertex_gradients",
      [](const ErrorsOf& e) { return by_vertices(e.overlap, {.errors = true, .centroid = true}); },
      nb::sig("def centroid_vertex_gradients(self) -> list[numpy.typing.NDArray[numpy.float64] | None]"),
      R"(For each body, (k,) without unit: bounds of the errors of all nine entries of a vertex; None for other bodies than
hulls and rounded hulls. NaN where there is no derivative. Infinite for bodies that touch, and where the error of the volume is as large as the
volume. Computed on each access.)");
  cls.def_prop_ro(
      "depth", [](const ErrorsOf& e) { return of_contact(e, &ContactErrors::depth); },
      nb::sig("def depth(self) -> float | None"),
      "m. None for three or more bodies. The same holds for `distance` and `witnesses`.");
  cls.def_prop_ro(
      "distance", [](const ErrorsOf& e) { return of_contact(e, &ContactErrors::distance); },
      nb::sig("def distance(self) -> float | None"), "m.");
  cls.def_prop_ro(
      "witnesses", [](const ErrorsOf& e) { return of_contact(e, &ContactErrors::witnesses); },
      nb::sig("def witnesses(self) -> float | None"),
      R"(m, sum of the distances of the witness points from their bodies and of the error of their distance. 0 if
overlapping.)");
  cls.def("__repr__", [](const ErrorsOf& e) { return repr(e); });
}

void define_boundary(nb::class_<Overlap>& cls) {
  array_property(
      cls, "vertices",
      [](const Overlap& o) { return solid(o) ? to_numpy(computed(o, &Overlap::boundary).vertices) : empty_rows(3); },
      "(n, 3) vertices of the common polytope, m; empty unless overlapping.");
  array_property(
      cls, "faces",
      [](const Overlap& o) {
        return solid(o) ? triangles(computed(o, &Overlap::boundary))
                        : to_numpy<IndexMatrix>(std::vector<int>{}, {0, 3});
      },
      "(k, 3) the facets as triangles, counter-clockwise from outside: indices into vertices.");
  cls.def_prop_ro(
      "facets",
      [](const Overlap& o) {
        return solid(o) ? polygons(computed(o, &Overlap::boundary).ring, computed(o, &Overlap::boundary).ring_start)
                        : nb::list();
      },
      nb::sig("def facets(self) -> list[numpy.typing.NDArray[numpy.int32]]"),
      "Indices of the vertices around each facet, counter-clockwise from outside.");
  array_property(
      cls, "halfspaces",
      [](const Overlap& o) {
        return solid(o) ? halfspace_rows(computed(o, &Overlap::boundary).planes) : empty_rows(4);
      },
      "(f, 4) rows [n, b], one per facet: n · x + b <= 0 inside, n unit (scipy's form).");
  array_property(
      cls, "owner",
      [](const Overlap& o) {
        return to_numpy(std::span<const int>(solid(o) ? computed(o, &Overlap::boundary).owner : std::vector<int>{}));
      },
      "(f,) index of the shape that each facet belongs to.");
  cls.def_prop_ro(
      "patch",
      [](const Overlap& o) {
        nb::list list;
        if (solid(o))
          for (const auto& polygon : computed(o, &Overlap::boundary).patch)
            list.append(nb::cast(to_numpy(polygon), nb::rv_policy::move));
        return list;
      },
      nb::sig("def patch(self) -> list[numpy.typing.NDArray[numpy.float64]]"),
      R"(Closed polygons (k, 3) along the edges where the owner changes, m. The first point is not repeated. For a pair,
they go counter-clockwise around a's part of the surface. For more bodies, they go around the part of each.)");
  const auto has_area = [](const Overlap& o) { return !std::isnan(computed(o, &Overlap::patch).distance); };
  patch_property(
      cls, "patch_area", [](const Overlap&) { return true; }, [](const Patch& p) { return to_numpy(p.area); },
      nb::sig("def patch_area(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3,) m², the area vector of b's part of the surface. It points to a, as `normal` does. Its length is the area within
`patch`, projected along it. For small overlaps it is the derivative of the volume by the depth. It equals
gradient[1, :3] and -gradient[0, :3]. Zeros unless overlapping. None for three or more bodies. The same holds for
`patch_centre`, `patch_moments` and `patch_distance`.)");
  patch_property(
      cls, "patch_centre", has_area, [](const Patch& p) { return to_numpy(p.centre); },
      nb::sig("def patch_centre(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3,) m, the centre of that area, in the plane through the centroid of the volume. None also without an area: if the
bodies do not overlap, or one body is inside the other.)");
  patch_property(
      cls, "patch_moments", [](const Overlap&) { return true; }, [](const Patch& p) { return to_numpy(p.moments); },
      nb::sig("def patch_moments(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3, 3) m⁴, ∫ x xᵀ dA of that area about its centre, world axes; zero along the area vector. Its eigenvectors are the
axes of the patch. The square roots of its eigenvalues divided by the area are the radii of gyration. Where formulas or
slices measure round bodies, it is that of the round patch, not of polygons.)");
  patch_property(
      cls, "patch_distance", has_area, [](const Patch& p) { return p.distance; },
      nb::sig("def patch_distance(self) -> float | None"),
      R"(m, mean distance of the points of that area from the centroid of the volume, in the plane through it. With friction
mu and a normal force N, the torque that resists spinning is at most mu * N * patch_distance. It is exact for polyhedra,
discs and ellipses. Where formulas or slices measure round bodies, other patches count as the ellipse with the same
centre and moments. That is 2 % too small for a long rectangle, within 1 % for a stadium, within 2 % for a half disc,
2 % too large for a triangle, and 6 % too small for a thin ring. None without an area.)");
  cls.def_prop_ro(
      "bounds",
      [](const Overlap& o) -> nb::object {
        if (!solid(o)) return nb::none();
        const auto& vertices = computed(o, &Overlap::boundary).vertices;
        Bounds box{vertices[0], vertices[0]};
        for (Vec3 v : vertices) box = {min(box.lower, v), max(box.upper, v)};
        return nb::cast(to_numpy(box), nb::rv_policy::move);
      },
      nb::sig("def bounds(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      "(2, 3) lower and upper corner of the box around the common polytope; None unless overlapping.");
}

std::string signature_of_way() {
  std::string ways;
  for (const char* way : kWayNames) ways += (ways.empty() ? "'" : ", '") + std::string(way) + "'";
  return "def way(self) -> typing.Literal[" + ways + "]";
}

void define_overlap(nb::module_& m) {
  nb::class_<Overlap> cls(m, "Overlap",
                          R"(The common set of two or more convex shapes. True only if they overlap.

An Overlap is immutable. Each quantity is computed at its first use. Units are SI. Coordinates are world coordinates. For
curved shapes, the polytope contains the common set, and is as close to it as `tolerance` demands.)");
  cls.def_prop_ro(
      "status", [](const Overlap& o) { return status_name(o.status()); },
      nb::sig("def status(self) -> typing.Literal['separated', 'touching', 'overlapping']"),
      "'touching' if rounding errors leave open whether the common set has a volume.");
  cls.def("__bool__", [](const Overlap& o) { return solid(o); });
  cls.def_prop_ro(
      "shapes",
      [](const Overlap& o) {
        nb::list list;
        for (const Placed& p : o.bodies()) list.append(nb::cast(p));
        return nb::tuple(list);
      },
      nb::sig("def shapes(self) -> tuple[Placed, ...]"), "The bodies in the order given.");
  cls.def_prop_ro("tolerance", &Overlap::tolerance, "Allowed relative error of the volume for curved shapes.");
  cls.def_prop_ro(
      "converged", [](const Overlap& o) { return measured(o).converged(); },
      R"(Whether the relative error of the volume is at most `tolerance`. It may be larger by rounding errors, or by the
limit on the number of planes of a curved shape. True for bodies that do not overlap.)");
  cls.def_prop_ro(
      "method", [](const Overlap& o) { return o.method() == Method::kAuto ? "auto" : "paper"; },
      nb::sig("def method(self) -> typing.Literal['auto', 'paper']"));
  cls.def_prop_ro(
      "way", [](const Overlap& o) { return name(measured(o).way()); }, nb::sig(signature_of_way().c_str()),
      R"(How the result was computed: the way that found the volume, or the status of bodies that do not overlap.

'separation': doubles prove a gap. 'clipping': the vertices of each body are compared with the planes of the other.
'tracing': the curve where two surfaces meet is followed from facet to facet. 'closed form': a formula. 'slicing':
integrated slices of round bodies. 'dual hull': the convex hull of dual points. 'wide ...': the same in double-double
arithmetic, where doubles are not accurate enough. 'doubt': double-doubles leave open whether there is a common volume,
so the status is 'touching'. 'paper': the method `paper`.)");
  cls.def_prop_ro(
      "facets_touched", [](const Overlap& o) { return computed(o, &Overlap::facets_touched); },
      "Number of planes of the shapes that took part in the measures.");
  cls.def_prop_ro(
      "errors",
      [](const Overlap& o) {
        return computed_of(o.bodies(), [&] {
          return ErrorsOf{o.errors(), solid(o), o.pair() ? std::optional(o.contact_errors()) : std::nullopt, o};
        });
      },
      R"(Error bound of each quantity, as `volume_error` is that of the volume. They take about as long as all
quantities together; `errors.vertices` takes as long as `vertices`.)");
  define_measures(cls);
  define_shape_gradient(cls);
  define_hessian(cls);
  define_centroid_gradient(cls);
  define_centroid_vertex_gradients(cls);
  define_boundary(cls);
  define_contact(cls);
  cls.def("__repr__", [](const Overlap& o) { return repr(o); });
  cls.def(
      "_repr_html_",
      [](nb::handle self) { return nb::module_::import_("overlapper.viewer.notebook").attr("overlap_html")(self); },
      nb::sig("def _repr_html_(self) -> str"));
  cls.def(
      "certificate",
      [](nb::handle self) { return nb::module_::import_("overlapper.proof.certificate").attr("certificate")(self); },
      nb::sig("def certificate(self) -> typing.Any"),
      R"(A certificate that proves the status and bounds of the volume.

Its `verify()` checks everything in rational arithmetic, without the core.

Returns
-------
overlapper.proof.claims.Certificate
    `verify()` returns (lower, upper) bounds of the common volume in m³.

Raises
------
overlapper.proof.claims.CertificateError
    If there is no certificate.)");
  cls.def("__copy__", [](nb::handle self) { return nb::borrow(self); });
  cls.def("__deepcopy__", [](nb::handle self, nb::handle) { return nb::borrow(self); }, "memo"_a);
  cls.def(
      "__getstate__",
      [](nb::handle self) { return nb::make_tuple(self.attr("shapes"), self.attr("tolerance"), self.attr("method")); },
      nb::sig("def __getstate__(self) -> tuple[object, ...]"));
  cls.def(
      "__setstate__",
      [](Overlap& self, nb::handle state) {
        if (!nb::isinstance<nb::tuple>(state) || nb::len(state) != 3 || !nb::isinstance<nb::tuple>(state[0]))
          throw nb::value_error("state must be that of an overlap");
        std::vector<Placed> bodies;
        for (nb::handle shape : state[0]) {
          if (!nb::isinstance<Placed>(shape)) throw nb::value_error("state must be that of an overlap");
          bodies.push_back(nb::cast<Placed>(shape));
        }
        const double tolerance = to_double(state[1], "tolerance");
        new (&self) Overlap(std::move(bodies), tolerance, to_method(state[2]));
      },
      nb::sig("def __setstate__(self, state: tuple[object, ...]) -> None"));
}

/// In the order and about the reference of an Overlap, so that both give the same bits.
std::array<Placed, 2> relative_pair(nb::handle a, nb::handle b) {
  const std::array<Placed, 2> pair{to_placed(a, "a"), to_placed(b, "b")};
  const std::vector<int> order = canonical_order(pair);
  const Placed &first = pair[order[0]], &second = pair[order[1]];
  return {first.seen_from(first.pose.translation), second.seen_from(first.pose.translation)};
}

/// The contact of a pair if doubles alone do not decide its status, or do not give its contact accurately enough.
Contact contact_in_doubt(nb::handle a, nb::handle b) {
  const std::array pair{to_placed(a, "a"), to_placed(b, "b")};
  return computed_of(pair, [&] { return Overlap(pair[0], pair[1], 1e-3, Method::kAuto).contact(); });
}

double union_ratio(nb::handle a, nb::handle b, double tolerance) {
  const Overlap common = make_overlap({to_placed(a, "a"), to_placed(b, "b")}, tolerance, Method::kAuto);
  if (!solid(common)) return 0;
  const double shared = measured(common).volume();
  const double both = volume(common.bodies()[0].shape) + volume(common.bodies()[1].shape) - shared;
  return std::min(1.0, shared / both);
}

void define_functions(nb::module_& m) {
  m.def(
      "overlap", [type = nb::type<Overlap>()](const Placed& a, const Placed& b) { return overlap_of_pair(type, a, b); },
      nb::sig("def overlap(a: Placed, b: Placed, /) -> Overlap"));
  m.def(
      "overlap",
      [](nb::args shapes, nb::handle tolerance, nb::handle method) {
        return make_overlap(to_bodies(shapes), to_double(tolerance, "tolerance"), to_method(method));
      },
      "shapes"_a, "tolerance"_a.none() = 1e-3, "method"_a.none() = "auto",
      nb::sig(("def overlap(*shapes: " + any_body() +
               ", tolerance: float = 0.001, method: typing.Literal['auto', 'paper'] = 'auto') -> Overlap")
                  .c_str()),
      R"(The common set of two or more convex shapes.

>>> from overlapper import Placed, Sphere, overlap
>>> lens = overlap(Sphere(0.5), Placed(Sphere(0.5), position=(0.6, 0, 0)))
>>> round(lens.volume, 6), round(lens.depth, 6), lens.normal.tolist()
(0.108909, 0.4, [-1.0, 0.0, 0.0])

Parameters
----------
*shapes : shape, Placed, (n, 3) array_like or trimesh.Trimesh
    Two or more bodies. A bare shape lies at the origin. Points in m stand for their convex hull. A mesh in m must be
    closed and convex.
tolerance : float, default 0.001
    Allowed relative error of the volume for curved shapes, between 0 and 1. Polyhedra are exact and ignore it.
method : {'auto', 'paper'}, default 'auto'
    'auto' tries the ways of `Overlaps.WAYS`. 'paper' follows the article of Tereshchenko, Chevokin and Fisunenko,
    'Algorithm for finding the domain intersection of a set of polytopes' (ICCS 2013). docs/how.md has its steps.

Returns
-------
Overlap
    SI units, world coordinates. No overlap is a result, not an error: `bool(result)` is False.

Raises
------
ValueError
    If there are fewer than two shapes, if the common set is unbounded, or if a mesh is not closed or not convex.)");
  m.def(
      "distance",
      [](nb::handle a, nb::handle b) {
        const auto pair = relative_pair(a, b);
        const auto& [p, q] = pair;
        if (!bounded(p.shape) && !bounded(q.shape))
          return have_no_common_point(pair) ? contact_in_doubt(a, b).distance : 0.0;
        const Distance d = computed_of(pair, [&] { return distance(pair[0], pair[1]); });
        if (!in_doubt(d.gap, p, q)) return d.distance;
        if (!in_doubt(norm2(d.normal) > 0 ? -d.distance : d.overlap, p, q)) return 0.0;
        return contact_in_doubt(a, b).distance;
      },
      "a"_a.none(), "b"_a.none(),
      nb::sig(("def distance(a: " + any_body() + ", b: " + any_body() + ") -> float").c_str()),
      R"(Distance between the nearest points of two shapes.

Parameters
----------
a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
    The two bodies, as `overlap` takes them.

Returns
-------
float
    Distance in m. 0 if the bodies touch or overlap.

Examples
--------
>>> from overlapper import Box, Placed, distance
>>> distance(Box([0.5, 0.5, 0.5]), Placed(Box([0.5, 0.5, 0.5]), (1.25, 0, 0)))
0.25)");
  m.def(
      "penetration_depth",
      [](nb::handle a, nb::handle b) {
        const auto pair = relative_pair(a, b);
        const auto& [p, q] = pair;
        const double depth = computed_of(pair, [&] { return penetration(pair[0], pair[1]).depth; });
        if (in_doubt(std::abs(depth), p, q) || (depth > 0 && has_curved_core(p, q)))
          return contact_in_doubt(a, b).depth;
        return std::max(0.0, depth);
      },
      "a"_a.none(), "b"_a.none(),
      nb::sig(("def penetration_depth(a: " + any_body() + ", b: " + any_body() + ") -> float").c_str()),
      R"(Length of the shortest translation that separates two shapes.

Parameters
----------
a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
    The two bodies, as `overlap` takes them.

Returns
-------
float
    Depth in m. It is positive where pybullet's contact distance is negative. 0 if the bodies do not overlap.

Raises
------
ValueError
    If both bodies are half-spaces.

Examples
--------
>>> from overlapper import Box, Placed, penetration_depth
>>> penetration_depth(Box([0.5, 0.5, 0.5]), Placed(Box([0.5, 0.5, 0.5]), (0.75, 0, 0)))
0.25)");
  m.def(
      "iou",
      [](nb::handle a, nb::handle b, nb::handle tolerance) {
        return union_ratio(a, b, to_double(tolerance, "tolerance"));
      },
      "a"_a.none(), "b"_a.none(), "tolerance"_a.none() = 1e-3,
      nb::sig(("def iou(a: " + any_body() + ", b: " + any_body() + ", tolerance: float = 0.001) -> float").c_str()),
      R"(Intersection over union of two shapes: the common volume divided by the volume of the union.

Parameters
----------
a, b : shape, Placed, (n, 3) array_like or trimesh.Trimesh
    The two bodies, as `overlap` takes them.
tolerance : float, default 0.001
    Allowed relative error of the common volume for curved shapes, between 0 and 1.

Returns
-------
float
    The ratio, from 0 to 1.

Examples
--------
>>> from overlapper import Box, Placed, iou
>>> round(iou(Box([0.5, 0.5, 0.5]), Placed(Box([0.5, 0.5, 0.5]), (0.5, 0, 0))), 12)
0.333333333333)");
}

}  // namespace

Method to_method(nb::handle value) {
  if (!nb::isinstance<nb::str>(value)) throw nb::type_error("method must be 'auto' or 'paper'");
  if (PyUnicode_CompareWithASCIIString(value.ptr(), "auto") == 0) return Method::kAuto;
  const std::string name = nb::cast<std::string>(value);
  if (name == "paper") return Method::kPaper;
  fail("method", "must be 'auto' or 'paper', not '" + name + "'");
}

void define_overlaps(nb::module_& m) {
  define_errors(m);
  define_overlap(m);
  define_functions(m);
}

}  // namespace overlapper::python
