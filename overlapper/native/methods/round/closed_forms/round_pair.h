#pragma once

#include <array>
#include <optional>
#include <vector>

#include "geometry/measures.h"
#include "methods/round/closed_forms/revolved.h"

namespace overlapper::closed_forms {

/// Two bodies as closed forms see them, about a reference. At least one of them is round.
struct RoundPair {
  std::array<const Placed*, 2> body;
  std::array<std::optional<Revolved>, 2> revolved;  ///< the bodies that are balls, capsules or cylinders
  double rounding;                                  ///< m: error of surfaces
  Vec3 reference;
  std::array<Vec3, 2> positions;  ///< of the bodies, about the reference
  // Only if one body is a half-space, a box or a hull:
  int self = 0;                 ///< number of the round body
  std::vector<Plane> planes{};  ///< of the flat body
  bool outside = false;         ///< the centre of the round body is outside the flat body

  const Placed& round_body() const { return *body[self]; }
  const Placed& flat_body() const { return *body[1 - self]; }
};
RoundPair round_pair(const Placed& a, const Placed& b, double rounding, Vec3 reference);

/// Measures of bodies that overlap, for a closed form; all numbers are still zero.
inline Measures measures_in_closed_form() {
  Measures m;
  m.status = Status::kOverlapping;
  m.way = Way::kClosedForm;
  m.measured = true;
  return m;
}

/// The pulls of a force on the first body and its opposite on the second. Both act at `where`. Each moment is about the
/// position of its body.
inline std::array<Pull, 2> opposite_pulls(const RoundPair& pair, Vec3 force_on_first, Vec3 where) {
  return {about({force_on_first, {}}, where, pair.positions[0]),
          about({-force_on_first, {}}, where, pair.positions[1])};
}

/// The same, from the force on the flat body.
inline std::array<Pull, 2> pulls_of_flat(const RoundPair& pair, Vec3 force_on_flat, Vec3 where) {
  return opposite_pulls(pair, pair.self == 0 ? -force_on_flat : force_on_flat, where);
}

}  // namespace overlapper::closed_forms
