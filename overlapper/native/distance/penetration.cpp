#include "distance/penetration.h"

#include <limits>
#include <stdexcept>
#include <vector>

#include "distance/box_axes.h"
#include "distance/gjk.h"
#include "distance/polytope_axes.h"
#include "geometry/cancellation.h"
#include "geometry/expanding_hull.h"
#include "geometry/predicates.h"
#include "geometry/rounding.h"

namespace overlapper {
namespace {

/// EPA's polytope: support points of the difference of two cores, and whether each facet is final.
class DepthSearch {
 public:
  DepthSearch(const Placed& a, const Placed& b) : a_(a), b_(b) {}

  /// The least of some ways out.
  Penetration begin() {
    for (int axis = 0; axis < 3; ++axis)
      for (double side : {-1.0, 1.0}) ask({axis == 0 ? side : 0, axis == 1 ? side : 0, axis == 2 ? side : 0});
    for (double x : {-1.0, 1.0})
      for (double y : {-1.0, 1.0})
        for (double z : {-1.0, 1.0}) ask({x, y, z});
    return best_;
  }

  /// With `local_minima`, a facet close to the surface is final if Newton's method leads from there to a local minimum.
  Penetration run(bool local_minima = false) {
    begin();
    // The support points of a slender difference may all lie in one plane. Its support across that plane adds more,
    // unless the difference itself is flat, as for two segments.
    bool solid = hull_.build();
    for (int attempt = 0; attempt < 3 && !solid; ++attempt) {
      const Vec3 across = across_all();
      ask(across);
      ask(-across);
      solid = hull_.build();
    }
    if (!solid) return best_;
    for (int round = 0; round < kMaxRounds; ++round) {
      cancellation_point();
      const int facet = least_facet();
      if (facet < 0) break;
      const Vec3 normal = normal_of(facet);
      const double before = offset_[facet];
      const double reached = ask(normal);
      const int p = static_cast<int>(hull_.points.size()) - 1;
      const double gap = reached - before;
      // The polytope never reaches a smooth rim. Stop when the facet's offset and the support agree to rounding.
      if ((local_minima && gap <= kClose * extent_ && leads_to_minimum(normal)) || gap <= rounding(extent_) ||
          !hull_.sees(facet, p)) {
        final_.resize(hull_.facets.size(), false);
        final_[facet] = true;
        if (best_.depth <= before + kSettled * extent_) break;
        continue;
      }
      hull_.insert(p, facet);
    }
    return best_;
  }

  /// A lower bound of the depth of the polytope, and so of the set around the polytope, but for the rounding of its
  /// points.
  double lower() {
    if (hull_.facets.empty()) return -std::numeric_limits<double>::infinity();
    least_facet();
    double least = std::numeric_limits<double>::infinity();
    for (size_t f = 0; f < offset_.size(); ++f)
      if (!hull_.facets[f].removed()) least = std::min(least, offset_[f]);
    return least - 4 * rounding(extent_);
  }

 private:
  static constexpr int kMaxRounds = 2000;
  /// Relative to the coordinates. A way out counts as the least if it is no more than this longer than the distance of
  /// the nearest facet.
  static constexpr double kSettled = 1e-12;
  /// m, over the coordinates: the distance of facets from the surface where each sees at most one local minimum.
  static constexpr double kClose = 1e-4;
  static constexpr double kNear = 0.2;   ///< rad: from such a facet to its local minimum
  static constexpr double kSame = 1e-7;  ///< rad: between directions of one minimum

  Vec3 corner(int facet, int i) const { return hull_.points[hull_.facets[facet].vertex[i]]; }

  /// Adds the support point along `direction`; its offset is an upper bound of the depth.
  double ask(Vec3 direction) {
    direction = unit(direction);
    const Vec3 w = a_.core_support(direction) - b_.core_support(-direction);
    extent_ = std::max(extent_, max_component(abs(w)));
    hull_.add(w);
    const double offset = dot(direction, w);
    // `direction` moves A - B away from the origin. Body a leaves b in the opposite direction.
    if (offset < best_.depth) best_ = {offset, -direction};
    return offset;
  }

  /// Whether there is a local minimum near a direction, which then counts.
  bool leads_to_minimum(Vec3 direction) {
    const LocalWay at = local_way_out(a_, b_, direction);
    if (!at.least || norm2(at.outward - direction) > kNear * kNear) return false;
    if (norm2(at.outward + best_.normal) > kSame * kSame) ask(at.outward);
    return true;
  }

  Vec3 normal_of(int facet) const {
    return unit(accurate_normal(corner(facet, 0), corner(facet, 1), corner(facet, 2)));
  }

