#include "overlap/vertex_gradient.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <limits>

#include "geometry/cancellation.h"
#include "methods/round/round.h"
#include "overlap/facet_sections.h"
#include "overlap/shape_gradient.h"

namespace overlapper {
namespace {

using Polygon = std::vector<Vec3>;

/// The part of a convex polygon where dot(inwards, x - from) is not negative.
void cut_off(Polygon& polygon, Vec3 inwards, Vec3 from, Polygon& kept) {
  kept.clear();
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 p = polygon[i], q = polygon[i + 1 < polygon.size() ? i + 1 : 0];
    const double before = dot(inwards, p - from), after = dot(inwards, q - from);
    if (before >= 0) kept.push_back(p);
    if ((before < 0) != (after < 0) && before != 0 && after != 0)
      kept.push_back(p + before / (before - after) * (q - p));
  }
  polygon.swap(kept);
}

/// A facet's fan of triangles, and integrals over polygons in them.
class HullSurface {
 public:
  /// Coordinates are about an origin, seen from the reference.
  HullSurface(const Placed& body, Vec3 reference, Vec3 origin) : hull_(*polytope_of(body.shape)) {
    const Placed relative = body.seen_from(reference);
    for (Vec3 v : hull_.vertices) {
      vertices_.push_back(relative.pose * v - origin);
      reach_ = std::max(reach_, norm(vertices_.back()));
    }
    for (const Plane& own : hull_.planes) {
      const Plane plane = relative.pose * own;
      planes_.push_back({plane.normal, -signed_distance(plane, origin)});
    }
    gradient_.resize(vertices_.size()), moved_.resize(vertices_.size()), area_.resize(vertices_.size());
  }

  /// Adds a polygon of the common surface, in the plane of a facet of this body.
  void add(const Polygon& polygon, Vec3 normal) {
    // Facets whose planes are as near to the corners as the nearest plane is, but for rounding.
    std::vector<double> off(planes_.size(), std::numeric_limits<double>::infinity());
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t f = 0; f < planes_.size(); ++f) {
      if (!(dot(planes_[f].normal, normal) > kAlike)) continue;
      off[f] = 0;
      for (Vec3 corner : polygon) off[f] = std::max(off[f], std::abs(signed_distance(planes_[f], corner)));
      nearest = std::min(nearest, off[f]);
    }
    for (size_t f = 0; f < planes_.size(); ++f)
      if (off[f] <= 2 * nearest + kRounding * reach_) add_in_facet(static_cast<int>(f), polygon);
  }

  /// Adds a part of a triangle, with its area and ∫ x dA.
  void add(const FacetSection& section) {
    const double twice = dot(twice_area(section.corners), section.normal);
    const Vec3 first = section.first - section.area * vertices_[section.corners[0]];
    if (twice > 0) add_shares(section.corners, section.normal, twice, section.area, first);
  }

  /// Adds the surface of a ball at a vertex, or of a cylinder along an edge.
  void add(const pieces::RoundSurface& surface) {
    if (surface.ball) {
      const auto away = [&](Vec3 vertex) { return norm2(vertex - surface.centre); };
      gradient_[std::ranges::min_element(vertices_, {}, away) - vertices_.begin()] += surface.force;
      return;
    }
    const auto away = [&](const Edge& e) { return norm2((vertices_[e.from] + vertices_[e.to]) / 2 - surface.centre); };
    const Edge& edge = *std::ranges::min_element(hull_.edges, {}, away);
    const Vec3 way = vertices_[edge.to] - vertices_[edge.from];
    const double length = norm(way);
    const Vec3 towards = (dot(way, surface.axis) > 0 ? 1 : -1) / length * surface.along;
    gradient_[edge.from] += surface.force / 2 - towards, gradient_[edge.to] += surface.force / 2 + towards;
    for (const int v : {edge.from, edge.to}) {
      moved_[v] += norm(surface.force) / length, area_[v] += norm(surface.force);
    }
  }

  double reach() const { return reach_; }

  /// Adds the difference of the sum from the area vector of the body's part to the errors.
  VertexGradient found(Vec3 force, double owned, double misplaced, bool with_errors) const {
    VertexGradient result{gradient_, {}};
    if (!with_errors) return result;
    Vec3 sum;
    for (Vec3 each : gradient_) sum += each;
    owned += norm(sum - force);
    for (size_t v = 0; v < moved_.size(); ++v)
      result.error.push_back(owned + std::min(misplaced * moved_[v], area_[v]));
    return result;
  }

 private:
  static constexpr double kAlike = 0.5, kRounding = 64 * DBL_EPSILON;

