#include "distance/wide_parting.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <vector>

#include "distance/near_polytope.h"
#include "distance/penetration.h"
#include "distance/wide_gap.h"
#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/thresholds.h"

namespace overlapper {
namespace {

/// If the sine between two directions is smaller than this, their product is taken in double-double.
constexpr double kNearlyParallel = 0x1p-3;

/// Error of the sine between an arc's middle and a direction along it or against it. The sine comes from sums of unit
/// vectors times sines that may be as small as the error.
constexpr double kDoubtful = 0x1p-40;

/// A unit vector across two directions. For nearly parallel directions the product is mostly rounding error; the vector
/// then counts as across the first only.
struct Across {
  WideVector direction;
  double sine, lost;  ///< between the two directions; error of `direction`
};
Across across(const WideVector& u, const WideVector& v) {
  const WideVector product = cross(u, v);
  const double sine = norm(product).head;
  const WideVector about = unit(product);
  return {unit(about - dot(u, about) * u), sine, std::min(kLostWide / sine, kLostWide + sine)};
}

/// A body in double-double and in doubles, about the same point.
struct Body {
  const WideBody& wide;
  const Placed& plain;
};

/// The lengths of the ways out of A - B, of the cores. Directions point out of A - B.
class Ways {
 public:
  Ways(Body a, Body b) : a_(a), b_(b), lost_(0x1p-94 * (a.wide.reach() + b.wide.reach())) {}

  DoubleDouble shortest() const { return shortest_; }
  const WideVector& direction() const { return direction_; }
  /// m: error of the way along a direction, in double-double.
  double lost() const { return lost_; }

  /// The way along a unit direction.
  double measure(const WideVector& direction) {
    const DoubleDouble way = dot(direction, a_.wide.core_support(direction) - b_.wide.core_support(-direction));
    if (way < shortest_) shortest_ = way, direction_ = direction;
    return way.head;
  }

  /// A lower bound of the way along a direction. Measures the way unless doubles prove that it is not the shortest.
  double at_least(const WideVector& direction) {
    const Vec3 plain = unit(rounded(direction));
    const double way = dot(plain, a_.plain.core_support(plain) - b_.plain.core_support(-plain));
    const double least = way - kPlain * (a_.wide.reach() + b_.wide.reach());
    return least > shortest_.head ? least : measure(unit(direction)) - lost_;
  }

 private:
  static constexpr double kPlain = 0x1p-44;  ///< error of a way in doubles, over the size of the numbers

  Body a_, b_;
  double lost_;
  DoubleDouble shortest_{kInfinity};
  WideVector direction_;
};

/// A normal of the difference that may be the least way out.
struct Candidate {
  double least;  ///< m: lower bound of the way along it
  enum Kind { kFacetOfA, kFacetOfB, kRidges } kind;
  int of_a, of_b;
  double sign;  ///< of the product of two ridges
};

class PolytopeSearch {
 public:
  PolytopeSearch(Body a, Body b, const WideVector& about) : ways(a, b), a_(a.wide, about), b_(b.wide, about) {}

  Ways ways;
  double lower = kInfinity;  ///< m: lower bound of all ways, if the cores have a common point

  /// False if there are too many pairs of ridges to compare, or too many ways to measure with all corners.
  bool run(Vec3 outward) {
    ways.measure(unit(wide(outward)));
    // On the least way out, a point of each body is on the other body, or no farther from it than the way is long.
    const double farthest_a = a_.most_reach(outward), farthest_b = b_.most_reach(-outward);
    const double room = up(way() * (1 + 0x1p-40)) + ways.lost();
    a_.cut(outward, -farthest_b - room);
    b_.cut(-outward, -farthest_a - room);
    if (static_cast<double>(a_.ridges.size()) * static_cast<double>(b_.ridges.size()) > kMostRidgesCompared)
      return false;
    for (int f = 0; f < static_cast<int>(a_.facets.size()) && !asked_too_many(); ++f)
      consider({0, Candidate::kFacetOfA, f, -1, 1}, a_.facets[f].normal);
    for (int f = 0; f < static_cast<int>(b_.facets.size()) && !asked_too_many(); ++f)
      consider({0, Candidate::kFacetOfB, -1, f, 1}, -b_.facets[f].normal);
    consider_ridges();
    if (asked_too_many()) return false;
    std::ranges::sort(candidates_, {}, &Candidate::least);
    for (const Candidate& candidate : candidates_) {
      cancellation_point();
      // Candidates are sorted: all others are longer.
      if (candidate.least > way()) break;
      lower = std::min(lower, measured(candidate));
    }
    lower = std::min(lower, way() - ways.lost());
    return true;
  }

