#include "shapes/rounded_hull.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <numbers>
#include <stdexcept>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/scratch.h"
#include "shapes/cutter.h"
#include "shapes/limits.h"
#include "shapes/sphere.h"
#include "shapes/wide_body.h"

namespace overlapper {
namespace {

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

/// The facets, edges and vertices of a core, as far as they matter in a region, and the planes that several pieces
/// share. A negative number belongs to a plane that is not yet placed.
struct SharedPlanes {
  struct Base {
    double least, most;  ///< m: bounds of the signed distances of the region's points
    int plane;
    WideVector normal;  ///< if it is placed
  };
  struct Ends {
    int from, to;  ///< planes across an edge, outwards beyond `to`
    WideVector along;
  };
  struct Beside {
    int vertex, other, edge;
  };
  std::vector<Base> bases;
  std::vector<int> sides;    ///< for each corner of a ring, the plane along the facet's normal through its next edge
  std::vector<Ends> ends;    ///< for each edge
  std::vector<char> raised;  ///< for each vertex: the region may reach beyond a facet there
  std::vector<Beside> beside;
  std::vector<Vec3> normals;  ///< of the facets at a vertex
};

/// Cuts a rounded hull. Parts that the region does not reach are left out.
class RoundedCutter {
 public:
  /// Leaves out pieces around features farther from a box than the radius.
  RoundedCutter(const RoundedHull& rounded, Cutter& cutter, const Bounds& near)
      : core_(rounded.core), hull_(*core_.data), radius_(rounded.radius), cutter_(cutter), near_(near) {
    shared_->bases.clear(), shared_->beside.clear();
    shared_->sides.assign(hull_.ring.size(), kNotPlaced);
    shared_->ends.assign(hull_.edges.size(), {kNotPlaced, kNotPlaced, {}});
    shared_->raised.assign(hull_.vertices.size(), false);
    for (int f = 0; f < facets(); ++f) {
      cancellation_point();
      const auto [least, most] = cutter_.heights(hull_.planes[f]);
      shared_->bases.push_back({least, most, kNotPlaced, {}});
      if (!raised(f)) continue;
      for (const int v : hull_.facet(f)) shared_->raised[v] = true;
    }
  }

  void cut_core() {
    cutter_.begin();
    for (int f = 0; f < facets() && !cutter_.empty(); ++f)
      if (raised(f)) cutter_.cut_inside(base(f).plane);
    cutter_.end();
  }

  /// The polytope within the facets moved out. False if the region reaches beyond a facet at an edge where that
  /// polytope has an angle below 60 degrees, so that it is much larger than the rounded hull.
  bool cut_mitred() {
    constexpr double kSharp = -0.5;
    cutter_.begin();
    for (int f = 0; f < facets(); ++f)
      if (!(shared_->bases[f].most < radius_)) cutter_.face_beyond(base(f).plane, radius_);
    cutter_.end();
    return std::ranges::none_of(hull_.edges, [&](const Edge& edge) {
      return dot(hull_.planes[edge.left].normal, hull_.planes[edge.right].normal) < kSharp &&
             (raised(edge.left) || raised(edge.right));
    });
  }

  void cut_facets() {
    for (int f = 0; f < facets(); ++f) cut_facet(f);
  }
  /// A wedge of a cylinder along each edge, and of a ball at each vertex.
  void cut_edges_and_vertices() { cut_along_edges(&RoundedCutter::cut_edge, &RoundedCutter::cut_vertex); }
  /// The parts of these wedges that matter for what the mitred polytope has outside them.
  void cut_mitres() { cut_along_edges(&RoundedCutter::cut_mitre, &RoundedCutter::cut_mitred_vertex); }

 private:
  static constexpr int kNotPlaced = -1;

  int facets() const { return static_cast<int>(hull_.planes.size()); }

