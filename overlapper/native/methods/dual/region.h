#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/measures.h"
#include "geometry/region.h"
#include "methods/dual/deepest_ball.h"
#include "shapes/shape.h"

namespace overlapper {

/// Grows the dual hull of the bodies' common set, whose round frame is given, until vertices reach so
/// little out of smooth bodies that the volume is right to the fraction `tolerance`. Bodies, planes and frame relative
/// to `reference`; `rounding` is how far a plane may be off, in m. Bodies are Placed or WideBody.
template <class Body>
Region grow(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
            const FrameAbout<PointOf<Body>>& frame, double tolerance, double rounding, Vec3 reference);

/// The region of polytopes and half-spaces once more in the same frame, from dual points that are right to the last
/// bit: planes, poses and the distance from the origin are taken in double-double, and unmerged facets from their
/// corners as given, whatever `bodies` are relative to. Nothing if the frame's origin turns out not to be inside.
std::optional<Region> widened(std::span<const Placed> bodies, const Region& region);

/// Measures of a region by Way::kDual; owners of the region's facets are numbers of `bodies`.
MeasuresAndInertia measure(const Region& region, std::span<const Placed> bodies);

}  // namespace overlapper
