#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/revolved_part.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::closed_forms {
namespace {

constexpr double kPi = std::numbers::pi;

/// The depth, over the smaller radius, up to which a contact at sides is shallow.
constexpr double kShallowSides = 0.25;

/// The common part of a cylinder and a ball or another cylinder, in a shallow contact far from all ends. Heights count
/// from the cylinder's axis towards the other's centre or axis.
struct SideContact {
  double volume = 0;
  double height = 0;  ///< m: of the centroid
  double area = 0;    ///< m²
  double force = 0;   ///< m²: what a body's volume grows by as it moves towards the other
};

/// How far the contact of a ball reaches along the axis, to either side.
double reach_of_ball(double s, double depth) { return std::sqrt(depth * (2 * s - depth)); }

/// A cylinder of radius r and a ball of radius s whose centre is `distance` from the axis. `depth` is r + s − distance,
/// which is given for its digits.
///
/// Slices across the cylinder's axis, z from the ball's centre, are lenses of two discs. Their depth is an analytic
/// function of z times z0² − z², where z0 is how far they reach; and so, over half powers of that, are all measures of
/// them. With z = z0 cos θ all that is integrated is an even function of θ with a period of half a turn. Its sum over
/// nodes in the middle of N equal parts is off by as little as a term of order 2 N. The nearest singularity is where
/// slices of the ball shrink to a point: e^-0.97, for contacts as deep as are shallow.
SideContact ball_at_side(double r, double s, double distance, double depth) {
  constexpr int kNodes = 12;                     // of half of 24 parts
  const double d = distance, least = s - depth;  // the radius of the disc that is but touched
  const double reach = reach_of_ball(s, depth), reach2 = reach * reach;
  SideContact sum;
  double moment = 0;
  for (int k = 0; k < kNodes; ++k) {
    const double angle = (k + 0.5) * kPi / (2 * kNodes), sine = std::sin(angle);
    const double inside = reach2 * sine * sine, q = std::sqrt(least * least + inside), deep = inside / (q + least);
    const double half = std::sqrt(deep * (2 * d + deep) * (2 * r - deep) * (q + least)) / (2 * d);  // of the chord
    // From the cylinder's axis and from the ball's centre to the chord.
    const double from_axis = r - deep * (2 * q - deep) / (2 * d), from_ball = q - deep * (2 * r - deep) / (2 * d);
    const double of_axis = std::atan2(half, from_axis), of_ball = std::atan2(half, from_ball);
    const auto a = quadric::segment(of_axis, half / r, from_axis / r);
    const auto b = quadric::segment(of_ball, half / q, from_ball / q);
    const double area = r * r * a.area + q * q * b.area;
    sum.volume += sine * area;
    moment += sine * (from_axis * area + r * r * r * a.first_across - q * q * q * b.first_across);
    sum.area += sine * 2 * (r * of_axis + s * of_ball);
    sum.force += sine * 2 * half;
  }
  const double weight = reach * kPi / kNodes;
  return {weight * sum.volume, moment / sum.volume, weight * sum.area, weight * sum.force};
}

/// How far that contact reaches along the first axis, to either side.
double reach_of_crossing(double r, double s, double depth, double sine, double cosine) {
  // The half-widths of each where the other but touches it.
  const double of_first = reach_of_ball(r, depth), of_second = reach_of_ball(s, depth);
  return (of_second + of_first * cosine) / sine;
}

/// Two cylinders, the directions of their axes of that sine.
///
/// Slices along both axes are parallelograms as wide as the cylinders there. Heights are t = r − depth (1 + cos θ) / 2:
/// widths are then half-angle sines and cosines times analytic functions, and what is integrated is as above. The
/// nearest singularities are on the far sides of the cylinders: e^-3.4, for contacts as deep as are shallow.
SideContact sides_crossing(double r, double s, double depth, double sine) {
  constexpr int kNodes = 8;
  SideContact sum;
  double moment = 0;
  for (int k = 0; k < kNodes; ++k) {
    const double angle = (k + 0.5) * kPi / (2 * kNodes), half_sine = std::sin(angle), half_cosine = std::cos(angle);
    // Below the top of the first, and above the bottom of the second.
    const double below = depth * half_cosine * half_cosine, above = depth * half_sine * half_sine;
    const double t = r - below, u = s - above;
    const double first = std::sqrt(2 * r - below), second = std::sqrt(2 * s - above);
    // Common factors are left out: 2 depth sin cos in dt, and the root of depth and sin or cos in widths.
    const double across = half_sine * half_cosine, area = across * across * first * second;
    sum.volume += area;
    moment += area * t;
    sum.area += r * half_sine * half_sine * second / first + s * half_cosine * half_cosine * first / second;
    sum.force += half_cosine * half_cosine * first / second * u;
  }
  const double weight = 4 * depth / sine * kPi / kNodes;
  return {weight * depth * sum.volume, moment / sum.volume, weight * sum.area, weight * sum.force};
}

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
