#include "methods/round/breakpoints.h"

#include <algorithm>
#include <limits>

namespace overlapper::slicing {
namespace {

/// A point this far outside of another surface, relative to the terms of that, may yet be a corner.
constexpr double kNear = 1e-6;

/// A point or direction (x, y, t).
using Place = Vec3;

/// Two points of the line where two planes meet.
struct Ridge {
  Place point, direction;
};

/// The two roots of a u² + 2 h u + c, if they are real, without cancellation.
template <class Use>
void for_roots(double a, double h, double c, Use use) {
  const double discriminant = h * h - a * c;
  if (!(discriminant >= 0)) return;
  const double far = -(h + std::copysign(std::sqrt(discriminant), h));
  if (far != 0) use(c / far);
  if (a != 0) use(far / a);
}

class Candidates {
 public:
  Candidates(const Stack& stack, std::vector<double>& values) : stack_(stack), values_(values) {}

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
    if (stack_.quadrics == 2) {
      const Quadric &p = stack_.quadric[0], &q = stack_.quadric[1];
      if (p.ball != q.ball) ball_and_cylinder(p.ball ? p : q, p.ball ? q : p);
      else if (std::abs(cross(p.across, q.across)) < 1e-12) parallel_cylinders(p, q);
    }
  }

 private:
  bool plane(int i) const { return stack_.line[i].quadric < 0; }
  static Place gradient(const Line& line) { return {line.normal.x, line.normal.y, line.rate}; }

  void add(double t) {
    if (t > stack_.low && t < stack_.high) values_.push_back(t);
  }
  void add_if_near(Point p, double t) {
    if (!(t > stack_.low && t < stack_.high)) return;
    for (int i = 0; i < stack_.lines - 4; ++i) {
      if (!plane(i)) continue;
      const Line& l = stack_.line[i];
      const double terms =
          std::abs(l.offset) + std::abs(l.rate * t) + std::abs(l.normal.x * p.x) + std::abs(l.normal.y * p.y);
      if (l.offset - l.rate * t - dot(l.normal, p) < -kNear * terms) return;
    }
    for (int i = 0; i < stack_.quadrics; ++i) {
      const Quadric& q = stack_.quadric[i];
      const double terms = q.terms(t) + dot(p, p) + 2 * (std::abs(q.centre.x * p.x) + std::abs(q.centre.y * p.y));
      if (q.value(p, t) > kNear * terms) return;
    }
    values_.push_back(t);
  }

  void on_ridge(int i, int j) {
    const Line &a = stack_.line[i], &b = stack_.line[j];
    const Place g = gradient(a), h = gradient(b), d = overlapper::cross(g, h);
    const double length2 = norm2(d);
    if (!(length2 > 1e-24 * norm2(g) * norm2(h))) return;
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

  /// Where the plane's circle on the ball ends.
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

  /// Values of t where the line a y + b t = c of the plane across a cylinder meets its disc.
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

  /// A plane that holds the axis's direction leaves the cylinder where its border meets the sides.
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
};

/// Finds what the closed forms have not, and puts intervals together that have the same outline.
class Settling {
 public:
  Settling(const Stack& stack, bool closely, std::vector<Interval>& intervals)
      : stack_(stack),
        beside_(closely ? 1e-13 : 1e-5),
        inner_(closely               ? kMostInner
               : stack.quadrics == 2 ? 6
                                     : 2),
        intervals_(intervals),
        low_(stack.low),
        high_(stack.high) {}

  bool run(std::vector<double>& values) {
    values.push_back(low_), values.push_back(high_);
    std::sort(values.begin(), values.end());
    if (!close_in(values)) return true;
    values.push_back(low_), values.push_back(high_);
    std::sort(values.begin(), values.end());
    const double least = 1e-14 * (high_ - low_);
    for (size_t i = 0; i + 1 < values.size(); ++i)
      if (values[i] >= low_ && values[i + 1] <= high_ && values[i + 1] - values[i] > least &&
          !settle(values[i], values[i + 1]))
        return false;
    return true;
  }

 private:
  /// Of an interval, how many parts of it are looked at at most.
  static constexpr int kMostInner = 48;
  static constexpr double kPointlike = 1e-11;  ///< of the stack
  static constexpr int kMostEvents = 40;

  Outline at(double t) const { return outline(Slice(stack_, t)); }

