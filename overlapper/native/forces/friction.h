#pragma once

#include <array>
#include <vector>

#include "forces/elastic_patch.h"
#include "forces/three.h"

namespace overlapper {

/// The law of friction: one law for the slip and the spin of a patch together, or Coulomb's at points spread over it.
enum class Friction { kEllipsoid, kDistributed };

/// The force of at most `limit` that ends the slip. If no such force does, the force has that size and opposes the slip
/// that is left: it takes away the most energy of all forces within the limit (Coulomb's law). The slip is `slip`
/// without the force; `mobility`, symmetric and positive, times the force is added to it. The slip that is left is
/// -`shift` times the force. A guess of `shift`, as from a similar problem, is replaced by the answer.
Three opposing(const ThreeByThree& mobility, const Three& slip, double limit, double& shift);

/// The friction of a patch in a step: forces along two axes in the plane, and a torque about the normal through the
/// centroid of the volume.
class PatchFriction {
 public:
  /// `mobility` times such forces is the change of the slip within the step.
  PatchFriction(double coefficient, const PlaneArea& area, const ThreeByThree& mobility, Friction kind);

  /// Begins with known forces, as far as this law can have them, and returns them.
  Three begin(const Three& known);

  /// The forces at the end of the step. `slip` includes the effect of `last`, the last answer; pressures push with
  /// `force`.
  Three answer(const Three& slip, const Three& last, double force);

 private:
  struct Point {
    double u, v, share;
    double fu = 0, fv = 0, shift = 0;
  };

  void spread(const PlaneArea& area);
  Three at_points(Three slip, double limit);

  double coefficient_, distance_, shift_ = 0;
  ThreeByThree mobility_;
  std::vector<Point> points_;
};

}  // namespace overlapper
