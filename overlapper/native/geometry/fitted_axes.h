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

/// The principal values of a symmetric matrix, and the axes.
struct Principal {
  std::array<double, 3> value;  ///< in ascending order
  std::array<Vec3, 3> axis;
};

/// The principal values and axes of KᵀK, by Jacobi's rotations of the columns of K.
inline Principal principal(const Mat3& k) {
  std::array<Vec3, 3> column{Vec3{k.row0.x, k.row1.x, k.row2.x}, Vec3{k.row0.y, k.row1.y, k.row2.y},
                             Vec3{k.row0.z, k.row1.z, k.row2.z}};
  std::array<Vec3, 3> axis{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  constexpr int kMostSweeps = 12;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    bool turned = false;
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      const double both = dot(column[p], column[q]), of_p = norm2(column[p]), of_q = norm2(column[q]);
      if (!(std::abs(both) > 0x1p-52 * std::sqrt(of_p * of_q))) continue;
      // The column along the axis of an endless cylinder is only rounding.
      if (std::min(of_p, of_q) < 0x1p-100 * std::max(of_p, of_q)) continue;
      turned = true;
      const double half = (of_q - of_p) / (2 * both);
      const double tangent = std::copysign(1 / (std::abs(half) + std::sqrt(half * half + 1)), half);
      const double cosine = 1 / std::sqrt(tangent * tangent + 1), sine = tangent * cosine;
      for (auto* vectors : {&column, &axis}) {
        const Vec3 before = (*vectors)[p];
        (*vectors)[p] = cosine * before - sine * (*vectors)[q];
        (*vectors)[q] = sine * before + cosine * (*vectors)[q];
      }
    }
    if (!turned) break;
  }
  std::array<int, 3> order{0, 1, 2};
  const std::array<double, 3> value{norm2(column[0]), norm2(column[1]), norm2(column[2])};
  std::ranges::sort(order, {}, [&](int i) { return value[i]; });
  return {{value[order[0]], value[order[1]], value[order[2]]}, {axis[order[0]], axis[order[1]], axis[order[2]]}};
}

}  // namespace overlapper
