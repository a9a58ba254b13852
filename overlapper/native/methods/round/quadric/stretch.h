#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/moments.h"

namespace overlapper::quadric {

/// An ellipsoid as a stretch of the unit ball about its centre: x, y and z times a half axis each. Cofactors map area
/// vectors of the ball, or of a plane, to area vectors of the ellipsoid. The area element per solid angle at (u, v, w)
/// is √(b²c² u² + c²a² v² + a²b² w²), which has no integral in closed form.
struct Stretch {
  /// If the relative difference of two rules is at most this, the finer rule is accepted. The rule of fifteen nodes is
  /// far more accurate, unless the two agree by chance.
  static constexpr double kApart = 1e-11;

  explicit Stretch(Vec3 half_axes_)
      : half_axes(half_axes_),
        cofactors{half_axes_.y * half_axes_.z, half_axes_.z * half_axes_.x, half_axes_.x * half_axes_.y},
        volume(half_axes_.x * cofactors.x) {}

  Vec3 half_axes, cofactors;
  double volume;  ///< the determinant

  /// The relative error of the surface's area. In a body over a thousand times as long as thick, the element changes
  /// within so small a part of the ball that rules may miss it.
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

  /// The image of ∫ x nᵀ dA.
  Mat3 moved(const Mat3& of_ball) const {
    return {half_axes.x * scaled(cofactors, of_ball.row0), half_axes.y * scaled(cofactors, of_ball.row1),
            half_axes.z * scaled(cofactors, of_ball.row2)};
  }

  /// The surface between two parallel planes, per height of the strip, along the arc level + cos φ across + sin φ along
  /// of the unit ball, |φ| <= half_angle.
  double arc(Vec3 level, Vec3 across, Vec3 along, double half_angle) const;
  /// An upper bound of the same.
  double most_of_arc(Vec3 level, Vec3 across, Vec3 along, double half_angle) const {
    const double farthest = std::sin(std::min(half_angle, std::numbers::pi / 2));
    return 2 * half_angle * (area(level + across) + (1 - std::cos(half_angle)) * area(across) + farthest * area(along));
  }

  /// The image of the moments of a part of the ball.
  Moments moments(const Moments& of_ball) const {
    const Vec3 h = half_axes;
    return {volume * of_ball.volume, volume * scaled(h, of_ball.first), volume * scaled(scaled(h, h), of_ball.squares),
            volume * scaled(cofactors, of_ball.products)};
  }

  struct Cap {
    double area, error;
  };
  /// The surface of a cap of the unit ball, up to 2 high, beyond a plane orthogonal to the unit normal.
  Cap cap(Vec3 normal, double height) const;
};

}  // namespace overlapper::quadric
