#include "methods/paper.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <limits>
#include <numbers>
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

/// Vertices and facets of a polytope that approximates a smooth shape from inside, its volume short by the fraction
/// `tolerance` or less; a polytope's own. Half-spaces and rounded hulls have none: std::invalid_argument.
Hull tessellated(const Shape& shape, double tolerance) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return *hull;
  require(!std::holds_alternative<RoundedHull>(shape), "shapes must not be rounded hulls for method 'paper'");
  std::vector<Vec3> points;
  const auto circle = [&](double radius, double z, int n) {
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * i / n;
      points.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  };
  if (const Box* box = std::get_if<Box>(&shape)) {
    for (double x : {-1.0, 1.0})
      for (double y : {-1.0, 1.0})
        for (double z : {-1.0, 1.0})
          points.push_back({x * box->half_extents.x, y * box->half_extents.y, z * box->half_extents.z});
  } else if (const Cylinder* cylinder = std::get_if<Cylinder>(&shape)) {
    // An inscribed n-gon lacks 2/3 (π/n)² of its disc.
    require(tolerance >= 1e-11, "tolerance must be 1e-11 or more where method 'paper' tessellates a cylinder");
    const int n = std::max(8, static_cast<int>(std::ceil(std::numbers::pi * std::sqrt(2 / (3 * tolerance)))));
    circle(cylinder->radius, -cylinder->length / 2, n);
    circle(cylinder->radius, cylinder->length / 2, n);
  } else if (bounded(shape)) {
    // A grid of latitudes and longitudes with the same step s lacks at most about s²/2 of the ball.
    const Capsule* capsule = std::get_if<Capsule>(&shape);
    const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&shape);
    const double radius = ellipsoid ? 1 : core_radius(shape), half = capsule ? capsule->length / 2 : 0;
    // Two latitudes' worth of points per band: beyond a million or so their hull is out of reach.
    require(tolerance >= 1e-5, "tolerance must be 1e-5 or more where method 'paper' tessellates a round shape");
    const int bands = std::max(4, static_cast<int>(std::ceil(std::numbers::pi / std::sqrt(2 * tolerance))));
    points.push_back({0, 0, radius + half});
    points.push_back({0, 0, -radius - half});
    for (int band = 1; band < bands; ++band) {
      const double latitude = std::numbers::pi * (static_cast<double>(band) / bands - 0.5);
      const double r = radius * std::cos(latitude), z = radius * std::sin(latitude);
      const int around = std::max(6, static_cast<int>(std::ceil(2 * bands * std::cos(latitude))));
      if (z <= 0) circle(r, z - half, around);
      if (z >= 0) circle(r, z + half, around);
    }
    if (ellipsoid)
      for (Vec3& p : points) p = scaled(ellipsoid->half_axes, p);
  } else {
    throw std::invalid_argument("a half-space is unbounded and has no vertices");
  }
  return make_hull(points);
}

/// The minimal step of the 26 shifts, as a fraction of the smaller polytope's extent. The text gives no number. Half of
/// a double's digits are spent on getting off the boundary, half are left to the dual points.
constexpr double kMinimalStep = 0x1p-26;

/// A polytope on the way up the tree, in the common coordinates, and the body that each of its facets came from.
struct Part {
  std::shared_ptr<const HullData> hull;
  std::vector<int> owner;
};

/// Nothing, or a polytope, or less than a solid.
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

/// A cube in the half-space, one face in its plane, that holds all of it that the other bodies can reach.
Hull stand_in(const Plane& plane, std::span<const Placed> bodies) {
  double reach = 0;
  for (const Placed& body : bodies) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    reach = std::max(reach, norm(max(abs(box.lower), abs(box.upper))));
  }
  if (reach == 0) throw std::invalid_argument("shapes must have a bounded one among them for method 'paper'");
  const Vec3 n = plane.normal, u = any_orthogonal(n), v = cross(n, u);
  // A plane farther away than that cuts off all or nothing, and the cube would be a needle.
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

/// The planes through the vertex dual to a face of the first hull: its own three, and where more planes meet in one
/// point, those of the faces around it that have the same dual.
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

/// The source plane that a facet of the second hull lies in: of those through its corners, the one that all corners fit
/// best. `tried` has an element per plane, -1 before the first call.
int plane_of_facet(const HullData& hull, int facet, std::span<const std::vector<int>> planes_at,
                   std::span<const Plane> planes, std::span<int> tried) {
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int corner : hull.facet(facet)) {
    for (int p : planes_at[corner]) {
      // Once for all corners that it passes through, and no further than up to one that it misses.
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

/// Steps 3 to 5: the dual points of all planes about `origin`, their hull, the dual of its faces, and the hull of
/// those.
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
  // So thin that rounding has put its centre outside: there is no solid to speak of.
  for (const Plane& plane : hull->planes)
    if (!(signed_distance(plane, hull->centroid) < 0)) return {Status::kTouching, {}};
  std::vector<std::vector<int>> planes_at;
  for (int s : source)
    planes_at.push_back(planes_through(dual, face_of[s], vertex_of_face, 64 * rounding(extent_of_vertices)));
  Part part = placed_part({hull}, {{}, hull->origin}, -1);
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

/// What another thread computes, which ends early if `given_up` tells it to.
Intersection wait_for(std::future<Intersection>& answer, std::atomic<bool>& given_up) {
  try {
    while (answer.wait_for(cancellation::kPatience) == std::future_status::timeout) cancellation::look_at_clock();
    return answer.get();
  } catch (const Cancelled&) {
    given_up = true;
    throw;
  }
}

/// Step 6. A level's pairs run side by side; a body without a partner waits for the next level.
Intersection intersect_tree(std::vector<Part> parts) {
  while (parts.size() > 1) {
    std::atomic<bool> given_up{false};
    std::vector<std::future<Intersection>> pairs;
    for (size_t i = 0; i + 1 < parts.size(); i += 2) {
      // The last pair of a level is computed here, when it is asked for, so that one pair alone costs no thread.
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

}  // namespace

PaperResult intersect_as_in_paper(std::span<const Placed> bodies, double tolerance) {
  std::vector<Part> parts;
  int planes = 0;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const Placed& body = bodies[i];
    if (const HalfSpace* half = std::get_if<HalfSpace>(&body.shape)) {
      const Hull box = stand_in(body.pose * half->plane, bodies);
      parts.push_back(placed_part(box, {{}, box.data->origin}, i));
    } else {
      const Hull hull = tessellated(body.shape, tolerance);
      parts.push_back(placed_part(hull, body.pose, i));
    }
    planes += static_cast<int>(parts.back().owner.size());
  }
  Intersection common = intersect_tree(std::move(parts));
  PaperResult result{common.status, std::nullopt};
  if (common.status != Status::kOverlapping) return result;
  result.region = region_of(common.part);
  result.region->facets_touched = planes;
  // So thin that rounding has turned it inside out: there is no solid to speak of.
  if (!(measure(*result.region, bodies).measures.volume > 0)) return {Status::kTouching, std::nullopt};
  return result;
}

}  // namespace overlapper