  /// The facet nearest to the origin that is not final yet. Boxes with parallel axes make needles of collinear corners,
  /// and the plain normals of needles are only rounding. Ranked by plain normals, the nearest facet may come last.
  int least_facet() {
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int f = 0; f < static_cast<int>(hull_.facets.size()); ++f) {
      if (f == static_cast<int>(offset_.size()))
        offset_.push_back(hull_.facets[f].removed() ? 0 : dot(normal_of(f), corner(f, 0)));
      if (hull_.facets[f].removed() || (f < static_cast<int>(final_.size()) && final_[f])) continue;
      if (offset_[f] < least) least = offset_[f], best = f;
    }
    return best;
  }

  /// Orthogonal to the plane, or to the line, of the present points.
  Vec3 across_all() const {
    Vec3 u, v;
    for (Vec3 p : hull_.points) {
      const Vec3 edge = p - hull_.points[0];
      if (norm2(edge) > norm2(u)) u = edge;
    }
    for (Vec3 p : hull_.points) {
      const Vec3 edge = p - hull_.points[0];
      if (norm2(cross(u, edge)) > norm2(cross(u, v))) v = edge;
    }
    const Vec3 normal = unit(cross(u, v));
    if (norm2(normal) > 0) return normal;
    return norm2(u) > 0 ? any_orthogonal(unit(u)) : Vec3{0, 0, 1};
  }

  const Placed &a_, &b_;
  ExpandingHull hull_;
  std::vector<char> final_;
  std::vector<double> offset_;  ///< per facet: offset of its plane along the outward unit normal
  double extent_ = 0;
  Penetration best_{std::numeric_limits<double>::infinity(), {}};
};

}  // namespace

Penetration penetration(const Placed& a, const Placed& b) {
  if (!bounded(a.shape) && !bounded(b.shape))
    throw std::invalid_argument("no translation separates two half-spaces: one of a and b must be bounded");
  if (!bounded(a.shape) || !bounded(b.shape)) {
    const Distance height = distance(a, b);
    return {-height.distance, height.normal};
  }
  const std::optional<Penetration> of_boxes = box_penetration(a, b, 0);
  if (of_boxes) {
    if (of_boxes->depth > 0) return *of_boxes;
  } else if (const auto of_polytopes = polytope_penetration(a, b)) {
    return *of_polytopes;
  }
  const double radius = core_radius(a.shape) + core_radius(b.shape);
  const Separation cores = separate_cores(a, b);
  if (!cores.origin_inside && cores.gap > 0) return {radius - cores.distance, cores.normal, cores.distance - cores.gap};
  if (of_boxes) return *of_boxes;
  Penetration result = DepthSearch(a, b).run();
  // Where the cores have no common point after all, the normal of a facet may be wrong.
  if (!(result.depth > 0) && radius > 0) result.open = std::numeric_limits<double>::infinity();
  result.depth += radius;
  return result;
}

LocalWay local_way_out(const Placed& a, const Placed& b, Vec3 outward) {
  for (int round = 0; round < 20; ++round) {
    const Vec3 farthest = a.core_support(outward) - b.core_support(-outward);
    const double way = dot(outward, farthest);
    const Vec3 slope = farthest - way * outward;
    const Vec3 u = any_orthogonal(outward), v = cross(outward, u);
    double uu = -way, uv = 0, vv = -way;
    for (const Placed* body : {&a, &b}) {
      if (!has_rims(body->shape)) {
        const auto own = [&](Vec3 w) { return apply_transposed(body->pose.rotation, w); };
        const Mat3 curved = core_slope(body->shape, own(outward));
        uu += dot(own(u), curved * own(u)), uv += dot(own(u), curved * own(v)), vv += dot(own(v), curved * own(v));
        continue;
      }
      const Vec3 tangent = cross(body->pose.rotation * Vec3{0, 0, 1}, outward);
      const double across = norm(tangent);
      if (!(across > 0)) return {outward, false};
      const double curved = revolution(body->shape)->radius / (across * across * across);
      const double tu = dot(tangent, u), tv = dot(tangent, v);
      uu += curved * tu * tu, uv += curved * tu * tv, vv += curved * tv * tv;
    }
    const double determinant = uu * vv - uv * uv, su = dot(slope, u), sv = dot(slope, v);
    if (!(uu > 0 && determinant > 0)) return {outward, false};
    const Vec3 step = (uv * sv - vv * su) / determinant * u + (uv * su - uu * sv) / determinant * v;
    outward = unit(outward + step);
    if (norm(step) < 0x1p-50) return {outward, true};
  }
  return {outward, false};
}

Penetration curved_depth(const Placed& a, const Placed& b) { return DepthSearch(a, b).run(true); }

Vec3 some_way_out(const Placed& a, const Placed& b) {
  const Separation cores = separate_cores(a, b);
  return !cores.origin_inside && cores.gap > 0 ? cores.normal : DepthSearch(a, b).begin().normal;
}

EnclosedDepth enclosed_depth(const Placed& a, const Placed& b) {
  DepthSearch search(a, b);
  const Penetration depth = search.run();
  return {depth, search.lower()};
}

}  // namespace overlapper
