#include "overlap/vertex_gradient.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <limits>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/moments.h"
#include "methods/round/round.h"
#include "overlap/centroid_gradient.h"
#include "overlap/facet_sections.h"
#include "overlap/rounded_surface.h"
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
  /// Coordinates are about an origin, seen from the reference. The centroid is about that origin.
  HullSurface(const Placed& body, Vec3 reference, Vec3 origin, Vec3 centroid)
      : hull_(*polytope_of(body.shape)), centroid_(centroid) {
    const Placed relative = body.seen_from(reference);
    for (Vec3 v : hull_.vertices) {
      vertices_.push_back(relative.pose * v - origin);
      reach_ = std::max(reach_, norm(vertices_.back()));
    }
    for (const Plane& own : hull_.planes) {
      const Plane plane = relative.pose * own;
      planes_.push_back({plane.normal, -signed_distance(plane, origin)});
    }
    gradient_.resize(vertices_.size()), of_centroid_.resize(vertices_.size(), Mat3{{}, {}, {}});
    moved_.resize(vertices_.size()), area_.resize(vertices_.size());
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
    const auto near = [&](double distance) { return distance <= 2 * nearest + kRounding * reach_; };
    const bool alone = std::ranges::count_if(off, near) == 1;
    for (size_t f = 0; f < planes_.size(); ++f)
      if (near(off[f])) add_in_facet(static_cast<int>(f), polygon, alone);
  }

  /// Adds a part of a triangle, with its area and ∫ x dA.
  void add(const FacetSection& section) {
    const double twice = dot(twice_area(section.corners), section.normal);
    const Vec3 corner = vertices_[section.corners[0]], first = section.first - section.area * corner;
    const Vec3 about = section.first - section.area * centroid_;
    const Mat3 second = section.second - outer(centroid_, section.first) - outer(about, centroid_);
    if (twice > 0) add_shares(section.corners, section.normal, twice, {section.area, first, about, second});
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

  /// Adds sums over balls and cylinders, for each vertex.
  void add(std::span<const Mat3> by_vertex) {
    for (size_t v = 0; v < by_vertex.size(); ++v) of_centroid_[v] = of_centroid_[v] + by_vertex[v];
  }

  double reach() const { return reach_; }

  /// Adds the difference of the sum from the area vector of the body's part to the errors.
  VertexGradient found(Vec3 force, double owned, double misplaced, bool with_errors) const {
    VertexGradient result{gradient_, {}, {}, {}};
    if (!with_errors) return result;
    owned += missing(force);
    for (size_t v = 0; v < moved_.size(); ++v) result.error.push_back(owned + by_corners(v, misplaced));
    return result;
  }

  /// Adds the derivatives of the centroid. Lengths of `about` are m, and areas m². The derivatives by the translation
  /// of the body, `whole`, are those of all vertices together. The difference is added to the errors.
  struct About {
    double volume, volume_error, owned, misplaced, radius, displaced;
    double lost = 0;  ///< m³, of ∫ x λ nᵀ dA
  };
  void add_of_centroid(const About& about, bool with_errors, Vec3 force, const CentroidGradient& whole,
                       VertexGradient& result) const {
    double lost = about.lost + missing(force) * about.radius;
    for (int j = 0; j < 3; ++j) {
      Vec3 sum;
      for (const Mat3& each : of_centroid_) sum += std::array{each.row0, each.row1, each.row2}[j];
      lost += norm(sum - about.volume * Vec3{whole.pose[j][0], whole.pose[j][1], whole.pose[j][2]});
    }
    if (std::isnan(lost)) lost = kInfinity;
    const double least = about.volume - about.volume_error;
    for (size_t v = 0; v < of_centroid_.size(); ++v) {
      const auto& [x, y, z] = of_centroid_[v];
      result.centroid.push_back({x / about.volume, y / about.volume, z / about.volume});
      if (!with_errors) continue;
      const double moment = (about.owned + by_corners(v, about.misplaced)) * about.radius + about.displaced * area_[v];
      const double by_volume = about.volume_error / about.volume * area_[v] * about.radius;
      result.centroid_error.push_back(least > 0 ? (moment + lost + by_volume) / least : kInfinity);
    }
  }

 private:
  static constexpr double kAlike = 0.5, kRounding = 64 * DBL_EPSILON;

  /// m²: how far the sum of all vertices is from the area vector of the body's part.
  double missing(Vec3 force) const {
    Vec3 sum;
    for (Vec3 each : gradient_) sum += each;
    return norm(sum - force);
  }

  /// m²: the error by misplaced corners.
  double by_corners(size_t v, double misplaced) const { return std::min(misplaced * moved_[v], area_[v]); }

  /// Integrals over a part of a triangle.
  struct Sums {
    double area = 0;
    Vec3 first;               ///< ∫ x dA, about the first corner
    Vec3 about_centroid;      ///< the same about the centroid
    Mat3 second{{}, {}, {}};  ///< ∫ x xᵀ dA, about the centroid
  };

  /// A polygon that is alone in its facet ends within the facet. Only diagonals then cut it.
  void add_in_facet(int facet, const Polygon& polygon, bool alone) {
    const auto ring = hull_.facet(facet);
    for (size_t i = 1; i + 1 < ring.size(); ++i) {
      cancellation_point();
      const std::array<bool, 3> cut{!alone || i > 1, !alone, !alone || i + 2 < ring.size()};
      add_in_triangle({ring[0], ring[i], ring[i + 1]}, planes_[facet].normal, polygon, cut);
    }
  }

  Vec3 twice_area(const std::array<int, 3>& corners) const {
    const Vec3 start = vertices_[corners[0]];
    return cross(vertices_[corners[1]] - start, vertices_[corners[2]] - start);
  }

  /// `cut` tells which sides cut the polygon.
  void add_in_triangle(const std::array<int, 3>& corners, Vec3 normal, const Polygon& polygon,
                       const std::array<bool, 3>& cut) {
    const auto at = [&](int k) { return vertices_[corners[k % 3]]; };
    const double twice = dot(twice_area(corners), normal);
    if (!(twice > 0)) return;
    part_ = polygon;
    for (int k = 0; k < 3; ++k)
      if (cut[k]) cut_off(part_, cross(normal, at(k + 1) - at(k)), at(k), spare_);
    Sums sums;
    for (size_t i = 1; i + 1 < part_.size(); ++i) {
      const double piece = dot(cross(part_[i] - part_[0], part_[i + 1] - part_[0]), normal) / 2;
      sums.area += piece, sums.first += piece / 3 * ((part_[0] - at(0)) + (part_[i] - at(0)) + (part_[i + 1] - at(0)));
      const Vec3 p = part_[0] - centroid_, q = part_[i] - centroid_, r = part_[i + 1] - centroid_, sum = p + q + r;
      sums.about_centroid += piece / 3 * sum;
      for (Vec3 x : {p, q, r, sum}) sums.second = sums.second + outer(piece / 12 * x, x);
    }
    if (sums.area > 0) add_shares(corners, normal, twice, sums);
  }

  void add_shares(const std::array<int, 3>& corners, Vec3 normal, double twice, const Sums& sums) {
    const auto& [area, first, about_centroid, second] = sums;
    const auto at = [&](int k) { return vertices_[corners[k % 3]]; };
    double longest = 0;
    for (int k = 0; k < 3; ++k) longest = std::max(longest, norm(at(k + 1) - at(k)));
    // Barycentric coordinates, integrated: each is the distance from the side across the corner, over the height.
    for (int k = 0; k < 3; ++k) {
      const Vec3 inwards = cross(normal, at(k + 2) - at(k + 1));
      const double share = (dot(inwards, first) + area * dot(inwards, at(0) - at(k + 1))) / twice;
      const Vec3 moment = (second * inwards + dot(inwards, centroid_ - at(k + 1)) * about_centroid) / twice;
      gradient_[corners[k]] += std::clamp(share, 0.0, area) * normal;
      of_centroid_[corners[k]] = of_centroid_[corners[k]] + outer(moment, normal);
      moved_[corners[k]] += area * longest / twice, area_[corners[k]] += area;
    }
  }

  const HullData& hull_;
  Vec3 centroid_;
  std::vector<Vec3> vertices_;
  double reach_ = 0;  ///< m: of the vertices
  std::vector<Plane> planes_;
  std::vector<Vec3> gradient_;
  std::vector<Mat3> of_centroid_;  ///< times the volume
  std::vector<double> moved_;      ///< m: how the error grows with a corner's displacement
  std::vector<double> area_;       ///< m², of the triangles around each vertex
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

/// Derivatives of the centroid that are not known.
void add_unknown(size_t vertices, Wanted wanted, VertexGradient& result) {
  constexpr Vec3 kUnknownRow{kNoDerivative, kNoDerivative, kNoDerivative};
  if (wanted.centroid) result.centroid.assign(vertices, {kUnknownRow, kUnknownRow, kUnknownRow});
  if (wanted.centroid && wanted.errors) result.centroid_error.assign(vertices, kNoDerivative);
}

/// A hull that overlaps a round body, or a rounded hull. No value if slices give up.
std::optional<VertexGradient> in_pair(const Overlap& overlap, int body, Wanted wanted) {
  const Vec3 reference = overlap.centroid();
  HullSurface surface(overlap.bodies()[body], reference, {}, {});
  double owned = wanted.errors ? overlap.errors().gradient[body][0] : 0;
  for (const FacetSection& section : facet_sections(overlap, body, reference)) {
    surface.add(section);
    owned += section.error;
  }
  if (smooth(overlap.bodies()[body].shape)) {
    const auto rounds = round_surfaces(overlap, body, reference);
    if (!rounds) return std::nullopt;
    for (const pieces::RoundSurface& round : *rounds) surface.add(round);
  }
  const double misplaced = 16 * DBL_EPSILON * surface.reach();
  VertexGradient result = surface.found(force_of(overlap, body), owned, misplaced, wanted.errors);
  if (!wanted.centroid) return result;
  const bool rounded = smooth(overlap.bodies()[body].shape);
  if (rounded) {
    const std::optional<Borders> borders = borders_of(overlap);
    if (!borders) {
      add_unknown(result.by_vertex.size(), wanted, result);
      return result;
    }
    surface.add(rounded_surface(overlap, body, reference, borders->seam[body], borders->rims[body]).by_vertex);
  }
  HullSurface::About about{overlap.volume(), overlap.volume_error(), owned, misplaced, 0, 0, 0};
  if (wanted.errors) {
    about.radius = std::sqrt(most_distance2(overlap.inertia(), overlap.volume()));
    about.displaced = overlap.errors().centroid;
    // Sums along the seam have the errors of those for poses.
    if (rounded) {
      const CentroidGradient errors = centroid_gradient_errors(overlap)[body];
      for (const auto& row : errors.pose) about.lost += about.volume * row[0];
    }
  }
  surface.add_of_centroid(about, wanted.errors, force_of(overlap, body),
                          wanted.errors ? centroid_gradient(overlap)[body] : CentroidGradient(), result);
  return result;
}

}  // namespace

