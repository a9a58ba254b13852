#include <algorithm>
#include <utility>

#include "methods/round/closed_forms/answer.h"
#include "methods/round/closed_forms/revolved_part.h"
#include "methods/round/closed_forms/side_contact.h"

namespace overlapper::closed_forms {
namespace {

/// `normal` leads from the axis of the first body, from the point `foot`, to the second body.
MeasuresAndInertia measures_of(const SideContact& contact, const RoundPair& pair, Vec3 foot, Vec3 normal,
                               double twist) {
  Measures q = measures_in_closed_form();
  q.way = Way::kSlicing;
  q.volume = contact.volume, q.area = contact.area;
  q.volume_error = kSummation * q.volume;
  q.centroid = pair.reference + (foot + contact.height * normal);
  q.pulls = opposite_pulls(pair, contact.force * normal, foot);
  q.pulls[0].moment += twist * normal, q.pulls[1].moment += -twist * normal;
  return {q, {}};
}

/// The fraction of its length by which a contact at the side of a body keeps off the end.
constexpr double kEndMargin = 1e-9;

bool shallow_at_sides(double r, double s, DoubleDouble depth) {
  return depth.head > 0 && depth.head <= kShallowSides * std::min(r, s);
}

/// The second body is a ball, or a capsule whose nearer end touches the side of the first body. The contact is far from
/// the ends of the first body and does not pass the plane through the end of the capsule.
std::optional<MeasuresAndInertia> ball_beside(const RoundPair& pair) {
  const Revolved &body = *pair.revolved[0], &ball = *pair.revolved[1];
  const double r = body.radius, s = ball.radius, h = body.half_length;
  const auto along_body = [&](Vec3 point) { return dot(point - body.centre, body.axis); };
  const auto from_axis = [&](Vec3 point) { return norm(point - body.centre - along_body(point) * body.axis); };
  double side = 0;
  Vec3 centre = ball.centre;
  if (ball.half_length > 0) {
    const Vec3 arm = ball.half_length * ball.axis;
    side = from_axis(ball.centre + arm) < from_axis(ball.centre - arm) ? 1 : -1;
    centre += side * arm;
  }
  const double along = along_body(centre);
  if (!(std::abs(along) < h && from_axis(centre) < r + s)) return std::nullopt;
  const WideVector axis = axis_of(*body.placed);
  WideVector between = wide_difference(ball.placed->position, body.placed->position);
  if (side != 0) between = between + side * ball.half_length * axis_of(*ball.placed);
  const WideVector out = between - dot(between, axis) * axis;
  const DoubleDouble distance = norm(out), depth = two_sum(r, s) - distance;
  if (!shallow_at_sides(r, s, depth)) return std::nullopt;
  const double reach = reach_of_ball(s, depth.head);
  if (!(std::abs(along) + reach < h - kEndMargin * (h + r))) return std::nullopt;
  const Vec3 normal = rounded(out / distance);
  // All that is shared is beyond the cylinder's tangent plane.
  const double margin = kEndMargin * (ball.half_length + s);
  if (side != 0 && !(reach_of_cap(s, normal, depth.head - s, -side * ball.axis, margin) < 0)) return std::nullopt;
  const SideContact contact = ball_at_side(r, s, distance.head, depth.head);
  return measures_of(contact, pair, body.centre + along * body.axis, normal, 0);
}

/// The sides of two capsules or cylinders that cross far from all ends.
std::optional<MeasuresAndInertia> crossing_sides(const RoundPair& pair) {
  const Revolved &a = *pair.revolved[0], &b = *pair.revolved[1];
  const double r = a.radius, s = b.radius;
  // Where the axes are nearest to each other, along each, as far as doubles know.
  const Vec3 plain = b.centre - a.centre, across = cross(a.axis, b.axis);
  const double cosine = dot(a.axis, b.axis), sine2 = norm2(across);
  const double on_a = dot(plain, a.axis), on_b = dot(plain, b.axis);
  if (!(sine2 > 0)) return std::nullopt;
  const double along_a = (on_a - cosine * on_b) / sine2, along_b = (cosine * on_a - on_b) / sine2;
  if (!(std::abs(along_a) < a.half_length && std::abs(along_b) < b.half_length)) return std::nullopt;
  const WideVector between = wide_difference(b.placed->position, a.placed->position);
  const WideVector common = cross(axis_of(*a.placed), axis_of(*b.placed));
  const DoubleDouble wide_sine = norm(common), signed_distance_of_axes = dot(between, common) / wide_sine;
  const DoubleDouble distance = abs(signed_distance_of_axes), depth = two_sum(r, s) - distance;
  if (!shallow_at_sides(r, s, depth)) return std::nullopt;
  const double sine = wide_sine.head, turn = std::abs(cosine);
  const double reach_a = reach_of_crossing(r, s, depth.head, sine, turn);
  const double reach_b = reach_of_crossing(s, r, depth.head, sine, turn);
  if (!(std::abs(along_a) + reach_a < a.half_length - kEndMargin * (a.half_length + r) / sine2)) return std::nullopt;
  if (!(std::abs(along_b) + reach_b < b.half_length - kEndMargin * (b.half_length + s) / sine2)) return std::nullopt;
  const SideContact contact = sides_crossing(r, s, depth.head, sine);
  const bool turned = signed_distance_of_axes.head < 0;
  const Vec3 normal = rounded(common / wide_sine) * (turned ? -1.0 : 1.0);
  // The volume is inversely as the sine of the angle between the axes, which the first turns towards the second.
  const double twist = (turned ? -1 : 1) * contact.volume * cosine / sine;
  return measures_of(contact, pair, a.centre + along_a * a.axis, normal, twist);
}

RoundPair swapped(RoundPair pair) {
  std::swap(pair.body[0], pair.body[1]);
  std::swap(pair.revolved[0], pair.revolved[1]);
  std::swap(pair.positions[0], pair.positions[1]);
  return pair;
}

}  // namespace

std::optional<MeasuresAndInertia> sides(const RoundPair& pair) {
  const Revolved &a = *pair.revolved[0], &b = *pair.revolved[1];
  std::optional<MeasuresAndInertia> found;
  if (a.half_length > 0 && b.half_length > 0) found = crossing_sides(pair);
  if (!found && a.half_length > 0 && b.round) found = ball_beside(pair);
  if (found || b.half_length == 0 || !a.round) return found;
  found = ball_beside(swapped(pair));
  if (found) std::swap(found->measures.pulls[0], found->measures.pulls[1]);
  return found;
}

}  // namespace overlapper::closed_forms
