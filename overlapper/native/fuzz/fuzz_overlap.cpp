// A harness of libFuzzer for overlaps of two to four shapes. Every quantity of their overlap is computed and checked.
// With OVERLAPPER_FUZZ_PRINT set, it first prints the shapes as Python.

#include "fuzz/fuzzer.h"
#include "overlap/overlap.h"

namespace overlapper {
namespace {

// ---------------------------------------------------------------------------------------------------- bodies to Python

void print(double value) { std::fprintf(stderr, "%.17g", value); }
void print(Vec3 v) { std::fprintf(stderr, "(%.17g, %.17g, %.17g)", v.x, v.y, v.z); }
void print(const Hull& h) {
  std::fprintf(stderr, "[");
  for (Vec3 v : h.data->vertices) print(v + h.data->origin), std::fprintf(stderr, ", ");
  std::fprintf(stderr, "]");
}

template <class... Arguments>
void print_call(const char* name, const Arguments&... arguments) {
  std::fprintf(stderr, "%s(", name);
  ((print(arguments), std::fprintf(stderr, ", ")), ...);
  std::fprintf(stderr, ")");
}

template <class S>
void print_shape(const S& shape) {
  std::apply([&](const auto&... field) { print_call(S::kName, shape.*field.member...); }, S::fields());
}
void print_shape(const Hull& hull) { print_call(Hull::kName, hull); }
void print_shape(const RoundedHull& hull) { print_call(RoundedHull::kName, hull.core, hull.radius); }

void print(const std::vector<Placed>& bodies, double tolerance, const char* method) {
  std::fprintf(stderr, "overlap(");
  for (const Placed& body : bodies) {
    const Quaternion q = body.orientation;
    std::fprintf(stderr, "Placed("), ask(body.shape, [](const auto& s) { print_shape(s); }), std::fprintf(stderr, ", "),
        print(body.position);
    std::fprintf(stderr, ", (%.17g, %.17g, %.17g, %.17g)), ", q.x, q.y, q.z, q.w);
  }
  std::fprintf(stderr, "tolerance=%.17g, method='%s')\n", tolerance, method);
}

// ------------------------------------------------------------------------------------------------------------ invariants

bool sound(double value) { return std::isfinite(value) && value >= 0; }

bool any_bounded(std::span<const Placed> bodies) {
  return std::any_of(bodies.begin(), bodies.end(), [](const Placed& b) { return bounded(b.shape); });
}

/// How far the bounded bodies reach from the origin.
double extent(std::span<const Placed> bodies) {
  double reach = 0;
  for (const Placed& body : bodies) {
    reach = std::max(reach, norm(body.position));
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    reach = std::max(reach, norm(max(abs(box.lower), abs(box.upper))));
  }
  return reach;
}

void check_volume(const Overlap& overlap) {
  const double volume = overlap.volume(), error = overlap.volume_error();
  require(sound(volume), "the volume is finite and not negative");
  require(error >= 0, "the error of the volume is not negative");
  require(std::isfinite(error) || !any_bounded(overlap.bodies()), "the error of the volume is finite");
  if (overlap.status() == Status::kSeparated && overlap.method() == Method::kAuto)
    require(error == 0, "separated bodies have nothing in common for certain");
  for (const Placed& body : overlap.bodies()) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(make_placed(body.shape, {}, {}));
    const double own_rounding = 0x1p-46 * std::pow(norm(box.upper - box.lower), 3);
    require(volume - error <= overlapper::volume(body.shape) + own_rounding,
            "the common part is no larger than a body");
  }
}

void check_region(const Region& region, bool simple) {
  const Polytope& p = region.polytope;
  const int vertices = static_cast<int>(p.vertices.size()), edges = static_cast<int>(p.ring.size()) / 2;
  require(vertices - edges + p.facets() == 2, "Euler's formula for the region");
  if (simple) require(p.ring.size() == 3 * p.vertices.size(), "every vertex lies on three facets");
  for (Vec3 v : p.vertices) require(finite(region.to_world(v)), "the region's vertices are finite");
  for (double t : region.inner) require(t >= 0 && t <= 1, "vertices are pulled inwards");
}

void check_measures(const Overlap& overlap) {
  const double area = overlap.area();
  const Mat3 inertia = overlap.inertia();
  require(overlap.volume() > 0 && area > 0 && std::isfinite(area), "an overlap has a volume and a surface");
  require(finite(overlap.centroid()), "the centroid is finite");
  for (Vec3 row : {inertia.row0, inertia.row1, inertia.row2}) require(finite(row), "the inertia is finite");
}

void check_boundary(const Boundary& boundary, int bodies, Method method) {
  const int facets = static_cast<int>(boundary.planes.size()), vertices = static_cast<int>(boundary.vertices.size());
  require(boundary.ring.size() % 2 == 0 && boundary.owner.size() == boundary.planes.size(), "facets are complete");
  // The article's second hull merges facets that are coplanar but for rounding. A thin body may have no other facets.
  const bool closed = vertices - static_cast<int>(boundary.ring.size()) / 2 + facets == 2;
  require(closed || method == Method::kPaper, "Euler's formula for the surface");
  for (int v : boundary.ring) require(v >= 0 && v < vertices, "facets refer to vertices");
  for (int owner : boundary.owner) require(owner >= 0 && owner < bodies, "facets have an owner");
  for (const auto& polygon : boundary.patch) {
    require(polygon.size() >= 3, "the patch consists of polygons");
    for (Vec3 v : polygon) require(finite(v), "the patch is finite");
  }
}

void check_patch(const Patch& patch) {
  require(finite(patch.area), "the area of the patch is finite");
  for (Vec3 row : {patch.moments.row0, patch.moments.row1, patch.moments.row2})
    require(finite(row), "the moments of the patch are finite");
  require(std::isnan(patch.distance) ? std::isnan(patch.centre.x) : finite(patch.centre) && sound(patch.distance),
          "where there is a patch, it has a centre and a distance");
}

void check_contact(const Overlap& overlap) {
  const Contact& c = overlap.contact();
  const Placed &a = overlap.bodies()[0], &b = overlap.bodies()[1];
  require(std::abs(norm(c.normal) - 1) < 1e-12, "the normal has length one");
  require(sound(c.depth) && sound(c.distance), "depth and distance are finite and not negative");
  const ContactErrors& e = overlap.contact_errors();
  require(sound(e.depth) && sound(e.distance) && sound(e.witnesses), "errors are finite and not negative");
  if (overlap.status() == Status::kOverlapping) return;
  require(finite(c.witness_a) && finite(c.witness_b), "the witness points are finite");
  require(finite(c.separating.normal) && std::isfinite(c.separating.offset), "the separating plane is finite");
  const double rounding = 0x1p-46 * extent(overlap.bodies());
  // Method "paper" may report bodies as separated that are not.
  if (overlap.status() != Status::kSeparated || overlap.method() == Method::kPaper) return;
  require(c.distance > 0, "separated bodies are apart");
  if (bounded(a.shape))
    require(signed_distance(c.separating, a.support(-c.normal)) >= -rounding,
            "the separating plane has a on its far side");
  if (bounded(b.shape))
    require(signed_distance(c.separating, b.support(c.normal)) <= rounding,
            "the separating plane has b on its near side");
}

/// The forces are the area vectors of a closed surface, so they sum to zero.
void check_gradient(const Overlap& overlap) {
  Vec3 sum;
  for (const auto& row : overlap.gradient()) {
    for (double slope : row) require(std::isfinite(slope), "the gradient is finite");
    sum += {row[0], row[1], row[2]};
  }
  if (overlap.method() == Method::kAuto) require(norm(sum) <= 0x1p-40 * overlap.area(), "the area vectors sum to zero");
}

void check_errors(const Overlap& overlap) {
  const Errors& e = overlap.errors();
  for (double error : {e.volume, e.area, e.centroid, e.inertia, overlap.vertices_error()})
    require(sound(error), "errors are finite and not negative");
  for (const auto& [force, moment] : e.gradient)
    require(sound(force) && sound(moment), "the errors of the gradient are finite and not negative");
  require(e.volume == overlap.volume_error(), "the error of the volume is that of the volume");
}

void check(const Overlap& overlap) {
  check_volume(overlap);
  if (any_bounded(overlap.bodies())) check_errors(overlap);
  if (overlap.status() == Status::kOverlapping) {
    check_region(overlap.region(), overlap.method() == Method::kAuto);
    check_measures(overlap);
    check_gradient(overlap);
    check_boundary(overlap.boundary(), static_cast<int>(overlap.bodies().size()), overlap.method());
  }
  if (overlap.pair()) check_contact(overlap);
  if (overlap.pair() && any_bounded(overlap.bodies())) check_patch(overlap.patch());
}

void check_order(const Overlap& overlap) {
  const Overlap reversed({overlap.bodies().rbegin(), overlap.bodies().rend()}, overlap.tolerance(), overlap.method());
  require(reversed.status() == overlap.status(), "the status does not depend on the order");
  if (!any_bounded(overlap.bodies())) return;
  require(std::abs(reversed.volume() - overlap.volume()) <= reversed.volume_error() + overlap.volume_error(),
          "the volumes of two orders agree within their bounds");
}

void run(Decoder& decoder) {
  const Method method = decoder.integer(0, 3) == 0 ? Method::kPaper : Method::kAuto;
  const double tolerance = decoder.tolerance();
  const std::vector<Placed> bodies = decoder.bodies();
  if (std::getenv("OVERLAPPER_FUZZ_PRINT")) print(bodies, tolerance, method == Method::kPaper ? "paper" : "auto");
  try {
    const Overlap overlap(bodies, tolerance, method);
    check(overlap);
    if (method == Method::kAuto) check_order(overlap);
  } catch (const std::invalid_argument& refusal) {
    require(may_be_refused(bodies, method == Method::kPaper), refusal.what());
  }
}

}  // namespace
}  // namespace overlapper
