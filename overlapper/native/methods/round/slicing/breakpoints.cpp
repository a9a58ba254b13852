#include "methods/round/slicing/breakpoints.h"

#include <algorithm>
#include <cfloat>
#include <limits>
#include <numbers>

#include "geometry/constants.h"
#include "methods/round/slicing/nodes.h"

namespace overlapper::slicing {
namespace {

/// A point may be a corner if it is at most so far outside another surface, relative to the terms of that surface.
constexpr double kNear = 1e-6;

/// A point or direction (x, y, t).
using Place = Vec3;

/// Calls use(u) for the real roots of a u² + 2 h u + c. No difference of nearly equal numbers is taken.
template <class Use>
void for_roots(double a, double h, double c, Use use) {
  const double discriminant = h * h - a * c;
  if (!(discriminant >= 0)) return;
  const double far = -(h + std::copysign(std::sqrt(discriminant), h));
  if (far != 0) use(c / far);
  if (a != 0) use(far / a);
}

/// Finds values of t at which the outline may change.
class Candidates {
  static constexpr int kSamples = 24;
  static_assert(kSamples % kRow == 0);
  static constexpr int kMostTurns = 12;
  /// Values at a turn, relative to those of the samples on either side: below the first one, closer values may be zero;
  /// below the second one, it is zero but for rounding.
  static constexpr double kGrazing = 0.1, kTouching = 1e-9;
  using Samples = std::array<double, kSamples>;

 public:
  Candidates(const Stack& stack, std::vector<double>& values) : stack_(stack), values_(values) {}

  /// Collects the values that have closed forms.
  void collect() {
    const int lines = stack_.lines - 4;
    for (int i = 0; i < lines; ++i) {
      if (plane(i)) {
        for (int j = i + 1; j < lines; ++j)
          if (plane(j)) on_ridge(i, j);
        if (stack_.ball >= 0) plane_and_ball(stack_.line[i]);
        for (int q = 0; q < stack_.quadrics; ++q)
          if (!stack_.quadric[q].ball) plane_along(stack_.line[i], stack_.quadric[q]);
      }
    }
    for_pairs([&](const Quadric& p, const Quadric& q) {
      if (p.ball != q.ball) ball_and_cylinder(p.ball ? p : q, p.ball ? q : p);
      else if (parallel(p, q)) parallel_cylinders(p, q);
    });
  }

  /// Collects the values between low and high where a corner meets another surface. The corner of two sides of
  /// cylinders may meet a plane or the ball. The corner of a side and a plane may meet the ball. False position finds
  /// these values between two samples on either side.
  void trace(double low, double high) {
    bool crossing = false;
    for_pairs([&](const Quadric& p, const Quadric& q) { crossing = crossing || p.ball || q.ball || !parallel(p, q); });
    if (!crossing) return;
    find_samples(low, high);
    const bool ball = stack_.ball >= 0;
    for (int i = 0; i < stack_.lines - 4; ++i) {
      if (plane(i)) continue;
      for (int j = 0; j < stack_.lines - 4; ++j) {
        const bool sides = stack_.line[j].quadric > stack_.line[i].quadric;
        if (!plane(j) && !sides) continue;
        if (sides) corner_and_planes(i, j);
        if (ball) corner_and_ball(i, j);
      }
    }
  }

 private:
  /// Between -1 and 1, both included, and denser towards both ends, where sides are steep. A plane may cut off a corner
  /// very near the end where the sides of a cylinder meet: that corner, too, is between two samples.
  static Samples places() {
    Samples result;
    for (int k = 0; k < kSamples; ++k) result[k] = -std::cos(std::numbers::pi * k / (kSamples - 1));
    return result;
  }

  void find_samples(double low, double high) {
    static const Samples kPlaces = places();
    const double middle = low + (high - low) / 2, half = (high - low) / 2;
    for (int k = 0; k < kSamples; ++k) samples_[k] = middle + half * kPlaces[k];
    samples_.front() = low, samples_.back() = high;
    for (int row = 0; row < kSamples / kRow; ++row) {
      Row t;
      std::copy_n(samples_.begin() + row * kRow, kRow, t.begin());
      find_sides(stack_, t, {}, sides_[row]);
    }
  }

