#pragma once

#include "forces/elastic_patch.h"
#include "forces/linear.h"
#include "forces/three.h"

namespace overlapper {

/// The rule by which pressures follow the depth within a step. kKeeping keeps the energy of an oscillation, and is
/// stable for steps of any length. kDamping is backward Euler.
enum class Rule { kKeeping, kDamping };

/// The pressures of a patch in a step: a force along the normal, and torques about two axes in the plane through the
/// centroid of the volume.
class Pressure {
 public:
  /// Damping of motion along the normal, besides the dissipation.
  struct Damping {
    double factor = 0;    ///< N s/m
    double approach = 0;  ///< m/s: the slip at the beginning of the step that it sees, negative for an impact
    double staying = 0;   ///< from 0 to 1: to which part tipping follows backward Euler. Rolling bodies have 0.
  };

  /// `before` is the slip at the beginning of the step. `mobility` times pressures is the change of the slip in 1 s.
  Pressure(const ElasticPatch& patch, const PlaneArea& area, const ThreeByThree& mobility, const Damping& damping,
           const Three& before, double duration, Rule rule);

  /// The pressures. `slip` is the slip at the end of the step without them. Pressures push, and their centre stays on
  /// the area. `more` in N is damping that does not follow from this slip.
  Three answer(const Three& slip, double more) const;

  /// The pressures near a slip that includes the effect of those `present`. They are held back from those `before`, as
  /// in Coulomb::held. The other number is `more`.
  Linear held(const Three& slip, double more, double give, const Three& before, const Three& present) const;

 private:
  struct Drawn;
  Drawn drawn(const Three& asked) const;

  PlaneArea area_;
  ThreeByThree mobility_, response_, implicit_;
  Three rest_;
  Three in_radii_;  ///< coefficients of u², uv and v²: squared distance from the centre, in radii of gyration
  double duration_;
};

}  // namespace overlapper
