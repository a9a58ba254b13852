#pragma once

#include "shapes/mesh.h"

namespace overlapper {

/// The answer of a search along the ray from the centroid of A - B through the origin.
struct Portal {
  enum class Answer { kApart, kCommon, kUnknown } answer = Answer::kUnknown;
  Vec3 point;   ///< a common point in the first body's own coordinates, if the bodies have one
  Vec3 normal;  ///< approximate direction of the shortest way out, from the first body to the second; not unit
};

/// Minkowski portal refinement (Snethen 2008), with supports found by climbing. The portal is a triangle of points of A
/// - B; the ray from an inner point to the origin leaves through it. The search moves the portal outwards until the
/// origin is behind it, or until a supporting plane proves a gap larger than `doubt`. `pose` places the second body in
/// the first one's own coordinates. The common point is a combination of corners and the centroid. The weight of the
/// centroid is positive, so the point lies inside.
Portal find_portal(const Mesh& a, const Mesh& b, const Pose& pose, double doubt);

}  // namespace overlapper
