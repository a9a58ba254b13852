#include "methods/round/closed_forms/round_pair.h"

#include <algorithm>
#include <limits>

namespace overlapper::closed_forms {

RoundPair round_pair(const Placed& a, const Placed& b, double rounding, Vec3 reference) {
  RoundPair pair{
      {&a, &b}, {revolved(a), revolved(b)}, rounding, reference, {a.position - reference, b.position - reference}};
  if (smooth(a.shape) == smooth(b.shape)) return pair;
  pair.self = smooth(a.shape) ? 0 : 1;
  append_planes(pair.flat_body().shape, pair.planes);
  double over = -std::numeric_limits<double>::infinity();
  for (Plane& plane : pair.planes) {
    plane = pair.flat_body().pose * plane;
    over = std::max(over, signed_distance(plane, pair.round_body().pose.translation));
  }
  pair.outside = over > 0;
  return pair;
}

}  // namespace overlapper::closed_forms
