#pragma once

#include <array>
#include <optional>
#include <vector>

#include "geometry/measures.h"
#include "geometry/patch.h"
#include "methods/round/closed_forms/revolved.h"

namespace overlapper::closed_forms {

/// Two bodies as closed forms see them, about a reference. At least one of them is round.
struct RoundPair {
  std::array<const Placed*, 2> body;
  std::array<std::optional<Revolved>, 2> revolved;  ///< the bodies that are balls, capsules or cylinders
  double rounding;                                  ///< m: how far a surface may be off
  Vec3 reference;
  std::array<Vec3, 2> positions;  ///< of the bodies, about the reference
  // Where one body is a half-space, a box or a hull:
  int self = 0;                 ///< number of the round body
  std::vector<Plane> planes{};  ///< of the flat body
  bool outside = false;         ///< the centre of the round body is outside the flat body

  const Placed& round_body() const { return *body[self]; }
  const Placed& flat_body() const { return *body[1 - self]; }
};
RoundPair round_pair(const Placed& a, const Placed& b, double rounding, Vec3 reference);

/// Measures of an overlapping pair right to rounding, whatever the tolerance. Nothing for pairs that the form does not
/// cover. Volumes are right to their last digits however shallow the contact is, but those of ellipsoids: depths come
/// from positions in double-doubles.
using ClosedForm = std::optional<MeasuresAndInertia> (*)(const RoundPair&);

/// The lens of two balls, of a ball and the end of a capsule, or of the ends of two capsules.
std::optional<MeasuresAndInertia> lens(const RoundPair& pair);

/// A shallow contact at the side of a cylinder or capsule, far from its ends: of a ball, of the end of a capsule, or of
/// the side of another cylinder or capsule.
std::optional<MeasuresAndInertia> sides(const RoundPair& pair);

/// A ball, a capsule or a cylinder where at most one plane of the flat body cuts off anything that the others leave.
std::optional<MeasuresAndInertia> cut_by_one_plane(const RoundPair& pair);

/// The same of an ellipsoid.
std::optional<MeasuresAndInertia> ellipsoid_cut_by_one_plane(const RoundPair& pair);

/// A ball in a shallow contact with edges and corners of a box or a hull.
std::optional<MeasuresAndInertia> shallow_ball_in_polyhedron(const RoundPair& pair);

/// The end of a capsule in such a contact, if the capsule shares nothing else with the box or hull.
std::optional<MeasuresAndInertia> shallow_end_in_polyhedron(const RoundPair& pair);

/// A ball cut by several planes of a box or a hull.
std::optional<MeasuresAndInertia> ball_in_polyhedron(const RoundPair& pair);

/// A capsule or a cylinder cut by several planes of a box or a hull.
std::optional<MeasuresAndInertia> long_body_in_polyhedron(const RoundPair& pair);

/// The patch of a half-space and a ball, a capsule or a cylinder that overlap: the section of the round body by the
/// plane. Nothing for every other pair. `centroid` and `area` are those of the patch.
std::optional<Patch> section_patch(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area);

}  // namespace overlapper::closed_forms
