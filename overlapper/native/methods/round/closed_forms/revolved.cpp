#include "methods/round/closed_forms/revolved.h"

#include <algorithm>

namespace overlapper::closed_forms {

std::optional<Revolved> revolved(const Placed& body) {
  const std::optional<Revolution> own = revolution(body.shape);
  if (!own) return std::nullopt;
  const Vec3 axis = body.pose.rotation * Vec3{0, 0, 1};
  return Revolved{body.pose.translation, axis, own->radius, own->half_length, own->round_ends, &body};
}

double reach_of_cap(double r, Vec3 normal, double offset, Vec3 direction, double rounding) {
  const double t = offset + rounding, along = dot(direction, normal);
  if (r * along <= t) return r + rounding;
  const double disc = std::sqrt(std::max(0.0, (r - t) * (r + t)));
  return t * along + disc * norm(direction - along * normal) + 2 * rounding;
}

WideMatrix wide_turn(const Placed& body) {
  if (unturned(body.orientation)) return {{{1}, {}, {}}, {{}, {1}, {}}, {{}, {}, {1}}};
  return wide_rotation(body.orientation);
}

WideVector axis_of(const Placed& body) {
  const WideMatrix turn = wide_turn(body);
  return {turn.row0.z, turn.row1.z, turn.row2.z};
}

WideAxis seen_from(const Placed& other, const Revolved& body) {
  const WideMatrix turn = wide_turn(other);
  WideAxis seen{apply_transposed(turn, wide_difference(body.placed->position, other.position)), {}};
  if (const HullData* hull = polytope_of(other.shape)) seen.centre = seen.centre - wide(hull->origin);
  if (body.half_length > 0) seen.axis = apply_transposed(turn, axis_of(*body.placed));
  return seen;
}

}  // namespace overlapper::closed_forms
