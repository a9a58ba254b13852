#include <algorithm>
#include <cmath>

#include "distance/gjk.h"
#include "distance/penetration.h"
#include "methods/half_spaces_alone.h"
#include "overlap/overlap.h"
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
std::string any_body() { return any_shape() + " | Placed | numpy.typing.ArrayLike"; }

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
      R"((3,) unit, from b to a as pybullet's contactNormalOnB: moving a by depth * normal separates an overlapping
pair. Also given for pairs that touch or are apart. None for three or more bodies.)");
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
      "volume", [](const Overlap& o) { return measured(o).volume(); }, "m³, the best estimate; 0 unless overlapping.");
  cls.def_prop_ro(
      "volume_error", [](const Overlap& o) { return computed(o, &Overlap::volume_error); },
      R"(m³, certified: the true volume is within volume ± volume_error.

For polyhedra it bounds the rounding: every plane moved by 16 half-ulps of the coordinates' magnitude, times the
area. Where a formula gives the measures of a pair with a round body, it is that, too; where slices do, what is left of
the series over them, the rounding of their lines, and what area vectors, which sum to zero over a closed surface, leave
open. For others with smooth shapes it is the share of the volume between an outer and an inner polytope, plus that. A
pair that touches may hide a volume of rounding size. For method 'paper', which bounds nothing itself, it is the
difference from what 'auto' finds, plus the error of that. 0 if separated.)");
  cls.def_prop_ro(
      "widened", [](const Overlap& o) { return measured(o).widened(); },
      R"(True if double arithmetic could not place the volume within 1e-12 of itself, and it was computed again in wider
arithmetic from the shapes' own numbers, as were centroid, area, inertia and gradient.)");
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

/// The error bounds of an overlap.
struct ErrorsOf {
  Errors errors;
  bool solid;
  std::optional<ContactErrors> contact;  ///< only for a pair
};

std::string repr(const ErrorsOf& e) {
  std::string text = "Errors(volume=" + number(e.errors.volume) + " m³, area=" + number(e.errors.area) + " m²";
  if (e.solid) text += ", centroid=" + number(e.errors.centroid) + " m, vertices=" + number(e.errors.vertices) + " m";
  if (e.contact) text += ", depth=" + number(e.contact->depth) + " m, distance=" + number(e.contact->distance) + " m";
  return text + ")";
}

nb::object of_contact(const ErrorsOf& e, double ContactErrors::* error) {
  return e.contact ? nb::object(nb::float_(*e.contact.*error)) : nb::none();
}

nb::object if_solid(const ErrorsOf& e, double error) { return e.solid ? nb::object(nb::float_(error)) : nb::none(); }

void define_errors(nb::module_& m) {
  nb::class_<ErrorsOf> cls(m, "Errors",
                           R"(How far the figures of an Overlap may be off: bounds that hold, in the same units.

They rest on another way to the same figures, whose rounding is bounded from its operations, and on how far that and the
figures are apart.)");
  cls.def_prop_ro("volume", [](const ErrorsOf& e) { return e.errors.volume; }, "m³, the same as `volume_error`.");
  cls.def_prop_ro("area", [](const ErrorsOf& e) { return e.errors.area; }, "m².");
  cls.def_prop_ro(
      "centroid", [](const ErrorsOf& e) { return if_solid(e, e.errors.centroid); },
      nb::sig("def centroid(self) -> float | None"),
      "m: the true centroid is no farther away. None unless overlapping.");
  cls.def_prop_ro("inertia", [](const ErrorsOf& e) { return e.errors.inertia; }, "m⁵, of each entry.");
  cls.def_prop_ro(
      "vertices", [](const ErrorsOf& e) { return if_solid(e, e.errors.vertices); },
      nb::sig("def vertices(self) -> float | None"),
      R"(m: no point of the hull of the vertices is farther from the common set, and none of that from the hull. None unless
overlapping.)");
  array_property(
      cls, "gradient",
      [](const ErrorsOf& e) {
        std::vector<double> values;
        for (const auto& [force, moment] : e.errors.gradient)
          values.insert(values.end(), {force, force, force, moment, moment, moment});
        return to_numpy<Matrix>(std::move(values), {e.errors.gradient.size(), 6});
      },
      R"((m, 6) m² and m³: of the length of the three numbers that they stand for, and so of each.

Where facets of two bodies lie in one plane the volume has a slope to one side and another to the other, and what is
stated may be either: the error is then as large as the facet. Where surfaces are tangent, or nearly, rounding moves the
border between them by far more than itself.)");
  cls.def_prop_ro(
      "depth", [](const ErrorsOf& e) { return of_contact(e, &ContactErrors::depth); },
      nb::sig("def depth(self) -> float | None"), "m. None for three or more bodies, as are the next two.");
  cls.def_prop_ro(
      "distance", [](const ErrorsOf& e) { return of_contact(e, &ContactErrors::distance); },
      nb::sig("def distance(self) -> float | None"), "m.");
  cls.def_prop_ro(
      "witnesses", [](const ErrorsOf& e) { return of_contact(e, &ContactErrors::witnesses); },
      nb::sig("def witnesses(self) -> float | None"),
      R"(m: by how much, both together, the witnesses are outside of their bodies and farther apart than the bodies are. 0 if
overlapping.)");
  cls.def("__repr__", [](const ErrorsOf& e) { return repr(e); });
}

void define_boundary(nb::class_<Overlap>& cls) {
  array_property(
      cls, "vertices",
      [](const Overlap& o) { return solid(o) ? to_numpy(computed(o, &Overlap::boundary).vertices) : empty_rows(3); },
      "(n, 3) corners of the common polytope, m; empty unless overlapping.");
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
      "(f,) which of the shapes each facet belongs to.");
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
      R"(Closed polygons (k, 3) along the ridges where the owner changes, the first point not repeated. For a pair they go
counter-clockwise around a's part of the surface; for more bodies, around the part of each.)");
  const auto has_area = [](const Overlap& o) { return !std::isnan(computed(o, &Overlap::patch).distance); };
  patch_property(
      cls, "patch_area", [](const Overlap&) { return true; }, [](const Patch& p) { return to_numpy(p.area); },
      nb::sig("def patch_area(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3,) m², the area vector of b's part of the surface, which points to a as `normal` does: its length is the area within
`patch`, seen along it, and for small overlaps what the volume grows by per metre of depth. The same as gradient[1, :3],
and opposite to gradient[0, :3]; zeros unless overlapping. None for three or more bodies, as are the next three.)");
  patch_property(
      cls, "patch_centre", has_area, [](const Patch& p) { return to_numpy(p.centre); },
      nb::sig("def patch_centre(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3,) m, the centre of that area, in the plane through the centroid of the volume. None, too, without an area: unless
the bodies overlap, and of a body inside the other.)");
  patch_property(
      cls, "patch_moments", [](const Overlap&) { return true; }, [](const Patch& p) { return to_numpy(p.moments); },
      nb::sig("def patch_moments(self) -> numpy.typing.NDArray[numpy.float64] | None"),
      R"((3, 3) m⁴, ∫ x xᵀ dA of that area about its centre, world axes; nothing along the area vector. Its eigenvectors and the
roots of its eigenvalues over the area are the axes of the patch and its radii of gyration. Where formulas or slices
measure round bodies it is that of the round patch, not of polygons.)");
  patch_property(
      cls, "patch_distance", has_area, [](const Patch& p) { return p.distance; },
      nb::sig("def patch_distance(self) -> float | None"),
      R"(m, how far the points of that area are on the average from the centroid of the volume, in the plane through it:
with friction mu and a normal force N, the torque that resists spinning is at most mu * N * patch_distance. Exact of
polyhedra, discs and ellipses. Where formulas or slices measure round bodies, other patches count as the ellipse that
has the same centre and moments: of a long rectangle that is 2 % less than the truth, of a stadium within 1 %, of a half
disc within 2 %, of a triangle 2 % more, and of a thin ring 6 % less. None without an area, as the centre.)");
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
                          R"(What two or more convex shapes share. True only if they overlap.

Immutable; each quantity is computed when first asked for. SI units, world coordinates. For smooth shapes the
polytope contains the common set, as closely as `tolerance` asks.)");
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
  cls.def_prop_ro("tolerance", &Overlap::tolerance, "Allowed relative error of the volume for curved shapes.");
  cls.def_prop_ro(
      "converged", [](const Overlap& o) { return measured(o).converged(); },
      R"(False if the volume may be off by more than the fraction `tolerance`: where rounding, or the most planes that a
smooth shape is given, leave more in doubt. True of bodies that do not overlap.)");
  cls.def_prop_ro(
      "method", [](const Overlap& o) { return o.method() == Method::kAuto ? "auto" : "paper"; },
      nb::sig("def method(self) -> typing.Literal['auto', 'paper']"));
  cls.def_prop_ro(
      "way", [](const Overlap& o) { return name(measured(o).way()); }, nb::sig(signature_of_way().c_str()),
      R"(How the answer came: by which way the volume was measured, or the status found of bodies that do not overlap.

'separation': doubles prove a gap. 'clipping': corners of each body held against the planes of the other. 'tracing': the
seam of two surfaces followed from facet to facet. 'closed form': a formula. 'slicing': slices of
round bodies, integrated. 'dual hull': the convex hull of dual points. 'wide ...': the same in double-doubles, where doubles are not
enough. 'doubt': not even these tell whether there is an inside, so that the bodies are said to touch. 'paper': the
method asked for.)");
  cls.def_prop_ro(
      "facets_touched", [](const Overlap& o) { return computed(o, &Overlap::facets_touched); },
      "How many planes of the shapes took part in the measures.");
  cls.def_prop_ro(
      "errors",
      [](const Overlap& o) {
        return computed_of(o.bodies(), [&] {
          return ErrorsOf{o.errors(), solid(o), o.pair() ? std::optional(o.contact_errors()) : std::nullopt};
        });
      },
      R"(How far each figure may be off, as `volume_error` is that of the volume. It costs about as much as all figures
together.)");
  define_measures(cls);
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
      R"(What proves the status, and bounds of the volume, to somebody who does not trust us: an overlapper.proof.claims.Certificate.

`verify()` of it checks everything in rational arithmetic without the core, and returns (lower, upper) bounds of the common
volume in m³. Raises CertificateError where there is none.)");
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

    lens = overlap(Sphere(0.5), Placed(Sphere(0.5), position=(0.6, 0, 0)))
    lens.volume, lens.volume_error, lens.depth, lens.normal

Each of `shapes` is a shape, a Placed, or an (n, 3) array of points, which stands for their convex hull. `tolerance`, between
0 and 1, is the allowed relative error of the volume for curved shapes. `converged` is False if it was not reached.
Polyhedra are exact and ignore it. No overlap is an answer, not an error. Raises ValueError if the common set is unbounded.

`method` 'auto' tries the ways of `Overlaps.WAYS` and always returns an answer. `method` 'paper' follows the article of
Tereshchenko, Chevokin and Fisunenko, 'Algorithm for finding the domain intersection of a set of polytopes' (ICCS 2013). GJK
finds a common point. A point on a boundary is shifted by 2^-26 of the smaller polytope in one of 26 directions. If no
shifted point is inside both bodies, the status is 'touching'. The convex hull of the dual points of all face planes follows,
then its dual. More than two bodies are intersected in pairs, by divide and conquer. Three things differ from the article:
curved shapes are replaced by inscribed polytopes, half-spaces by large boxes, and hulls use exact predicates.)");
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
      "Distance (m) between the nearest points of two shapes. 0 if they touch or overlap.");
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
      R"(Length (m) of the shortest translation that separates two shapes. 0 if they do not overlap. Positive where pybullet's
contact distance is negative. Raises ValueError for two half-spaces.)");
  m.def(
      "iou",
      [](nb::handle a, nb::handle b, nb::handle tolerance) {
        return union_ratio(a, b, to_double(tolerance, "tolerance"));
      },
      "a"_a.none(), "b"_a.none(), "tolerance"_a.none() = 1e-3,
      nb::sig(("def iou(a: " + any_body() + ", b: " + any_body() + ", tolerance: float = 0.001) -> float").c_str()),
      "Intersection over union of two shapes: the common volume divided by the volume of the union, from 0 to 1.");
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
