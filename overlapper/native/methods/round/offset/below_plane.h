#pragma once

#include <optional>

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper::offset {

/// The volume of a rounded hull below the plane of a facet of a half-space, a box or a hull, by its surface. Let h be
/// the height above the plane, with the unit normal n. The field h n has divergence 1 and is zero on the plane. So the
/// volume is the integral of h n·u over the surface below the plane, for the outward normal u. Facets, bands of
/// cylinders and parts of spheres have closed forms, or are integrals over an angle, of functions without singularities
/// nearby. In a shallow contact, no term is negative.
///
/// No value if facets are not exact, or if the error is more than kEnough of the volume.
std::optional<VolumeAlone> volume_below_plane(const Placed& rounded_hull, const Placed& flat, int facet);

}  // namespace overlapper::offset