  /// Calls use(p, q) for every two quadrics.
  template <class Use>
  void for_pairs(Use use) const {
    for (int i = 0; i < stack_.quadrics; ++i)
      for (int j = i + 1; j < stack_.quadrics; ++j) use(stack_.quadric[i], stack_.quadric[j]);
  }

  bool plane(int i) const { return stack_.line[i].quadric < 0; }
  static Place gradient(const Line& line) { return {line.normal.x, line.normal.y, line.rate}; }

  void add(double t) {
    if (t > stack_.low && t < stack_.high) values_.push_back(t);
  }
  void add_if_near(Point p, double t) {
    if (!(t > stack_.low && t < stack_.high)) return;
    // If a plane goes through the origin, its terms are only the rounding of a point.
    const double blur = kNear * stack_.line[stack_.lines - 1].offset;
    for (int i = 0; i < stack_.lines - 4; ++i) {
      if (!plane(i)) continue;
      const Line& l = stack_.line[i];
      const double terms = std::abs(l.offset) + std::abs(l.rate * t) + l.length * (norm(p) + blur);
      if (l.offset - l.rate * t - dot(l.normal, p) < -kNear * terms) return;
    }
    for (int i = 0; i < stack_.quadrics; ++i) {
      const Quadric& q = stack_.quadric[i];
      const double terms = q.terms(t) + dot(p, p) + 2 * (std::abs(q.centre.x * p.x) + std::abs(q.centre.y * p.y)) +
                           blur * (norm(p) + norm(q.centre) + std::abs(t) + std::abs(q.level));
      if (q.value(p, t) > kNear * terms) return;
    }
    values_.push_back(t);
  }

  static bool parallel(const Quadric& p, const Quadric& q) { return std::abs(cross(p.across, q.across)) < 1e-12; }

  /// Sets x_ and y_ to the corner of two lines at the samples.
  void find_corners(int i, int j) {
    const LineCorner corner_of(stack_.line[i], stack_.line[j]);
    Samples p, q;
    for (const bool first : {true, false}) {
      const Line& line = stack_.line[first ? i : j];
      Samples& side = first ? p : q;
      const double offset = line.offset, rate = line.rate;
      if (line.quadric < 0)
        for (int k = 0; k < kSamples; ++k) side[k] = offset - rate * samples_[k];
      else
        for (int k = 0; k < kSamples; ++k) {
          const Sides& sides = sides_[k / kRow];
          side[k] = line.upper ? sides.upper[line.quadric][k % kRow] : -sides.lower[line.quadric][k % kRow];
        }
    }
    for (int k = 0; k < kSamples; ++k) {
      const Point at = corner_of(p[k], q[k]);
      x_[k] = at.x, y_[k] = at.y;
    }
  }

  void corner_and_planes(int i, int j) {
    find_corners(i, j);
    for (int k = 0; k < stack_.lines - 4; ++k) {
      if (!plane(k)) continue;
      const Line& l = stack_.line[k];
      const Point n = l.normal;
      const double offset = l.offset, rate = l.rate;
      Samples slack;
      for (int s = 0; s < kSamples; ++s) slack[s] = offset - rate * samples_[s] - (n.x * x_[s] + n.y * y_[s]);
      for_changes(slack, i, j, [&](Point p, double t) { return offset - rate * t - dot(n, p); });
    }
  }

  /// The corner of the side of a cylinder and a plane, or of the sides of two cylinders.
  void corner_and_ball(int i, int j) {
    const Point a = stack_.line[i].normal, b = stack_.line[j].normal;
    if (std::abs(cross(a, b)) < 1e-9 * stack_.line[j].length) return;
    find_corners(i, j);
    const Quadric& ball = stack_.quadric[stack_.ball];
    Samples value;
    for (int s = 0; s < kSamples; ++s) {
      const Sides& sides = sides_[s / kRow];
      const int k = s % kRow;
      value[s] =
          x_[s] * x_[s] + y_[s] * y_[s] - 2 * (x_[s] * sides.centre_x[k] + y_[s] * sides.centre_y[k]) + sides.slack[k];
    }
    for_changes(value, i, j, [&](Point p, double t) { return ball.value(p, t); });
  }

