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

double square(const Three& v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

}  // namespace

Three opposing(const ThreeByThree& mobility, const Three& slip, double limit, double& shift) {
  if (!(limit > 0) || square(slip) == 0) return {};
  // The force is -(mobility + shift)⁻¹ slip: what is left of the slip is then -shift times the force. Newton's method
  // on the inverse of its size finds the shift, if any (Moré and Sorensen 1983).
  constexpr double kClose = 1e-12;
  Three force{};
  double size = 0;
  for (int step = 0; step < 50; ++step) {
    const Factor factor(mobility, shift);
    force = factor.upper(factor.lower(slip));
    size = std::sqrt(square(force));
    if (std::abs(size - limit) <= kClose * limit || (shift == 0 && size <= limit)) break;
    const double slope = square(factor.lower(force));
    const double next = std::max(0.0, shift + size * size / slope * (size - limit) / limit);
    if (next == shift) break;
    shift = next;
  }
  const double factor = size > limit ? -limit / size : -1;
  return {factor * force[0], factor * force[1], factor * force[2]};
}

}  // namespace overlapper