  void append(double low, double high, const Outline& between) {
    if (between.empty()) return;
    // Of a convex set there is no empty slice between others, but by rounding.
    if (!intervals_.empty()) intervals_.back().high = low;
    // A corner and a circle, or three lines, meet in a value of t; rounding makes it an interval of its own.
    const double pointlike = kPointlike * (high_ - low_);
    if (high - low < pointlike && !intervals_.empty()) {
      intervals_.back().high = high;
      return;
    }
    if (intervals_.size() == 1 && intervals_[0].high - intervals_[0].low < pointlike) {
      intervals_[0] = {intervals_[0].low, high, between};
      return;
    }
    if (!intervals_.empty() && intervals_.back().outline == between) intervals_.back().high = high;
    else intervals_.push_back({low, high, between});
  }

  bool settle(double low, double high) {
    const double width = high - low;
    // The corners of a plane and two quadrics come and go between samples only if they are close together.
    std::array<double, kMostInner + 2> t;
    t[0] = low + beside_ * width;
    for (int i = 1; i < inner_; ++i) t[i] = low + width * i / inner_;
    t[inner_] = high - beside_ * width;
    int samples = inner_ + 1;
    if (t[0] < inside_ && inside_ < t[inner_]) {
      t[samples++] = inside_;
      std::sort(t.begin(), t.begin() + samples);
    }
    std::array<Outline, kMostInner + 2> seen;
    for (int i = 0; i < samples; ++i) seen[i] = at(t[i]);
    double from = low;
    for (int i = 0; i + 1 < samples; ++i) {
      double here = t[i];
      Outline now = seen[i];
      while (!(now == seen[i + 1])) {
        if (++events_ > kMostEvents) return false;
        // The first change between here and there, or one of them.
        double before = here, after = t[i + 1];
        Outline then = seen[i + 1];
        for (int step = 0; step < 60; ++step) {
          const double middle = before + (after - before) / 2;
          if (middle <= before || middle >= after) break;
          const Outline found = at(middle);
          if (found == now) before = middle;
          else after = middle, then = found;
        }
        append(from, after, now);
        from = here = after;
        now = then;
      }
    }
    append(from, high, seen[samples - 1]);
    return true;
  }

  /// What slices hold something is found to a factor of four, so that a bisection looks where changes are. False if
  /// none does: where all breakpoints have closed forms, one in the middle between two of them would.
  bool close_in(const std::vector<double>& values) {
    const auto holds = [&](double t) { return !at(t).empty(); };
    std::optional<double> inside;
    // The origin is a point of the common set, though not of every piece.
    if (low_ < 0 && 0 < high_ && holds(0)) inside = 0;
    for (size_t i = 0; i + 1 < values.size() && !inside; ++i)
      if (const double middle = values[i] + (values[i + 1] - values[i]) / 2; holds(middle)) inside = middle;
    if (!inside && stack_.quadrics == 2) inside = look_for_something();
    if (!inside) return false;
    inside_ = *inside;
    for (double* end : {&low_, &high_}) {
      for (int step = 0; step < 60; ++step) {
        const double nearer = inside_ + (*end - inside_) / 4;
        if (nearer == inside_ || holds(nearer)) break;
        *end = nearer;
      }
    }
    return true;
  }

  /// Slices that hold something are an interval, and so are those in which the first lines leave something, and those
  /// in which a line misses it by no more than so much: a golden section meets them.
  std::optional<double> look_for_something() const {
    constexpr double kGolden = 0.6180339887498949;
    const auto better = [](const Outline& a, const Outline& b) {
      return a.failed != b.failed ? a.failed > b.failed : a.missed > b.missed;
    };
    double low = stack_.low, high = stack_.high;
    double p = high - kGolden * (high - low), q = low + kGolden * (high - low);
    Outline at_p = at(p), at_q = at(q);
    for (int i = 0; i < 70; ++i) {
      if (!at_p.empty()) return p;
      if (!at_q.empty()) return q;
      if (better(at_p, at_q)) {
        high = q, q = p, at_q = at_p;
        p = high - kGolden * (high - low), at_p = at(p);
      } else {
        low = p, p = q, at_p = at_q;
        q = low + kGolden * (high - low), at_q = at(q);
      }
    }
    return std::nullopt;
  }

  const Stack& stack_;
  /// Of an interval: where its ends are looked at. The root of a slice's area is concave, so that what begins or ends
  /// nearer than that holds no more than its cube of the volume.
  double beside_;
  int inner_;
  std::vector<Interval>& intervals_;
  double low_, high_;                                        ///< beyond which there is nothing
  double inside_ = std::numeric_limits<double>::infinity();  ///< at which there is something, if it is known
  int events_ = 0;
};

}  // namespace

bool find_intervals(const Stack& stack, bool closely, std::vector<Interval>& intervals) {
  intervals.clear();
  if (!(stack.low < stack.high)) return true;
  thread_local std::vector<double> values;
  values.clear();
  Candidates(stack, values).collect();
  return Settling(stack, closely, intervals).run(values);
}

}  // namespace overlapper::slicing
