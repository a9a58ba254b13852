#include "methods/paper.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <limits>
#include <stdexcept>
#include <thread>
#include <unordered_set>
#include <utility>

#include "distance/gjk.h"
#include "geometry/cancellation.h"
#include "geometry/expanding_hull.h"
#include "geometry/polytope.h"
#include "geometry/predicates.h"
#include "geometry/rounding.h"
#include "shapes/limits.h"

namespace overlapper {
namespace {

/// The minimal step of the 26 shifts, as a fraction of the smaller polytope's extent. The article gives no number. Half
/// of a double's digits go into leaving the boundary; half remain for the dual points.
constexpr double kMinimalStep = 0x1p-26;

/// A polytope of the tree in the common coordinates, with the source body of each facet.
struct Part {
  std::shared_ptr<const HullData> hull;
  std::vector<int> owner;
};

/// A polytope, an empty set, or a flat set.
struct Intersection {
  Status status = Status::kSeparated;
  Part part;
};

Part placed_part(const Hull& hull, const Pose& pose, int owner) {
  auto data = std::make_shared<HullData>(*hull.data);
  for (Vec3& v : data->vertices) v = pose * v;
  for (Plane& p : data->planes) p = pose * p;
  data->centroid = pose * data->centroid;
  data->origin = {};
  return {data, std::vector<int>(data->planes.size(), owner)};
}

/// A cube in the half-space with one face in its plane. It contains the part of the half-space that the other bodies
/// can reach.
Hull stand_in(const Plane& plane, std::span<const Placed> bodies) {
  double reach = 0;
  for (const Placed& body : bodies) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    reach = std::max(reach, norm(max(abs(box.lower), abs(box.upper))));
  }
  if (reach == 0) throw std::invalid_argument("shapes must include a bounded shape for method 'paper'");
  const Vec3 n = plane.normal, u = any_orthogonal(n), v = cross(n, u);
  // A plane farther away cuts off all or nothing, and the cube would be a needle.
  const double offset = std::clamp(plane.offset, -2 * reach, 2 * reach), depth = std::max(0.0, reach + offset);
  std::vector<Vec3> corners;
  for (double a : {-2.0, 2.0})
    for (double b : {-2.0, 2.0})
      for (double c : {0.0, -2 * depth - reach}) corners.push_back(a * reach * u + b * reach * v + (offset + c) * n);
  return make_hull(corners);
}

double extent(const HullData& hull) {
  Vec3 lower = hull.vertices[0], upper = lower;
  for (Vec3 v : hull.vertices) lower = min(lower, v), upper = max(upper, v);
  return max_component(upper - lower);
}

double least_slack(const Part& a, const Part& b, Vec3 point) {
  double least = std::numeric_limits<double>::infinity();
  for (const Part* part : {&a, &b})
    for (const Plane& p : part->hull->planes) least = std::min(least, -signed_distance(p, point));
  return least;
}

/// Step 2. False if the point stays on the boundary.
bool shift_inside(const Part& a, const Part& b, double on_boundary, Vec3& point) {
  if (least_slack(a, b, point) > on_boundary) return true;
  const double step = kMinimalStep * std::min(extent(*a.hull), extent(*b.hull));
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        const Vec3 direction{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        const Vec3 shifted = point + step * unit(direction);
        if (least_slack(a, b, shifted) <= on_boundary) continue;
        point = shifted;
        return true;
      }
  return false;
}

/// The planes through the vertex dual to a face of the first hull: the three planes of the face. If more planes meet in
/// that point, also the planes of neighbouring faces with the same dual.
std::vector<int> planes_through(const ExpandingHull& dual, int face, std::span<const Vec3> vertex_of_face,
                                double same) {
  std::vector<int> planes, stack{face};
  std::unordered_set<int> seen{face};
  while (!stack.empty()) {
    cancellation_point();
    const ExpandingHull::Facet& facet = dual.facets[stack.back()];
    stack.pop_back();
    planes.insert(planes.end(), facet.vertex.begin(), facet.vertex.end());
    for (int other : facet.neighbour)
      if (norm(vertex_of_face[other] - vertex_of_face[face]) <= same && seen.insert(other).second)
        stack.push_back(other);
  }
  std::sort(planes.begin(), planes.end());
  planes.erase(std::unique(planes.begin(), planes.end()), planes.end());
  return planes;
}

/// The source plane of a facet of the second hull: of the planes through its corners, the best fit for all corners.
/// `tried` has an element per plane, -1 before the first call.
int plane_of_facet(const HullData& hull, int facet, std::span<const std::vector<int>> planes_at,
                   std::span<const Plane> planes, std::span<int> tried) {
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int corner : hull.facet(facet)) {
    for (int p : planes_at[corner]) {
      // Tries each plane once, and stops at the first corner that misses it.
      if (std::exchange(tried[p], facet) == facet) continue;
      double misfit = 0;
      const auto ring = hull.facet(facet);
      for (size_t i = 0; i < ring.size() && misfit < least; ++i)
        misfit = std::max(misfit, std::abs(signed_distance(planes[p], hull.vertices[ring[i]] + hull.origin)));
      if (misfit < least) least = misfit, best = p;
    }
  }
  return best;
}

