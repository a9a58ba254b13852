#include "shapes/relation.h"

#include "geometry/rounding.h"

namespace overlapper {

double doubt_of_signs(double reach, double flat) { return doubt(reach) + 4 * flat; }

Relation relation(const Placed& first, const Placed& second) {
  const Pose pose = relative_pose(first.pose, second.pose);
  const double between = norm(pose.translation), radius_first = radius(first.shape),
               radius_second = radius(second.shape);
  const double far = std::max(reach(first, radius_first), reach(second, between + radius_second));
  const double flat = std::max(flatness(first.shape), flatness(second.shape)), doubt = doubt_of_signs(far, flat);
  const bool apart = bounded(second.shape) && between > radius_first + radius_second + doubt;
  return {pose, far, flat, doubt, apart};
}

}  // namespace overlapper