  /// True if the difference has an interior. Its least way out is then along the normal of a facet.
  bool solid() const { return !a_.facets.empty() || !b_.facets.empty(); }

 private:
  double way() const { return ways.shortest().head; }

  /// A lower bound of the way along the candidate's exact normal.
  double measured(const Candidate& c) {
    const auto along = [&](const WideVector& direction, double lost) {
      return ways.measure(direction) - ways.lost() - lost * (a_.radius + b_.radius);
    };
    if (c.kind == Candidate::kFacetOfA) return along(a_.normal(a_.facets[c.of_a]), a_.lost(a_.facets[c.of_a]));
    if (c.kind == Candidate::kFacetOfB) return along(-b_.normal(b_.facets[c.of_b]), b_.lost(b_.facets[c.of_b]));
    const NearRidge &of_a = a_.ridges[c.of_a], &of_b = b_.ridges[c.of_b];
    const WideVector u = a_.along(of_a);
    const Across ridges = across(u, b_.along(of_b));
    const WideVector direction = c.sign * ridges.direction;
    const double least = along(direction, ridges.lost);
    return of_b.left < 0 || of_a.left < 0 ? least
                                          : std::max(least, least_of_strip(of_a, of_b, u, direction, ridges.lost));
  }

  /// A lower bound of the way along the exact normal of the facet of two ridges. Nearly parallel ridges make a strip.
  /// The error of the strip's direction turns it about the ridge of a, and moves a point of the strip by at most that
  /// angle times the point's distance from the ridge. The nearest point of the surface is the foot of the origin on its
  /// facet. If the foot is beside a strip, the strip is not the least way out.
  double least_of_strip(const NearRidge& of_a, const NearRidge& of_b, const WideVector& along_a,
                        const WideVector& direction, double lost) const {
    const WideVector across = cross(along_a, direction);
    const double rounding = ways.lost() + kLostWide * (a_.radius + b_.radius);
    double low = kInfinity, high = -kInfinity, least = -kInfinity, farthest = 0;
    for (const int i : {of_a.from, of_a.to})
      for (const int j : {of_b.from, of_b.to}) {
        const WideVector corner = a_.corner(i) - b_.corner(j);
        const double beside = dot(across, corner).head, out = dot(direction, corner).head;
        low = std::min(low, beside), high = std::max(high, beside);
        least = std::max(least, out - lost * (std::abs(beside) + lost * std::abs(out)) - rounding);
        farthest = std::max(farthest, std::abs(out));
      }
    const double margin = 2 * lost * farthest + rounding;
    return low > margin || high < -margin ? kInfinity : least;
  }

  bool asked_too_many() const { return corners_asked_ > kMostCornersAsked; }

  void consider(Candidate candidate, Vec3 direction) {
    cancellation_point(a_.corners.size() + b_.corners.size());
    corners_asked_ += static_cast<double>(a_.corners.size() + b_.corners.size());
    candidate.least = a_.least_reach(direction) + b_.least_reach(-direction) - ways.lost();
    if (candidate.least <= way()) candidates_.push_back(candidate);
  }

  /// False if every point of the ridge is farther from the other body than the way out is long.
  bool near(const NearRidge& ridge, const NearPolytope& other) const {
    return norm(ridge.near.at) - ridge.near.lost <= way() + other.radius;
  }