/// Steps 3 to 5: the dual points of all planes about `origin`, their hull, the dual points of its faces, and the hull
/// of these.
Intersection intersect_about(const Part& a, const Part& b, Vec3 origin) {
  ExpandingHull dual;
  std::vector<Plane> planes;
  std::vector<int> owner;
  for (const Part* part : {&a, &b}) {
    planes.insert(planes.end(), part->hull->planes.begin(), part->hull->planes.end());
    owner.insert(owner.end(), part->owner.begin(), part->owner.end());
  }
  for (const Plane& plane : planes) dual.points.push_back(polar_dual(plane, origin));
  if (!dual.build()) return {Status::kTouching, {}};

  std::vector<Vec3> vertices, vertex_of_face(dual.facets.size());
  std::vector<int> face_of;
  double extent_of_vertices = 0;
  for (int f = 0; f < static_cast<int>(dual.facets.size()); ++f) {
    if (dual.facets[f].removed()) continue;
    const auto [i, j, k] = dual.facets[f].vertex;
    const Vec3 relative = polar_vertex(dual.points[i], dual.points[j], dual.points[k]);
    if (!finite(relative)) return {Status::kTouching, {}};
    vertex_of_face[f] = origin + relative;
    vertices.push_back(vertex_of_face[f]);
    face_of.push_back(f);
    extent_of_vertices = std::max(extent_of_vertices, norm(relative));
  }
  std::vector<int> source;
  const auto hull = hull_of(vertices, &source);
  if (!hull) return {Status::kTouching, {}};
  // If rounding has put the centre of a thin polytope outside, it counts as flat.
  for (const Plane& plane : hull->planes)
    if (!(signed_distance(plane, hull->centroid) < 0)) return {Status::kTouching, {}};
  std::vector<std::vector<int>> planes_at;
  for (int s : source)
    planes_at.push_back(planes_through(dual, face_of[s], vertex_of_face, 64 * rounding(extent_of_vertices)));
  Part part = placed_part(Hull(hull), {{}, hull->origin}, -1);
  std::vector<int> tried(planes.size(), -1);
  for (int f = 0; f < static_cast<int>(part.owner.size()); ++f) {
    cancellation_point();
    part.owner[f] = owner[plane_of_facet(*hull, f, planes_at, planes, tried)];
  }
  return {Status::kOverlapping, std::move(part)};
}

Intersection intersect(const Part& a, const Part& b) {
  const Placed placed_a = make_placed(Hull{a.hull}, {}, {}), placed_b = make_placed(Hull{b.hull}, {}, {});
  const Separation gjk = separate_cores(placed_a, placed_b);
  double magnitude = 0;
  for (const Part* part : {&a, &b})
    for (Vec3 v : part->hull->vertices) magnitude = std::max(magnitude, max_component(abs(v)));
  if (!gjk.origin_inside) return {gjk.gap > rounding(magnitude) ? Status::kSeparated : Status::kTouching, {}};
  Vec3 point = gjk.simplex.witness_a();
  if (!shift_inside(a, b, rounding(magnitude), point)) return {Status::kTouching, {}};
  return intersect_about(a, b, point);
}