  /// Adds the values of t at which a function of a corner is zero. If the function turns near zero, two zeros may lie
  /// between two samples.
  template <class Function>
  void for_changes(const Samples& value, int i, int j, Function function) {
    const auto at = [&](double t) { return function(Slice(stack_, t).corner(i, j), t); };
    const auto between = [&](double low, double high, double at_low, double at_high) {
      if ((at_low < 0) != (at_high < 0)) add_zero(low, high, at_low, at_high, i, j, at);
    };
    for (const bool first : {true, false}) add_turn_at_end(value, first, i, j, at, between);
    for (int k = 0; k + 1 < kSamples; ++k) {
      between(samples_[k], samples_[k + 1], value[k], value[k + 1]);
      if (k == 0) continue;
      const double before = value[k - 1], here = value[k], after = value[k + 1], side = here < 0 ? -1 : 1;
      // In a symmetric pose, the samples on either side of the turn are equal.
      if (!(side * before > side * here && side * after >= side * here)) continue;
      add_turn({samples_[k - 1], samples_[k], samples_[k + 1]}, {before, here, after}, i, j, at, between);
    }
  }

  /// The same for a turn between the first two or the last two samples. At an end of a cylinder, the function is a
  /// series in the root of the distance from the end, and samples are even in that root. A parabola through three
  /// samples finds the turn.
  template <class Function, class Between>
  void add_turn_at_end(const Samples& value, bool first, int i, int j, Function at, Between between) {
    const int end = first ? 0 : kSamples - 1, next = first ? 1 : -1;
    const double zero = value[end], one = value[end + next], two = value[end + 2 * next];
    const double curve = zero - 2 * one + two, slope = (4 * one - 3 * zero - two) / 2;
    if ((zero < 0) != (one < 0) || (zero < 0) != (curve < 0)) return;
    const double turn = -slope / curve;
    if (!(turn > 0 && turn < 1)) return;
    const double t = samples_[end] + turn * turn * (samples_[end + next] - samples_[end]);
    if (const double there = at(t); (there < 0) != (zero < 0)) {
      between(samples_[end], t, zero, there), between(t, samples_[end + next], there, one);
    } else if (first) {
      add_turn({samples_[end], t, samples_[end + next]}, {zero, there, one}, i, j, at, between);
    } else {
      add_turn({samples_[end + next], t, samples_[end]}, {one, there, zero}, i, j, at, between);
    }
  }

  /// Adds the zeros on either side of a turn of the function. Parabolas through three values find the turn. If the
  /// function only touches zero, as a corner does that grazes another surface, the turn itself is added.
  template <class Function, class Between>
  void add_turn(std::array<double, 3> t, std::array<double, 3> value, int i, int j, Function at, Between between) {
    const bool negative = value[1] < 0;
    const double size = std::max(std::abs(value[0]), std::abs(value[2]));
    for (int step = 0; step < kMostTurns; ++step) {
      const double p = t[1] - t[0], q = t[2] - t[1];
      const double fall = (value[1] - value[0]) / p, rise = (value[2] - value[1]) / q, curve = (rise - fall) / (p + q);
      const double turn = t[1] - (fall + p * curve) / (2 * curve);
      if (!(turn > t[0] && turn < t[2]) || turn == t[1]) break;
      const double there = at(turn);
      const bool later = turn > t[1];
      if ((there < 0) != negative) {
        const int before = later ? 1 : 0;
        between(t[before], turn, value[before], there), between(turn, t[before + 1], there, value[before + 1]);
        return;
      }
      // The middle one of the three values stays the nearest to zero.
      const bool nearer = std::abs(there) < std::abs(value[1]);
      if (nearer) {
        const int end = later ? 0 : 2;
        t[end] = t[1], value[end] = value[1], t[1] = turn, value[1] = there;
      } else {
        const int end = later ? 2 : 0;
        t[end] = turn, value[end] = there;
      }
      if (!(std::abs(value[1]) < kGrazing * size)) break;
    }
    if (std::abs(value[1]) <= kTouching * size) add_if_near(Slice(stack_, t[1]).corner(i, j), t[1]);
  }

