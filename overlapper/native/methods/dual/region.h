#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/measures.h"
#include "geometry/region.h"
#include "methods/dual/deepest_ball.h"
#include "shapes/shape.h"

namespace overlapper {

/// Grows the dual hull of the bodies' common set in its round frame. It ends when the vertices are so little outside
/// smooth bodies that the relative error of the volume is at most `tolerance`. Bodies, planes and frame are relative to
/// `reference`; `rounding` bounds the error of a plane, in m. Bodies are Placed or WideBody.
template <class Body>
Region grow(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
            const FrameAbout<PointOf<Body>>& frame, double tolerance, double rounding, Vec3 reference);

/// The region of polytopes and half-spaces again in the same frame, from dual points that are right to the last bit.
/// Planes, poses and the distance from the origin are in double-double. Unmerged facets come from their corners as
/// given, whatever `bodies` are relative to. No value if the frame's origin is not inside after all.
std::optional<Region> widened(std::span<const Placed> bodies, const Region& region);

/// Measures of a region by Way::kDual; the owners of the region's facets are numbers of `bodies`.
MeasuresAndInertia measure(const Region& region, std::span<const Placed> bodies);

}  // namespace overlapper
