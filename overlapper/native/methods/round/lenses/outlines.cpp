#include "methods/round/lenses/outlines.h"

#include <algorithm>
#include <span>

#include "methods/round/lenses/polynomials.h"
#include "methods/round/lenses/region.h"

namespace overlapper::lenses {

namespace {

/// Steps are at most `near` times the interval. Each is `step` times as long as the one before.
struct Grading {
  double near, step;
};

/// Adds steps between two changes, away from a change that is much nearer to one of them than they are to each other. A
/// series in an interval converges slowly if there is a square root just outside.
void add_steps(double low, double high, std::span<const double> others, Grading grading, Changes& result) {
  const auto [near, step_by] = grading;
  double below = high - low, above = high - low;
  for (const double other : others) {
    if (other < low) below = std::min(below, low - other);
    if (other > high) above = std::min(above, other - high);
  }
  const double width = high - low;
  for (double step = step_by * below; step < near * width; step *= step_by) result.add(low + step);
  for (double step = step_by * above; step < near * width; step *= step_by) result.add(high - step);
}

/// Finds where circles touch, where either disc ends, and where the discs are concentric. The chord has a pair of
/// complex roots beside a bend at which it has no zero.
void find_singular(const Discs& discs, const std::array<double, 5>& of_chord, const Roots& touching, const Roots& bends,
                   Changes& result) {
  const auto add = [&](double t, double square) {
    if (std::isfinite(t) && square >= 0) result.singular[result.singulars++] = {t, std::sqrt(square)};
  };
  for (int i = 0; i < touching.count; ++i) add(touching.t[i], 0);
  for (int i = 0; i < bends.count; ++i) {
    const double t = bends.t[i], bend = of_chord[2] + t * (3 * of_chord[3] + 6 * t * of_chord[4]);
    add(t, value(of_chord, t) / bend);
  }
  for (const double t : discs.ends()) add(t, 0);
  const Quadratic apart = dot(discs.apart, discs.apart);
  const double middle = -apart[1] / (2 * apart[2]);
  add(middle, std::max(0.0, apart[0] / apart[2] - middle * middle));
}

}  // namespace

/// The half chord h has 4 d² h² = 4 (e × μ)² + 4 (S d² + D e·μ) − D², with e from the first centre to the second, d
/// its length, S the mean of the slacks, D their difference, and μ that mean of the centres.
std::array<double, 5> chord(const Line& apart, const Line& centre, const Quadratic& slack,
                            const Quadratic& difference) {
  const Quadratic aside = cross(apart, centre), square = dot(apart, apart), ahead = dot(apart, centre);
  const auto a = product(aside, aside), b = product(slack, square), c = product(difference, ahead),
             d = product(difference, difference);
  std::array<double, 5> result;
  for (size_t i = 0; i < result.size(); ++i) result[i] = 4 * (a[i] + (b[i] + c[i])) - d[i];
  return result;
}

Changes changes(const Discs& discs) {
  const auto [low, high] = discs.range();
  Changes result;
  if (!(low < high)) return result;
  result.add(low);
  const auto of_chord = chord(discs.apart, discs.centre, discs.slack, discs.difference);
  Roots bends;
  const Roots touching = roots<4>(of_chord, low, high, &bends);
  for (int i = 0; i < touching.count; ++i) result.add(touching.t[i]);
  find_singular(discs, of_chord, touching, bends, result);
  // If the circles nearly touch, or coincide, outlines change within a short interval.
  for (int i = 0; i < bends.count; ++i) {
    const double t = bends.t[i];
    double size = 0, power = 1;
    for (const double each : of_chord) size += std::abs(each * power), power *= t;
    if (std::abs(value(of_chord, t)) <= 1e-3 * size) result.add(t);
  }
  if (discs.cuts > 0) add_changes_by_walls(discs, low, high, result);
  result.add(high);
  result.sort();
  std::array<double, kMostChanges + 4> places;
  const auto behind = std::copy_n(result.t.begin(), result.count, places.begin());
  const std::span<const double> others(places.begin(), std::ranges::copy(discs.ends(), behind).out);
  // Areas of arcs and walls converge more slowly than volumes.
  const Grading grading = discs.cuts > 0 ? Grading{0.5, 6} : Grading{1.0 / 8, 24};
  for (int i = 0, changes = result.count; i + 1 < changes; ++i)
    add_steps(places[i], places[i + 1], others, grading, result);
  result.sort();
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