/// The result of another thread; the wait ends early if `given_up` is set.
Intersection wait_for(std::future<Intersection>& answer, std::atomic<bool>& given_up) {
  try {
    while (answer.wait_for(cancellation::kPatience) == std::future_status::timeout) cancellation::look_at_clock();
    return answer.get();
  } catch (const Cancelled&) {
    given_up = true;
    throw;
  }
}

/// Step 6. The pairs of a level run in parallel; a body without a partner waits for the next level.
Intersection intersect_tree(std::vector<Part> parts) {
  while (parts.size() > 1) {
    std::atomic<bool> given_up{false};
    std::vector<std::future<Intersection>> pairs;
    for (size_t i = 0; i + 1 < parts.size(); i += 2) {
      // The last pair of a level runs on this thread, on demand: one pair alone needs no thread.
      const auto policy = i + 3 < parts.size() ? std::launch::async : std::launch::deferred;
      pairs.push_back(std::async(policy, [&, i, asking = std::this_thread::get_id()] {
        if (std::this_thread::get_id() != asking) cancellation::given_up = &given_up;
        return intersect(parts[i], parts[i + 1]);
      }));
    }
    std::vector<Part> next;
    Status worst = Status::kOverlapping;
    for (auto pair = pairs.rbegin(); pair != pairs.rend(); ++pair) {
      Intersection common = wait_for(*pair, given_up);
      worst = std::min(worst, common.status);
      next.push_back(std::move(common.part));
    }
    if (worst != Status::kOverlapping) return {worst, {}};
    std::reverse(next.begin(), next.end());
    if (parts.size() % 2 == 1) next.push_back(parts.back());
    parts = std::move(next);
  }
  return {Status::kOverlapping, std::move(parts[0])};
}

Region region_of(const Part& part) {
  const HullData& hull = *part.hull;
  Region region;
  region.frame.origin = hull.centroid;
  double magnitude = 0;
  for (Vec3 v : hull.vertices) {
    region.polytope.vertices.push_back(v - hull.centroid);
    magnitude = std::max(magnitude, norm(v));
  }
  region.polytope.ring = hull.ring;
  region.polytope.ring_start = hull.ring_start;
  for (int f = 0; f < static_cast<int>(hull.planes.size()); ++f) {
    region.polytope.dual.push_back(polar_dual(hull.planes[f], hull.centroid));
    region.polytope.plane.push_back(f);
    region.facets.push_back(
        {hull.planes[f].normal, -signed_distance(hull.planes[f], hull.centroid), rounding(magnitude), part.owner[f]});
  }
  region.inner.assign(hull.vertices.size(), 1);
  return region;
}

/// The status of bodies if one of them is thinner than the rounding of its corners. The article has no polytope for
/// that body. Only a gap between two bodies can then be proved.
Status status_without_polytopes(std::span<const Placed> bodies) {
  for (const Placed& a : bodies)
    for (const Placed& b : bodies) {
      if (&a == &b || !bounded(a.shape)) continue;
      const double apart = norm(a.pose.translation - b.pose.translation);
      const double size = reach(a, reach(b, apart + reach(a.shape) + reach(b.shape)));
      if (distance(a, b).gap > doubt(size)) return Status::kSeparated;
    }
  return Status::kTouching;
}

}  // namespace

PaperResult intersect_as_in_paper(std::span<const Placed> bodies, double tolerance) {
  std::vector<Part> parts;
  int planes = 0;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const Placed& body = bodies[i];
    if (const Plane* plane = only_plane(body.shape)) {
      const Hull box = stand_in(body.pose * *plane, bodies);
      parts.push_back(placed_part(box, {{}, box.data->origin}, i));
    } else {
      const Hull hull = inscribed(body.shape, tolerance);
      if (!hull.data) return {status_without_polytopes(bodies), std::nullopt};
      parts.push_back(placed_part(hull, body.pose, i));
    }
    planes += static_cast<int>(parts.back().owner.size());
  }
  Intersection common = intersect_tree(std::move(parts));
  PaperResult result{common.status, std::nullopt};
  if (common.status != Status::kOverlapping) return result;
  result.region = region_of(common.part);
  result.region->facets_touched = planes;
  // If rounding has turned a thin polytope inside out, it counts as flat.
  const Measures measures = measure(*result.region, bodies).measures;
  if (!(measures.volume > 0 && measures.area > 0)) return {Status::kTouching, std::nullopt};
  return result;
}

}  // namespace overlapper
