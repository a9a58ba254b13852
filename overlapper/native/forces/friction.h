#pragma once

#include <array>
#include <vector>

#include "forces/elastic_patch.h"
#include "forces/three.h"

namespace overlapper {

/// The law of friction: one law for slip and spin of a patch together, or Coulomb's law at points spread over the
/// patch.
enum class Friction { kEllipsoid, kDistributed };

/// The force of at most `limit` that ends the slip. If no such force ends it, the force has the size `limit` and
/// opposes the remaining slip. It takes away the most energy of all forces within the limit (Coulomb's law). `slip` is
/// the slip without the force. The force changes it by `mobility` times the force; `mobility` is symmetric and
/// positive. The remaining slip is -`shift` times the force. `shift` may hold a guess, as from a similar problem; the
/// answer replaces it.
Three opposing(const ThreeByThree& mobility, const Three& slip, double limit, double& shift);

/// The friction of a patch in a step: forces along two axes in the plane, and a torque about the normal through the
/// centroid of the volume.
class PatchFriction {
 public:
  /// `mobility` times the forces of friction is the change of the slip within the step.
  PatchFriction(const ElasticPatch& patch, const PlaneArea& area, const ThreeByThree& mobility, Friction kind);

  /// Begins with known forces, limited to those that this law allows, and returns them.
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