  /// A prism on the facet.
  void cut_facet(int f) {
    const auto ring = hull_.facet(f);
    if (!near(ring)) return;
    if (inexact(f)) charge_corners(ring, hull_.planes[f].normal);
    if (!raised(f) || shared_->bases[f].least > radius_) return;
    cutter_.begin();
    cutter_.cut_outside(base(f).plane);
    cutter_.face_beyond(base(f).plane, radius_);
    for (size_t i = 0; i < ring.size() && !cutter_.empty(); ++i) cutter_.cut_inside(side(f, ring[i]));
    cutter_.end();
  }

  using Vertex = std::span<const SharedPlanes::Beside>;

  void cut_along_edges(void (RoundedCutter::*at_edge)(int), void (RoundedCutter::*at_vertex)(Vertex)) {
    for (int e = 0; e < static_cast<int>(hull_.edges.size()); ++e) {
      cancellation_point();
      const Edge& edge = hull_.edges[e];
      const std::array<int, 2> both{edge.from, edge.to};
      if (!near(both)) continue;
      for (const int i : {0, 1})
        if (shared_->raised[both[i]] && near(std::span(both).subspan(i, 1)))
          shared_->beside.push_back({both[i], both[1 - i], e});
      // Each direction between two normals points away from one of the two facets.
      if (raised(edge.left) || raised(edge.right)) (this->*at_edge)(e);
    }
    std::vector<SharedPlanes::Beside>& all = shared_->beside;
    std::ranges::sort(all, {}, [](const SharedPlanes::Beside& b) { return std::pair(b.vertex, b.other); });
    for (size_t i = 0, end; i < all.size(); i = end) {
      for (end = i + 1; end < all.size() && all[end].vertex == all[i].vertex;) ++end;
      (this->*at_vertex)(std::span(all).subspan(i, end - i));
    }
  }

  /// A wedge of a cylinder along the edge.
  void cut_edge(int e) {
    const Edge& edge = hull_.edges[e];
    const Vec3 a = hull_.vertices[edge.from], b = hull_.vertices[edge.to], way = unit(b - a);
    if (!between_ends(e, way)) return;
    const Vec3 out_left = hull_.planes[edge.left].normal, out_right = hull_.planes[edge.right].normal;
    if (beyond(cross(out_left, way), a) || beyond(cross(way, out_right), a)) return;
    if (inexact(edge.left) || inexact(edge.right)) charge_fold(dot(cross(out_left, out_right), way), norm(b - a));
    begin_at_edge(e);
    cut_beside(edge);
    cutter_.end();
  }

  /// Across the edge, the mitred polytope leaves the cylinder along two lines. Its part outside the cylinder lies
  /// beyond the plane through both lines.
  void cut_mitre(int e) {
    // Up to this angle between the facets, that part is not worth a piece. Up to the other, the plane grazes the
    // cylinder.
    constexpr double kFlat = 1e-5, kGrazing = 0.01;
    const Edge& edge = hull_.edges[e];
    const Vec3 a = hull_.vertices[edge.from], b = hull_.vertices[edge.to];
    const std::array<Vec3, 2> normals{hull_.planes[edge.left].normal, hull_.planes[edge.right].normal};
    const Mitre mitre = mitre_at(a, normals);
    if (!reached(mitre) || !between_ends(e, unit(b - a))) return;
    const double angle = norm(cross(normals[0], normals[1]));
    if (angle <= kFlat) {
      const double area = radius_ * angle * angle * angle / 12 * norm(b - a);
      cutter_.gap(radius_ * area, area);
      return;
    }
    begin_at_edge(e);
    const bool grazing = angle <= kGrazing && dot(normals[0], normals[1]) > 0;
    cut_beyond(mitre, grazing ? kFartherIn : 1);
    if (grazing) cut_beside(edge);
    cutter_.end();
  }

