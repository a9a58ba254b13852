#pragma once

#include <span>
#include <vector>

namespace overlapper {

/// A motor that drives one coordinate, as Bullet's motors of joints do. It changes the velocity v that the coordinate
/// would have without the motor to (1 - gain) v + target, if its force suffices.
struct Motor {
  int coordinate;  ///< among those of all bodies; in `MotorsOfBody`, among those of the body
  double target;   ///< m/s or rad/s
  double gain;     ///< from 0 to 1
  double limit;    ///< N or N m: its largest force
};

/// The motors of a body in a step. A motor whose force suffices is part of the body: with a gain of 1 its coordinate
/// has the velocity of the target, whatever else pushes. The other motors push with their largest force.
class MotorsOfBody {
 public:
  /// `mass` is the mass matrix by rows, and `velocity` that of all coordinates of the body after the step, if neither
  /// motors nor contacts push. `full` tells for each coordinate whether its motor pushes with its largest force: 1
  /// forwards, -1 backwards, else 0.
  MotorsOfBody(std::vector<Motor> motors, std::span<const double> mass, std::span<const double> velocity,
               double duration, std::span<signed char> full);

  /// The velocity after the step, if no contacts push.
  const std::vector<double>& velocity() const { return pushed_; }

  /// The inverse mass matrix of the body with its motors by rows. It tells the answer to forces of contacts.
  const std::vector<double>& inverse_mass() const { return inverse_mass_; }

  /// Finds which motors push with their largest force, if contacts push with these impulses on the coordinates, so that
  /// the velocity is this one. Returns whether they are others than before. With `last`, no motor changes to a
  /// smaller force than its largest one.
  bool changes(std::span<const double> velocity, std::span<const double> impulses, bool last);

 private:
  struct Held {
    Motor motor;
    double velocity;   ///< at which the motor does not push
    double stiffness;  ///< impulse for a velocity of 1 beside that; infinite for a gain of 1
    double most;       ///< impulse
  };

  std::vector<Held> motors_;
  std::span<const double> mass_;
  std::span<signed char> full_;
  std::vector<double> free_, pushed_, inverse_mass_;
};

}  // namespace overlapper
