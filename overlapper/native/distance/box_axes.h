#pragma once

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// Where two boxes part, or would part soonest: the facets of the difference of two boxes are orthogonal to a face
/// of one of them or to an edge of each, so fifteen axes hold the least translation (Gottschalk, Lin and Manocha 1996).
/// For boxes that overlap, the depth and normal of penetration(). For boxes apart, the depth is negative and its size a
/// lower bound of the distance; the first axis along which they are farther apart than `far` ends the search.
Penetration box_penetration(const Box& a, const Pose& pose_a, const Box& b, const Pose& pose_b, double far);

}  // namespace overlapper
