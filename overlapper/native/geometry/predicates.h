#pragma once

#include "geometry/vec.h"

namespace overlapper {

/// Sign of det(b - a, c - a, d - a), exact for all finite doubles whose products neither overflow nor underflow. +1 if
/// a, b, c appear counter-clockwise from the side of d, 0 if the four points are coplanar.
int orientation(Vec3 a, Vec3 b, Vec3 c, Vec3 d);

/// cross(b - a, c - a) computed with about 30 digits and rounded once; accurate even for nearly collinear points.
Vec3 accurate_normal(Vec3 a, Vec3 b, Vec3 c);

/// The vertex y with dot(a, y) = dot(b, y) = dot(c, y) = 1, where the planes dual to three points meet. Computed with
/// about 30 digits if doubles would lose more than two digits.
Vec3 polar_vertex(Vec3 a, Vec3 b, Vec3 c);

}  // namespace overlapper
