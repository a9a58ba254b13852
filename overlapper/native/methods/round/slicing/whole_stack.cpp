#include "methods/round/slicing/whole_stack.h"

#include <algorithm>

#include "methods/round/slicing/nodes.h"

namespace overlapper::slicing {
namespace {

/// Whether slices between t, where the intervals end, and the end of the stack are not empty.
bool holds_to(const Stack& stack, double t, double end) {
  const double middle = t + (end - t) / 2;
  return t == end || !outline(Slice(stack, middle == end ? t : middle)).empty();
}

bool ended_by(const std::optional<Line>& plane, double t) { return plane && plane->offset / plane->rate == t; }

/// Adds the face at one end: the lower one for `side` -1. If a plane ends the stack, there is such a face. If slices
/// are extended to the end of a quadric, there is also a face, as thin as rounding.
void add_end_face(const Stack& stack, const std::optional<Line>& plane, double end, int side, int drawn_to, double t,
                  const Outline& of_last, bool few, Integrals& sum) {
  if (plane && t == end) {
    add_face(*plane, stack, of_last, t, sum);
  } else if (drawn_to >= 0 && !few) {
    Line line;
    line.rate = side, line.offset = side * t, line.owner = drawn_to;
    add_face(line, stack, of_last, t, sum);
  }
}

/// m³: the volume that may be missing, beyond rounding. It is the difference of the volume and ∫ t N dA, plus the sum
/// of the area vectors times the size. Area vectors sum to zero over a closed surface. The integrals of area vectors of
/// lines and arcs are less smooth than the integral of the volume over the same slices.
double open_part(const Stack& stack, const Integrals& s) {
  const Vec3 left = s.pull[0] + s.pull[1] + s.pull[2];
  const auto part = [&](double sum, double square) {
    return std::max(0.0, std::abs(sum) - kSummation * s.border) * std::sqrt(std::max(0.0, square / s.volume));
  };
  return std::max(0.0, std::abs(s.across - s.volume) - kSummation * s.terms) + part(left.x, s.squares.x) +
         part(left.y, s.squares.y) + part(left.z + stack.shear.x * left.x + stack.shear.y * left.y, s.squares.z);
}

}  // namespace

bool find_drawn_intervals(const Stack& stack, bool closely, DrawnIntervals& drawn) {
  std::vector<Interval>& intervals = drawn.intervals;
  drawn.drawn_low = drawn.drawn_high = -1;
  if (!find_intervals(stack, closely, intervals)) return false;
  if (intervals.empty()) return true;
  double &low = intervals.front().low, &high = intervals.back().high;
  const double thin = 1e-13 * (stack.high - stack.low);
  const auto reaches = [&](double t, double end) { return std::abs(end - t) <= thin && holds_to(stack, t, end); };
  if (ended_by(stack.low_plane, stack.low) && reaches(low, stack.low)) low = stack.low;
  if (ended_by(stack.high_plane, stack.high) && reaches(high, stack.high)) high = stack.high;
  for (int i = 0; i < stack.quadrics; ++i) {
    const Quadric& q = stack.quadric[i];
    if (stack.low == q.low && reaches(low, stack.low)) low = stack.low, drawn.drawn_low = q.owner;
    if (stack.high == q.high && reaches(high, stack.high)) high = stack.high, drawn.drawn_high = q.owner;
  }
  return true;
}

double integrate_whole(const Stack& stack, const DrawnIntervals& drawn, double volume, double area, bool few,
                       double strictness, Sum& sum) {
  sum.integrals = {}, sum.about = sum.error = sum.area_error = 0, sum.rules = 0, sum.samples.clear();
  const bool sound = integrate(stack, drawn.intervals, volume, area, few, strictness, sum);
  const Interval &lowest = drawn.intervals.front(), &highest = drawn.intervals.back();
  add_end_face(stack, stack.low_plane, stack.low, -1, drawn.drawn_low, lowest.low, lowest.outline, few, sum.integrals);
  add_end_face(stack, stack.high_plane, stack.high, 1, drawn.drawn_high, highest.high, highest.outline, few,
               sum.integrals);
  // A flat end may lie within a pointlike interval. The slices of another outline then end before it or beyond it.
  if (!sum.samples.empty()) {
    sum.error += lowest.joined * std::max(0.0, sum.samples.front().area);
    if (drawn.intervals.size() > 1) sum.error += highest.joined * std::max(0.0, sum.samples.back().area);
  }
  // Otherwise the error is the size of the piece, which may be only rounding.
  if (!sound || !(sum.integrals.volume > 0) || !within_chords(lowest.low, highest.high, sum))
    return 8 * std::abs(sum.about) + std::abs(sum.integrals.volume);
  return open_part(stack, sum.integrals);
}

}  // namespace overlapper::slicing