  void consider_ridges() {
    std::vector<int> of_b;
    for (int j = 0; j < static_cast<int>(b_.ridges.size()); ++j)
      if (near(b_.ridges[j], a_)) of_b.push_back(j);
    std::vector<double> rises(b_.facets.size());
    for (int i = 0; i < static_cast<int>(a_.ridges.size()); ++i) {
      cancellation_point();
      if (asked_too_many()) return;
      const NearRidge& ridge = a_.ridges[i];
      if (!near(ridge, b_)) continue;
      for (size_t f = 0; f < rises.size(); ++f) rises[f] = dot(b_.facets[f].normal, ridge.along);
      for (int j : of_b) consider_ridges(i, j, rises);
    }
  }

  /// Two ridges make a facet if two arcs cross: the arc between the facet normals beside one ridge, and the reversed
  /// arc of the other.
  void consider_ridges(int i, int j, const std::vector<double>& rises) {
    const NearRidge &of_a = a_.ridges[i], &of_b = b_.ridges[j];
    Vec3 arc_a, arc_b;
    if (of_a.left >= 0) {
      const Vec3 left = a_.facets[of_a.left].normal, right = a_.facets[of_a.right].normal;
      if (!crossed(left, dot(left, of_b.along), right, dot(right, of_b.along), arc_a)) return;
    }
    if (of_b.left >= 0) {
      const Vec3 left = b_.facets[of_b.left].normal, right = b_.facets[of_b.right].normal;
      if (!crossed(left, rises[of_b.left], right, rises[of_b.right], arc_b)) return;
    }
    Vec3 product = cross(of_a.along, of_b.along);
    double sine = norm(product);
    if (sine < kNearlyParallel) {
      product = rounded(cross(a_.along(of_a), b_.along(of_b)));
      sine = norm(product);
      // A facet of parallel ridges is also parallel to a facet of one body.
      if (sine < kLostWide) return;
    }
    product = product / sine;
    const double apart = dot(product, of_a.near.at - of_b.near.at),
                 lost = of_a.near.lost + of_b.near.lost + ways.lost();
    for (double sign : {1.0, -1.0}) {
      if (sign * dot(arc_a, product) < -kDoubtful || sign * dot(arc_b, product) > kDoubtful) continue;
      if (sign * apart - lost <= way()) consider({0, Candidate::kRidges, i, j, sign}, sign * product);
    }
  }

  /// False if the arc from `left` to `right` does not cross a plane. `left_side` and `right_side` are the signed
  /// distances of its ends from the plane. `at` is then about the crossing.
  static bool crossed(Vec3 left, double left_side, Vec3 right, double right_side, Vec3& at) {
    if (std::min(left_side, right_side) > kLost || std::max(left_side, right_side) < -kLost) return false;
    if (std::min(std::abs(left_side), std::abs(right_side)) > kLost)
      at = std::abs(right_side) * left + std::abs(left_side) * right;
    return true;
  }

  NearPolytope a_, b_;
  std::vector<Candidate> candidates_;
  double corners_asked_ = 0;
};

/// A cylinder with its axis and rims in double-double.
struct Rims {
  WideVector centre, axis;
  double radius, half;

  explicit Rims(const WideBody& body) : centre(body.placed({})), axis(body.turned({{}, {}, {1}})) {
    const Revolution cylinder = *revolution(body.shape);
    radius = cylinder.radius, half = cylinder.half_length;
  }
};

/// The nearest point to (x, y) on an ellipse about the origin with semi-axes 1 along y and `k` < 1 along x, on its side
/// of positive x. Returns its eccentric angle, if the distance has a local minimum there.
///
/// With `s` = 1 - k², the slope of half the squared distance is cos φ (k x tan φ - y + s sin φ). For x >= 0 the bracket
/// increases everywhere. For x < 0 it increases where cos³ φ > k |x| / s. A local minimum is where the bracket
/// increases through zero.
std::optional<double> nearest_on_ellipse(double k, double s, double x, double y) {
  const double slope = k * x;
  double end = std::numbers::pi / 2;
  if (slope < 0) {
    const double cube = -slope / s;
    if (!(cube < 1)) return std::nullopt;
    end = std::acos(std::cbrt(cube));
  }
  const auto bracket = [&](double angle) { return slope * std::tan(angle) - y + s * std::sin(angle); };
  double low = -end, high = end;
  if (slope <= 0 && !(bracket(low) < 0 && bracket(high) > 0)) return std::nullopt;
  double angle = 0;
  for (int round = 0; round < 200; ++round) {
    const double value = bracket(angle);
    (value < 0 ? low : high) = angle;
    const double cosine = std::cos(angle);
    double next = angle - value / (slope / (cosine * cosine) + s * cosine);
    if (!(next > low && next < high)) next = low + (high - low) / 2;
    if (std::abs(next - angle) <= 0x1p-52 * std::abs(angle) || next == low || next == high) return next;
    angle = next;
  }
  return angle;
}

/// The ways out of a cylinder and a polytope, or of two cylinders except where two rims meet.
///
/// A support function has a local minimum on the sphere only where both radii of curvature are as long as the way out,
/// or where it has a kink. A rim is straight across itself. The least way is therefore one of these: along the axis;
/// along the normal of a facet; across the axis and a ridge; from the axis through a corner; or through a point of a
/// rim at which a ridge leaves it. In the last case the rim, seen along the ridge, is an ellipse, and the point is the
/// nearest one of the ellipse.
class RimSearch {
 public:
  RimSearch(Body a, Body b) : ways(a, b), a_(a.wide), b_(b.wide) {}

