#include "distance/wide_gap.h"

#include <array>
#include <limits>

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Corner {
  WideVector on_a, on_b;
  WideVector difference() const { return on_a - on_b; }
};

/// One to four points of A - B, and the point of their hull that is nearest to the origin.
struct Nearest {
  std::array<Corner, 4> corner;
  std::array<DoubleDouble, 4> weight{};
  int size = 0;
  WideVector point;
  double distance = kInfinity;

  WideVector combined(WideVector Corner::* on) const {
    WideVector sum;
    for (int i = 0; i < size; ++i) sum = sum + weight[i] * (corner[i].*on);
    return sum;
  }
};

bool positive(DoubleDouble x) { return x.head > 0; }

bool weigh(Nearest& s, const WideVector& a, const WideVector& b) {
  const WideVector ab = b - a;
  const DoubleDouble wb = -dot(a, ab), wa = dot(b, ab);
  if (!positive(wa) || !positive(wb)) return false;
  const DoubleDouble sum = wa + wb;
  s.weight = {wa / sum, wb / sum};
  s.point = wb < wa ? a + s.weight[1] * ab : b - s.weight[0] * ab;
  return true;
}

bool weigh(Nearest& s, const WideVector& a, const WideVector& b, const WideVector& c) {
  const WideVector n = unit(wide_cross(b - a, c - a));
  const DoubleDouble wa = dot(n, wide_cross(b, c)), wb = dot(n, wide_cross(c, a)), wc = dot(n, wide_cross(a, b));
  if (!positive(wa) || !positive(wb) || !positive(wc)) return false;
  const DoubleDouble sum = wa + wb + wc;
  s.weight = {wa / sum, wb / sum, wc / sum};
  const DoubleDouble aa = dot(a, a), bb = dot(b, b), cc = dot(c, c);
  s.point = dot(n, !(bb < aa) && !(cc < aa) ? a : !(cc < bb) ? b : c) * n;
  return true;
}

/// Of a tetrahedron that contains the origin.
bool weigh(Nearest& s, const WideVector& a, const WideVector& b, const WideVector& c, const WideVector& d) {
  const DoubleDouble wa = -dot(b, wide_cross(c, d)), wb = dot(a, wide_cross(c, d)), wc = -dot(a, wide_cross(b, d)),
                     wd = dot(a, wide_cross(b, c));
  const DoubleDouble sum = wa + wb + wc + wd;
  if (sum.head == 0) return false;
  s.weight = {wa / sum, wb / sum, wc / sum, wd / sum};
  for (DoubleDouble w : s.weight)
    if (w.head < 0) return false;
  s.point = {};
  return true;
}

/// Keeps the corners that support the nearest point, found among those of all sub-simplices.
Nearest reduced(const Nearest& s) {
  Nearest best;
  for (int subset = 1; subset < 1 << s.size; ++subset) {
    Nearest part;
    std::array<WideVector, 4> p;
    for (int i = 0; i < s.size; ++i) {
      if (!(subset >> i & 1)) continue;
      p[part.size] = s.corner[i].difference();
      part.corner[part.size++] = s.corner[i];
    }
    bool valid = true;
    switch (part.size) {
      case 1: part.weight[0] = {1}, part.point = p[0]; break;
      case 2: valid = weigh(part, p[0], p[1]); break;
      case 3: valid = weigh(part, p[0], p[1], p[2]); break;
      default: valid = weigh(part, p[0], p[1], p[2], p[3]);
    }
    if (!valid) continue;
    part.distance = norm(part.point).head;
    if (part.distance < best.distance) best = part;
  }
  return best;
}

bool contains(const Nearest& s, const WideVector& difference) {
  for (int i = 0; i < s.size; ++i)
    if (norm(s.corner[i].difference() - difference).head == 0) return true;
  return false;
}

WideGap gap_above_plane(const WideBody& a, const WideBody& half_space) {
  const WidePlane plane = half_space.tightest(WideVector{});
  const WideVector lowest = a.support(-plane.normal);
  const DoubleDouble height = signed_distance(plane, lowest);
  return {height.head, height.head, rounded(plane.normal), lowest, lowest - height * plane.normal};
}

}  // namespace

WideGap wide_gap(const WideBody& a, const WideBody& b, double noise) {
  if (!bounded(b.shape)) return gap_above_plane(a, b);
  if (!bounded(a.shape)) {
    const WideGap mirrored = gap_above_plane(b, a);
    return {mirrored.distance, mirrored.certified, -mirrored.normal, mirrored.witness_b, mirrored.witness_a};
  }
  const auto farthest = [&](const WideVector& direction) {
    return Corner{a.core_support(direction), b.core_support(-direction)};
  };
  WideVector towards = b.position() - a.position();
  if (!(norm(towards).head > 0)) towards = wide({1, 0, 0});
  Nearest simplex;
  simplex.corner[0] = farthest(towards);
  simplex.size = 1;
  simplex = reduced(simplex);

  WideGap result{0, -kInfinity, {}, {}, {}};
  WideVector normal;
  constexpr int kMaxRounds = 256;  // polytopes end by themselves; a rim converges
  for (int round = 0; round < kMaxRounds && simplex.distance > noise; ++round) {
    const WideVector direction = unit(simplex.point);
    const Corner corner = farthest(-direction);
    const WideVector difference = corner.difference();
    const double gap = dot(difference, direction).head;
    if (gap > result.certified) result.certified = gap, normal = direction;
    if (simplex.distance - gap <= noise || contains(simplex, difference)) break;
    Nearest grown = simplex;
    grown.corner[grown.size++] = corner;
    grown = reduced(grown);
    if (!(grown.distance < simplex.distance)) break;
    simplex = grown;
  }
  const double radius_a = core_radius(a.shape), radius_b = core_radius(b.shape);
  // The difference of the radii and a distance of nearly their sum is taken before it is rounded.
  const DoubleDouble radii = two_sum(radius_a, radius_b), apart = norm(simplex.point);
  const bool cores_apart = simplex.distance > noise && result.certified > 0;
  result.distance = (apart - radii).head;
  result.certified = cores_apart ? (dot(farthest(-normal).difference(), normal) - radii).head : -radii.head;
  if (cores_apart) result.normal = rounded(normal);
  result.witness_a = simplex.combined(&Corner::on_a) - DoubleDouble{radius_a} * normal;
  result.witness_b = simplex.combined(&Corner::on_b) + DoubleDouble{radius_b} * normal;
  return result;
}

double wide_depth(const WideBody& a, const WideBody& b, const WideVector& normal) {
  if (!bounded(b.shape)) return -gap_above_plane(a, b).certified;
  if (!bounded(a.shape)) return -gap_above_plane(b, a).certified;
  const WideVector along = unit(normal);
  return dot(along, b.support(along) - a.support(-along)).head;
}

}  // namespace overlapper
