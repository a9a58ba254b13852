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

/// Adds to the patch the sections of a ball, of a capsule or a cylinder, or of an ellipsoid by the faces of a box or a
/// hull. They count as seen from the front if the flat body is the second one. False if the error of the volume would
/// exceed kSureOfSections of it.
bool add_sections_of_ball(const RoundPair& pair, PatchSums& patch);
bool add_sections_of_long_body(const RoundPair& pair, PatchSums& patch);
bool add_sections_of_ellipsoid(const RoundPair& pair, PatchSums& patch);
inline constexpr double kSureOfSections = 1e-10;

/// The patch of a flat body and a ball, a capsule, a cylinder or an ellipsoid that overlap. It consists of the sections
/// of the round body by planes of the half-space, the box or the hull. No value for other pairs, for an ellipsoid and a
/// half-space, and for very shallow contacts. `centroid` and `area` are those of the patch.
std::optional<Patch> section_patch(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area);

}  // namespace overlapper::closed_forms
