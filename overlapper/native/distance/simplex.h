#pragma once

#include <array>
#include <limits>
#include <type_traits>

#include "geometry/predicates.h"
#include "geometry/wide.h"

namespace overlapper {

/// A point of the Minkowski difference A - B, with its points of A and of B.
template <class Vector>
struct DifferencePointOf {
  Vector on_a, on_b;
  Vector difference() const { return on_a - on_b; }
};
using DifferencePoint = DifferencePointOf<Vec3>;

/// One to four points of A - B and the weights (barycentric coordinates) of the point of their hull nearest to the
/// origin. In doubles or in double-double.
template <class Vector>
struct SimplexOf {
  using Point = DifferencePointOf<Vector>;
  using Scalar = decltype(Vector::x);

  std::array<Point, 4> corner;
  std::array<Scalar, 4> weight{};
  int size = 0;
  Vector nearest;  ///< that point, from the plane or line of the corners: it has a direction even when tiny

  /// The same combination of the points of A; a common point of both if `nearest` is the origin.
  Vector witness_a() const { return combined(&Point::on_a); }
  Vector witness_b() const { return combined(&Point::on_b); }

 private:
  Vector combined(Vector Point::* on) const {
    Vector sum;
    for (int i = 0; i < size; ++i) sum = sum + weight[i] * (corner[i].*on);
    return sum;
  }
};
using Simplex = SimplexOf<Vec3>;

/// The result of GJK.
template <class Vector>
struct SeparationOf {
  SimplexOf<Vector> simplex;
  bool origin_inside = false;  ///< the simplex contains the origin
  double distance = 0;         ///< length of simplex.nearest, 0 if the origin is inside; an upper bound
  /// A lower bound of the distance: the gap between the supporting planes along `normal`; negative if none separates.
  double gap = -std::numeric_limits<double>::infinity();
  Vector normal;  ///< unit, from b to a; {0, 0, 0} if the origin is inside
};
using Separation = SeparationOf<Vec3>;

// Differences between doubles and double-doubles.

/// The squared distance orders points like the distance, without a square root.
inline double rank(Vec3 nearest) { return norm2(nearest); }
/// The square of a tiny distance may underflow in double-double. A relative excess of 1e-16 in the distance turns the
/// direction by its square root, 1e-8, so the order must use more digits.
inline DoubleDouble rank(const WideVector& nearest) { return norm(nearest); }

/// Whether GJK may take a step to more corners that is shorter only by rounding. If four corners are coplanar but for
/// rounding, the nearest point may be on the diagonal of their quadrilateral. The step to a third corner then gains
/// only the square of rounding, but the normal of these three corners leads to the fourth.
template <class Vector>
inline constexpr bool kTurnsOnTheSpot = !std::is_same_v<Vector, Vec3>;

/// Gives the normal of a needle about twice as many digits as its corners have.
inline Vec3 plane_normal(Vec3 a, Vec3 b, Vec3 c) { return accurate_normal(a, b, c); }
/// Double-doubles have digits to spare; scaling keeps their products in range.
inline WideVector plane_normal(const WideVector& a, const WideVector& b, const WideVector& c) {
  return unit(cross(b - a, c - a));
}

/// The point nearest to the origin on the plane through p with that plane_normal().
inline Vec3 foot(Vec3 normal, Vec3 p) { return dot(normal, p) / norm2(normal) * normal; }
inline WideVector foot(const WideVector& normal, const WideVector& p) { return dot(normal, p) * normal; }

/// True if the tetrahedron contains the origin, decided by exact signs; then also its weights.
inline bool weigh(Vec3 a, Vec3 b, Vec3 c, Vec3 d, std::array<double, 4>& weight) {
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
/// True if all weights have one sign in double-double. These corners are not doubles, so exact predicates do not apply.
inline bool weigh(const WideVector& a, const WideVector& b, const WideVector& c, const WideVector& d,
                  std::array<DoubleDouble, 4>& weight) {
  const DoubleDouble wa = -dot(b, cross(c, d)), wb = dot(a, cross(c, d)), wc = -dot(a, cross(b, d)),
                     wd = dot(a, cross(b, c));
  const DoubleDouble sum = wa + wb + wc + wd;
  if (sum.head == 0) return false;
  weight = {wa / sum, wb / sum, wc / sum, wd / sum};
  return std::ranges::none_of(weight, [](DoubleDouble w) { return w.head < 0; });
}

/// Exact signs prove that the origin is inside. A face, edge or corner onto which rounding has put the origin is a
/// weaker proof. Without exact signs, the fewest corners are the better proof.
template <class Vector>
inline constexpr bool kInsideIsExact = std::is_same_v<Vector, Vec3>;

/// A nearest point without its corners.
template <class Vector>
struct NearestOf {
  std::array<decltype(Vector::x), 4> weight{};
  Vector nearest;
};

/// Weights of the point of a segment's line nearest to the origin, and that point; false unless both are positive.
template <class Vector>
bool weigh(const Vector& a, const Vector& b, NearestOf<Vector>& s) {
  const Vector ab = b - a;
  const auto wb = -dot(a, ab), wa = dot(b, ab);
  if (!(rounded(wa) > 0 && rounded(wb) > 0)) return false;
  // Divided by their own sum and not by |ab|²: on a short segment the two differ by far more than rounding.
  const auto sum = wa + wb;
  s.weight = {wa / sum, wb / sum};
  s.nearest = wa > wb ? a + s.weight[1] * ab : b - s.weight[0] * ab;
  return true;
}

/// The same for a triangle's plane: areas seen along its normal.
template <class Vector>
bool weigh(const Vector& a, const Vector& b, const Vector& c, NearestOf<Vector>& s) {
  const Vector n = plane_normal(a, b, c);
  const auto wa = dot(n, cross(b, c)), wb = dot(n, cross(c, a)), wc = dot(n, cross(a, b));
  if (!(rounded(wa) > 0 && rounded(wb) > 0 && rounded(wc) > 0 && rounded(dot(n, n)) > 0)) return false;
  const auto sum = wa + wb + wc;
  s.weight = {wa / sum, wb / sum, wc / sum};
  // The normal of a needle has more digits than a sum of its far corners, which nearly cancels.
  const auto aa = dot(a, a), bb = dot(b, b), cc = dot(c, c);
  s.nearest = foot(n, !(aa > bb) && !(aa > cc) ? a : !(bb > cc) ? b : c);
  return true;
}

/// Keeps the corners that support the point nearest to the origin. Tries all sub-simplices, or all with the last corner
/// if the simplex without it was reduced before, and takes the nearest valid one. This needs no case analysis of
/// Voronoi regions, which rounding could contradict. Returns the rank() of the nearest point: 0 if the origin is
/// inside.
template <class Vector>
auto reduce(SimplexOf<Vector>& s, bool with_last = false) {
  std::array<Vector, 4> difference;
  for (int i = 0; i < s.size; ++i) difference[i] = s.corner[i].difference();
  NearestOf<Vector> best;
  int best_subset = 0;
  decltype(rank(s.nearest)) least{std::numeric_limits<double>::infinity()};
  for (int subset = with_last ? 1 << (s.size - 1) : 1; subset < 1 << s.size; ++subset) {
    NearestOf<Vector> part;
    std::array<Vector, 4> p;
    int size = 0;
    for (int i = 0; i < s.size; ++i)
      if (subset >> i & 1) p[size++] = difference[i];
    bool valid = false;
    switch (size) {
      case 1: part.weight[0] = {1}, part.nearest = p[0], valid = true; break;
      case 2: valid = weigh(p[0], p[1], part); break;
      case 3: valid = weigh(p[0], p[1], p[2], part); break;
      case 4:
        if ((rounded(least) == 0 && !kInsideIsExact<Vector>) || !weigh(p[0], p[1], p[2], p[3], part.weight)) break;
        s.weight = part.weight, s.nearest = {};
        return decltype(least){0};
    }
    if (!valid) continue;
    const auto distance = rank(part.nearest);
    if (distance < least) least = distance, best = part, best_subset = subset;
  }
  int size = 0;
  for (int i = 0; i < s.size; ++i)
    if (best_subset >> i & 1) s.corner[size++] = s.corner[i];
  s.size = size, s.weight = best.weight, s.nearest = best.nearest;
  return least;
}

/// True if the nearest point of the line or plane of all corners is between the corners; `s` then holds it.
template <class Vector>
bool reaches_with_all(SimplexOf<Vector>& s) {
  const auto corner = [&](int i) { return s.corner[i].difference(); };
  NearestOf<Vector> all;
  if (!(s.size == 2 && weigh(corner(0), corner(1), all)) &&
      !(s.size == 3 && weigh(corner(0), corner(1), corner(2), all)))
    return false;
  s.weight = all.weight, s.nearest = all.nearest;
  return true;
}

template <class Vector>
bool contains(const SimplexOf<Vector>& s, const Vector& difference) {
  for (int i = 0; i < s.size; ++i)
    if (s.corner[i].difference() == difference) return true;
  return false;
}

/// GJK with witness points (Gilbert, Johnson, Keerthi 1988), from any simplex of points of A - B that reduce() has
/// reduced. `support` finds a farthest point of A - B along a unit vector. `settled(length, gap, best)` decides whether
/// the distance is known well enough. The distance is at most `length`, and at least `gap` of this round and `best` of
/// all rounds (the duality gap of Frank and Wolfe).
template <class Vector, class Support, class Settled>
SeparationOf<Vector> separate(const SimplexOf<Vector>& start, const Support& support, const Settled& settled) {
  SeparationOf<Vector> result;
  SimplexOf<Vector>& simplex = result.simplex;
  simplex = start;
  auto least = rank(simplex.nearest);
  // Polytopes end by themselves, as each round finds a new vertex. A cylinder's rim converges: no bit improves after
  // some dozens of rounds.
  constexpr int kMaxRounds = 256;
  for (int round = 0; round < kMaxRounds; ++round) {
    const auto length = norm(simplex.nearest);
    if (settled(rounded(length), 0, 0)) {
      result.origin_inside = rounded(length) == 0;
      break;
    }
    const Vector direction = simplex.nearest / length;
    const DifferencePointOf<Vector> farthest = support(-direction);
    const Vector w = farthest.difference();
    const double gap = rounded(dot(w, direction));
    if (gap > result.gap) result.gap = gap, result.normal = direction;
    if (settled(rounded(length), gap, result.gap) || contains(simplex, w)) break;
    SimplexOf<Vector> grown = simplex;
    grown.corner[grown.size++] = farthest;
    SimplexOf<Vector> reduced = grown;
    const auto nearer = reduce(reduced, true);
    result.origin_inside = rounded(nearer) == 0;
    if (result.origin_inside) {
      // Where signs are not exact, weights of a flat tetrahedron may miss the origin by more than its nearest face
      // does.
      if (kInsideIsExact<Vector> || norm(reduced.witness_a() - reduced.witness_b()) < norm(simplex.nearest))
        simplex = reduced;
      break;
    }
    if (nearer < least) {
      simplex = reduced, least = nearer;
    } else if (kTurnsOnTheSpot<Vector> && reaches_with_all(grown)) {
      simplex = grown;
    } else {
      break;
    }
  }
  if (result.origin_inside) result.normal = {};
  else result.distance = rounded(norm(simplex.nearest));
  return result;
}

/// The same from one point of A - B.
template <class Vector, class Support, class Settled>
SeparationOf<Vector> separate(const DifferencePointOf<Vector>& first, const Support& support, const Settled& settled) {
  SimplexOf<Vector> start;
  start.corner[0] = first;
  start.weight[0] = {1};
  start.size = 1;
  start.nearest = first.difference();
  return separate(start, support, settled);
}

}  // namespace overlapper
