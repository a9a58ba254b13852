#pragma once

#include <array>
#include <vector>

#include "geometry/measures.h"
#include "overlap/overlap.h"

namespace overlapper {

/// The derivatives of the common volume by the numbers of each body's shape, in the order of its fields.
///
/// - A box has its half extents, a sphere and a rounded hull the radius.
/// - A capsule and a cylinder have the radius and the length.
/// - A half-space has the offset along its unit normal.
///
/// NaN for ellipsoids and hulls, for the length 0, and for groups of three with a round body. NaN also for flat faces
/// and ends of bodies that overlap an ellipsoid.
///
/// A surface moves along its normal at some speed. The volume grows at the rate of the integral of that speed over the
/// part of the surface that the body owns. The sides of a box across one axis move at the speed 1 if that half extent
/// grows. The derivative is therefore the area of these sides in the boundary of the common set.
std::vector<Vec3> shape_gradient(const Overlap& overlap);

/// The volume of a pair and its derivatives.
struct PairGradient {
  double volume = 0;
  std::array<std::array<double, 6>, 2> pose{};  ///< as Overlap::gradient()
  std::array<Vec3, 2> shape{};                  ///< as shape_gradient()
};
/// Has the bits of an Overlap of both, and takes less time.
PairGradient pair_gradient(const Placed& a, const Placed& b, double tolerance);

}  // namespace overlapper
