#pragma once

#include <cmath>

#include "geometry/vec.h"

namespace overlapper::offset {

/// The solid angle of a triangle on the unit sphere, with its sign.
inline double solid_angle(Vec3 a, Vec3 b, Vec3 c) {
  return 2 * std::atan2(dot(a, cross(b, c)), 1 + dot(a, b) + dot(b, c) + dot(c, a));
}

/// The same of an arc of a great circle as seen from a pole. Between nearly opposite directions, the triangle loses
/// digits. Its halves do not.
inline double solid_angle(Vec3 pole, Vec3 first, Vec3 middle, Vec3 last, double turned) {
  constexpr double kLong = 2;
  if (turned <= kLong) return solid_angle(pole, first, last);
  return solid_angle(pole, first, middle) + solid_angle(pole, middle, last);
}

}  // namespace overlapper::offset
