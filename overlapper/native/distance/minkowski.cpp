#include "distance/minkowski.h"

#include <limits>
#include <stdexcept>

#include "distance/box_axes.h"
#include "distance/polytope_axes.h"
#include "geometry/expanding_hull.h"
#include "geometry/predicates.h"

namespace overlapper {
namespace {

Vec3 combine(const Simplex& s, Vec3 DifferencePoint::* point) {
  Vec3 sum;
  for (int i = 0; i < s.size; ++i) sum += s.weight[i] * (s.corner[i].*point);
  return sum;
}

/// Weights of the point of a segment's line nearest to the origin, and that point; false unless both are positive.
bool weigh(Vec3 a, Vec3 b, std::array<double, 4>& weight, Vec3& nearest) {
  const Vec3 ab = b - a;
  const double wb = -dot(a, ab), wa = dot(b, ab);
  if (!(wa > 0 && wb > 0)) return false;
  // Divided by their own sum and not by |ab|²: on a short segment the two differ by far more than rounding.
  const double sum = wa + wb;
  weight = {wa / sum, wb / sum};
  nearest = wa > wb ? a + weight[1] * ab : b - weight[0] * ab;
  return true;
}

/// The same for a triangle's plane: areas seen along its normal.
bool weigh(Vec3 a, Vec3 b, Vec3 c, std::array<double, 4>& weight, Vec3& nearest) {
  const Vec3 n = accurate_normal(a, b, c);
  const double area2 = norm2(n);
  const double wa = dot(n, cross(b, c)), wb = dot(n, cross(c, a)), wc = dot(n, cross(a, b));
  if (!(wa > 0 && wb > 0 && wc > 0 && area2 > 0)) return false;
  const double sum = wa + wb + wc;
  weight = {wa / sum, wb / sum, wc / sum};
  // The normal of a needle is known to more digits than a sum of its far corners, of which nearly all cancels.
  const double aa = norm2(a), bb = norm2(b), cc = norm2(c);
  const Vec3 shortest = aa <= bb && aa <= cc ? a : bb <= cc ? b : c;
  nearest = dot(n, shortest) / area2 * n;
  return true;
}

/// True if the tetrahedron contains the origin, decided by exact signs; then also its weights.
bool weigh(Vec3 a, Vec3 b, Vec3 c, Vec3 d, std::array<double, 4>& weight) {
  const int side = orientation(a, b, c, d);
  if (side == 0) return false;
  const Vec3 o;
  if (orientation(o, b, c, d) * side < 0 || orientation(a, o, c, d) * side < 0 || orientation(a, b, o, d) * side < 0 ||
      orientation(a, b, c, o) * side < 0)
    return false;
  const auto volume = [&](Vec3 p, Vec3 q, Vec3 r) { return std::max(0.0, side * dot(p, cross(q, r))); };
  weight = {volume(b, c, d), volume(a, d, c), volume(a, b, d), volume(a, c, b)};
  const double sum = weight[0] + weight[1] + weight[2] + weight[3];
  if (!(sum > 0)) return false;
  for (double& w : weight) w /= sum;
  return true;
}

/// Keeps the corners that support the point nearest to the origin. All sub-simplices are tried and the nearest valid
/// one wins, which needs no case analysis of Voronoi regions that rounding could contradict. True if the origin is
/// inside.
bool reduce(Simplex& s) {
  Simplex best;
  double least = std::numeric_limits<double>::infinity();
  for (int subset = 1; subset < 1 << s.size; ++subset) {
    Simplex part;
    std::array<Vec3, 4> p;
    for (int i = 0; i < s.size; ++i) {
      if (!(subset >> i & 1)) continue;
      p[part.size] = s.corner[i].difference();
      part.corner[part.size++] = s.corner[i];
    }
    bool valid = false;
    switch (part.size) {
      case 1: part.weight = {1}, part.nearest = p[0], valid = true; break;
      case 2: valid = weigh(p[0], p[1], part.weight, part.nearest); break;
      case 3: valid = weigh(p[0], p[1], p[2], part.weight, part.nearest); break;
      case 4:
        if (weigh(p[0], p[1], p[2], p[3], part.weight)) {
          s = part;
          return true;
        }
    }
    if (!valid) continue;
    const double distance2 = norm2(part.nearest);
    if (distance2 < least) least = distance2, best = part;
  }
  s = best;
  return least == 0;
}

bool contains(const Simplex& s, Vec3 difference) {
  for (int i = 0; i < s.size; ++i)
    if (s.corner[i].difference() == difference) return true;
  return false;
}

DifferencePoint core_support(const Placed& a, const Placed& b, Vec3 direction) {
  return {a.core_support(direction), b.core_support(-direction)};
}

const HalfSpace* half_space(const Placed& placed) { return std::get_if<HalfSpace>(&placed.shape); }

Distance distance_to_half_space(const Placed& a, const Placed& b) {
  const Plane plane = b.pose * half_space(b)->plane;
  const Vec3 lowest = a.support(-plane.normal);
  const double height = signed_distance(plane, lowest);
  return {height, height, plane.normal, lowest, lowest - height * plane.normal};
}

Distance mirrored(const Distance& d) { return {d.distance, d.gap, -d.normal, d.witness_b, d.witness_a}; }

}  // namespace

Vec3 Simplex::witness_a() const { return combine(*this, &DifferencePoint::on_a); }
Vec3 Simplex::witness_b() const { return combine(*this, &DifferencePoint::on_b); }

Separation separate_cores(const Placed& a, const Placed& b) {
  Separation result;
  Simplex& simplex = result.simplex;
  Vec3 towards = a.pose.translation - b.pose.translation;
  if (norm2(towards) == 0) towards = {1, 0, 0};
  simplex.corner[0] = core_support(a, b, -towards);
  simplex.weight = {1};
  simplex.size = 1;
  simplex.nearest = simplex.corner[0].difference();
  result.gap = -std::numeric_limits<double>::infinity();

  // Polytopes end by themselves, as each round finds a new vertex; a cylinder's rim converges, and no bit improves
  // after some dozens of rounds.
  for (int round = 0; round < 256; ++round) {
    const double length = norm(simplex.nearest);
    if (length == 0) {
      result.origin_inside = true;
      break;
    }
    const Vec3 direction = simplex.nearest / length;
    const DifferencePoint farthest = core_support(a, b, -direction);
    const Vec3 w = farthest.difference();
    const double gap = dot(w, direction);
    if (gap > result.gap) result.gap = gap, result.normal = direction;
    // Frank-Wolfe duality gap: the distance lies between `gap` and `length`.
    if (length - result.gap <= 4 * 0x1p-53 * length || contains(simplex, w)) break;
    Simplex grown = simplex;
    grown.corner[grown.size++] = farthest;
    if (reduce(grown)) {
      simplex = grown;
      result.origin_inside = true;
      break;
    }
    if (!(norm2(grown.nearest) < norm2(simplex.nearest))) break;
    simplex = grown;
  }
  if (result.origin_inside) {
    result.normal = {};
    return result;
  }
  result.distance = norm(simplex.nearest);
  return result;
}

Distance distance(const Placed& a, const Placed& b) {
  if (half_space(b)) return distance_to_half_space(a, b);
  if (half_space(a)) return mirrored(distance_to_half_space(b, a));
  const double radius_a = core_radius(a.shape), radius_b = core_radius(b.shape);
  const Separation cores = separate_cores(a, b);
  Distance result;
  result.distance = cores.distance - radius_a - radius_b;
  result.gap = cores.gap - radius_a - radius_b;
  // Along the line of the witness points, distance * normal is their difference. On a curved rim that direction is
  // known to half of the digits only; where so little separates it that this matters, the direction that proves the gap
  // is given.
  const Vec3 along = unit(cores.simplex.nearest);
  const double gap_along = dot(along, core_support(a, b, -along).difference());
  result.normal = cores.origin_inside || gap_along <= 0 ? cores.normal : along;
  result.witness_a = cores.simplex.witness_a() - radius_a * result.normal;
  result.witness_b = cores.simplex.witness_b() + radius_b * result.normal;
  return result;
}

namespace {

/// EPA's polytope: support points of the difference of two cores, and which of its facets are known to be final.
class DepthSearch {
 public:
  DepthSearch(const Placed& a, const Placed& b) : a_(a), b_(b) {}