  Ways ways;
  double lower = kInfinity;  ///< m: least of the measured ways

  void run(Vec3 outward, const WideVector& about) {
    ways.measure(unit(wide(outward)));
    if (has_rims(a_.shape) && has_rims(b_.shape)) {
      of_cylinders(Rims(a_), Rims(b_));
    } else if (has_rims(a_.shape)) {
      of_polytope(Rims(a_), b_, 1, -outward, about);
    } else {
      of_polytope(Rims(b_), a_, -1, outward, about);
    }
    lower = std::min(lower, ways.shortest().head - ways.lost());
  }

 private:
  /// Directions point from the polytope out of the cylinder; `sign` turns them out of A - B.
  void of_polytope(const Rims& rims, const WideBody& body, double sign, Vec3 into, const WideVector& about) {
    NearPolytope polytope(body, about);
    const double room = up(ways.shortest().head * (1 + 0x1p-40)) + ways.lost();
    const WideVector farthest = (sign > 0 ? a_ : b_).core_support(wide(-into)) - about;
    const double beyond = dot(-into, rounded(farthest)) + kLost * norm(rounded(farthest));
    polytope.cut(into, -beyond - room);
    along_axis(rims, sign);
    for (const NearFacet& facet : polytope.facets) look(-sign * polytope.normal(facet), polytope.lost(facet));
    for (const NearRidge& ridge : polytope.ridges)
      beside(rims, polytope.along(ridge), rims.centre - polytope.corner(ridge.from), sign);
    for (const NearCorner& corner : polytope.corners) {
      const WideVector arm = polytope.corner(corner) - rims.centre;
      look(sign * from_axis(rims, arm), 0);
    }
  }

  void of_cylinders(const Rims& a, const Rims& b) {
    along_axis(a, 1);
    along_axis(b, 1);
    // A cylinder's side is a ridge along its axis, moved out by its radius: the ellipse grows, and its normals stay.
    beside(a, b.axis, a.centre - b.centre, 1);
    beside(b, a.axis, b.centre - a.centre, -1);
    const WideVector arm = from_axis(a, b.centre - a.centre);
    look(arm, 0), look(-arm, 0);
  }

  void along_axis(const Rims& rims, double sign) { look(sign * rims.axis, 0), look(-sign * rims.axis, 0); }

  static WideVector from_axis(const Rims& rims, const WideVector& arm) {
    // For an arm along the axis, only rounding error is left, and any direction is good.
    const auto leveled = [&](const WideVector& v) { return unit(v - dot(rims.axis, v) * rims.axis); };
    const WideVector level = leveled(leveled(arm));
    return norm(level).head > 0 ? level : leveled(wide(any_orthogonal(rounded(rims.axis))));
  }

