#include "shapes/rounded_hull.h"

#include <algorithm>
#include <cfloat>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "geometry/cancellation.h"
#include "shapes/cutter.h"
#include "shapes/limits.h"
#include "shapes/sphere.h"
#include "shapes/wide_body.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Up to so many facets, a scan takes no longer than a tree.
constexpr size_t kMostScanned = 64;

bool scanned(const HullData& hull) { return !hull.graph || hull.ring.size() <= 6 * kMostScanned; }

/// The nearest point of the core to a point outside the core. It lies on a facet that the point sees.
Foot foot(const RoundedHull& rounded, Vec3 x) {
  const HullData& hull = *rounded.core.data;
  Foot nearest{x, {}, kInfinity};
  if (scanned(hull)) {
    for (int f = 0; f < static_cast<int>(hull.planes.size()); ++f) {
      const double height = signed_distance(hull.planes[f], x);
      if (height <= 0 || height * height >= nearest.height2) continue;
      const Foot found = foot_on_part(hull, whole_facet(hull, f), x);
      if (found.height2 < nearest.height2) nearest = found;
    }
    return nearest;
  }
  // The surface towards the centroid is not nearer, but for rounding.
  const double from_centroid = norm(x - hull.centroid);
  const double rounding = 64 * DBL_EPSILON * (from_centroid + hull.radius) / hull.graph->inradius;
  double gauge;
  hull.graph->facet_towards(hull, x, gauge);
  if (gauge < 1 - rounding) return nearest;
  const double within = from_centroid * (std::max(0.0, 1 - 1 / gauge) + rounding);
  const FacetTree& tree = rounded.parts->get([&] { return FacetTree(hull); });
  nearest = tree.foot(hull, x, within * within);
  if (gauge > 1 + rounding && !(norm2(nearest.outward) > 0)) nearest = tree.foot(hull, x, kInfinity);
  return nearest;
}

Plane highest_plane(const HullData& hull, Vec3 point) {
  const Plane* highest = &hull.planes[0];
  for (const Plane& plane : hull.planes)
    if (signed_distance(plane, point) > signed_distance(*highest, point)) highest = &plane;
  return *highest;
}

/// The sums over ridges and corners of a polytope in Steiner's formula.
struct Steiner {
  double area = 0, mean_width = 0;  ///< m², m: the volume is V + area r + mean_width r² + 4/3 π r³
  Vec3 of_facets, of_edges, of_corners;
};

Steiner steiner(const HullData& hull) {
  Steiner sums;
  std::vector<double> defect(hull.vertices.size(), 2 * std::numbers::pi);
  for (int f = 0; f < static_cast<int>(hull.planes.size()); ++f) {
    const auto ring = hull.facet(f);
    const Vec3 apex = hull.vertices[ring[0]];
    for (size_t i = 0; i < ring.size(); ++i) {
      const Vec3 a = hull.vertices[ring[(i + ring.size() - 1) % ring.size()]], b = hull.vertices[ring[i]],
                 c = hull.vertices[ring[(i + 1) % ring.size()]];
      defect[ring[i]] -= std::atan2(norm(cross(a - b, c - b)), dot(a - b, c - b));
      const double area = dot(cross(b - apex, c - apex), hull.planes[f].normal) / 2;
      sums.area += area;
      sums.of_facets += area / 3 * (apex + b + c);
    }
  }
  for (const Edge& edge : hull.edges) {
    const Vec3 a = hull.vertices[edge.from], b = hull.vertices[edge.to];
    const Vec3 left = hull.planes[edge.left].normal, right = hull.planes[edge.right].normal;
    const double sine = norm(cross(left, right)), cosine = dot(left, right), angle = std::atan2(sine, cosine);
    const double length = norm(b - a);
    sums.mean_width += length * angle / 2;
    sums.of_edges += length * angle / 2 * ((a + b) / 2);
    // The sum of the outward directions across the ridge: the sum of the normals times the tangent of half the angle.
    sums.of_corners += length / 3 * sine / (1 + cosine) * (left + right);
  }
  // The solid angle of the normals at a corner is a full turn less the angles of its facets.
  for (size_t v = 0; v < defect.size(); ++v) sums.of_corners += defect[v] / 3 * hull.vertices[v];
  return sums;
}

}  // namespace

RoundedHull make_rounded_hull(std::span<const Vec3> points, double radius) {
  RoundedHull rounded{make_hull(points), Sphere::make(radius).radius};
  if (rounded.core.data->edges.empty())
    throw std::invalid_argument("vertices must not be so flat that rounding errors leave no edges");
  return rounded;
}

double RoundedHull::volume() const {
  const Steiner sums = steiner(*core.data);
  const double r = radius;
  return core.data->volume + r * (sums.area + r * (sums.mean_width + r * (4.0 / 3.0) * std::numbers::pi));
}

Vec3 RoundedHull::centroid() const {
  const Steiner sums = steiner(*core.data);
  const double r = radius;
  const Vec3 moment =
      core.data->volume * core.data->centroid + r * (sums.of_facets + r * (sums.of_edges + r * sums.of_corners));
  return moment / volume();
}

