#include <algorithm>
#include <span>
#include <vector>

#include "geometry/constants.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/revolved_part.h"

namespace overlapper::closed_forms {
namespace {

/// A ball, or the end of a capsule, where dot(outward, x − centre) >= 0. Every side of a ball is such an end.
struct RoundEnd {
  Vec3 centre, outward;
};

/// Lower bound of the distance of a ball's cap, dot(normal, x − centre) <= offset, from an end's plane on its outer
/// side.
double clearance(const RoundEnd& end, Vec3 centre, double radius, Vec3 normal, double offset, double rounding) {
  return dot(end.outward, centre - end.centre) - reach_of_cap(radius, normal, offset, -end.outward, rounding);
}

/// The lens of two balls: cap of a towards b, cap of b towards a. `between` leads from a to b.
std::optional<MeasuresAndInertia> lens_of_balls(const RoundPair& pair, Vec3 a, Vec3 b, const WideVector& between,
                                                std::span<const RoundEnd> ends) {
  const double ra = pair.revolved[0]->radius, rb = pair.revolved[1]->radius, rounding = pair.rounding;
  const DoubleDouble distance = norm(between), wider = two_sum(ra, -rb), depth = two_sum(ra, rb) - distance;
  if (!(depth.head > 0)) return std::nullopt;
  const Vec3 towards = distance.head > 0 ? rounded(between / distance) : Vec3{1, 0, 0};
  double height_a = 0, height_b = 0;
  if (!(distance > abs(wider))) {
    (ra <= rb ? height_a : height_b) = 2 * std::min(ra, rb);
  } else {
    // The formula gives the smaller height, and the other one is the rest. A circle misplaced by rounding then moves no
    // volume.
    const bool a_higher = wider.head < 0;
    const DoubleDouble less = depth * (distance - abs(wider)) / (DoubleDouble{2} * distance);
    height_a = (a_higher ? depth - less : less).head, height_b = (a_higher ? less : depth - less).head;
  }
  for (const RoundEnd& end : ends) {
    const double by_a = height_a > 0 ? clearance(end, a, ra, -towards, height_a - ra, rounding) : kInfinity;
    const double by_b = height_b > 0 ? clearance(end, b, rb, towards, height_b - rb, rounding) : kInfinity;
    if (std::min(by_a, by_b) <= 0) return std::nullopt;
  }
  const RevolvedPart cap_a = cap(ra, height_a, -towards), cap_b = cap(rb, height_b, towards);
  Measures q = measures_in_closed_form();
  q.volume = cap_a.volume + cap_b.volume;
  q.area = cap_a.curved_area + cap_b.curved_area;
  // About the point where the line of centres passes through the circle.
  const Vec3 moment = cap_a.moment + (ra - height_a) * cap_a.volume * -towards + cap_b.moment +
                      (rb - height_b) * cap_b.volume * towards;
  const Vec3 circle = height_a > 0 ? a + (ra - height_a) * towards : b - (rb - height_b) * towards;
  q.centroid = pair.reference + (circle + moment / q.volume);
  q.volume_error = kSummation * q.volume;
  const double disc = std::max(cap_a.flat_area, cap_b.flat_area);
  if (disc > 0) q.pulls = opposite_pulls(pair, disc * towards, circle);
  return MeasuresAndInertia{q, {}};
}

}  // namespace

/// If every point of the common set lies beyond the ends of both bodies, only the ends matter. The common set is
/// connected, and no other parts of the bodies are around the lens.
std::optional<MeasuresAndInertia> lens(const RoundPair& pair) {
  std::vector<RoundEnd> ends;
  const Revolved &a = *pair.revolved[0], &b = *pair.revolved[1];
  WideVector between = wide_difference(b.placed->position, a.placed->position);
  // The end of a body that is nearer to the other body.
  const auto end = [&](const Revolved& body, Vec3 other, double side) {
    if (body.half_length == 0) return body.centre;
    const bool back = dot(body.axis, other - body.centre) < 0;
    const double along = back ? -body.half_length : body.half_length;
    between = between + side * along * axis_of(*body.placed);
    ends.push_back({body.centre + along * body.axis, back ? -body.axis : body.axis});
    return ends.back().centre;
  };
  const Vec3 centre_a = end(a, b.centre, -1), centre_b = end(b, a.centre, 1);
  return lens_of_balls(pair, centre_a, centre_b, between, ends);
}

}  // namespace overlapper::closed_forms
