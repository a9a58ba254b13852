#pragma once

#include "shapes/mesh.h"

namespace overlapper {

/// What is found along the ray from the centroid of A - B through the origin.
struct Portal {
  enum class Answer { kApart, kCommon, kUnknown } answer = Answer::kUnknown;
  Vec3 point;   ///< of both bodies, in the first one's own coordinates, if they have one in common
  Vec3 normal;  ///< about the way out that is shortest, from the first body to the second; not unit
};

/// Minkowski portal refinement (Snethen 2008), with supports found by climbing: a triangle of points of A - B through
/// which the ray from an inner point to the origin leaves, moved outwards until the origin is behind it or a support
/// plane proves a gap of more than `doubt`. `pose` places the second body in the first one's own coordinates. The
/// common point is a combination of corners and the centroid, whose share is positive, so that it lies inside.
Portal find_portal(const Mesh& a, const Mesh& b, const Pose& pose, double doubt);

}  // namespace overlapper
