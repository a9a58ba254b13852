#include <algorithm>
#include <cmath>

#include "geometry/constants.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/revolved_part.h"

namespace overlapper::closed_forms {
namespace {

/// A contact at sides is shallow up to this depth, relative to the smaller radius.
constexpr double kShallowSides = 0.25;

/// The common part of two cylinders in a shallow contact far from all ends. Heights count from the first axis towards
/// the other.
struct SideContact {
  double volume = 0;
  double height = 0;  ///< m: of the centroid
  double area = 0;    ///< m²
  double force = 0;   ///< m²: growth of the volume as a body moves towards the other body
};

/// The half-width of a contact of this depth, about the nearest point of a circle.
double half_width(double radius, double depth) { return std::sqrt(depth * (2 * radius - depth)); }

/// The half-length of this contact along the first axis.
double reach_of_crossing(double r, double s, double depth, double sine, double cosine) {
  // The half-widths of each body where the other body only touches it.
  const double of_first = half_width(r, depth), of_second = half_width(s, depth);
  return (of_second + of_first * cosine) / sine;
}

/// Two cylinders. `sine` is the sine of the angle between their axes.
///
/// Slices along both axes are parallelograms, as wide as the cylinders there. With heights t = r − depth (1 + cos θ) /
/// 2, widths are half-angle sines and cosines times analytic functions. The integrand then has a period of half a turn,
/// and its sum over the middles of equal parts converges geometrically. The nearest singularities are on the far sides
/// of the cylinders. For the deepest shallow contacts, the ratio is e^-3.4.
SideContact sides_crossing(double r, double s, double depth, double sine) {
  constexpr int kParts = 8;
  SideContact sum;
  double moment = 0;
  for (int k = 0; k < kParts; ++k) {
    const double angle = (k + 0.5) * kPi / (2 * kParts), half_sine = std::sin(angle), half_cosine = std::cos(angle);
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
  const double weight = 4 * depth / sine * kPi / kParts;
  return {weight * depth * sum.volume, moment / sum.volume, weight * sum.area, weight * sum.force};
}

/// `normal` leads from the axis of the first body, at the point `foot`, to the second body.
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

/// The least distance of a contact at the side from the end of the body, relative to the body's length.
constexpr double kEndMargin = 1e-9;

bool shallow_at_sides(double r, double s, DoubleDouble depth) {
  return depth.head > 0 && depth.head <= kShallowSides * std::min(r, s);
}

/// The sides of two capsules or cylinders that cross far from all ends.
std::optional<MeasuresAndInertia> crossing_sides(const RoundPair& pair) {
  const Revolved &a = *pair.revolved[0], &b = *pair.revolved[1];
  const double r = a.radius, s = b.radius;
  // The places along each axis where the axes are nearest to each other, in doubles.
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
  // The volume is inversely proportional to the sine of the angle by which the first axis turns to the second.
  const double twist = (turned ? -1 : 1) * contact.volume * cosine / sine;
  return measures_of(contact, pair, a.centre + along_a * a.axis, normal, twist);
}

}  // namespace

std::optional<MeasuresAndInertia> sides(const RoundPair& pair) {
  const Revolved &a = *pair.revolved[0], &b = *pair.revolved[1];
  return a.half_length > 0 && b.half_length > 0 ? crossing_sides(pair) : std::nullopt;
}

}  // namespace overlapper::closed_forms
