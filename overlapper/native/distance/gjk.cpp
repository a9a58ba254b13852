#include "distance/gjk.h"

namespace overlapper {
namespace {

const HalfSpace* half_space(const Placed& placed) { return std::get_if<HalfSpace>(&placed.shape); }

Distance distance_to_half_space(const Placed& a, const Placed& b) {
  const Plane plane = b.pose * half_space(b)->plane;
  const Vec3 lowest = a.support(-plane.normal);
  const double height = signed_distance(plane, lowest);
  return {height, height, plane.normal, lowest, lowest - height * plane.normal};
}

Distance mirrored(const Distance& d) { return {d.distance, d.gap, -d.normal, d.witness_b, d.witness_a}; }

DifferencePoint core_support(const Placed& a, const Placed& b, Vec3 direction) {
  return {a.core_support(direction), b.core_support(-direction)};
}

}  // namespace

Separation separate_cores(const Placed& a, const Placed& b) {
  Vec3 towards = a.pose.translation - b.pose.translation;
  if (norm2(towards) == 0) towards = {1, 0, 0};
  const auto support = [&](Vec3 direction) { return core_support(a, b, direction); };
  // The best gap of all rounds: on a rim, those of single rounds scatter by more than this.
  const auto settled = [](double length, double, double best) { return length - best <= 4 * 0x1p-53 * length; };
  return separate(support(-towards), support, settled);
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

}  // namespace overlapper
