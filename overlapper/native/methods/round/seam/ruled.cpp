#include <algorithm>
#include <cfloat>
#include <cmath>

#include "geometry/constants.h"
#include "methods/round/lenses/polynomials.h"
#include "methods/round/seam/part.h"

namespace overlapper::seam {
namespace {

using lenses::product;
using Second = std::array<double, 3>;  ///< a polynomial of T, and its coefficients of 1, T and T²
using Fourth = std::array<double, 5>;

/// Rounding of a discriminant, relative to its terms.
constexpr double kBlur = 4 * DBL_EPSILON;

/// The crossing of a quadric with a plane or a cylinder, which consists of straight lines along `along`. A line starts
/// at a place on a base curve, at the parameter p. In a plane, the base is a straight line, and p is a share of its
/// length. On a cylinder, it is a circle with the angle p from the point that is nearest to the inner point. Numbers
/// near this point keep their digits. Along the line, the quadric has the value α τ² + 2 β τ + γ.
///
/// The base is a polynomial of T over another one: of T = p in a plane, of T = tan(p / 2) or 1 / T on a cylinder.
class Ruled {
 public:
  /// In the plane through the origin's foot. Points are at most `extent` away.
  static Ruled in_plane(Vec3 normal, double slack, const Quadric& quadric, double extent) {
    Ruled ruled(quadric);
    const Vec3 u = any_orthogonal(normal), v = cross(normal, u), ku = quadric.k * u, kv = quadric.k * v;
    // Lines are along the shorter axis of the section.
    const double angle = 0.5 * std::atan2(2 * dot(ku, kv), norm2(ku) - norm2(kv));
    ruled.along_ = std::cos(angle) * u + std::sin(angle) * v;
    ruled.length_ = extent;
    ruled.base_ = {slack * normal, extent * cross(normal, ruled.along_), Vec3{}};
    ruled.below_ = {1, 0, 0};
    ruled.set_alpha();
    return ruled;
  }
  static Ruled on_cylinder(const Quadric& cylinder, const Quadric& quadric) {
    Ruled ruled(quadric);
    const double away = norm(cylinder.centre);
    const Vec3 e = away > 0 ? -cylinder.centre / away : any_orthogonal(cylinder.axis);
    const double near = -cylinder.slack / (cylinder.radius + away);
    ruled.along_ = cylinder.axis, ruled.cylinder_ = &cylinder;
    ruled.base_ = {near * e, 2 * cylinder.radius * cross(cylinder.axis, e), (near - 2 * cylinder.radius) * e};
    ruled.below_ = {1, 0, 1};
    ruled.set_alpha();
    return ruled;
  }

  /// Adds the parts that the common part has. make(x) gives both normals; weights are over `scale`.
  template <class Make>
  void add(Part& part, Part::Sides sides, double scale, Make make, std::vector<SeamPoint>& points) {
    if (!(alpha_ > 0)) return;
    find_intervals();
    if (tangent_) {
      constexpr int kSamples = 32;
      for (int i = 0; i < kSamples; ++i) {
        const double p = least() + (i + 0.5) / kSamples * (most() - least());
        const Line line = line_at(p);
        if (part.holds(line.start - line.beta / alpha_ * along_, sides)) part.touch();
      }
      return;
    }
    if (intervals_.empty()) return;
    find_changes(part, sides);
    for (const auto& [low, high] : intervals_) {
      const auto parameter = [&, low = low, high = high](double angle) {
        const double sine = std::sin(angle / 2), cosine = std::cos(angle / 2);
        return sine < cosine ? low + (high - low) * sine * sine : high - (high - low) * cosine * cosine;
      };
      steps_.assign({0, kPi});
      for (double p : changes_)
        for (const double turn : {-2 * kPi, 0.0, 2 * kPi}) {
          const double share = (p + (cylinder_ ? turn : 0) - low) / (high - low);
          if (share > 0 && share < 1 && (cylinder_ || turn == 0)) steps_.push_back(2 * std::asin(std::sqrt(share)));
        }
      std::ranges::sort(steps_);
      for (const int branch : {-1, 1}) {
        const auto at = [&, low = low, high = high](double angle) {
          const Line line = line_at(parameter(angle));
          const double rate = (high - low) / 2 * std::sin(angle);
          const double square = fall_ > 0 ? fall_ * rate * rate : std::max(0.0, line.discriminant());
          const double root = std::sqrt(square);
          const Vec3 x = line.start + line.crossing(branch, root) * along_;
          if (fall_ > 0) return SeamPoint{x, make(x), length_ / std::sqrt(fall_) / scale, 0};
          if (!(square > 0)) return SeamPoint{x, make(x), 0, 0};
          return SeamPoint{x, make(x), rate * length_ / root / scale, kBlur * line.terms / square};
        };
        Quadrature quadrature(at, points);
        for (size_t i = 0; i + 1 < steps_.size(); ++i)
          if (steps_[i + 1] - steps_[i] > 1e-13 && part.holds(at(steps_[i] / 2 + steps_[i + 1] / 2).place, sides))
            if (!quadrature.add(steps_[i], steps_[i + 1])) part.touch();
      }
    }
  }

