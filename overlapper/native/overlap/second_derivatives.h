#pragma once

#include <vector>

#include "overlap/overlap.h"

namespace overlapper {

/// The numbers of one body: translation, rotation vector about its position, and the numbers of shape_gradient().
inline constexpr int kNumbersOfBody = 9;

/// The second derivatives of the common volume by the numbers of all bodies, as rows of a symmetric matrix. Zeros
/// unless overlapping, and for the vertices of hulls. Not a number if a facet of one body lies in the plane of another
/// body's facet: there the volume has a kink. Not a number either if round surfaces coincide or touch along a line. For
/// pairs with a round body, only the part for poses is known; for groups with a round body, nothing.
///
/// A body may be moved by a twist v, at first order by v(x) at x. In the frame of a body, its part of the surface only
/// changes at its border: the seam with another body's part. Let n and m be the normals of the two surfaces at the
/// seam, and s the sine between them. The other body moves by v, so the border moves by (m · v) / s. The area vectors
/// and moments of the part therefore change by the integral of the facet's own vectors times (m · v) / s along the
/// seam. The twist itself turns the area vectors. This adds dot(t, cross(r, F)) to the second derivative along a
/// translation t and a rotation vector r, where F is the area vector of the body's part.
///
/// If a side of a box moves out, the borders of its facets move too. At an edge of the box, they move by the speed of
/// the other side. At the seam, they move by the negative cosine over the sine.
std::vector<double> second_derivatives(const Overlap& overlap);

/// The part for translations and rotations: six numbers of each body.
std::vector<double> pose_hessian(const Overlap& overlap);

}  // namespace overlapper
