#pragma once

#include "shapes/shape.h"

namespace overlapper {

/// The numbers behind the signs of a pair of polytopes: the second body's pose in the first one's own coordinates, with
/// error bounds.
struct Relation {
  Pose pose;
  double reach;  ///< size of the coordinates
  double flat;   ///< m: sum of the two flatnesses
  double doubt;  ///< m: a corner nearer to a plane than this may be on either side
  bool apart;    ///< true if the balls around the bodies are disjoint
};
/// Neither body may be round, and the first must be bounded.
Relation relation(const Placed& first, const Placed& second);

/// m: error of signed distances between polytopes of coordinates up to `reach` and of that flatness.
double doubt_of_signs(double reach, double flat);

}  // namespace overlapper
