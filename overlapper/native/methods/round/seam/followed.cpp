#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/fitted_axes.h"
#include "methods/round/lenses/polynomials.h"
#include "methods/round/seam/part.h"

namespace overlapper::seam {
namespace {

using Fourth = std::array<double, 5>;

/// Σ value y² + 2 slope y + constant on the unit ball, along its axes there.
struct OnUnitBall {
  std::array<double, 3> value{}, slope{};
  double constant = 0;
};

/// The lines in which two quadrics cross, each a ball or an ellipsoid. They are followed in steps. In a step, places
/// have the distance along the tangent at its beginning as a parameter, and Newton's method finds them.
class Followed {
 public:
  Followed(Part& part, std::vector<SeamPoint>& points)
      : part_(part), points_(points), one_(*part.round[0]), two_(*part.round[1]) {}

  void add() {
    find_starts();
    for (size_t i = 0; i < starts_.size(); ++i)
      if (!passed_[i]) follow(starts_[i]);
  }

 private:
  static constexpr Part::Sides kSides{Part::kRound, Part::kRound};

  /// A part of a line: where it begins, the unit tangent and the curvature there.
  struct Step {
    Vec3 from, tangent, bend;
    double length = 0;
  };

  /// On the first body, the value of the second has at most two minima and two maxima. A line of the seam separates a
  /// minimum from a maximum. Great circles from each of them to the next one therefore meet every line.
  void find_starts() {
    const Principal of = principal(two_.k * one_.stretch);
    OnUnitBall on;
    const Vec3 gradient = two_.gradient(one_.centre);
    on.constant = two_.value(one_.centre);
    for (int i = 0; i < 3; ++i) on.value[i] = of.value[i], on.slope[i] = dot(gradient, one_.stretch * of.axis[i]);
    find_extremes(on);
    const auto place = [&](Vec3 y) {
      return one_.centre + one_.stretch * (y.x * of.axis[0] + y.y * of.axis[1] + y.z * of.axis[2]);
    };
    for (size_t i = 0; i + 1 < extremes_.size(); ++i) {
      const Vec3 p = extremes_[i], next = extremes_[i + 1], beside = next - dot(next, p) * p;
      const Vec3 q = norm2(beside) > 1e-20 ? unit(beside) : any_orthogonal(p);
      for (const double sign : {1.0, -1.0}) {  // both halves of the circle
        const auto at = [&](double t) { return (sign * (1 - t * t) * p + 2 * t * q) / (1 + t * t); };
        const lenses::Roots roots = lenses::roots<4>(on_circle(on, sign * p, q), -1, 1);
        for (int r = 0; r < roots.count; ++r) add_start(place(at(roots.t[r])));
      }
    }
    passed_.assign(starts_.size(), false);
  }

  static Fourth on_circle(const OnUnitBall& on, Vec3 p, Vec3 q) {
    Fourth sum{on.constant, 0, 2 * on.constant, 0, on.constant};
    for (int i = 0; i < 3; ++i) {
      const double v = on.value[i], s = 2 * on.slope[i], a = p[i], b = 2 * q[i];
      // y (1 + T²) = a + b T − a T²
      sum[0] += v * a * a + s * a;
      sum[1] += 2 * v * a * b + s * b;
      sum[2] += v * (b * b - 2 * a * a);
      sum[3] += -2 * v * a * b + s * b;
      sum[4] += v * a * a - s * a;
    }
    return sum;
  }