std::vector<VertexGradient> vertex_gradients(const Overlap& overlap, Wanted wanted) {
  const bool with_errors = wanted.errors;
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
    if (overlapping) {
      add_unknown(count, wanted, found[i]);
    } else {
      if (wanted.centroid) found[i].centroid.assign(count, Mat3{{}, {}, {}});
      const bool touching = overlap.status() == Status::kTouching;
      if (wanted.centroid && with_errors) found[i].centroid_error.assign(count, touching ? kInfinity : 0);
      continue;
    }
    if (!flat && overlap.pair()) {
      if (auto in = in_pair(overlap, static_cast<int>(i), wanted)) found[i] = std::move(*in);
      continue;
    }
    if (smooth(bodies[i].shape)) continue;
    const Region& region = flat ? overlap.drawn() : overlap.region();
    const PolytopeMoments in_frame = moments(region.polytope);
    const Vec3 centroid = region.frame.axes * (in_frame.first_moment / in_frame.volume);
    HullSurface surface(bodies[i], region.reference, region.frame.origin, centroid);
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
    if (!flat) add_unknown(count, wanted, found[i]);
    if (!flat || !wanted.centroid) continue;
    HullSurface::About about{determinant(region.frame.axes) * in_frame.volume, 0, owned, misplaced, 0, 0, 0};
    if (with_errors) {
      const StatedWithErrors measured = measured_with_errors(region, bodies);
      const bool known = measured.errors.volume < about.volume;
      about.volume_error = known ? measured.errors.volume : about.volume;
      about.owned = std::max(owned, measured.errors.gradient[i][0]);
      about.radius = measured.radius, about.displaced = measured.displaced;
    }
    surface.add_of_centroid(about, with_errors, force_of(overlap, static_cast<int>(i)),
                            with_errors ? centroid_gradient(overlap)[i] : CentroidGradient(), found[i]);
  }
  return found;
}

}  // namespace overlapper