  /// Ways across the axis and a ridge, and ways in the plane across the ridge. `arm` leads from the ridge to the
  /// centre.
  void beside(const Rims& rims, const WideVector& ridge, const WideVector& arm, double sign) {
    const auto [level, sine, lost] = across(rims.axis, ridge);
    if (sine < kLostWide) return;
    look(level, lost), look(-level, lost);
    const WideVector upward = unit(cross(ridge, level));
    const double cosine = std::abs(dot(rims.axis, ridge).head);
    const double k = std::min(cosine, 1.0), r = rims.radius, x = -dot(arm, upward).head, y = -dot(arm, level).head;
    if (k == 0) return;
    for (double side : {1.0, -1.0}) {
      const double from_cap = side * x - sine * rims.half;
      const auto angle = nearest_on_ellipse(k, sine * sine, from_cap / r, y / r);
      if (!angle) continue;
      const WideVector direction = side * std::cos(*angle) * upward + k * std::sin(*angle) * level;
      // At a local minimum the excess length of the way is at most its slope, which is rounding, times the angle.
      look(sign * direction, lost, 0x1p-46 * (std::abs(from_cap) + std::abs(y) + r));
    }
  }

  /// Measures the way along a direction with the error `lost`; the way is at most `too_long` longer than the local
  /// minimum.
  void look(const WideVector& direction, double lost, double too_long = 0) {
    lower = std::min(lower, ways.at_least(direction) - lost * (a_.reach() + b_.reach()) - too_long);
  }

  const WideBody &a_, &b_;
};

/// The ways out of an ellipsoid and a polytope, or an ellipsoid and a cylinder.
///
/// The support function has its local minima and kinks there. The way is along the normal of a facet, across a ridge,
/// or from a corner to a nearest point of the surface. Across a ridge the ellipsoid is seen as an ellipse, with the
/// nearest points to the ridge. A point inside an ellipsoid has at most two such points.
class EllipsoidSearch {
 public:
  /// Directions point out of the ellipsoid `a`; `sign` turns them out of A - B.
  EllipsoidSearch(const WideBody& a, const WideBody& b, Ways& ways, double sign)
      : ways_(ways),
        sign_(sign),
        shape_(*stretched(a.shape)),
        longest_(max_component(shape_.half_axes)),
        centre_(a.placed({})),
        axes_{a.turned({{1}, {}, {}}), a.turned({{}, {1}, {}}), a.turned({{}, {}, {1}})},
        reach_(a.reach() + b.reach()) {}

  double lower = kInfinity;  ///< m: least of the measured ways

  void of_polytope(NearPolytope& polytope) {
    for (const NearFacet& facet : polytope.facets) look(-polytope.normal(facet), polytope.lost(facet) * reach_);
    for (const NearRidge& ridge : polytope.ridges) beside(polytope.along(ridge), polytope.corner(ridge.from));
    for (const NearCorner& corner : polytope.corners) {
      const Vec3 place = seen(polytope.corner(corner) - centre_);
      for (const Vec3 way : shape_.ways_out(place)) look(placed(way), beside_least(place));
    }
  }

  void of_cylinder(const Rims& rims) {
    look(rims.axis, 0), look(-rims.axis, 0);
    beside(rims.axis, rims.centre);
  }

 private:
  Vec3 seen(const WideVector& v) const { return {dot(axes_[0], v).head, dot(axes_[1], v).head, dot(axes_[2], v).head}; }
  WideVector placed(Vec3 v) const { return v.x * axes_[0] + v.y * axes_[1] + v.z * axes_[2]; }

  /// m: at a local minimum the excess length of the way is at most its slope, which is rounding, times the angle.
  double beside_least(Vec3 place) const { return 0x1p-46 * (norm(place) + longest_); }

  /// Ways across a ridge through `point`.
  void beside(const WideVector& ridge, const WideVector& point) {
    const Vec3 along = seen(ridge), place = seen(point - centre_);
    const Vec3 u = any_orthogonal(along), v = cross(along, u);
    // The principal axes of the ellipse that is seen along the ridge.
    const Vec3 p = scaled(shape_.half_axes, u), q = scaled(shape_.half_axes, v);
    const double angle = std::atan2(2 * dot(p, q), dot(p - q, p + q)) / 2;
    const Vec3 major = std::cos(angle) * u + std::sin(angle) * v, minor = cross(along, major);
    const double size = norm(scaled(shape_.half_axes, major)), width = norm(scaled(shape_.half_axes, minor));
    const double k = std::min(1.0, width / size), rest = (1 - k) * (1 + k);
    for (const double side : {1.0, -1.0}) {
      look(placed(side * minor), beside_least(place));
      look(placed(side * major), beside_least(place));
      const auto at = nearest_on_ellipse(k, rest, side * dot(minor, place) / size, dot(major, place) / size);
      if (at) look(placed(side * std::cos(*at) * minor + k * std::sin(*at) * major), beside_least(place));
    }
  }

