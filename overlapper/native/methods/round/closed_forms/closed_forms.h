#pragma once

#include <optional>

#include "geometry/patch.h"
#include "methods/round/closed_forms/round_pair.h"

namespace overlapper::closed_forms {

/// Measures of an overlapping pair, accurate to rounding for any tolerance. No value for pairs that the form does not
/// cover. Depths come from positions in double-doubles. Volumes are therefore accurate to their last digits at any
/// depth, except those of ellipsoids.
using ClosedForm = std::optional<MeasuresAndInertia> (*)(const RoundPair&);

/// The lens of two balls, of a ball and the end of a capsule, or of the ends of two capsules.
std::optional<MeasuresAndInertia> lens(const RoundPair& pair);

/// A cylinder or a capsule with a ball, by sections across the axis. The ball may also be the end of a capsule whose
/// other parts are outside the first body.
std::optional<MeasuresAndInertia> ball_at_axis(const RoundPair& pair);

/// A shallow contact at the sides of two cylinders or capsules, far from their ends.
std::optional<MeasuresAndInertia> sides(const RoundPair& pair);

/// A ball, a capsule or a cylinder, if at most one plane of the flat body cuts off anything that the other planes
/// leave.
std::optional<MeasuresAndInertia> cut_by_one_plane(const RoundPair& pair);

/// An ellipsoid cut by the planes of the flat body: the part of a ball, stretched. The area is not measured.
std::optional<MeasuresAndInertia> ellipsoid_in_flat(const RoundPair& pair);

/// A ball in a shallow contact with edges and corners of a box or a hull.
std::optional<MeasuresAndInertia> shallow_ball_in_polyhedron(const RoundPair& pair);

/// The end of a capsule in such a contact, if no other part of the capsule is in the box or hull.
std::optional<MeasuresAndInertia> shallow_end_in_polyhedron(const RoundPair& pair);

/// A ball cut by several planes of a box or a hull.
std::optional<MeasuresAndInertia> ball_in_polyhedron(const RoundPair& pair);

/// A capsule or a cylinder cut by several planes of a box or a hull.
std::optional<MeasuresAndInertia> long_body_in_polyhedron(const RoundPair& pair);

/// The patch of a half-space and a ball, a capsule or a cylinder that overlap: the section of the round body by the
/// plane. No value for any other pair. `centroid` and `area` are those of the patch.
std::optional<Patch> section_patch(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area);

}  // namespace overlapper::closed_forms
