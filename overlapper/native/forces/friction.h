#pragma once

#include <array>

namespace overlapper {

/// Forces of friction and the slips against them: two along a plane, and about its normal a torque and a spin, both
/// divided and multiplied by a length, so that all are alike.
using Three = std::array<double, 3>;
using ThreeByThree = std::array<Three, 3>;

/// The force of at most `limit` that ends the slip, or where that does not suffice the one of that size that opposes
/// what slip is left (Coulomb's law: of all forces within the limit, it takes away the most energy). Without it the
/// slip is `slip`, and `mobility` of the force, symmetric and positive, is added to that. What slip is left is `shift`
/// times the force: as a guess it may be of a problem like this, and is then that of this one.
Three opposing(const ThreeByThree& mobility, const Three& slip, double limit, double& shift);

}  // namespace overlapper