  Penetration run() {
    for (int axis = 0; axis < 3; ++axis)
      for (double side : {-1.0, 1.0}) ask({axis == 0 ? side : 0, axis == 1 ? side : 0, axis == 2 ? side : 0});
    for (double x : {-1.0, 1.0})
      for (double y : {-1.0, 1.0})
        for (double z : {-1.0, 1.0}) ask({x, y, z});
    // A slender difference may show its corners in one plane only. Asked across that plane, it shows more, unless it is
    // flat itself, which the difference of two segments is.
    bool solid = hull_.build();
    for (int attempt = 0; attempt < 3 && !solid; ++attempt) {
      const Vec3 across = across_all();
      ask(across);
      ask(-across);
      solid = hull_.build();
    }
    if (!solid) return best_;
    for (int round = 0; round < kMaxRounds; ++round) {
      const int facet = least_facet();
      if (facet < 0) break;
      const Vec3 normal = normal_of(facet);
      const double before = offset_[facet];
      const double reached = ask(normal);
      const int p = static_cast<int>(hull_.points.size()) - 1;
      // A smooth rim is never reached: stop when the facet's offset and the support agree to rounding.
      if (reached - before <= rounding(extent_) || !hull_.sees(facet, p)) {
        final_.resize(hull_.facets.size(), false);
        final_[facet] = true;
        if (best_.depth <= before + 1e-12 * extent_) break;
        continue;
      }
      hull_.insert(p, facet);
    }
    return best_;
  }

