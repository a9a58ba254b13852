#pragma once

#include <cfloat>

#include "geometry/wide.h"

namespace overlapper::slicing {

/// The owner of planes that cut a body in two.
inline constexpr int kCut = 2;

/// Sums of area vectors are right to this fraction of the area.
inline constexpr double kSummation = 16 * DBL_EPSILON;

/// A ball, or a cylinder without ends, about a point of the common set.
struct Round {
  bool ball;
  WideVector centre;  ///< any point of a cylinder's axis
  WideVector axis;    ///< unit
  double radius;
  double half_length;  ///< of a cylinder: how far from its centre the piece reaches along the axis
  int owner;
};

/// The point of a cylinder's axis that is nearest to the origin.
inline WideVector foot(const Round& cylinder) {
  return cylinder.centre - dot(cylinder.centre, cylinder.axis) * cylinder.axis;
}

/// { X : dot(normal, X) <= slack }, about the same point.
struct Wall {
  WideVector normal;  ///< unit
  DoubleDouble slack;
  int owner;  ///< the body that it is a face of; kCut for a cut between two pieces of one body
};

}  // namespace overlapper::slicing
