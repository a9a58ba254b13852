#pragma once

#include "shapes/shape.h"

namespace overlapper {

/// What the signs of a pair of polytopes are computed from: where the second body is in the first one's own
/// coordinates.
struct Relation {
  Pose pose;
  double reach;  ///< how large the numbers are
  double flat;   ///< m: flatness of either
  double doubt;  ///< m: a corner that is nearer to a plane may be on either side of it
  bool apart;    ///< the balls around the bodies are
};
/// Neither body may be round, and the first must be bounded.
Relation relation(const Placed& first, const Placed& second);

/// m: what signed distances of numbers that large are uncertain by, between polytopes of that flatness.
double doubt_of_signs(double reach, double flat);

}  // namespace overlapper
