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

Three opposing(const ThreeByThree& mobility, const Three& slip, double limit) {
  if (!(limit > 0) || square(slip) == 0) return {};
  // The force is -(mobility + shift)⁻¹ slip: what is left of the slip is then -shift times the force. Newton's method
  // on the inverse of its size comes to the shift from below (Moré and Sorensen 1983).
  double shift = 0;
  Three force{};
  for (int step = 0; step < 50; ++step) {
    const Factor factor(mobility, shift);
    const Three half = factor.lower(slip);
    force = factor.upper(half);
    const double size = std::sqrt(square(force));
    if (size <= limit * (1 + 1e-14)) break;
    const double slope = square(factor.lower(force));
    const double more = size * size / slope * (size - limit) / limit;
    if (!(shift + more > shift)) break;
    shift += more;
  }
  const double size = std::sqrt(square(force)), factor = size > limit ? -limit / size : -1;
  return {factor * force[0], factor * force[1], factor * force[2]};
}

}  // namespace overlapper