  void add_in_facet(int facet, const Polygon& polygon) {
    const auto ring = hull_.facet(facet);
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      cancellation_point();
      add_in_triangle({ring[0], ring[i], ring[i + 1]}, planes_[facet].normal, polygon);
    }
  }

  Vec3 twice_area(const std::array<int, 3>& corners) const {
    const Vec3 start = vertices_[corners[0]];
    return cross(vertices_[corners[1]] - start, vertices_[corners[2]] - start);
  }

  void add_in_triangle(const std::array<int, 3>& corners, Vec3 normal, const Polygon& polygon) {
    const auto at = [&](int k) { return vertices_[corners[k % 3]]; };
    const double twice = dot(twice_area(corners), normal);
    if (!(twice > 0)) return;
    part_ = polygon;
    for (int k = 0; k < 3; ++k) cut_off(part_, cross(normal, at(k + 1) - at(k)), at(k), spare_);
    double area = 0;
    Vec3 first;
    for (size_t i = 1; i + 1 < part_.size(); ++i) {
      const double piece = dot(cross(part_[i] - part_[0], part_[i + 1] - part_[0]), normal) / 2;
      area += piece, first += piece / 3 * ((part_[0] - at(0)) + (part_[i] - at(0)) + (part_[i + 1] - at(0)));
    }
    if (area > 0) add_shares(corners, normal, twice, area, first);
  }

  /// Adds a part of a triangle, with its area and ∫ x dA about the first corner.
  void add_shares(const std::array<int, 3>& corners, Vec3 normal, double twice, double area, Vec3 first) {
    const auto at = [&](int k) { return vertices_[corners[k % 3]]; };
    double longest = 0;
    for (int k = 0; k < 3; ++k) longest = std::max(longest, norm(at(k + 1) - at(k)));
    // Barycentric coordinates, integrated: each is the distance from the side across the corner, over the height.
    for (int k = 0; k < 3; ++k) {
      const Vec3 inwards = cross(normal, at(k + 2) - at(k + 1));
      const double share = (dot(inwards, first) + area * dot(inwards, at(0) - at(k + 1))) / twice;
      gradient_[corners[k]] += std::clamp(share, 0.0, area) * normal;
      moved_[corners[k]] += area * longest / twice, area_[corners[k]] += area;
    }
  }

  const HullData& hull_;
  std::vector<Vec3> vertices_;
  double reach_ = 0;  ///< m: of the vertices
  std::vector<Plane> planes_;
  std::vector<Vec3> gradient_;
  std::vector<double> moved_;  ///< m: how the error grows with a corner's displacement
  std::vector<double> area_;   ///< m², of the triangles around each vertex
  Polygon part_, spare_;
};

Vec3 force_of(const Overlap& overlap, int body) {
  const auto row = overlap.gradient()[body];
  return {row[0], row[1], row[2]};
}

/// The surfaces of the balls and cylinders of a rounded hull, about a point. No value if slices give up.
std::optional<std::vector<pieces::RoundSurface>> round_surfaces(const Overlap& overlap, int body, Vec3 inside) {
  const Arrangement at = arranged(overlap.bodies());
  const int place = at.order[0] == body ? 0 : 1;
  std::vector<pieces::RoundSurface> found;
  const auto measured = measure_by_slices({.a = at.relative[place],
                                           .b = at.relative[1 - place],
                                           .reference = at.reference,
                                           .inside = wide_difference(inside, at.reference),
                                           .rounds = &found});
  return measured ? std::optional(std::move(found)) : std::nullopt;
}

/// A hull that overlaps a round body, or a rounded hull. No value if slices give up.
std::optional<VertexGradient> in_pair(const Overlap& overlap, int body, bool with_errors) {
  const Vec3 reference = overlap.centroid();
  HullSurface surface(overlap.bodies()[body], reference, {});
  double owned = with_errors ? overlap.errors().gradient[body][0] : 0;
  for (const FacetSection& section : facet_sections(overlap, body, reference)) {
    surface.add(section);
    owned += section.error;
  }
  if (smooth(overlap.bodies()[body].shape)) {
    const auto rounds = round_surfaces(overlap, body, reference);
    if (!rounds) return std::nullopt;
    for (const pieces::RoundSurface& round : *rounds) surface.add(round);
  }
  return surface.found(force_of(overlap, body), owned, 16 * DBL_EPSILON * surface.reach(), with_errors);
}

}  // namespace

std::vector<VertexGradient> vertex_gradients(const Overlap& overlap, bool with_errors) {
  const std::span<const Placed> bodies = overlap.bodies();
  std::vector<VertexGradient> found(bodies.size());
  const bool overlapping = overlap.status() == Status::kOverlapping, flat = polyhedral(bodies);
  Errors none;
  none.gradient.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!polytope_of(bodies[i].shape)) continue;
    const size_t count = polytope_of(bodies[i].shape)->vertices.size();
    const double value = overlapping ? kNoDerivative : 0;
    found[i].by_vertex.assign(count, {value, value, value});
    if (with_errors) found[i].error.assign(count, overlapping ? value : overlap.errors().gradient[i][0]);
    if (!overlapping) continue;
    if (!flat && overlap.pair()) {
      if (auto in = in_pair(overlap, static_cast<int>(i), with_errors)) found[i] = std::move(*in);
      continue;
    }
    if (smooth(bodies[i].shape)) continue;
    const Region& region = flat ? overlap.drawn() : overlap.region();
    HullSurface surface(bodies[i], region.reference, region.frame.origin);
    Polygon polygon;
    for (int f = 0; f < region.polytope.facets(); ++f) {
      if (region.facets[f].owner != static_cast<int>(i)) continue;
      polygon.clear();
      for (int v : region.polytope.facet(f)) polygon.push_back(region.frame.axes * region.polytope.vertices[v]);
      surface.add(polygon, region.facets[f].normal);
    }
    const Errors errors = !with_errors ? none : flat ? overlap.errors() : measured_with_errors(region, bodies).errors;
    const double owned = errors.gradient[i][0], misplaced = with_errors && flat ? overlap.vertices_error() : 0;
    found[i] = surface.found(force_of(overlap, static_cast<int>(i)), owned, misplaced, with_errors);
  }
  return found;
}

}  // namespace overlapper
