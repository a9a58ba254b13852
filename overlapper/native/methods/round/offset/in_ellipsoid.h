#pragma once

#include <optional>

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper::offset {

/// The volume of a rounded hull in an ellipsoid whose axes differ, as a sum of cones from one point over both surfaces.
/// In units of its half axes, the ellipsoid is a unit ball. Every part of a surface is reduced to integrals along its
/// border. A border consists of arcs between features of the rounded hull, and of the line in which both surfaces
/// cross. In facets, this line consists of arcs of circles. In bands, it consists of the ends of their lines in the
/// ellipsoid. On the sphere around a vertex, the line lies in parallel planes across which the ellipsoid and the sphere
/// are circles. Its points follow from the roots of one quartic.
///
/// Where surfaces meet at a small angle, rounding moves the line far along both. The error counts the rounding of the
/// line's direction, and the gaps between its parts.
///
/// No value if facets are not exact, if the line around a vertex nearly lies in one of those planes, if the parts of a
/// border do not follow each other, if area vectors do not add up to zero, or if the error is more than kEnough of the
/// volume.
std::optional<VolumeAlone> volume_in_ellipsoid(const Placed& rounded_hull, const Placed& ellipsoid);

}  // namespace overlapper::offset
