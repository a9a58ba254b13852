#pragma once

#include <array>
#include <vector>

#include "forces/elastic_patch.h"
#include "forces/three.h"

namespace overlapper {

/// How friction resists: by one law for the slip and the spin of a patch, or at points that are spread over it.
enum class Friction { kEllipsoid, kDistributed };

/// The force of at most `limit` that ends the slip, or where that does not suffice the one of that size that opposes
/// what slip is left (Coulomb's law: of all forces within the limit, it takes away the most energy). Without it the
/// slip is `slip`, and `mobility` of the force, symmetric and positive, is added to that. What slip is left is `shift`
/// times the force: as a guess it may be of a problem like this, and is then that of this one.
Three opposing(const ThreeByThree& mobility, const Three& slip, double limit, double& shift);

/// The friction of a patch in a step: its forces along two axes in the plane and its torque about the normal, through
/// the centroid of the volume.
class PatchFriction {
 public:
  /// `mobility` is what such forces do to the slip within the step.
  PatchFriction(double coefficient, const PlaneArea& area, const ThreeByThree& mobility, Friction kind);

  /// Begins with forces like those known: what they are here.
  Three begin(const Three& known);

  /// Of the slip at the end of the step as it is with the forces of the last answer, if pressures push with `force`.
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
