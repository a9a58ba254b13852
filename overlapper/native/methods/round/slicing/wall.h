#pragma once

#include <cfloat>

#include "geometry/wide.h"

namespace overlapper::slicing {

/// The owner of a plane that cuts a body in two.
inline constexpr int kCut = 2;

/// Error of sums of area vectors, relative to the area.
inline constexpr double kSummation = 16 * DBL_EPSILON;

/// A ball, or an infinite cylinder, relative to a point of the common set.
struct Round {
  bool ball;
  WideVector centre;  ///< any point of a cylinder's axis
  WideVector axis;    ///< unit
  double radius;
  double half_length;  ///< for a cylinder: how far the piece reaches along the axis from `centre`
  int owner;
};

/// The point of a cylinder's axis that is nearest to the origin.
inline WideVector foot(const Round& cylinder) {
  return cylinder.centre - dot(cylinder.centre, cylinder.axis) * cylinder.axis;
}

/// { X : dot(normal, X) <= slack }, relative to the same point.
struct Wall {
  WideVector normal;  ///< unit
  DoubleDouble slack;
  int owner;  ///< the body with this face; kCut for a cut between two pieces of one body
};

}  // namespace overlapper::slicing
