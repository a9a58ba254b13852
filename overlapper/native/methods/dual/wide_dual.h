#pragma once

#include <span>
#include <vector>

#include "methods/dual/deepest_ball.h"
#include "shapes/shape.h"

namespace overlapper {

/// Relative rounding error if only the last steps are in doubles and all others in double-double: four ulps.
inline constexpr double kLastRounding = 8 * 0x1p-53;

/// m: the movement of a plane when its dual point is rounded once: an ulp, as seen from the origin, at the distance of
/// the vertices.
inline double rounding_of_dual(double slack, Vec3 dual, double farthest) {
  return slack * kLastRounding * std::max(1.0, norm(dual) * farthest);
}

/// The dual point of a body's plane in the coordinates of a frame. The error of each coordinate is an ulp of the
/// point's length.
struct WideDual {
  Vec3 point;
  Vec3 normal;   ///< unit, in the world
  double slack;  ///< m: distance of the plane from the frame's origin; not positive if the origin is outside
  int owner;
};

/// The dual points of all planes of polytopes and half-spaces, from their defining numbers: corners, half extents,
/// positions and orientations. An orientation is the exact rotation of its quaternion of any length. The frame is about
/// `reference`.
std::vector<WideDual> wide_duals(std::span<const Placed> bodies, Vec3 reference, const Frame& frame, double reach);

}  // namespace overlapper
