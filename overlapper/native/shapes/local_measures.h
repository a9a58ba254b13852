#pragma once

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper {

/// Says in the world what was measured in the coordinates of `a`, or of `b` if `swapped`, with the pull on that body
/// about the centroid; the other body has the opposite.
inline void say_in_world(Measures& measures, Pull pull, const Placed& a, const Placed& b, bool swapped) {
  if (measures.status != Status::kOverlapping) return;
  const Pose& pose = (swapped ? b : a).pose;
  const Vec3 centroid = pose.rotation * measures.centroid;
  measures.centroid = centroid + pose.translation;
  pull = {pose.rotation * pull.force, pose.rotation * pull.moment};
  // Not the negatives, which would make negative zeros.
  if (swapped) pull = {Vec3{} - pull.force, Vec3{} - pull.moment};
  // Differences of places that are near each other keep the digits that a centroid far from the world's origin loses.
  const auto lever = [&](const Placed& body) { return centroid + (pose.translation - body.position); };
  measures.pulls = {about(pull, lever(a), {}), about({-pull.force, -pull.moment}, lever(b), {})};
}

}  // namespace overlapper
