#include "distance/wide_gap.h"

#include "distance/simplex.h"

namespace overlapper {
namespace {

WideGap gap_above_plane(const WideBody& a, const WideBody& half_space) {
  const WidePlane plane = half_space.tightest(WideVector{});
  const WideVector lowest = a.support(-plane.normal);
  const DoubleDouble height = signed_distance(plane, lowest);
  return {height.head, height.head, height.head, rounded(plane.normal), lowest, lowest - height * plane.normal};
}

}  // namespace

WideGap wide_gap(const WideBody& a, const WideBody& b, double rounding) {
  if (!bounded(b.shape)) return gap_above_plane(a, b);
  if (!bounded(a.shape)) {
    const WideGap mirrored = gap_above_plane(b, a);
    return {mirrored.distance, mirrored.certified, mirrored.most,
            -mirrored.normal,  mirrored.witness_b, mirrored.witness_a};
  }
  const auto support = [&](const WideVector& direction) {
    return DifferencePointOf<WideVector>{a.core_support(direction), b.core_support(-direction)};
  };
  WideVector towards = b.position() - a.position();
  if (!(norm(towards).head > 0)) towards = wide({1, 0, 0});
  // The gap of this round. The bound of an earlier round says nothing about the present nearest point, which gives the
  // witness points.
  const auto settled = [&](double length, double gap, double) { return length - gap <= rounding; };
  const SeparationOf<WideVector> cores = separate(support(towards), support, settled);

  const double radius_a = core_radius(a.shape), radius_b = core_radius(b.shape);
  // The distance may be nearly the sum of the radii: subtract before rounding.
  const DoubleDouble radii = two_sum(radius_a, radius_b);
  const DoubleDouble apart = cores.origin_inside ? DoubleDouble{} : norm(cores.simplex.nearest);
  const WideVector& normal = cores.normal;
  const bool cores_apart = cores.distance > rounding && cores.gap > 0;
  WideGap result;
  result.distance = (apart - radii).head;
  result.most = (norm(cores.simplex.witness_a() - cores.simplex.witness_b()) - radii).head;
  result.certified = cores_apart ? (dot(support(-normal).difference(), normal) - radii).head : -radii.head;
  if (cores_apart) result.normal = rounded(normal);
  // Along the line of the cores' witness points, the distance of the bodies' witness points is the distance of the
  // bodies. On a rim, the direction that proves the largest gap is known to half of the digits only.
  const WideVector along = cores_apart ? unit(cores.simplex.nearest) : normal;
  result.witness_a = cores.simplex.witness_a() - DoubleDouble{radius_a} * along;
  result.witness_b = cores.simplex.witness_b() + DoubleDouble{radius_b} * along;
  return result;
}

}  // namespace overlapper
