#pragma once

#include "methods/round/closed_forms/closed_forms.h"

namespace overlapper::closed_forms {

/// Measures of bodies that overlap, by a closed form; all numbers are zero.
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
