#include "methods/round/quadric/stretch.h"

#include <cfloat>
#include <numbers>

namespace overlapper::quadric {
namespace {

/// A node x >= 0 of the rule of Gauss and Kronrod with fifteen nodes on [-1, 1]; -x is a node, too. Seven of the nodes
/// have a weight in the rule of Gauss.
struct Node {
  double x, weight, of_gauss;
};
constexpr std::array<Node, 8> kNodes{{
    {0, 0.209482141084727828, 0.417959183673469388},
    {0.207784955007898468, 0.204432940075298892, 0},
    {0.405845151377397167, 0.190350578064785410, 0.381830050505118945},
    {0.586087235467691130, 0.169004726639267903, 0},
    {0.741531185599394440, 0.140653259715525919, 0.279705391489276668},
    {0.864864423359769073, 0.104790010322250184, 0},
    {0.949107912342758525, 0.063092092629978553, 0.129484966168869693},
    {0.991455371120812640, 0.022935322010529225, 0},
}};

static_assert(2 * kNodes.size() - 1 == 15);

constexpr int kMostHalvings = 40;

struct Integral {
  double value = 0, error = 0;
};

/// Halves the interval until the difference of the two rules is a small fraction of the value there, or of the whole.
template <class Integrand>
Integral integrate(const Integrand& integrand, double low, double high, double whole, int halvings = 0) {
  const double middle = low + (high - low) / 2, half = (high - low) / 2;
  double value = 0, gauss = 0;
  for (const auto& [x, weight, of_gauss] : kNodes) {
    const double here = x > 0 ? integrand(middle - half * x) + integrand(middle + half * x) : integrand(middle);
    value += weight * here, gauss += of_gauss * here;
  }
  value *= half, gauss *= half;
  const double apart = std::abs(value - gauss);
  if (!(apart > Stretch::kApart * value && apart > DBL_EPSILON * whole) || halvings == kMostHalvings)
    return {value, apart};
  const double all = std::max(whole, value);
  const Integral below = integrate(integrand, low, middle, all, halvings + 1),
                 above = integrate(integrand, middle, high, all, halvings + 1);
  return {below.value + above.value, below.error + above.error};
}

}  // namespace

double Stretch::arc(Vec3 level, Vec3 across, Vec3 along, double half_angle) const {
  const Vec3 a = normal(level), b = normal(across), c = normal(along);
  const int parts = std::max(1, static_cast<int>(std::ceil(half_angle / (std::numbers::pi / 4))));
  const double step = half_angle / parts, end = std::tan(step / 2);
  double sum = 0;
  for (int i = 0; i < parts; ++i) {
    const double angle = (2 * i + 1 - parts) * step, cosine = std::cos(angle), sine = std::sin(angle);
    const Vec3 out = cosine * b + sine * c, on = cosine * c - sine * b;
    // The variable is s = tan(angle / 2), so that no sine is needed. The complex zeros of the polynomial under the root
    // are then as far from the arc as on the circle.
    const auto element = [&](double s) {
      const double square = s * s, inverse = 1 / (1 + square);
      const Vec3 at = (1 + square) * a + (1 - square) * out + (2 * s) * on;
      return 2 * std::sqrt(norm2(at)) * inverse * inverse;
    };
    sum += integrate(element, -end, end, sum).value;
  }
  return sum;
}

Stretch::Cap Stretch::cap(Vec3 normal, double height) const {
  // By rounding, a plane that touches the ball may cut off less than nothing, or leave less than nothing.
  if (!(height > 0)) return {0, 0};
  const Vec3 across = any_orthogonal(normal), along = cross(normal, across);
  const auto circle = [&](double h) {
    const double radius = std::sqrt(std::max(0.0, h * (2 - h)));
    return arc((1 - h) * normal, radius * across, radius * along, std::numbers::pi);
  };
  const Integral area = integrate(circle, 0, height, 0);
  return {area.value, area.error};
}

}  // namespace overlapper::quadric
