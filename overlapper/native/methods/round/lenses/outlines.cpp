#include "methods/round/lenses/outlines.h"

#include <algorithm>
#include <span>

namespace overlapper::lenses {
namespace {

double value(std::span<const double> polynomial, double t) {
  double sum = 0;
  for (size_t i = polynomial.size(); i-- > 0;) sum = sum * t + polynomial[i];
  return sum;
}

/// The root between two values of t where a polynomial has different signs, by Newton's method and halving.
double root_between(std::span<const double> p, std::span<const double> slope, double low, double high, double at_low) {
  double t = low < 0 && high > 0 ? 0 : low / 2 + high / 2;
  constexpr int kMostSteps = 200;
  for (int step = 0; step < kMostSteps; ++step) {
    const double here = value(p, t);
    if (here == 0) return t;
    ((here < 0) == (at_low < 0) ? low : high) = t;
    double next = t - here / value(slope, t);
    if (!(next > low && next < high)) next = low / 2 + high / 2;
    if (next == t || !(next > low && next < high)) return next;
    if (std::abs(next - t) <= 0x1p-52 * std::abs(t)) return next;
    t = next;
  }
  return t;
}

/// The roots of a polynomial between two values of t at which its sign changes, between those of its slope.
struct Roots {
  std::array<double, 4> t;
  int count = 0;
};
template <size_t kDegree>
Roots roots(const std::array<double, kDegree + 1>& p, double low, double high, Roots* bends = nullptr) {
  Roots found;
  if constexpr (kDegree > 0) {
    std::array<double, kDegree> slope;
    for (size_t i = 0; i < kDegree; ++i) slope[i] = static_cast<double>(i + 1) * p[i + 1];
    const Roots turns = roots<kDegree - 1>(slope, low, high);
    double from = low, at_from = value(p, low);
    for (int i = 0; i <= turns.count; ++i) {
      const double to = i < turns.count ? turns.t[i] : high, at_to = value(p, to);
      if ((at_from < 0) != (at_to < 0)) found.t[found.count++] = root_between(p, slope, from, to, at_from);
      from = to, at_from = at_to;
    }
    if (bends) *bends = turns;
  }
  return found;
}

std::array<double, 5> product(const Quadratic& a, const Quadratic& b) {
  return {a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[1] * b[1] + a[2] * b[0], a[1] * b[2] + a[2] * b[1],
          a[2] * b[2]};
}

/// Adds steps between two changes, away from a change that is much nearer to one of them than they are to each other. A
/// series in an interval converges slowly if there is a square root just outside.
void add_steps(double low, double high, std::span<const double> others, Changes& result) {
  constexpr double kNear = 1.0 / 8, kStep = 24;
  double below = high - low, above = high - low;
  for (const double other : others) {
    if (other < low) below = std::min(below, low - other);
    if (other > high) above = std::min(above, other - high);
  }
  const double width = high - low;
  for (double step = kStep * below; step < kNear * width; step *= kStep) result.add(low + step);
  for (double step = kStep * above; step < kNear * width; step *= kStep) result.add(high - step);
}

}  // namespace

/// The half chord h has 4 d² h² = 4 (e × μ)² + 4 (S d² + D e·μ) − D², with e from the first centre to the second, d
/// its length, S the mean of the slacks, D their difference, and μ that mean of the centres.
Changes changes(const Discs& discs) {
  const auto [low, high] = discs.range();
  const Quadratic aside = cross(discs.apart, discs.centre), square = dot(discs.apart, discs.apart),
                  ahead = dot(discs.apart, discs.centre);
  const auto a = product(aside, aside), b = product(discs.slack, square), c = product(discs.difference, ahead),
             d = product(discs.difference, discs.difference);
  std::array<double, 5> chord;
  for (size_t i = 0; i < chord.size(); ++i) chord[i] = 4 * (a[i] + (b[i] + c[i])) - d[i];

  Changes result;
  result.add(low);
  Roots bends;
  const Roots touching = roots<4>(chord, low, high, &bends);
  for (int i = 0; i < touching.count; ++i) result.add(touching.t[i]);
  // If the circles nearly touch, or coincide, outlines change within a short interval.
  for (int i = 0; i < bends.count; ++i) {
    const double t = bends.t[i];
    double size = 0, power = 1;
    for (const double each : chord) size += std::abs(each * power), power *= t;
    if (std::abs(value(chord, t)) <= 1e-3 * size) result.add(t);
  }
  result.add(high);
  std::sort(result.t.begin(), result.t.begin() + result.count);
  std::array<double, 20> places;
  const auto behind = std::copy_n(result.t.begin(), std::min(result.count, 16), places.begin());
  const std::span<const double> others(places.begin(), std::ranges::copy(discs.ends(), behind).out);
  for (int i = 0, changes = result.count; i + 1 < changes; ++i) add_steps(places[i], places[i + 1], others, result);
  std::sort(result.t.begin(), result.t.begin() + result.count);
  return result;
}

Section section(const Discs& discs, double t) {
  const Flat between = discs.apart.at(t), middle = discs.centre.at(t);
  const double apart = std::sqrt(dot(between, between)), difference = at(discs.difference, t);
  Section s;
  s.ahead = apart > 0 ? (1 / apart) * between : Flat{1, 0};
  const double along = dot(s.ahead, middle);
  s.aside = cross(s.ahead, middle);
  s.chord = apart > 0 ? difference / (2 * apart) : 0;
  s.to_first = s.chord - (along - discs.share * apart), s.to_second = along + (1 - discs.share) * apart - s.chord;
  const double square = at(discs.slack, t) + (s.aside * s.aside + s.chord * (2 * along - s.chord));
  s.half_chord = square > 0 ? std::sqrt(square) : 0;
  const bool one_in_the_other = apart == 0 && difference != 0;
  if (square > 0 && !one_in_the_other) s.outline = Outline::kLens;
  else if (one_in_the_other) s.outline = difference < 0 ? Outline::kFirst : Outline::kSecond;
  else if (s.to_first > 0 && s.to_second > 0) s.outline = Outline::kNothing;
  else s.outline = s.to_first <= s.to_second ? Outline::kFirst : Outline::kSecond;
  return s;
}

}  // namespace overlapper::lenses
