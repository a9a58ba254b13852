#pragma once

#include <array>
#include <cstdint>

#include "geometry/vec.h"

namespace overlapper {

/// Three components of a force and three of a torque, or of a velocity and an angular velocity.
using SixNumbers = std::array<double, 6>;
using SixBySix = std::array<SixNumbers, 6>;

/// A constraint between two links, as in Bullet. With kPoint, a point of one link stays at a point of the other. With
/// kFixed, the links do not move relative to each other. With kSlider, they only move along an axis.
struct Constraint {
  enum class Kind { kPoint, kFixed, kSlider };

  std::int64_t key = 0;  ///< the same in every step
  Kind kind = Kind::kPoint;
  std::array<int, 2> links{};  ///< -1 for the world
  std::array<Pose, 2> frames;  ///< of the constraint, in the inertial frame of each link
  Vec3 axis;                   ///< of a slider, in the inertial frame of the first link
  double correction = 0;       ///< 1/s: the velocity that corrects an error of position, over the error
  double limit = 0;            ///< N or N m: the largest force in each direction
};

/// The directions of a constraint in the world: three for velocities at the points, and three for angular velocities.
/// Directions that are free are 0. `target` is the velocity of the first link over the second in each direction.
struct Directions {
  std::array<Vec3, 6> axes;
  std::array<Vec3, 2> points;
  SixNumbers target{};
};

/// The directions of a constraint, if its links have these inertial frames. The frame of the world is not looked at.
Directions directions(const Constraint& constraint, const std::array<Pose, 2>& links);

/// The law of a constraint in a step: forces within the limit that give the target velocity, if they suffice.
class Bilateral {
 public:
  /// `mobility` times forces is the change of the slip in the step. Directions that forces do not move are free.
  Bilateral(const SixBySix& mobility, const SixNumbers& target, double limit);

  /// The forces. `slip` includes the effect of the forces that are `present`.
  SixNumbers answer(const SixNumbers& slip, const SixNumbers& present) const;

  /// Forces near a slip, and how they change by the slip. They are held back from those `before`, as in Coulomb::held.
  struct Near {
    SixNumbers value{};
    SixBySix by_slip{};
  };
  Near held(const SixNumbers& slip, const SixNumbers& before, double give) const;

  /// The largest component of a velocity in m/s. Angular velocities are multiplied by a radius of gyration.
  double speed(const SixNumbers& slip) const;

  /// The same for the difference to the target.
  double missing(const SixNumbers& slip) const;

 private:
  SixNumbers beside(const SixNumbers& slip) const;

  SixBySix mobility_;
  SixNumbers target_;
  double limit_;
  SixNumbers root_{};    ///< of the largest mobility of a force, three times, and of a torque
  SixBySix possible_{};  ///< maps a velocity to the part that forces can change
  SixBySix inverse_{};   ///< of the mobility, as far as there is one
  SixBySix hold_{};      ///< maps a velocity to forces: with the largest mobility, for what forces can change
};

}  // namespace overlapper