Plane RoundedHull::tightest(Vec3 point) const {
  const Foot nearest = foot(*this, point);
  if (norm2(nearest.outward) > 0) return supporting(nearest.outward);
  Plane plane = highest_plane(*core.data, point);
  plane.offset += radius;
  return plane;
}

Plane RoundedHull::supporting(Vec3 outward) const {
  const Vec3 normal = unit(outward);
  return {normal, dot(normal, core.support(normal)) + radius};
}

/// Newton's method from outside for the distance from the core along the ray, which is a convex function. Every step is
/// the exit through a supporting plane, so no step passes the surface.
Plane RoundedHull::ray_exit(Vec3 origin, Vec3 direction) const {
  const auto leave = [&](const Plane& plane) {
    const double rate = dot(plane.normal, direction);
    return rate > 0 ? -signed_distance(plane, origin) / rate : kInfinity;
  };
  Plane exit{};
  double t = kInfinity;
  if (scanned(*core.data)) {
    for (Plane plane : core.data->planes) {
      plane.offset += radius;
      if (leave(plane) < t) t = leave(plane), exit = plane;
    }
  } else {
    exit = supporting(direction), t = leave(exit);
    // The plane where the ray leaves the core is nearer.
    const HullGraph& graph = *core.data->graph;
    double gauge, rate;
    graph.facet_towards(*core.data, origin, gauge);
    if (gauge < 1 - 0x1p-20) {
      Plane plane = core.data->planes[graph.ray_exit(*core.data, origin, direction, rate)];
      plane.offset += radius;
      if (leave(plane) < t) t = leave(plane), exit = plane;
    }
  }
  constexpr int kMostSteps = 64;
  for (int step = 0; step < kMostSteps; ++step) {
    const Foot nearest = foot(*this, origin + t * direction);
    if (!(norm2(nearest.outward) > 0)) break;
    const Plane plane = supporting(nearest.outward);
    const double sooner = leave(plane);
    if (!(sooner < t)) break;
    exit = plane;
    if (sooner >= t * (1 - 2 * DBL_EPSILON)) break;
    t = sooner;
  }
  return exit;
}

void RoundedHull::append_planes(std::vector<Plane>& planes) const {
  for (const Plane& plane : core.data->planes) planes.push_back({plane.normal, plane.offset + radius});
}

namespace {

WidePlane wide_supporting(const RoundedHull& hull, Vec3 outward) {
  const WideVector normal = unit(wide(outward));
  return {normal, dot(normal, hull.wide_core_support(normal)) + DoubleDouble{hull.radius}};
}

}  // namespace

WidePlane RoundedHull::wide_ray_exit(const WideVector& origin, const WideVector& direction) const {
  return wide_supporting(*this, ray_exit(rounded(origin), rounded(direction)).normal);
}

WidePlane RoundedHull::wide_tightest(const WideVector& point, const WideTriangles&) const {
  return wide_supporting(*this, tightest(rounded(point)).normal);
}

void RoundedHull::append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) const {
  body.append_triangles(radius, planes);
}

namespace {

/// Cuts what surrounds the core. Parts that the region does not reach are left out.
class RoundedCutter {
 public:
  RoundedCutter(const RoundedHull& rounded, Cutter& cutter)
      : core_(rounded.core),
        hull_(*core_.data),
        radius_(rounded.radius),
        cutter_(cutter),
        near_(cutter.region(radius_)) {}

  /// A prism on the facet.
  void cut_facet(int f) {
    const auto ring = hull_.facet(f);
    const Plane& plane = hull_.planes[f];
    if (!near(ring)) return;
    if (inexact(f)) charge_corners(ring, plane.normal);
    if (cutter_.beyond({plane.normal, plane.offset + radius_}) || cutter_.beyond({-plane.normal, -plane.offset}))
      return;
    cutter_.begin();
    const auto [normal, offset] = core_.plane_through_corners(f);
    cutter_.cut({-normal, -offset});
    cutter_.face({normal, offset + DoubleDouble{radius_}});
    for (size_t i = 0; i < ring.size() && !cutter_.empty(); ++i) {
      const Vec3 a = hull_.vertices[ring[i]], b = hull_.vertices[ring[(i + 1) % ring.size()]];
      cut_through(unit(cross(wide_difference(b, a), normal)), a);
    }
    cutter_.end();
  }

  /// A wedge of a cylinder along the edge.
  void cut_edge(const Edge& edge) {
    const Vec3 a = hull_.vertices[edge.from], b = hull_.vertices[edge.to], way = unit(b - a);
    const Vec3 out_left = hull_.planes[edge.left].normal, out_right = hull_.planes[edge.right].normal;
    if (beyond(way, b) || beyond(-way, a) || beyond(cross(out_left, way), a) || beyond(cross(way, out_right), a))
      return;
    if (inexact(edge.left) || inexact(edge.right)) charge_fold(dot(cross(out_left, out_right), way), norm(b - a));
    const WideVector between = wide_difference(b, a), along = unit(between);
    cutter_.begin();
    cutter_.cylinder(DoubleDouble{0.5} * (wide(a) + wide(b)), along, radius_, rounded(norm(between)) / 2);
    cut_through(-along, a);
    cut_through(along, b);
    // Seen from outside, the left facet is on the left of the edge, so the direction beyond it is the opposite one.
    if (!cutter_.empty()) cut_through(unit(cross(core_.plane_through_corners(edge.left).normal, along)), a);
    if (!cutter_.empty()) cut_through(unit(cross(along, core_.plane_through_corners(edge.right).normal)), a);
    cutter_.end();
  }

