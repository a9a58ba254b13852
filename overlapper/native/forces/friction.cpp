#include "forces/friction.h"

#include <algorithm>
#include <cmath>

namespace overlapper {
namespace {

/// Trace of a mobility times which its eigenvalues are regarded as zero.
constexpr double kLeast = 1e-15;

/// A symmetric matrix with `shift` added along its diagonal, as L D Lᵀ.
struct Factor {
  Factor(const ThreeByThree& m, double shift) {
    const double least = kLeast * (m[0][0] + m[1][1] + m[2][2] + shift);
    const auto inverted = [&](double pivot) { return 1 / std::max(pivot, least); };
    first = inverted(m[0][0] + shift);
    b = m[1][0] * first, d = m[2][0] * first;
    second = inverted(m[1][1] + shift - b * m[1][0]);
    const double left = m[2][1] - d * m[1][0];
    e = left * second;
    third = inverted(m[2][2] + shift - d * m[2][0] - e * left);
  }
  Three solve(const Three& v) const {
    const double y = v[1] - b * v[0], z = (v[2] - d * v[0] - e * y) * third, up = y * second - e * z;
    return {v[0] * first - b * up - d * z, up, z};
  }
  double b, d, e;               ///< below the diagonal of L, by columns
  double first, second, third;  ///< the diagonal of D, inverted
};

/// The points of a patch are those of Gauss and Legendre in a rectangle that has the area moments of the patch.
constexpr std::array<double, 4> kGaussNodes{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                            0.8611363115940526};
constexpr std::array<double, 4> kWeights{0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                         0.1739274225687269};
static_assert(
    [] {
      double sum = 0, square = 0;
      for (size_t i = 0; i < kGaussNodes.size(); ++i)
        sum += kWeights[i], square += kWeights[i] * kGaussNodes[i] * kGaussNodes[i];
      return sum > 1 - 1e-15 && sum < 1 + 1e-15 && 3 * square > 1 - 1e-15 && 3 * square < 1 + 1e-15;
    }(),
    "means over an interval from -1 to 1, whose mean square is 1 / 3");

}  // namespace

Three opposing(const ThreeByThree& mobility, const Three& slip, double limit, double& shift) {
  if (!(limit > 0) || dot(slip, slip) == 0) return {};
  if (!(mobility[0][0] + mobility[1][1] + mobility[2][2] > 0)) return (-limit / std::sqrt(dot(slip, slip))) * slip;
  // The force is -(mobility + shift)⁻¹ slip, and the remaining slip is -shift times the force. Halley's method on the
  // inverse of the force's size finds the shift, if there is one (Moré and Sorensen 1983). Its errors are cubic, so the
  // force of the last step is found by its derivatives.
  constexpr double kClose = 1e-4;
  Three force{};
  double size = 0;
  for (int step = 0; step < 50; ++step) {
    const Factor factor(mobility, shift);
    force = factor.solve(slip);
    size = std::sqrt(dot(force, force));
    if (shift == 0 && size <= limit) return -1 * force;
    const Three by_shift = factor.solve(force);  // and the opposite sign
    const double off = (limit - size) / limit, slope = dot(force, by_shift) / size;
    const double bend = 3 * (slope * slope - dot(by_shift, by_shift));
    // Far away, the step is at most twice that of Newton's method.
    const double steep = std::max(2 * slope * slope - off * bend, slope * slope);
    const double next = std::max(0.0, shift - 2 * off * slope * size / steep);
    const double moved = next - shift;
    shift = next;
    if (moved == 0) break;
    if (next > 0 && std::abs(off) <= kClose) {
      force = force - moved * (by_shift - moved * factor.solve(by_shift));
      size = std::sqrt(dot(force, force));
      break;
    }
  }
  return (-limit / std::max(size, limit)) * force;
}

Coulomb::Coulomb(const ThreeByThree& rows, const ThreeByThree& mobility, double share)
    : rows_(rows), back_(transposed(rows)), mobility_(rows * (mobility * back_)), share_(share) {
  for (int i = 0; i < 3; ++i)
    if (dot(rows[i], rows[i]) == 0) mobility_[i][i] = 1;
}

void Coulomb::answer(const Three& slip, double pressing) {
  force_ = opposing(mobility_, rows_ * slip - mobility_ * force_, share_ * pressing, shift_);
}

Linear Coulomb::held(const Three& slip, double pressing, double give, bool afresh) {
  const ThreeByThree mobility = give * mobility_;
  const double limit = share_ * pressing;
  const Three free = afresh ? rows_ * slip : rows_ * slip - mobility * force_;
  held_ = opposing(mobility, free, limit, held_shift_);
  // With H = mobility + shift, H force = -free and |force| = limit. Without a limit, the shift stays 0.
  ThreeByThree by_free{};
  Three by_limit{};
  const double scale = mobility[0][0] + mobility[1][1] + mobility[2][2], speed = std::sqrt(dot(free, free));
  if (limit > 0 && scale > 0) {
    ThreeByThree shifted = mobility;
    for (int i = 0; i < 3; ++i) shifted[i][i] += held_shift_ + kLeast * scale;
    by_free = -1 * inverse(shifted);
    if (held_shift_ > 0) {
      const Three along = -1 * (by_free * held_);
      const double steep = dot(held_, along);
      by_limit = (limit / steep) * along;
      by_free = by_free + (1 / steep) * outer(along, along);
    }
  } else if (speed > 0) {
    by_limit = (-1 / speed) * free;
  }
  return {back_ * held_, back_ * (by_free * rows_), share_ * (back_ * by_limit)};
}

PatchFriction::PatchFriction(const ElasticPatch& patch, const PlaneArea& area, const ThreeByThree& mobility,
                             Friction kind)
    : distance_(area.distance > 0 ? area.distance : 0), mobility_(mobility) {
  if (area.area > 0 && patch.friction > 0) distance_ += patch.spinning / patch.friction;
  if (kind == Friction::kDistributed && area.area > 0) {
    spread(area, patch.friction);
  } else {
    const ThreeByThree rows{{{1, 0, 0}, {0, 1, 0}, {0, 0, distance_}}};
    parts_.emplace_back(rows, mobility, patch.friction);
  }
}

void PatchFriction::spread(const PlaneArea& area, double coefficient) {
  struct Point {
    double u, v, share;
  };
  std::vector<Point> points;
  const double half = (area.uu - area.vv) / 2, mean = (area.uu + area.vv) / 2, split = std::hypot(half, area.uv);
  const double turn = std::atan2(area.uv, half) / 2, c = std::cos(turn), s = std::sin(turn);
  const double a = std::sqrt(3 * (mean + split)), b = std::sqrt(3 * std::max(mean - split, 0.0));
  double reach = 0;
  for (size_t i = 0; i < kGaussNodes.size(); ++i)
    for (size_t j = 0; j < kGaussNodes.size(); ++j) {
      const double x = a * kGaussNodes[i], y = b * kGaussNodes[j], share = kWeights[i] * kWeights[j];
      points.push_back({c * x - s * y, s * x + c * y, share});
      reach += share * std::hypot(area.u + points.back().u, area.v + points.back().v);
    }
  // The mean distance of the points is scaled to that of the area. The resistance to a spin is then right.
  const double stretch = distance_ > 0 && reach > 0 ? distance_ / reach : 1;
  // The pressure is linear over the patch and never negative. Its centre is the centroid.
  const double least = 1e-9 * mean, uu = area.uu + least, vv = area.vv + least, square = uu * vv - area.uv * area.uv;
  const double slope_u = square > 0 ? (area.uv * area.v - vv * area.u) / square : 0;
  const double slope_v = square > 0 ? (area.uv * area.u - uu * area.v) / square : 0;
  double total = 0;
  for (Point& point : points) {
    point.share *= std::max(0.0, 1 + slope_u * point.u + slope_v * point.v);
    point.u = area.u + stretch * point.u, point.v = area.v + stretch * point.v;
    total += point.share;
  }
  for (const Point& point : points) {
    shares_.push_back(point.share / total);
    const ThreeByThree rows{{{1, 0, -point.v}, {0, 1, point.u}, {0, 0, 0}}};
    parts_.emplace_back(rows, mobility_, coefficient * shares_.back());
  }
}

Three PatchFriction::begin(const Three& known) {
  if (shares_.empty()) parts_[0].begin({known[0], known[1], distance_ > 0 ? known[2] / distance_ : 0});
  for (size_t i = 0; i < shares_.size(); ++i) parts_[i].begin({shares_[i] * known[0], shares_[i] * known[1], 0});
  return wrench();
}

Three PatchFriction::wrench() const {
  Three sum{};
  for (const Coulomb& part : parts_) sum = sum + part.wrench();
  return sum;
}

Three PatchFriction::answer(Three slip, double force) {
  for (Coulomb& part : parts_) {
    const Three before = part.wrench();
    part.answer(slip, force);
    slip = slip + mobility_ * (part.wrench() - before);
  }
  return wrench();
}

Linear PatchFriction::held(const Three& slip, double force, double give, bool afresh) {
  Linear sum;
  for (Coulomb& part : parts_) {
    const Linear one = part.held(slip, force, give, afresh);
    sum.value = sum.value + one.value, sum.by_slip = sum.by_slip + one.by_slip;
    sum.by_other = sum.by_other + one.by_other;
  }
  return sum;
}

void PatchFriction::take() {
  for (Coulomb& part : parts_) part.take();
}

}  // namespace overlapper
