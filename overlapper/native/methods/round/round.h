#pragma once

#include <array>
#include <optional>

#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/lenses/lenses.h"
#include "methods/round/pieces/group.h"
#include "methods/round/pieces/measure.h"

namespace overlapper {

/// The number of bodies of each kind in a pair.
struct RoundTraits {
  int balls = 0, capsules = 0, cylinders = 0;
  int stretched = 0;  ///< ellipsoids whose axes differ
  int rounded_hulls = 0;
  int flat = 0;          ///< boxes, hulls and half-spaces
  bool outside = false;  ///< the centre of the round body is outside the flat body
};

/// A line of the table: a condition on the two bodies, the closed forms to try in turn, and the way to slice the pair.
struct RoundChoice {
  const char* bodies;
  bool (*fits)(const RoundTraits&);
  /// The result with the least error counts. No form is tried after a form with an error of at most kEnoughOfRound.
  std::array<closed_forms::ClosedForm, 3> forms;
  pieces::Slicing slicing;
};

/// How pairs with a round body are measured by Way::kClosedForm and Way::kSlicing. The first line that fits counts.
/// Forms after the last one are null.
inline constexpr std::array<RoundChoice, 13> kRoundChoices{{
    {"two balls", [](const RoundTraits& t) { return t.balls == 2; }, {closed_forms::lens}, pieces::measure_pieces},
    {"two, each a ball or a capsule",
     [](const RoundTraits& t) { return t.balls + t.capsules == 2; },
     {closed_forms::lens, closed_forms::sides, closed_forms::ball_at_axis},
     pieces::measure_pieces},
    {"a cylinder, and a ball, a capsule or a cylinder",
     [](const RoundTraits& t) { return t.balls + t.capsules + t.cylinders == 2; },
     {closed_forms::sides, closed_forms::ball_at_axis},
     pieces::measure_pieces},
    {"a ball, its centre outside a box, a hull or a half-space",
     [](const RoundTraits& t) { return t.balls == 1 && t.flat == 1 && t.outside; },
     {closed_forms::shallow_ball_in_polyhedron, closed_forms::cut_by_one_plane, closed_forms::ball_in_polyhedron},
     pieces::measure_pieces},
    {"a ball, its centre inside a box, a hull or a half-space",
     [](const RoundTraits& t) { return t.balls == 1 && t.flat == 1; },
     {closed_forms::ball_in_polyhedron, closed_forms::cut_by_one_plane},
     pieces::measure_pieces},
    {"a capsule, its centre outside a box, a hull or a half-space",
     [](const RoundTraits& t) { return t.capsules == 1 && t.flat == 1 && t.outside; },
     {closed_forms::shallow_end_in_polyhedron, closed_forms::cut_by_one_plane, closed_forms::long_body_in_polyhedron},
     pieces::measure_pieces},
    {"a cylinder, its centre outside a box, a hull or a half-space",
     [](const RoundTraits& t) { return t.cylinders == 1 && t.flat == 1 && t.outside; },
     {closed_forms::cut_by_one_plane, closed_forms::long_body_in_polyhedron},
     pieces::measure_pieces},
    {"a capsule or a cylinder, its centre inside a box, a hull or a half-space",
     [](const RoundTraits& t) { return t.capsules + t.cylinders == 1 && t.flat == 1; },
     {closed_forms::long_body_in_polyhedron, closed_forms::cut_by_one_plane},
     pieces::measure_pieces},
    {"an ellipsoid, and a box, a hull or a half-space",
     [](const RoundTraits& t) { return t.stretched == 1 && t.flat == 1; },
     {closed_forms::ellipsoid_in_flat},
     pieces::measure_stretched},
    {"an ellipsoid, and a ball or an ellipsoid",
     [](const RoundTraits& t) { return t.stretched > 0 && t.stretched + t.balls == 2; },
     {},
     lenses::measure_lenses},
    {"an ellipsoid, and a capsule, a cylinder or a rounded hull",
     [](const RoundTraits& t) { return t.stretched == 1 && t.capsules + t.cylinders + t.rounded_hulls == 1; },
     {},
     lenses::measure_in_parts},
    {"a rounded hull, and no ellipsoid",
     [](const RoundTraits& t) { return t.rounded_hulls > 0 && t.stretched == 0; },
     {},
     pieces::measure_culled_pieces},
    {"all others", [](const RoundTraits&) { return true; }, {}, nullptr},
}};

/// The measures of an overlapping pair by a formula. `rounding` bounds the error of a surface, in m. Bodies are about
/// `reference`, in any order.
std::optional<MeasuresAndInertia> closed_form(const Placed& a, const Placed& b, double rounding, Vec3 reference);

/// The volume of an overlapping pair by the surface of a rounded hull, if one body is a rounded hull and the other one
/// a half-space, a box, a hull, a ball, an ellipsoid, a capsule, a cylinder or a rounded hull. `between` is a point
/// inside both bodies, if one is known.
std::optional<VolumeAlone> volume_by_surface(const Placed& a, const Placed& b, const std::optional<Vec3>& between,
                                             const std::optional<Vec3>& nearest, double depth);

/// The measures of an overlapping pair by slices.
std::optional<pieces::RoundMeasures> measure_by_slices(const pieces::SlicedPair& pair);

}  // namespace overlapper
