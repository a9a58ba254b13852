#pragma once

#include <vector>

#include "shapes/hull.h"

namespace overlapper {

/// Points of round shapes, of which the hull is short of the volume by the fraction `tolerance` or less. Each throws
/// std::invalid_argument for a tolerance that takes too many points.

/// Appends n points of a circle about z.
void append_circle(double radius, double z, int n, std::vector<Vec3>& points);
/// How many corners an inscribed polygon needs to be that near to its disc; of a shape called so.
int corners_of_circle(double tolerance, const char* shape);
/// Of a capsule along z; of a ball for a half length of 0.
std::vector<Vec3> points_of_capsule(double radius, double half_length, double tolerance);

}  // namespace overlapper