 private:
  explicit Ruled(const Quadric& quadric) : quadric_(quadric) {}

  struct Line {
    Vec3 start;
    double alpha, beta, gamma, terms;  ///< terms: the size of those of the discriminant
    double discriminant() const { return beta * beta - alpha * gamma; }
    double crossing(int branch, double root) const {
      const double far = -(beta + std::copysign(root, beta));
      return (far < 0) == (branch < 0) ? far / alpha : far != 0 ? gamma / far : 0;
    }
  };
  Line line_at(double p) const {
    Vec3 start = base_[0] + p * base_[1];
    if (cylinder_) {
      const double sine = std::sin(p / 2);
      start = base_[0] + sine * std::cos(p / 2) * base_[1] + sine * sine * (base_[2] - base_[0]);
    }
    const double beta = dot(k_along_, quadric_.k * start) - dot(quadric_.b, along_), gamma = quadric_.value(start);
    const double terms = norm2(quadric_.k * start) + std::abs(2 * dot(quadric_.b, start)) + std::abs(quadric_.slack);
    return {start, alpha_, beta, gamma, beta * beta + alpha_ * terms};
  }

  void set_alpha() { k_along_ = quadric_.k * along_, alpha_ = norm2(k_along_); }
  double least() const { return cylinder_ ? -kPi / 2 : -1; }
  double most() const { return cylinder_ ? 3 * kPi / 2 : 1; }

  /// Calls use(base, below, of) with the base by T, and a function from T to p.
  template <class Use>
  void for_charts(Use use) const {
    if (!cylinder_) return use(base_, [](double t) { return t; });
    use(base_, [](double t) { return 2 * std::atan(t); });
    use(std::array{base_[2], base_[1], base_[0]}, [](double t) { return kPi - 2 * std::atan(t); });
  }

  /// β and γ of another quadric, times the denominator and its square.
  struct Polynomials {
    double alpha;
    Second beta;
    Fourth gamma, size;  ///< size: a bound of the terms of γ
  };
  Polynomials polynomials(const Quadric& q, const std::array<Vec3, 3>& base) const {
    const Vec3 k_along = q.k * along_;
    Polynomials found{norm2(k_along), {}, {}, {}};
    for (int i = 0; i < 3; ++i) found.beta[i] = dot(k_along, q.k * base[i]) - dot(q.b, along_) * below_[i];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double square = dot(q.k * base[i], q.k * base[j]), linear = dot(q.b, base[i]) * below_[j];
        const double constant = q.slack * below_[i] * below_[j];
        found.gamma[i + j] += square - 2 * linear + constant;
        found.size[i + j] += std::abs(square) + 2 * std::abs(linear) + std::abs(constant);
      }
    return found;
  }

