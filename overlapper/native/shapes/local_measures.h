#pragma once

#include "geometry/measures.h"
#include "shapes/shape.h"

namespace overlapper {

/// Maps measures from the coordinates of `a`, or of `b` if `swapped`, to the world. `pull` acts on that body about the
/// centroid; the other body has the opposite pull.
inline void say_in_world(Measures& measures, Pull pull, const Placed& a, const Placed& b, bool swapped) {
  if (measures.status != Status::kOverlapping) return;
  const Pose& pose = (swapped ? b : a).pose;
  const Vec3 centroid = pose.rotation * measures.centroid;
  measures.centroid = centroid + pose.translation;
  pull = {pose.rotation * pull.force, pose.rotation * pull.moment};
  // Plain negatives would make negative zeros.
  if (swapped) pull = {Vec3{} - pull.force, Vec3{} - pull.moment};
  // Differences of nearby places keep digits that a centroid far from the world's origin loses.
  const auto lever = [&](const Placed& body) { return centroid + (pose.translation - body.position); };
  measures.pulls = {about(pull, lever(a), {}), about({-pull.force, -pull.moment}, lever(b), {})};
}

}  // namespace overlapper