  /// A wedge of a ball at a vertex. `beside` has the vertex with each vertex that it shares an edge with.
  void cut_vertex(std::span<const std::pair<int, int>> beside) {
    const Vec3 vertex = hull_.vertices[beside[0].first];
    for (const auto& [_, other] : beside)
      if (beyond(unit(hull_.vertices[other] - vertex), vertex)) return;
    cutter_.begin();
    cutter_.ball(wide(vertex), radius_);
    for (const auto& [_, other] : beside) cut_through(unit(wide_difference(hull_.vertices[other], vertex)), vertex);
    cutter_.end();
  }

  bool near(std::span<const int> vertices) const {
    Vec3 lower = hull_.vertices[vertices[0]], upper = lower;
    for (const int v : vertices.subspan(1)) {
      lower = min(lower, hull_.vertices[v]), upper = max(upper, hull_.vertices[v]);
    }
    return lower.x <= near_.upper.x && lower.y <= near_.upper.y && lower.z <= near_.upper.z &&
           upper.x >= near_.lower.x && upper.y >= near_.lower.y && upper.z >= near_.lower.z;
  }

 private:
  bool beyond(Vec3 normal, Vec3 point) const { return cutter_.beyond({normal, dot(normal, point)}); }
  bool inexact(int f) const { return hull_.facet_corners[f][0] < 0; }

  /// A prism ends along the normal of its facet. The ball at a corner ends across the two edges there. If the plane of
  /// the facet does not contain these edges, the pieces differ by the area between the normal and the great circles of
  /// both ends on the unit sphere.
  void charge_corners(std::span<const int> ring, Vec3 normal) {
    for (size_t i = 0; i < ring.size(); ++i) {
      const Vec3 at = hull_.vertices[ring[i]];
      const Vec3 before = unit(hull_.vertices[ring[(i + ring.size() - 1) % ring.size()]] - at);
      const Vec3 after = unit(hull_.vertices[ring[(i + 1) % ring.size()]] - at);
      const double tilt = std::abs(dot(normal, before)) + std::abs(dot(normal, after)) + 4 * DBL_EPSILON;
      const double sine = norm(cross(before, after)), sphere = 4 * std::numbers::pi;
      const double solid_angle = tilt * tilt < sphere * sine ? tilt * tilt / sine : sphere;
      cutter_.gap(solid_angle * radius_ * radius_ * radius_ / 3, solid_angle * radius_ * radius_);
    }
  }
  /// If the planes of two facets turn inwards at their edge, both prisms, and the core and the wedge of the cylinder,
  /// share a sector.
  void charge_fold(double sine, double length) {
    if (!(sine < 0)) return;
    const double sector = -sine * radius_ * length;
    cutter_.gap(sector * radius_, 2 * sector);
  }
  void cut_through(const WideVector& normal, Vec3 point) { cutter_.cut({normal, dot(normal, wide(point))}); }

  const Hull& core_;
  const HullData& hull_;
  double radius_;
  Cutter& cutter_;
  Bounds near_;
};

}  // namespace

/// The core, a prism on every facet, a wedge of a cylinder along every edge, and a wedge of a ball at every vertex.
void RoundedHull::give_pieces(Cutter& cutter) const {
  const int facets = core.facet_count();
  cutter.off(core.unexact());
  cutter.begin();
  for (int f = 0; f < facets && !cutter.empty(); ++f) {
    cancellation_point();
    if (!cutter.within(core.facet(f))) cutter.cut(core.plane_through_corners(f));
  }
  cutter.end();
  RoundedCutter around(*this, cutter);
  for (int f = 0; f < facets; ++f) around.cut_facet(f);
  std::vector<std::pair<int, int>> beside;
  for (const Edge& edge : core.edges()) {
    cancellation_point();
    const std::array<int, 2> ends{edge.from, edge.to};
    if (!around.near(ends)) continue;
    around.cut_edge(edge);
    for (const int i : {0, 1})
      if (around.near(std::span(ends).subspan(i, 1))) beside.push_back({ends[i], ends[1 - i]});
  }
  std::ranges::sort(beside);
  for (size_t i = 0, end; i < beside.size(); i = end) {
    for (end = i + 1; end < beside.size() && beside[end].first == beside[i].first;) ++end;
    around.cut_vertex(std::span(beside).subspan(i, end - i));
  }
}

Hull RoundedHull::inscribed(double) const {
  throw std::invalid_argument("shapes must not be rounded hulls for method 'paper'");
}

}  // namespace overlapper