  /// Whether the region reaches between the ends of an edge with this direction.
  bool between_ends(int e, Vec3 way) const {
    const Vec3 a = hull_.vertices[hull_.edges[e].from], b = hull_.vertices[hull_.edges[e].to];
    const auto [least, most] = cutter_.heights({way, dot(way, b)});
    return least <= 0 && most + norm(b - a) >= 0;
  }

  void begin_at_edge(int e) {
    const Vec3 a = hull_.vertices[hull_.edges[e].from], b = hull_.vertices[hull_.edges[e].to];
    const SharedPlanes::Ends& ends = ends_of(e);
    cutter_.begin();
    cutter_.cylinder(DoubleDouble{0.5} * (wide(a) + wide(b)), ends.along, radius_,
                     rounded(norm(wide_difference(b, a))) / 2);
    cutter_.cut_outside(ends.from);
    cutter_.cut_inside(ends.to);
  }

  /// Whether the region may reach beyond the facet.
  bool raised(int f) const { return !(shared_->bases[f].most < 0); }

  const SharedPlanes::Base& base(int f) {
    SharedPlanes::Base& base = shared_->bases[f];
    if (base.plane == kNotPlaced) {
      const WidePlane plane = core_.plane_through_corners(f);
      base.plane = cutter_.place(plane), base.normal = plane.normal;
    }
    return base;
  }

  /// The plane through the edge that begins at this vertex in the ring of the facet.
  int side(int f, int vertex) {
    const auto ring = hull_.facet(f);
    const size_t i = std::ranges::find(ring, vertex) - ring.begin();
    int& plane = shared_->sides[hull_.ring_start[f] + i];
    if (plane == kNotPlaced) {
      const Vec3 a = hull_.vertices[vertex], b = hull_.vertices[ring[(i + 1) % ring.size()]];
      plane = through(unit(cross(wide_difference(b, a), base(f).normal)), a);
    }
    return plane;
  }

  const SharedPlanes::Ends& ends_of(int e) {
    SharedPlanes::Ends& ends = shared_->ends[e];
    if (ends.from == kNotPlaced) {
      const Vec3 a = hull_.vertices[hull_.edges[e].from], b = hull_.vertices[hull_.edges[e].to];
      ends.along = unit(wide_difference(b, a));
      ends.from = through(ends.along, a), ends.to = through(ends.along, b);
    }
    return ends;
  }

  bool beyond(Vec3 normal, Vec3 point) const { return cutter_.heights({normal, dot(normal, point)}).first > 0; }
  int through(const WideVector& normal, Vec3 point) { return cutter_.place({normal, dot(normal, wide(point))}); }

  void cut_beside(const Edge& edge) {
    // Seen from outside, the left facet is on the left of the edge, so its ring has the edge in this direction.
    if (!cutter_.empty()) cutter_.cut_outside(side(edge.left, edge.from));
    if (!cutter_.empty()) cutter_.cut_outside(side(edge.right, edge.to));
  }

  /// The part of the ball between the ends of the edges at a vertex.
  void cut_vertex(Vertex beside) {
    if (!reaches_vertex(beside)) return;
    begin_at_vertex(beside);
    cutter_.end();
  }

  void cut_mitred_vertex(Vertex beside) {
    shared_->normals.clear();
    for (const auto& [_, other, edge] : beside)
      for (const int f : {hull_.edges[edge].left, hull_.edges[edge].right})
        shared_->normals.push_back(hull_.planes[f].normal);
    const Mitre mitre = mitre_at(hull_.vertices[beside[0].vertex], shared_->normals);
    if (!reached(mitre) || !reaches_vertex(beside)) return;
    begin_at_vertex(beside);
    cut_beyond(mitre, kFartherIn);
    cutter_.end();
  }

  bool reaches_vertex(Vertex beside) const {
    const Vec3 vertex = hull_.vertices[beside[0].vertex];
    return std::ranges::none_of(
        beside, [&](const SharedPlanes::Beside& b) { return beyond(unit(hull_.vertices[b.other] - vertex), vertex); });
  }

