#pragma once

#include <optional>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "shapes/shape.h"

namespace overlapper {

/// The measures of an overlapping pair where a formula gives them, right to rounding, whatever the tolerance:
///
/// - the lens of two balls, of a ball and the end of a capsule, or of two ends of capsules;
/// - a ball, a capsule, a cylinder or an ellipsoid cut by one plane: that of a half-space, or the only one of a box's
///   or a hull's that cuts off anything which the others leave;
/// - a ball, a capsule or a cylinder of which several planes of a box or a hull cut off something;
/// - a ball, a capsule, a cylinder or an ellipsoid that lies inside a half-space, a box or a hull, and all but the last
///   two inside a ball.
///
/// Of lenses, of balls, and of what one plane cuts, volumes are right to their last digits however shallow they are,
/// but for ellipsoids: what their depths are made from is taken from the bodies' positions in double-doubles.
///
/// Nothing for every other pair. Bodies relative to `reference`, in any order; `rounding` is how far a surface may be
/// off, in m.
std::optional<MeasuresAndInertia> closed_form(const Placed& a, const Placed& b, double rounding, Vec3 reference);

/// The patch of a half-space and a ball, a capsule or a cylinder that overlap: the section of that by the plane.
/// Nothing for every other pair. `centroid` and `area` are those of the patch.
std::optional<Patch> section_patch(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area);

}  // namespace overlapper
