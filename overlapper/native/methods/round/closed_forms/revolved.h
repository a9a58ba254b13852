#pragma once

#include <optional>

#include "geometry/wide.h"
#include "shapes/shape.h"
#include "shapes/wide_body.h"

namespace overlapper::closed_forms {

/// A ball, a capsule or a cylinder.
struct Revolved {
  Vec3 centre, axis;
  double radius, half_length;
  bool round;                      ///< it ends in half balls
  const Placed* placed = nullptr;  ///< the body

  bool ball() const { return round && half_length == 0; }
  /// The offset of the supporting plane along `direction`, about the centre.
  double reach(Vec3 direction) const {
    const double along = dot(axis, direction);
    return half_length * std::abs(along) + radius * norm(round ? direction : direction - along * axis);
  }
};

/// No value for bodies of other kinds. An ellipsoid with equal axes is a ball.
std::optional<Revolved> revolved(const Placed& body);

/// The largest dot(direction, x) over the part of a ball about the origin below a plane, for unit vectors. If planes
/// may be off by `rounding`, the result is an upper bound of this maximum. `offset` is between -r and r.
double reach_of_cap(double r, Vec3 normal, double offset, Vec3 direction, double rounding);

/// The rotation from a body's axes to the world's axes.
WideMatrix wide_turn(const Placed& body);

/// The direction of a body's z axis in the world.
WideVector axis_of(const Placed& body);

/// The centre of a round body and the direction of its axis.
struct WideAxis {
  WideVector centre, axis;
};
/// The centre and the axis of `body` in the own coordinates of `other`. A ball has no axis.
WideAxis seen_from(const Placed& other, const Revolved& body);

}  // namespace overlapper::closed_forms