 private:
  static constexpr int kMaxRounds = 2000;

  Vec3 corner(int facet, int i) const { return hull_.points[hull_.facets[facet].vertex[i]]; }

  /// Adds the support point along `direction`; its offset is an upper bound of the depth.
  double ask(Vec3 direction) {
    direction = unit(direction);
    const Vec3 w = core_support(a_, b_, direction).difference();
    extent_ = std::max(extent_, max_component(abs(w)));
    hull_.add(w);
    const double offset = dot(direction, w);
    // `direction` pushes A - B away from the origin; a leaves b the opposite way.
    if (offset < best_.depth) best_ = {offset, -direction};
    return offset;
  }

  Vec3 normal_of(int facet) const {
    return unit(accurate_normal(corner(facet, 0), corner(facet, 1), corner(facet, 2)));
  }

  /// The facet nearest to the origin that is not final yet. Equally turned boxes make needles of collinear corners,
  /// whose plain normals are noise: ranked by those, the nearest facet may come last.
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

  /// Orthogonal to the plane, or to the line, of the points so far.
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
  std::vector<double> offset_;  ///< per facet: of its plane, along its outward unit normal
  double extent_ = 0;
  Penetration best_{std::numeric_limits<double>::infinity(), {}};
};

}  // namespace

Penetration penetration(const Placed& a, const Placed& b) {
  if (half_space(a) && half_space(b))
    throw std::invalid_argument("two half-spaces have no least translation that separates them");
  if (half_space(a) || half_space(b)) {
    const Distance height = distance(a, b);
    return {-height.distance, height.normal};
  }
  Penetration of_boxes;
  const Box *box_a = std::get_if<Box>(&a.shape), *box_b = std::get_if<Box>(&b.shape);
  if (box_a && box_b) {
    of_boxes = box_penetration(*box_a, a.pose, *box_b, b.pose, 0);
    if (of_boxes.depth > 0) return of_boxes;
  } else if (const auto of_polytopes = polytope_penetration(a, b)) {
    return *of_polytopes;
  }
  const double radius = core_radius(a.shape) + core_radius(b.shape);
  const Separation cores = separate_cores(a, b);
  if (!cores.origin_inside && cores.gap > 0) return {radius - cores.distance, cores.normal};
  if (box_a && box_b) return of_boxes;
  Penetration result = DepthSearch(a, b).run();
  result.depth += radius;
  return result;
}

}  // namespace overlapper