  /// In a plane, the discriminant is fall (p − low) (high − p). True if this is between the ends of the base.
  bool find_ellipse() {
    fall_ = 0;
    if (cylinder_) return false;
    const Polynomials of = polynomials(quadric_, base_);
    const Fourth square = product(of.beta, of.beta);
    const double d0 = square[0] - alpha_ * of.gamma[0], d1 = square[1] - alpha_ * of.gamma[1];
    const double d2 = square[2] - alpha_ * of.gamma[2], under = d1 * d1 - 4 * d0 * d2;
    if (!(d2 < 0 && under > 0)) return false;
    const double far = -(d1 + std::copysign(std::sqrt(under), d1)), one = far / (2 * d2);
    const double two = far != 0 ? 2 * d0 / far : 0, low = std::min(one, two), high = std::max(one, two);
    if (!(low >= least() && high <= most())) return false;
    intervals_.assign(1, {low, high}), fall_ = -d2;
    return true;
  }

  /// Newton's method for the discriminant on a cylinder. Near the inner point, angles keep more digits than roots of
  /// polynomials.
  double polished(double p) const {
    if (!cylinder_) return p;
    constexpr double kNear = 1e-9;
    for (int i = 0; i < 2; ++i) {
      const Line line = line_at(p);
      const Vec3 rate = std::cos(p) / 2 * base_[1] + std::sin(p) / 2 * (base_[2] - base_[0]);
      const double slope =
          2 * (line.beta * dot(k_along_, quadric_.k * rate) - alpha_ * dot(quadric_.gradient(line.start), rate));
      const double step = -line.discriminant() / slope;
      if (!(std::abs(step) < kNear)) break;
      p += step;
    }
    return p;
  }

  void find_intervals() {
    tangent_ = false;
    if (find_ellipse()) return;
    std::vector<double> ends;
    double whole = 0, terms = 0;
    for_charts([&](const std::array<Vec3, 3>& base, auto parameter) {
      const Polynomials of = polynomials(quadric_, base);
      Fourth d = product(of.beta, of.beta);
      for (int i = 0; i < 5; ++i) {
        terms += std::abs(d[i]) + alpha_ * of.size[i];
        d[i] -= alpha_ * of.gamma[i];
        whole += std::abs(d[i]);
      }
      const lenses::Roots roots = lenses::roots<4>(d, -1, 1);
      for (int i = 0; i < roots.count; ++i) ends.push_back(polished(parameter(roots.t[i])));
    });
    tangent_ = whole <= 1e-14 * terms;
    intervals_.clear();
    if (tangent_) return;
    std::ranges::sort(ends);
    const auto add_if_crossed = [&](double low, double high) {
      if (low < high && line_at(low / 2 + high / 2).discriminant() > 0) intervals_.push_back({low, high});
    };
    if (cylinder_ && !ends.empty()) {
      ends.push_back(ends.front() + 2 * kPi);
    } else {
      ends.insert(ends.begin(), least()), ends.push_back(most());
    }
    for (size_t i = 0; i + 1 < ends.size(); ++i) add_if_crossed(ends[i], ends[i + 1]);
  }

