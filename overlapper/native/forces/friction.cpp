#include "forces/friction.h"

#include <algorithm>
#include <cmath>

namespace overlapper {
namespace {

/// The Cholesky factor of a symmetric matrix with `shift` added along its diagonal.
struct Factor {
  Factor(const ThreeByThree& m, double shift) {
    const double least = 1e-15 * (m[0][0] + m[1][1] + m[2][2] + shift);
    const auto root = [&](double square) { return 1 / std::sqrt(std::max(square, least)); };
    a = root(m[0][0] + shift);
    b = m[1][0] * a;
    c = root(m[1][1] + shift - b * b);
    d = m[2][0] * a;
    e = (m[2][1] - d * b) * c;
    f = root(m[2][2] + shift - d * d - e * e);
  }
  Three lower(const Three& v) const {
    const double x = v[0] * a, y = (v[1] - b * x) * c;
    return {x, y, (v[2] - d * x - e * y) * f};
  }
  Three upper(const Three& v) const {
    const double z = v[2] * f, y = (v[1] - e * z) * c;
    return {(v[0] - b * y - d * z) * a, y, z};
  }
  double a, b, c, d, e, f;  ///< by columns, the diagonal inverted
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
  // The force is -(mobility + shift)⁻¹ slip, and the remaining slip is -shift times the force. Newton's method on the
  // inverse of the force's size finds the shift, if there is one (Moré and Sorensen 1983).
  constexpr double kClose = 1e-12;
  Three force{};
  double size = 0;
  for (int step = 0; step < 50; ++step) {
    const Factor factor(mobility, shift);
    force = factor.upper(factor.lower(slip));
    size = std::sqrt(dot(force, force));
    if (std::abs(size - limit) <= kClose * limit || (shift == 0 && size <= limit)) break;
    const Three half = factor.lower(force);
    const double next = std::max(0.0, shift + size * size / dot(half, half) * (size - limit) / limit);
    if (next == shift) break;
    shift = next;
  }
  return (size > limit ? -limit / size : -1) * force;
}

PatchFriction::PatchFriction(const ElasticPatch& patch, const PlaneArea& area, const ThreeByThree& mobility,
                             Friction kind)
    : coefficient_(patch.friction), distance_(area.distance > 0 ? area.distance : 0), mobility_(mobility) {
  if (area.area > 0 && coefficient_ > 0) distance_ += patch.spinning / coefficient_;
  if (kind == Friction::kDistributed && area.area > 0) {
    spread(area);
  } else {
    for (int i = 0; i < 3; ++i) mobility_[2][i] *= distance_, mobility_[i][2] *= distance_;
  }
}

void PatchFriction::spread(const PlaneArea& area) {
  const double half = (area.uu - area.vv) / 2, mean = (area.uu + area.vv) / 2, split = std::hypot(half, area.uv);
  const double turn = std::atan2(area.uv, half) / 2, c = std::cos(turn), s = std::sin(turn);
  const double a = std::sqrt(3 * (mean + split)), b = std::sqrt(3 * std::max(mean - split, 0.0));
  double reach = 0;
  for (size_t i = 0; i < kGaussNodes.size(); ++i)
    for (size_t j = 0; j < kGaussNodes.size(); ++j) {
      const double x = a * kGaussNodes[i], y = b * kGaussNodes[j], share = kWeights[i] * kWeights[j];
      points_.push_back({c * x - s * y, s * x + c * y, share});
      reach += share * std::hypot(area.u + points_.back().u, area.v + points_.back().v);
    }
  // The mean distance of the points is scaled to that of the area. The resistance to a spin is then right.
  const double stretch = distance_ > 0 && reach > 0 ? distance_ / reach : 1;
  // The pressure is linear over the patch and never negative. Its centre is the centroid.
  const double least = 1e-9 * mean, uu = area.uu + least, vv = area.vv + least, square = uu * vv - area.uv * area.uv;
  const double slope_u = square > 0 ? (area.uv * area.v - vv * area.u) / square : 0;
  const double slope_v = square > 0 ? (area.uv * area.u - uu * area.v) / square : 0;
  double total = 0;
  for (Point& point : points_) {
    point.share *= std::max(0.0, 1 + slope_u * point.u + slope_v * point.v);
    point.u = area.u + stretch * point.u, point.v = area.v + stretch * point.v;
    total += point.share;
  }
  for (Point& point : points_) point.share /= total;
}

Three PatchFriction::begin(const Three& known) {
  if (points_.empty()) return distance_ > 0 ? known : Three{known[0], known[1], 0};
  Three sum{};
  for (Point& point : points_) {
    point.fu = point.share * known[0], point.fv = point.share * known[1];
    sum = sum + Three{point.fu, point.fv, point.u * point.fv - point.v * point.fu};
  }
  return sum;
}

Three PatchFriction::answer(const Three& slip, const Three& last, double force) {
  const double limit = coefficient_ * force;
  if (!points_.empty()) return at_points(slip, limit);
  const Three had{last[0], last[1], distance_ > 0 ? last[2] / distance_ : 0};
  const Three free = Three{slip[0], slip[1], distance_ * slip[2]} - mobility_ * had;
  const Three found = opposing(mobility_, free, limit, shift_);
  return {found[0], found[1], distance_ * found[2]};
}

Three PatchFriction::at_points(Three slip, double limit) {
  Three sum{};
  for (Point& point : points_) {
    // The slip at the point, from the slip of the patch; and the change of the point's slip by forces at the point.
    const auto there = [&](const Three& of) { return Three{of[0] - point.v * of[2], of[1] + point.u * of[2], 0}; };
    const Three by_u = mobility_ * Three{1, 0, -point.v}, by_v = mobility_ * Three{0, 1, point.u};
    const Three uu = there(by_u), vv = there(by_v);
    const ThreeByThree mobility{{{uu[0], vv[0], 0}, {uu[1], vv[1], 0}, {0, 0, 1}}};
    const Three free = there(slip) - point.fu * uu - point.fv * vv;
    const Three found = opposing(mobility, free, limit * point.share, point.shift);
    slip = slip + (found[0] - point.fu) * by_u + (found[1] - point.fv) * by_v;
    point.fu = found[0], point.fv = found[1];
    sum = sum + Three{point.fu, point.fv, point.u * point.fv - point.v * point.fu};
  }
  return sum;
}

}  // namespace overlapper
