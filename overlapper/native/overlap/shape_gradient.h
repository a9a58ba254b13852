#pragma once

#include <array>
#include <limits>
#include <vector>

#include "geometry/measures.h"
#include "overlap/overlap.h"

namespace overlapper {

/// Stands for a derivative that does not exist or is not known.
inline constexpr double kNoDerivative = std::numeric_limits<double>::quiet_NaN();

/// The axis of a box that is across a facet with this normal.
int axis_across(const Placed& box, Vec3 normal);

/// How many numbers describe the size of a shape; a hull has its vertices instead, and counts as three.
int numbers_of(const Shape& shape);

/// The derivatives of the common volume by the numbers of each body's shape, in the order of its fields.
///
/// - A box has its half extents, a sphere and a rounded hull the radius.
/// - A capsule and a cylinder have the radius and the length.
/// - An ellipsoid has the half axes.
/// - A half-space has the offset along its unit normal.
///
/// NaN for hulls; vertex_gradients() has the derivatives by a hull's vertices. NaN also for the length 0 of a capsule.
/// Groups with a round body have the numbers of the polytope that encloses the common set: each of its planes touches
/// the body that owns it, and moves with that body.
///
/// A surface moves along its normal at some speed. The volume grows at the rate of the integral of that speed over the
/// part of the surface that the body owns. The sides of a box across one axis move at the speed 1 if that half extent
/// grows. The derivative is therefore the area of these sides in the boundary of the common set.
///
/// An ellipsoid whose half axis a grows is stretched along it: the surface moves at the speed n x / a. The sums of n x
/// over the parts of both bodies add up to the volume. Slices sum the ellipsoid's part. If the other body is flat, its
/// faces within the ellipsoid have closed forms.
std::vector<Vec3> shape_gradient(const Overlap& overlap);

/// m²: bounds of the errors of shape_gradient(). They are the bounds of the areas that bodies own. For boxes, and
/// for ellipsoids in groups, the difference from a second way is added. Pairs with an ellipsoid add the error of the
/// volume over the size. NaN where there is no derivative.
std::vector<Vec3> shape_gradient_errors(const Overlap& overlap);

/// The volume of a pair and its derivatives.
struct PairGradient {
  double volume = 0;
  std::array<std::array<double, 6>, 2> pose{};  ///< as Overlap::gradient()
  std::array<Vec3, 2> shape{};                  ///< as shape_gradient()
};
/// Has the bits of an Overlap of both, and takes less time.
PairGradient pair_gradient(const Placed& a, const Placed& b, double tolerance);

}  // namespace overlapper