  void look(const WideVector& direction, double too_long) {
    lower = std::min(lower, ways_.at_least(sign_ * direction) - too_long);
  }

  Ways& ways_;
  double sign_;
  const Ellipsoid& shape_;
  double longest_;
  WideVector centre_;
  std::array<WideVector, 3> axes_;
  double reach_;
};

/// Measures the least way out where two curved surfaces meet. Returns a lower bound of all ways, or of that way alone.
double measure_curved(const Placed& a, const Placed& b, bool bounds, Ways& ways) {
  const EnclosedDepth enclosed = bounds ? enclosed_depth(a, b) : EnclosedDepth{curved_depth(a, b), kInfinity};
  const Vec3 outward = -enclosed.depth.normal;
  for (const Vec3 way : {outward, local_way_out(a, b, outward).outward}) ways.measure(unit(wide(way)));
  return std::min(enclosed.lower, ways.shortest().head - ways.lost());
}

/// True if every way through a point where the rims of two nearly parallel cylinders meet is at least as long as `way`.
///
/// At a local minimum of length y, both radii of curvature are at least y. Let ε be the sine between the axes, and ρ_i
/// the sine between the direction and axis i. The smaller radius is at most r ε² / ρ³, so y ρ³ <= r ε²: the direction
/// is near an axis. There A - B reaches to a disc across this axis. The height of the disc is the height of a cap, less
/// the tilt of the other cap. Its rim surrounds the origin at the distance `room`. The way along a direction at the
/// angle η from the axis is therefore at least height cos η + room sin η.
bool rims_meet_farther_out(const Rims& a, const Rims& b, double way) {
  const Vec3 z = rounded(a.axis), apart = rounded(a.centre - b.centre);
  const double sine = norm(rounded(cross(a.axis, b.axis))), cosine = std::abs(dot(a.axis, b.axis).head);
  const double most = std::max(a.radius, b.radius), along = dot(apart, z);
  if (!(way > 0)) return false;
  if (sine < kLostWide) return true;
  // The caller excludes ways shorter than half of `way`.
  const double tilted = std::cbrt(2 * most * sine * sine / way) * (1 + 0x1p-40);
  if (!(tilted < 1)) return false;
  const double lost = 0x1p-40 * (norm(apart) + a.half + b.half + a.radius + b.radius);
  for (double side : {1.0, -1.0}) {
    const double height = a.half + b.half * cosine + side * along - b.radius * sine - lost;
    const Vec3 to_cap = apart + side * b.half * (dot(a.axis, b.axis).head > 0 ? 1 : -1) * rounded(b.axis);
    const double room = a.radius + b.radius * cosine - norm(to_cap - dot(to_cap, z) * z) - lost;
    const double at_end = height * std::sqrt(1 - tilted * tilted) + room * tilted;
    if (!(height > way && at_end > way)) return false;
  }
  return true;
}

}  // namespace

WideParting wide_parting(const Placed& a, const Placed& b, Vec3 reference, Vec3 hint, bool bounds) {
  const WideBody wide_a(a, wide(reference)), wide_b(b, wide(reference));
  const Body body_a{wide_a, a}, body_b{wide_b, b};
  const DoubleDouble radii = two_sum(core_radius(a.shape), core_radius(b.shape));
  const Vec3 outward = norm2(hint) > 0 ? -hint : Vec3{0, 0, 1};
  const auto found = [&](const Ways& ways, double lower) {
    const double depth = (ways.shortest() + radii).head;
    return WideParting{depth, down((DoubleDouble{lower} + radii).head), up(depth + ways.lost()),
                       -rounded(ways.direction())};
  };
  const auto is_polytope = [](const Shape& shape) { return !smooth(shape) && bounded(shape); };
  if (is_polytope(a.shape) && is_polytope(b.shape) && norm2(hint) > 0) {
    const bool a_is_smaller = radius(a.shape) < radius(b.shape);
    PolytopeSearch search(body_a, body_b, a_is_smaller ? wide_a.support(wide(outward)) : wide_b.support(wide(hint)));
    if (search.run(outward) && search.lower > 0) return found(search.ways, search.lower);
  }
  const double lost = 0x1p-94 * (wide_a.reach() + wide_b.reach());
  const bool common = !bounds && radii.head == 0;  // bodies that overlap are their cores
  WideGap gap;
  if (common) gap.witness_a = wide_a.core_support(wide(outward));
  else gap = wide_gap(wide_a, wide_b, lost / 4);
  if (norm2(gap.normal) > 0) {
    // GJK may not have converged on a curved surface; the hint may then be better.
    Ways ways(body_a, body_b);
    const bool curved = bounded(a.shape) && bounded(b.shape) && (has_curved_core(a.shape) || has_curved_core(b.shape));
    if (curved) ways.measure(unit(wide(outward)));
    const double certified = curved ? std::max(gap.certified, -(ways.shortest() + radii).head) : gap.certified;
    return {-gap.distance, down(-std::max(gap.distance, gap.most) - lost), up(-certified + lost), gap.normal};
  }
  // Cores without an interior, or without a common point, separate at once if one of them moves to the other.
  const double touching = -(std::max(gap.distance, gap.most) + radii.head) - lost;
  if (stretched(a.shape) || stretched(b.shape)) {
    Ways ways(body_a, body_b);
    ways.measure(unit(wide(outward)));
    const bool first = stretched(a.shape);
    EllipsoidSearch search(first ? wide_a : wide_b, first ? wide_b : wide_a, ways, first ? 1 : -1);
    const WideBody& other = first ? wide_b : wide_a;
    if (has_curved_core(other.shape)) {
      if (has_rims(other.shape)) search.of_cylinder(Rims(other));
      search.lower = measure_curved(a, b, bounds, ways);
    } else {
      NearPolytope polytope(other, gap.witness_a);
      const double room = up(ways.shortest().head * (1 + 0x1p-40)) + ways.lost();
      const Vec3 into = first ? -outward : outward;
      const WideVector farthest = (first ? wide_a : wide_b).core_support(wide(-into)) - gap.witness_a;
      const double beyond = dot(-into, rounded(farthest)) + kLost * norm(rounded(farthest));
      polytope.cut(into, -beyond - room);
      search.of_polytope(polytope);
      search.lower = std::min(search.lower, ways.shortest().head - ways.lost());
    }
    return found(ways, search.lower > 0 ? search.lower : touching);
  }
  if (core_kind(a.shape) == CoreKind::kCurved || core_kind(b.shape) == CoreKind::kCurved) {
    Ways ways(body_a, body_b);
    ways.measure(unit(wide(outward)));
    const double lower = measure_curved(a, b, bounds, ways);
    return found(ways, lower > 0 ? lower : touching);
  }
  if (has_rims(a.shape) || has_rims(b.shape)) {
    RimSearch search(body_a, body_b);
    search.run(outward, gap.witness_a);
    if (has_rims(a.shape) && has_rims(b.shape)) {
      const double coarse = measure_curved(a, b, bounds, search.ways);
      const double way = std::min(search.lower, search.ways.shortest().head);
      if (coarse > way / 2 && rims_meet_farther_out(Rims(wide_a), Rims(wide_b), way)) search.lower = way - lost;
      else search.lower = std::min(way, coarse);
    }
    return found(search.ways, search.lower > 0 ? search.lower : touching);
  }
  PolytopeSearch search(body_a, body_b, gap.witness_a);
  if (!search.run(outward)) search.lower = enclosed_depth(a, b).lower;
  return found(search.ways, search.solid() && search.lower > 0 ? search.lower : touching);
}

}  // namespace overlapper