  /// Where the gradient is along the normal: (value − λ) y = −slope. The lengths of y are 1 for at most six λ. Without
  /// a slope along an axis, y may have any component there if λ is the value of that axis.
  void find_extremes(const OnUnitBall& on) {
    extremes_.clear();
    const auto& [m0, m1, m2] = on.value;
    const double size = std::sqrt(on.slope[0] * on.slope[0] + on.slope[1] * on.slope[1] + on.slope[2] * on.slope[2]);
    const auto excess = [&](double lambda) {
      double sum = -1;
      for (int i = 0; i < 3; ++i) {
        const double ratio = on.slope[i] / (on.value[i] - lambda);
        sum += on.slope[i] != 0 ? ratio * ratio : 0;
      }
      return sum;
    };
    const auto add = [&](double lambda) {
      std::array<double, 3> y{};
      for (int i = 0; i < 3; ++i) y[i] = on.slope[i] != 0 ? -on.slope[i] / (on.value[i] - lambda) : 0;
      const Vec3 at{y[0], y[1], y[2]};
      if (finite(at) && norm2(at) > 0) extremes_.push_back(unit(at));
    };
    const auto bisect = [&](double low, double high, bool rises) {
      for (int i = 0; i < kHalvings; ++i) {
        const double middle = low / 2 + high / 2;
        ((excess(middle) > 0) == rises ? high : low) = middle;
      }
      add(low / 2 + high / 2);
    };
    bisect(m0 - 2 * size, m0, true), bisect(m2, m2 + 2 * size, false);
    for (const auto& [low, high] : {std::pair{m0, m1}, {m1, m2}}) {
      double from = low, to = high;
      for (int i = 0; i < kHalvings; ++i) {
        const double third = (to - from) / 3;
        if (excess(from + third) < excess(to - third)) to -= third;
        else from += third;
      }
      const double least = from / 2 + to / 2;
      if (!(excess(least) < 0)) continue;
      bisect(low, least, false), bisect(least, high, true);
    }
    for (int i = 0; i < 3; ++i) {
      std::array<double, 3> y{};
      double rest = 1;
      for (int j = 0; j < 3; ++j) {
        if (j != i && on.value[j] != on.value[i]) y[j] = -on.slope[j] / (on.value[j] - on.value[i]);
        rest -= y[j] * y[j];
      }
      if (!(rest > 0)) continue;
      for (const double sign : {-1.0, 1.0}) {
        y[i] = sign * std::sqrt(rest);
        extremes_.push_back(unit(Vec3{y[0], y[1], y[2]}));
      }
    }
  }

  /// Moves a place onto both surfaces, in the plane orthogonal to `tangent` if that is not zero. False if that fails.
  bool correct(Vec3& x, Vec3 tangent) const {
    double last = kInfinity;
    for (int i = 0; i < 30; ++i) {
      const Vec3 n = one_.gradient(x), m = two_.gradient(x);
      const Vec3 t = norm2(tangent) > 0 ? tangent : unit(cross(n, m));
      const double det = dot(n, cross(m, t));
      if (!(std::abs(det) > 0)) return false;
      // 2 n·step = −f, 2 m·step = −g, t·step = 0
      const Vec3 step = (-one_.value(x) / 2 * cross(m, t) - two_.value(x) / 2 * cross(t, n)) / det;
      const double size = norm(step);
      if (!(size < kInfinity)) return false;
      x += step;
      if (size <= 1e-15 * norm(x) || (i > 2 && size >= last / 2 && size <= 1e-9 * part_.extent)) return true;
      last = size;
    }
    return false;
  }

  void add_start(Vec3 x) {
    if (correct(x, {})) starts_.push_back(x);
  }

  Vec3 tangent_at(Vec3 x) const { return unit(cross(one_.gradient(x), two_.gradient(x))); }

  /// A step from a place, as long as half the radius of curvature or less.
  Step step_from(Vec3 x) const {
    const Vec3 n = one_.gradient(x), m = two_.gradient(x), t = unit(cross(n, m));
    const double det = dot(n, cross(m, t));
    // n·bend = −tᵀ(kᵀk)t and so on, t·bend = 0
    const Vec3 bend = (-norm2(one_.k * t) * cross(m, t) - norm2(two_.k * t) * cross(t, n)) / det;
    return {x, t, bend, std::min(0.5 / norm(bend), part_.extent)};
  }

  /// The place on both surfaces at a distance along a step. False if Newton's method leaves the line.
  bool place(const Step& step, double along, Vec3& x) const {
    const Vec3 guess = step.from + along * step.tangent + along * along / 2 * step.bend;
    x = guess;
    if (!correct(x, step.tangent)) return false;
    return norm(x - guess) <= 0.5 * std::abs(along) + 1e-12 * part_.extent && dot(tangent_at(x), step.tangent) > 0.2;
  }