  /// Adds a zero by false position after Dowell and Jarratt (1971).
  template <class Function>
  void add_zero(double low, double high, double at_low, double at_high, int i, int j, Function at) {
    double t = low;
    for (int step = 0; step < 40; ++step) {
      const double next = high - at_high * (high - low) / (at_high - at_low);
      const bool settled = std::abs(next - t) <= 1e-15 * std::abs(next);
      t = next;
      if (settled || !(t > std::min(low, high) && t < std::max(low, high))) break;
      const double here = at(t);
      if (here == 0) break;
      if ((here < 0) != (at_high < 0)) low = high, at_low = at_high;
      else at_low *= at_high / (at_high + here);
      high = t, at_high = here;
    }
    // If two lines are nearly parallel, rounding of t moves their corner far.
    const Line &a = stack_.line[i], &b = stack_.line[j];
    if (std::abs(cross(a.normal, b.normal)) < kNear * a.length * b.length) add(t);
    else add_if_near(Slice(stack_, t).corner(i, j), t);
  }

  void on_ridge(int i, int j) {
    const Line &a = stack_.line[i], &b = stack_.line[j];
    const Place g = gradient(a), h = gradient(b), d = overlapper::cross(g, h);
    const double length2 = norm2(d);
    if (!(length2 > kUnit * kUnit * norm2(g) * norm2(h))) return;
    const Place p = (a.offset * overlapper::cross(h, d) + b.offset * overlapper::cross(d, g)) / length2;
    if (std::abs(d.z) < 1e-9 * std::sqrt(length2)) {
      add(p.z);
      return;
    }
    const auto at = [&](double u) { add_if_near({p.x + u * d.x, p.y + u * d.y}, p.z + u * d.z); };
    for (int k = j + 1; k < stack_.lines - 4; ++k) {
      if (!plane(k)) continue;
      const Place w = gradient(stack_.line[k]);
      if (const double rate = overlapper::dot(w, d); rate != 0)
        at((stack_.line[k].offset - overlapper::dot(w, p)) / rate);
    }
    for (int k = 0; k < stack_.quadrics; ++k) {
      const Quadric& q = stack_.quadric[k];
      const Point flat_p{p.x, p.y}, flat_d{d.x, d.y};
      const Point y0 = q.ball ? flat_p : Point{dot(q.across, flat_p), 0},
                  y1 = q.ball ? flat_d : Point{dot(q.across, flat_d), 0};
      const double m0 = dot(q.shear, y0), m1 = dot(q.shear, y1), stretch = 1 + dot(q.shear, q.shear);
      for_roots(dot(y1, y1) + 2 * m1 * d.z + stretch * d.z * d.z,
                dot(y0, y1) + m0 * d.z + m1 * p.z - dot(q.centre, y1) + stretch * p.z * d.z - q.along * d.z,
                q.value(flat_p, p.z), at);
    }
  }

  /// Adds the ends of the circle in which the plane cuts the ball.
  void plane_and_ball(const Line& line) {
    const Quadric& q = stack_.quadric[stack_.ball];
    const Point u = (1 / line.length) * line.normal, d{-u.y, u.x};
    const double h0 = line.offset / line.length, h1 = -line.rate / line.length;
    const double cu = dot(u, q.centre), mu = -dot(q.shear, u), cd = dot(d, q.centre), md = -dot(q.shear, d);
    for_roots(md * md - h1 * h1 + 2 * h1 * mu - (1 + dot(q.shear, q.shear)),
              cd * md - h0 * h1 + h0 * mu + h1 * cu + q.along, cd * cd - h0 * h0 + 2 * h0 * cu - q.slack,
              [&](double t) {
                const double h = h0 + h1 * t, s = cd + md * t;
                add_if_near({h * u.x + s * d.x, h * u.y + s * d.y}, t);
              });
  }

