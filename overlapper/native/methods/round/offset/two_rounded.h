#pragma once

#include <optional>

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper::offset {

/// The volume of two rounded hulls, or of a rounded hull and a capsule or a cylinder, by both surfaces. The surfaces
/// consist of moved facets and discs, bands of cylinders and parts of spheres. Every two of these that are near each
/// other cross along parts of a line, an ellipse, a circle or a quartic. Where a crossing leaves a feature, it goes on
/// in the feature beside it. The flux of x / 3 through the part of a feature in the other body is an integral along the
/// border of this part (Stokes).
///
/// In a shallow contact, depths come from double-doubles. `between` is a point inside both bodies, if one is known.
///
/// No value if facets are not exact, if features touch up to rounding, or if the error is more than kEnough of the
/// volume.
std::optional<VolumeAlone> volume_of_two_rounded(const Placed& a, const Placed& b, const std::optional<Vec3>& between);

}  // namespace overlapper::offset