  /// Where the crossing may enter or leave other walls, or the quadric beside it.
  void find_changes(const Part& part, Part::Sides sides) {
    changes_.clear();
    for_charts([&](const std::array<Vec3, 3>& base, auto parameter) {
      const Polynomials of = polynomials(quadric_, base);
      const auto add_roots = [&](const Fourth& p) {
        const lenses::Roots roots = lenses::roots<4>(p, -1, 1);
        for (int i = 0; i < roots.count; ++i) changes_.push_back(parameter(roots.t[i]));
      };
      for (int f = 0; f < static_cast<int>(part.faces().size()); ++f) {
        if (f == sides[0] || f == sides[1]) continue;
        const Face& face = part.faces()[f];
        const double rate = dot(face.normal, along_);
        Second room;  // at the base
        for (int i = 0; i < 3; ++i) room[i] = face.slack * below_[i] - dot(face.normal, base[i]);
        const Fourth square = product(room, room), both = product(of.beta, room);
        Fourth sum;
        for (int i = 0; i < 5; ++i) sum[i] = of.alpha * square[i] + 2 * rate * both[i] + rate * rate * of.gamma[i];
        add_roots(sum);
        // If lines are nearly along the plane, two roots may be one.
        if (std::abs(rate) < 1e-3) add_roots({room[0], room[1], room[2], 0, 0});
      }
      if (const Quadric* beside = part.beside(sides)) {
        const Polynomials other = polynomials(*beside, base);
        Fourth ends;
        Second middles;
        for (int i = 0; i < 5; ++i) ends[i] = of.alpha * other.gamma[i] - other.alpha * of.gamma[i];
        for (int i = 0; i < 3; ++i) middles[i] = of.alpha * other.beta[i] - other.alpha * of.beta[i];
        // In a plane, the degrees are one half of those on a cylinder.
        const Second end{ends[0], ends[1], ends[2]};
        std::array<double, 6> crossed{};
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) {
            const double mixed = of.beta[i] * other.gamma[j] - other.beta[i] * of.gamma[j];
            for (int k = 0; k < 2; ++k)
              if (i + j + k < 6) crossed[i + j + k] += middles[k] * mixed;
          }
        const Fourth squares = product(end, end);
        Fourth sum;
        for (int i = 0; i < 5; ++i) sum[i] = squares[i] - 4 * crossed[i];
        add_roots(sum);
        // If both quadrics have the same middle along the lines, two roots are one.
        add_roots({end[0], end[1], end[2], 0, 0});
      }
    });
  }

  const Quadric& quadric_;
  const Quadric* cylinder_ = nullptr;
  std::array<Vec3, 3> base_;
  Second below_;  ///< the denominator
  Vec3 along_, k_along_;
  double alpha_ = 0, length_ = 1;  ///< m of the base per parameter, over the length of the ruled surface's normal
  double fall_ = 0;                ///< of the discriminant on an ellipse in a plane; 0 for other lines
  bool tangent_ = false;
  std::vector<std::array<double, 2>> intervals_;  ///< of p, with crossings
  std::vector<double> changes_, steps_;
};

}  // namespace

void add_section(Part& part, int face, const Quadric& quadric, std::vector<SeamPoint>& points) {
  const auto [normal, slack, owner] = part.faces()[face];
  if (!(std::abs(slack) <= part.extent)) return;
  Ruled::in_plane(normal, slack, quadric, part.extent)
      .add(
          part, {face, Part::kRound}, 1,
          [&, normal = normal, owner = owner](Vec3 x) {
            const Vec3 other = quadric.gradient(x);
            return owner == 0 ? std::array{normal, other} : std::array{other, normal};
          },
          points);
}

void add_radical(Part& part, std::vector<SeamPoint>& points) {
  const Quadric &a = *part.round[0], &b = *part.round[1];
  const Vec3 between = b.b - a.b;
  const double apart = norm(between);
  if (!(apart > 0)) return;
  const double slack = (b.slack - a.slack) / (2 * apart);
  if (!(std::abs(slack) <= part.extent)) return;
  // If bodies are nearly equal, the smaller one bounds the section.
  const Quadric& smaller = a.radius <= b.radius ? a : b;
  Ruled::in_plane(between / apart, slack, smaller, part.extent)
      .add(
          part, {Part::kRound, Part::kRound}, apart, [&](Vec3 x) { return std::array{a.gradient(x), b.gradient(x)}; },
          points);
}

void add_on_cylinder(Part& part, int number, std::vector<SeamPoint>& points) {
  const Quadric &cylinder = *part.round[number], &other = *part.round[1 - number];
  Ruled::on_cylinder(cylinder, other)
      .add(
          part, {Part::kRound, Part::kRound}, 1,
          [&](Vec3 x) { return std::array{part.round[0]->gradient(x), part.round[1]->gradient(x)}; }, points);
}

}  // namespace overlapper::seam