  /// Calls use(y, t) where the line a y + b t = c, in the plane across a cylinder, meets the circle of the cylinder.
  template <class Use>
  static void on_disc(const Quadric& q, double a, double b, double c, Use use) {
    const double length2 = a * a + b * b;
    if (!(length2 > 0)) return;
    const double y0 = c * a / length2, t0 = c * b / length2, y1 = -b, t1 = a, shear = q.shear.x,
                 stretch = 1 + shear * shear;
    for_roots(y1 * y1 + 2 * shear * y1 * t1 + stretch * t1 * t1,
              y0 * y1 + shear * (y0 * t1 + y1 * t0) - q.centre.x * y1 + stretch * t0 * t1 - q.along * t1,
              q.value(y0 * q.across, t0), [&](double u) { use(y0 + u * y1, t0 + u * t1); });
  }

  /// Adds the values at which a plane parallel to the axis of a cylinder meets the sides of the cylinder.
  void plane_along(const Line& line, const Quadric& q) {
    if (std::abs(cross(line.normal, q.across)) > 1e-9 * line.length) return;
    on_disc(q, dot(line.normal, q.across), line.rate, line.offset, [&](double, double t) { add(t); });
  }

  void ball_and_cylinder(const Quadric& ball, const Quadric& q) {
    const Point axis{-q.across.y, q.across.x};
    const double y = dot(q.across, ball.centre), z = dot(axis, ball.centre);
    const double along = ball.along - dot(ball.shear, ball.centre) + q.shear.x * y, slack = ball.slack - z * z;
    on_disc(q, q.centre.x - y, q.along - along, (q.slack - slack) / 2, [&](double side, double t) {
      const double s = z - dot(ball.shear, axis) * t;
      add_if_near({side * q.across.x + s * axis.x, side * q.across.y + s * axis.y}, t);
    });
  }

  void parallel_cylinders(const Quadric& p, const Quadric& q) {
    const double side = dot(p.across, q.across) < 0 ? -1 : 1;
    on_disc(p, p.centre.x - side * q.centre.x, p.along - q.along, (p.slack - q.slack) / 2,
            [&](double, double t) { add(t); });
  }

  const Stack& stack_;
  std::vector<double>& values_;
  Samples samples_, x_, y_;  ///< values of t, and a corner at each
  std::array<Sides, kSamples / kRow> sides_;
};

/// Halves the interval down to the last bit. `before(t)` is true if t lies before the wanted change.
template <class Before>
void halve(double& low, double& high, Before before) {
  for (int step = 0; step < 60; ++step) {
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return;
    (before(middle) ? low : high) = middle;
  }
}

/// Finds the changes of the outline that closed forms do not give, and joins intervals with the same outline.
class Settling {
 public:
  Settling(const Stack& stack, bool closely, std::vector<Interval>& intervals)
      : stack_(stack),
        closely_(closely),
        beside_(closely ? 1e-13 : 1e-5),
        inner_(closely ? kMostInner : 2),
        intervals_(intervals),
        low_(stack.low),
        high_(stack.high) {}

  bool run(Candidates& candidates, std::vector<double>& values) {
    candidates.collect();
    values.push_back(low_), values.push_back(high_);
    std::sort(values.begin(), values.end());
    if (!find_inside(values)) {
      // Corners of a plane and two quadrics were not collected yet.
      candidates.trace(low_, high_);
      std::sort(values.begin(), values.end());
      if (!find_inside(values)) return true;
    }
    close_in();
    if (pointlike() && find_wide(values)) close_in();
    candidates.trace(low_, high_);
    values.push_back(low_), values.push_back(high_);
    std::sort(values.begin(), values.end());
    for (size_t i = 0; i + 1 < values.size(); ++i) {
      const double low = values[i], high = values[i + 1];
      if (low >= low_ && high <= high_ && high - low > 1e-14 * size_near(low, high) && !settle(low, high)) return false;
    }
    if (intervals_.empty()) return true;
    intervals_.back().joined += joined_;
    refine();
    return true;
  }

 private:
  /// The largest number of parts of an interval, each of which has a slice.
  static constexpr int kMostInner = 48;
  static constexpr double kPointlike = 1e-11, kPointlikeClosely = 1e-14;  ///< relative to the height of the stack
  static constexpr double kRounded = 1e-12;  ///< relative to the distance of all slices from the origin
  static constexpr int kMostEvents = 40;

