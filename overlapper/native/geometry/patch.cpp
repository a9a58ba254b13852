#include "geometry/patch.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <limits>

namespace overlapper {
namespace {

double length(double u, double v) { return std::sqrt(u * u + v * v); }

/// An angle within a quarter, and its weight.
struct Angle {
  double cosine, sine, weight;
};

/// Gauss's eight nodes in a quarter. The weights of all four quarters sum to 2 / 3.
// clang-format off
constexpr std::array<Angle, 8> kQuarter{{
    {0.99951368521159, 0.031183217838231473, 0.008435711357531421},
    {0.9872753882019998, 0.15901983477098247, 0.018531752871114537},
    {0.9313672580554441, 0.36408107699011744, 0.026142220489823908},
    {0.801301417664392, 0.5982608444892876, 0.03022364861486347},
    {0.5982608444892877, 0.8013014176643919, 0.03022364861486347},
    {0.3640810769901175, 0.9313672580554441, 0.026142220489823908},
    {0.1590198347709826, 0.9872753882019998, 0.018531752871114537},
    {0.031183217838231487, 0.99951368521159, 0.008435711357531421},
}};
// clang-format on
static_assert(
    [] {
      double sum = 0;
      for (const Angle& angle : kQuarter) sum += 4 * angle.weight;
      return sum > 2.0 / 3 - 1e-15 && sum < 2.0 / 3 + 1e-15;
    }(),
    "the weights of all four quarters sum to 2 / 3");

/// The mean distance from (p, q) of the points of an ellipse about the origin, with half axes a and b along the
/// coordinates. It is a third of the integral of |y| y × dy along the border, seen from (p, q), per area.
double mean_distance(double a, double b, double p, double q) {
  // The width of such a narrow ellipse does not matter, but it is a divisor.
  const double least = 1e-6 * (a + b + std::abs(p) + std::abs(q)) + DBL_MIN;
  a = std::max(a, least), b = std::max(b, least);
  const double along = p / a, across = q / b;
  double mean = 0;
  for (const Angle& angle : kQuarter)
    for (const double x : {-angle.cosine, angle.cosine})
      for (const double y : {-angle.sine, angle.sine})
        mean += angle.weight * length(a * x - p, b * y - q) * (1 - along * x - across * y);
  return mean;
}

/// The mean distance from the origin of the points of the ellipse about (u, v) with these second moments per area.
double distance_in_ellipse(double u, double v, double uu, double uv, double vv) {
  const double middle = (uu + vv) / 2, half = (uu - vv) / 2, off = length(half, uv);
  const double turn = std::atan2(uv, half) / 2, cosine = std::cos(turn), sine = std::sin(turn);
  // Parts seen from behind have negative area, and may make moments negative.
  const double a = 2 * std::sqrt(std::max(0.0, middle + off)), b = 2 * std::sqrt(std::max(0.0, middle - off));
  return mean_distance(a, b, -cosine * u - sine * v, sine * u - cosine * v);
}

}  // namespace

/// h / 6 (s √(h² + s²) + h² asinh(s / h)) between the ends: h is the distance of the edge's line, and s the place of an
/// end along the line.
double distance_over_edge(double a, double b, double c, double d) {
  const double twice = a * d - b * c, p = length(a, b), q = length(c, d);
  // The line of the edge passes through the origin, but for rounding.
  if (!(std::abs(twice) > 0x1p-100 * (p * q))) return 0;
  const double along = length(c - a, d - b), h = twice / along, square = h * h;
  const double from = (a * (c - a) + b * (d - b)) / along, to = (c * (c - a) + d * (d - b)) / along;
  // The difference of the angles at both ends, by sums of numbers of one sign.
  const double angle = from >= 0 ? std::log((to + q) / (from + p))
                       : to <= 0 ? std::log((p - from) / (q - to))
                                 : std::log((to + q) * ((p - from) / square));
  return h / 6 * (to * q - from * p + square * angle);
}

Patch PatchSums::patch() const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Patch result{area_, {kNone, kNone, kNone}, {{}, {}, {}}, kNone};
  // An area that is only rounding differs each time it is summed.
  if (!(size_ > 0 && one_ > size_ / 2 && one_ < 2 * size_)) return result;
  const double u = u1_ / one_, v = v1_ / one_;
  result.centre = origin_ + (u * u_ + v * v_);
  const double uu = uu_ - u * u1_, uv = uv_ - u * v1_, vv = vv_ - v * v1_;
  const Vec3 along_u = uu * u_ + uv * v_, along_v = uv * u_ + vv * v_;
  result.moments = {u_.x * along_u + v_.x * along_v, u_.y * along_u + v_.y * along_v, u_.z * along_u + v_.z * along_v};
  // Distances of parts seen from behind are negative, too.
  result.distance =
      edges_alone_ ? std::max(0.0, distance_ / one_) : distance_in_ellipse(u, v, uu / one_, uv / one_, vv / one_);
  return result;
}

Patch lifted(const Patch& seen, Vec3 centroid, Vec3 normal) {
  const Vec3 along = unit(seen.area);
  const double cosine = dot(along, normal);
  if (cosine > 1 - 0x1p-50) return seen;
  const auto lift = [&](Vec3 x) { return x - (dot(x, normal) / cosine) * along; };
  const double area = norm(seen.area) / cosine;
  PatchSums sums(centroid, area * normal);
  // The columns of the moments are lifted, then the rows.
  const auto second = [&](Vec3 p, Vec3 q) {
    const auto down = [&](Vec3 x) { return x - (dot(x, along) / cosine) * normal; };
    return dot(down(p), seen.moments * down(q)) / cosine;
  };
  const Vec3 from = lift(seen.centre - centroid);
  const double u = dot(from, sums.u()), v = dot(from, sums.v());
  sums.add(area, area * u, area * v, second(sums.u(), sums.u()) + area * u * u,
           second(sums.u(), sums.v()) + area * u * v, second(sums.v(), sums.v()) + area * v * v);
  return sums.patch();
}

}  // namespace overlapper