  void begin_at_vertex(Vertex beside) {
    const int v = beside[0].vertex;
    cutter_.begin();
    cutter_.ball(wide(hull_.vertices[v]), radius_);
    for (const auto& [_, other, edge] : beside) {
      const SharedPlanes::Ends& ends = ends_of(edge);
      if (hull_.edges[edge].from == v) cutter_.cut_inside(ends.from);
      else cutter_.cut_outside(ends.to);
    }
  }

  /// The part of the mitred polytope over an edge or a vertex and outside the round lies beyond a plane. A direction
  /// from the point to there is a sum of the facets' normals with positive factors. The direction is no shorter than
  /// the radius, so the factors add up to at least the radius. Along `towards`, each normal reaches at least as far as
  /// `least`. If that is positive, the direction reaches at least as far as `least` times the radius. If not, there is
  /// no such plane.
  struct Mitre {
    Vec3 point, towards;
    double least;
  };
  static Mitre mitre_at(Vec3 point, std::span<const Vec3> normals) {
    Vec3 sum;
    for (const Vec3 n : normals) sum += n;
    const Vec3 towards = unit(sum);
    double least = 1;
    for (const Vec3 n : normals) least = std::min(least, dot(towards, n));
    return {point, towards, least};
  }
  bool reached(const Mitre& mitre) const {
    return !(mitre.least > 0) ||
           cutter_.heights({mitre.towards, dot(mitre.towards, mitre.point)}).second >= mitre.least * radius_;
  }
  /// A plane farther in does not touch the round where the polytope does.
  static constexpr double kFartherIn = 0.98;
  void cut_beyond(const Mitre& mitre, double part) {
    if (!(mitre.least > 0) || cutter_.empty()) return;
    const WideVector inwards = wide(-mitre.towards);
    cutter_.cut({inwards, dot(inwards, wide(mitre.point)) - DoubleDouble{part * mitre.least * radius_}});
  }

  bool near(std::span<const int> vertices) const {
    Vec3 lower = hull_.vertices[vertices[0]], upper = lower;
    for (const int v : vertices.subspan(1)) {
      lower = min(lower, hull_.vertices[v]), upper = max(upper, hull_.vertices[v]);
    }
    return lower.x <= near_.upper.x && lower.y <= near_.upper.y && lower.z <= near_.upper.z &&
           upper.x >= near_.lower.x && upper.y >= near_.lower.y && upper.z >= near_.lower.z;
  }

  bool inexact(int f) const { return hull_.facet_corners[f][0] < 0; }

  /// A prism ends along the normal of its facet. The ball at a corner ends across the two edges there. The plane of the
  /// facet may miss these edges. On the unit sphere, the pieces then differ by an area: it lies between the normal and
  /// the great circles of both ends.
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

  const Hull& core_;
  const HullData& hull_;
  double radius_;
  Cutter& cutter_;
  Bounds near_;
  Scratch<SharedPlanes> shared_;
};

}  // namespace

/// The core, a prism on every facet, a wedge of a cylinder along every edge, and a wedge of a ball at every vertex.
void RoundedHull::give_pieces(Cutter& cutter) const {
  cutter.off(core.unexact());
  RoundedCutter all(*this, cutter, cutter.region(radius));
  all.cut_core(), all.cut_facets(), all.cut_edges_and_vertices();
}

bool RoundedHull::give_mitred(Cutter& cutter) const {
  if (core.unexact() > 0) return false;
  const Vec3 far{kInfinity, kInfinity, kInfinity};
  RoundedCutter all(*this, cutter, {-far, far});
  if (!all.cut_mitred()) return false;
  all.cut_mitres();
  return true;
}

Hull RoundedHull::inscribed(double) const {
  throw std::invalid_argument("shapes must not be rounded hulls for method 'paper'");
}

}  // namespace overlapper