  /// The size that small intervals are compared with: the size of all intervals, or less near the origin, where doubles
  /// are finer.
  double size_near(double low, double high) const {
    const double all = high_ - low_;
    return std::clamp(1e3 * std::max(std::abs(low), std::abs(high)), 1e-3 * all, all);
  }

  Outline at(double t) const { return outline(Slice(stack_, t)); }
  /// The outline at t; faster if it is the likely one.
  Outline at(double t, const Outline& likely) const {
    const Slice slice(stack_, t);
    return !likely.empty() && is_outline(slice, likely) ? likely : outline(slice);
  }

  void append(double low, double high, const Outline& between) {
    if (between.empty()) return;
    // Only rounding leaves an empty slice between others: the set is convex.
    if (!intervals_.empty()) intervals_.back().high = low;
    // A corner and a circle, or three lines, meet at one value of t. Rounding may turn this value into an interval.
    const double far = std::max({0.0, low_, -high_});
    const double pointlike =
        std::max((closely_ ? kPointlikeClosely : kPointlike) * size_near(low, high), kRounded * far);
    if (high - low < pointlike && !intervals_.empty()) {
      intervals_.back().high = high, joined_ += high - low;
      return;
    }
    joined_ = 0;
    if (intervals_.size() == 1 && intervals_[0].high - intervals_[0].low < pointlike) {
      intervals_[0] = {intervals_[0].low, high, between, intervals_[0].joined + low - intervals_[0].low};
      return;
    }
    if (!intervals_.empty() && intervals_.back().outline == between) intervals_.back().high = high;
    else intervals_.push_back({low, high, between});
  }

  bool settle(double low, double high) {
    const double width = high - low;
    // If there is an unknown change between the two, the measured surface does not close.
    if (const Outline middle = at(low + width / 2, latest_); !closely_ && !middle.empty()) {
      latest_ = middle;
      append(low, high, middle);
      return true;
    }
    if (!closely_ && !(low < inside_ && inside_ < high)) return true;
    // The slice at the very end of a cylinder has no width, so rounding decides whether its outline is empty.
    const double least = 4 * DBL_EPSILON * std::max(std::abs(low), std::abs(high));
    const double beside = std::min(std::max(beside_ * width, least), width / (2 * inner_));
    std::array<double, kMostInner + 2> t;
    t[0] = low + beside;
    for (int i = 1; i < inner_; ++i) t[i] = low + width * i / inner_;
    t[inner_] = high - beside;
    int samples = inner_ + 1;
    if (t[0] < inside_ && inside_ < t[inner_]) {
      t[samples++] = inside_;
      std::sort(t.begin(), t.begin() + samples);
    }
    std::array<Outline, kMostInner + 2> seen;
    const int in_the_middle = samples / 2;
    seen[in_the_middle] = at(t[in_the_middle], latest_);
    latest_ = seen[in_the_middle];
    for (int i = 0; i < samples; ++i)
      if (i != in_the_middle) seen[i] = at(t[i], latest_);
    double from = low;
    for (int i = 0; i + 1 < samples; ++i)
      if (!append_changes(t[i], t[i + 1], seen[i], seen[i + 1], from)) return false;
    append(from, high, seen[samples - 1]);
    return true;
  }

  /// Appends the intervals from `from` to the last change between two slices. `from` becomes that change. False if
  /// there are too many changes.
  bool append_changes(double here, double there, Outline now, const Outline& last, double& from) {
    while (!(now == last)) {
      if (++events_ > kMostEvents) return false;
      // Finds a change between here and there, mostly the first one.
      double before = here, after = there;
      Outline then = last;
      halve(before, after, [&](double t) {
        const Outline found = at(t);
        if (found == now) return true;
        then = found;
        return false;
      });
      append(from, after, now);
      from = here = after;
      now = then;
    }
    return true;
  }

  /// Finds changes of the outline near the origin again, to the last bit. Doubles are finer there than the error of the
  /// equations of breakpoints.
  void refine() {
    constexpr double kFine = 1e-6, kRounding = 1e-15;
    const double range = stack_.high - stack_.low, away = kRounding * range;
    for (size_t i = 0; i <= intervals_.size(); ++i) {
      const double t = i < intervals_.size() ? intervals_[i].low : intervals_[i - 1].high;
      if (std::abs(t) < kFine * range) refine(i, t - away, t + away);
    }
  }