  void follow(Vec3 start) {
    constexpr int kMostSteps = 2000;
    constexpr double kShortest = 1e-9;  // relative to the length of the line so far
    Vec3 x = start;
    double far = 0;
    for (int count = 0; count < kMostSteps && !part_.touching(); ++count) {
      cancellation_point();
      Step step = step_from(x);
      Vec3 end, middle;
      int halvings = 0;
      for (; halvings < 40; ++halvings, step.length /= 2)
        if (place(step, step.length / 2, middle) && place(step, step.length, end)) break;
      if (halvings == 40 || !(step.length > kShortest * far)) return part_.touch();
      if (count > 0 && norm(x - start) <= 1e-9 * step.length) return;
      const bool closed = count > 0 && within(step, start);
      for (size_t i = 0; i < starts_.size(); ++i) passed_[i] = passed_[i] || within(step, starts_[i]);
      if (closed) step.length = dot(step.tangent, start - step.from);
      add_nodes(step);
      if (closed) return;
      x = end, far = std::max(far, norm(x - start));
    }
    part_.touch();
  }

  bool within(const Step& step, Vec3 x) const {
    const double along = dot(step.tangent, x - step.from);
    Vec3 there;
    return along >= -1e-9 * step.length && along <= step.length * (1 + 1e-9) &&
           norm(x - step.from) <= 3 * step.length && place(step, along, there) && norm(there - x) <= 1e-5 * step.length;
  }

  /// Adds the parts of a step inside all walls.
  void add_nodes(const Step& step) {
    const auto at = [&](double along) {
      Vec3 x;
      place(step, along, x);
      const Vec3 n = one_.gradient(x), m = two_.gradient(x);
      return SeamPoint{x, {n, m}, 1 / std::abs(dot(step.tangent, cross(n, m)))};
    };
    changes_.assign({0, step.length});
    if (!part_.faces().empty()) find_changes(step);
    std::ranges::sort(changes_);
    Quadrature quadrature(at, points_);
    for (size_t i = 0; i + 1 < changes_.size(); ++i) {
      const double low = changes_[i], high = changes_[i + 1];
      if (high - low > 1e-13 * step.length && part_.holds(at(low / 2 + high / 2).place, kSides))
        if (!quadrature.add(low, high)) part_.touch();
    }
  }

  void find_changes(const Step& step) {
    constexpr int kSamples = 24;
    std::array<Vec3, kSamples + 1> sample;
    const auto along = [&](int i) { return step.length * i / kSamples; };
    for (int i = 0; i <= kSamples; ++i) place(step, along(i), sample[i]);
    for (const Face& face : part_.faces()) {
      const auto room = [&](Vec3 x) { return face.slack - dot(face.normal, x); };
      const auto add_root = [&](double low, double high) {
        const auto at = [&](double t) {
          Vec3 x;
          place(step, t, x);
          return room(x);
        };
        const bool before = at(low) < 0;
        if ((at(high) < 0) == before) return;
        for (int i = 0; i < 60; ++i) {
          const double middle = low / 2 + high / 2;
          ((at(middle) < 0) == before ? low : high) = middle;
        }
        changes_.push_back(low / 2 + high / 2);
      };
      for (int i = 0; i < kSamples; ++i) {
        add_root(along(i), along(i + 1));
        if (i == 0) continue;
        // Two roots between three samples: the vertex of their parabola lies beyond the wall.
        const double p = room(sample[i - 1]), q = room(sample[i]), r = room(sample[i + 1]);
        const double rise = (r - p) / 2, bend = p - 2 * q + r;
        if ((p < 0) != (q < 0) || (q < 0) != (r < 0) || !(std::abs(rise) < std::abs(bend))) continue;
        const double vertex = along(i) - rise / bend * (along(1) - along(0));
        add_root(along(i - 1), vertex), add_root(vertex, along(i + 1));
      }
    }
  }

  static constexpr int kHalvings = 120;

  Part& part_;
  std::vector<SeamPoint>& points_;
  const Quadric &one_, &two_;
  std::vector<Vec3> extremes_, starts_;
  std::vector<char> passed_;
  std::vector<double> changes_;
};

}  // namespace

void add_followed(Part& part, std::vector<SeamPoint>& points) { Followed(part, points).add(); }

}  // namespace overlapper::seam
