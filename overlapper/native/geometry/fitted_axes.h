#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "geometry/vec.h"

namespace overlapper {

/// Orthogonal unit vectors. The first is along the longest line between two of the points, up to a factor. The second
/// is along the largest distance from this line. The point of an element is `at(element)`.
template <class Elements, class At>
std::array<Vec3, 3> fitted_axes(const Elements& elements, At at) {
  const auto farthest = [&](auto distance) {
    return at(*std::ranges::max_element(elements, {}, [&](const auto& each) { return distance(at(each)); }));
  };
  const Vec3 start = at(*elements.begin());
  const Vec3 end = farthest([&](Vec3 p) { return norm2(p - start); });
  const Vec3 along = farthest([&](Vec3 p) { return norm2(p - end); }) - end;
  if (!(norm2(along) > 0)) return {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  const Vec3 first = unit(along);
  const auto across = [&](Vec3 v) { return v - dot(v, first) * first; };
  const Vec3 aside = across(farthest([&](Vec3 p) { return norm2(across(p - end)); }) - end);
  // Repeated, because rounding leaves a short rest far from orthogonal.
  const Vec3 second = norm2(aside) > 0 ? unit(across(unit(aside))) : any_orthogonal(first);
  return {first, second, cross(first, second)};
}

/// Orthogonal unit vectors by Jacobi's rotations. Along these axes, the coordinates of the points are uncorrelated.
template <class Elements, class At>
std::array<Vec3, 3> principal_axes(const Elements& elements, At at) {
  Vec3 mean;
  for (const auto& each : elements) mean += at(each) / static_cast<double>(elements.size());
  Mat3 spread{{}, {}, {}};
  for (const auto& each : elements) {
    const Vec3 d = at(each) - mean;
    spread.row0 += d.x * d, spread.row1 += d.y * d, spread.row2 += d.z * d;
  }
  std::array<Vec3, 3> axes{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  constexpr int kSweeps = 6;  // the error is squared in each sweep
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      const Vec3 to_p = spread * axes[p], to_q = spread * axes[q];
      const double both = dot(axes[p], to_q);
      if (both == 0) continue;
      const double half = (dot(axes[q], to_q) - dot(axes[p], to_p)) / (2 * both);
      const double tangent = std::copysign(1 / (std::abs(half) + std::hypot(half, 1)), half);
      const double cosine = 1 / std::hypot(tangent, 1), sine = tangent * cosine;
      const Vec3 before = axes[p];
      axes[p] = cosine * before - sine * axes[q], axes[q] = sine * before + cosine * axes[q];
    }
  return axes;
}

}  // namespace overlapper