  /// Finds the change before interval i again, or the change after the last interval. Only if there is no other change
  /// between low and high.
  void refine(size_t i, double low, double high) {
    Interval* before = i > 0 ? &intervals_[i - 1] : nullptr;
    Interval* after = i < intervals_.size() ? &intervals_[i] : nullptr;
    if ((before && !(low > before->low)) || (after && !(high < after->high))) return;
    const auto outline_of = [](const Interval* interval) { return interval ? interval->outline : Outline{}; };
    const Outline of_before = outline_of(before);
    if (!(at(low) == of_before) || !(at(high) == outline_of(after))) return;
    halve(low, high, [&](double t) { return at(t) == of_before; });
    if (before) before->high = after ? high : low;
    if (after) after->low = high;
  }

  /// Whether the slice is not empty. latest_ becomes its outline.
  bool holds(double t) {
    const Outline found = at(t, latest_);
    if (found.empty()) return false;
    latest_ = found;
    return true;
  }

  /// Sets inside_ to a slice that is not empty: at the origin, or midway between two breakpoints, or beside that. False
  /// if there is none.
  bool find_inside(const std::vector<double>& values) {
    // The origin is a point of the common set, but not of every piece.
    if (low_ < 0 && 0 < high_ && holds(0)) {
      inside_ = 0;
      return true;
    }
    // The tip of a cone around the centre of a ball is in the middle of a cap of another ball. In that slice, all
    // planes of the cone meet in a point, and rounding may leave nothing.
    for (const double share : {0.5, 0.375}) {
      for (size_t i = 0; i + 1 < values.size(); ++i) {
        inside_ = values[i] + share * (values[i + 1] - values[i]);
        if (holds(inside_)) return true;
      }
      if (stack_.ball < 0) return false;
    }
    return false;
  }

  bool pointlike() const { return high_ - low_ < kPointlike * (stack_.high - stack_.low); }

  /// Looks for a slice that is not empty between two breakpoints farther from each other. A piece as small as a point
  /// may be a corner that only rounding has put near the origin.
  bool find_wide(const std::vector<double>& values) {
    const double least = kPointlike * (stack_.high - stack_.low);
    for (size_t i = 0; i + 1 < values.size(); ++i) {
      const double middle = values[i] + (values[i + 1] - values[i]) / 2;
      if (!(values[i + 1] - values[i] > least) || (low_ <= middle && middle <= high_) || !holds(middle)) continue;
      inside_ = middle, low_ = stack_.low, high_ = stack_.high;
      return true;
    }
    return false;
  }

  /// Sets low_ and high_ to at most four times the distance of the last slices that are not empty. Samples and
  /// bisections then lie where changes are.
  void close_in() {
    for (double* end : {&low_, &high_})
      for (int step = 0; step < 60; ++step) {
        const double nearer = inside_ + (*end - inside_) / 4;
        if (nearer == inside_ || holds(nearer)) break;
        *end = nearer;
      }
  }

  const Stack& stack_;
  bool closely_;
  /// The fraction of an interval that is left out at its ends. The root of a slice's area is concave. A part of the set
  /// that begins or ends there therefore has at most the cube of that fraction of the volume.
  double beside_;
  int inner_;
  std::vector<Interval>& intervals_;
  double low_, high_;                                        ///< slices outside are empty
  double inside_ = std::numeric_limits<double>::infinity();  ///< this slice is not empty
  double joined_ = 0;  ///< the width of the pointlike intervals after the last other one
  int events_ = 0;
  Outline latest_;
};

}  // namespace

bool find_intervals(const Stack& stack, bool closely, std::vector<Interval>& intervals) {
  intervals.clear();
  if (!(stack.low < stack.high)) return true;
  thread_local std::vector<double> values;
  values.clear();
  Candidates candidates(stack, values);
  return Settling(stack, closely, intervals).run(candidates, values);
}

}  // namespace overlapper::slicing
