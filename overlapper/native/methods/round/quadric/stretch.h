#pragma once

#include <algorithm>

#include "geometry/vec.h"

namespace overlapper::quadric {

/// An ellipsoid, as what makes it of the unit ball about its centre: x, y and z times a half axis each. An area vector
/// of the ball, or of a plane, becomes one of the ellipsoid by the cofactors, and the size of the element of its
/// surface, √(b²c² u² + c²a² v² + a²b² w²) per solid angle at (u, v, w), has no integral in closed form.
struct Stretch {
  /// The relative difference of two rules up to which the finer rule is believed. The rule of fifteen nodes is the
  /// better by far, unless the two agree by chance.
  static constexpr double kApart = 1e-11;

  explicit Stretch(Vec3 half_axes_)
      : half_axes(half_axes_),
        cofactors{half_axes_.y * half_axes_.z, half_axes_.z * half_axes_.x, half_axes_.x * half_axes_.y},
        volume(half_axes_.x * cofactors.x) {}

  Vec3 half_axes, cofactors;
  double volume;  ///< the determinant

  /// The relative error of the surface's area. In a body more than a thousand times as long as thick, the element
  /// changes within a part of the ball so small that rules may not notice it.
  double open() const {
    const double shortest = std::min({half_axes.x, half_axes.y, half_axes.z});
    const double slender = std::max(1.0, max_component(half_axes) / shortest / 1e3);
    return std::min(1.0, kApart * slender * slender);
  }

  /// The image of an area vector.
  Vec3 normal(Vec3 n) const { return scaled(cofactors, n); }
  double area(Vec3 n) const { return norm(normal(n)); }
  /// place × normal, in the world along the axes.
  Vec3 moment(Vec3 place, Vec3 n) const { return cross(scaled(half_axes, place), normal(n)); }

  /// Per height of the strip, the surface between two parallel planes along the arc level + cos φ across + sin φ along
  /// of the unit ball, |φ| <= half_angle.
  double arc(Vec3 level, Vec3 across, Vec3 along, double half_angle) const;

  struct Cap {
    double area, error;
  };
  /// The surface beyond a plane orthogonal to the unit normal, of a cap of the unit ball up to 2 high.
  Cap cap(Vec3 normal, double height) const;
};

}  // namespace overlapper::quadric
