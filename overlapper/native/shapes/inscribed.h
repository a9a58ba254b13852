#pragma once

#include <span>
#include <vector>

#include "shapes/hull.h"

namespace overlapper {

/// Points of round shapes. The hull of the points lacks at most the fraction `tolerance` of the volume. Each function
/// throws std::invalid_argument if the tolerance needs too many points.

/// Appends n points of a circle about z.
void append_circle(double radius, double z, int n, std::vector<Vec3>& points);
/// The number of corners of an inscribed polygon that approximates its disc within the tolerance. `shape` is the
/// shape's name in the error.
int corners_of_circle(double tolerance, const char* shape);
/// Points of a capsule along z; of a ball if the half length is 0.
std::vector<Vec3> points_of_capsule(double radius, double half_length, double tolerance);

/// The hull of points of a solid; without data if the solid is thinner than the rounding of the points.
Hull hull_within(std::span<const Vec3> points);

}  // namespace overlapper
