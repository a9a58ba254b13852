#pragma once

#include <vector>

#include "forces/elastic_patch.h"
#include "forces/linear.h"
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

/// Coulomb's law for a part of the slip of a patch.
class Coulomb {
 public:
  /// `rows` times the slip is the part of the slip; a row of zeros is not used. `mobility` times forces of the patch is
  /// the change of the slip within the step. The force is at most `share` times the pressing force.
  Coulomb(const ThreeByThree& rows, const ThreeByThree& mobility, double share);

  /// The force as one of the patch.
  Three wrench() const { return back_ * force_; }

  void begin(const Three& force) { force_ = force; }

  /// Answers a slip that includes the effect of the force before. Pressures push with `pressing`.
  void answer(const Three& slip, double pressing);

  /// The wrench near this slip, if the force before holds the slip back as far as it may: a slip that it does not end
  /// changes the force so much that `give` times the change would end it. The other number is the pressing force. With
  /// `afresh`, there was no force before.
  Linear held(const Three& slip, double pressing, double give, bool afresh);

  /// Takes the force of the last call of `held`.
  void take() { force_ = held_; }

 private:
  ThreeByThree rows_, back_, mobility_;
  double share_;
  Three force_{}, held_{};
  double shift_ = 0, held_shift_ = 0;
};

/// The friction of a patch in a step: forces along two axes in the plane, and a torque about the normal through the
/// centroid of the volume.
class PatchFriction {
 public:
  /// `mobility` times the forces of friction is the change of the slip within the step.
  PatchFriction(const ElasticPatch& patch, const PlaneArea& area, const ThreeByThree& mobility, Friction kind);

  /// Begins with known forces, limited to those that this law allows, and returns them.
  Three begin(const Three& known);

  Three wrench() const;

  /// Answers a slip that includes the effect of the present forces; pressures push with `force`. Returns the wrench.
  Three answer(Three slip, double force);

  /// See Coulomb.
  Linear held(const Three& slip, double force, double give, bool afresh);
  void take();

 private:
  void spread(const PlaneArea& area, double coefficient);

  double distance_;
  ThreeByThree mobility_;
  std::vector<Coulomb> parts_;  ///< the whole patch, or points
  std::vector<double> shares_;  ///< of the points in the pressing force
};

}  // namespace overlapper
