#pragma once

#include <optional>
#include <span>

#include "methods/round/lenses/sums.h"
#include "methods/round/pieces/measure.h"
#include "methods/round/pieces/totals.h"

namespace overlapper::lenses {

/// An ellipsoid, and a ball or an ellipsoid, by slices in which both are discs: the areas of lenses of two discs are
/// integrated. Where the first body is a unit ball, volume, moments and area vectors are those of its arcs alone. No
/// term is a difference of large ones, at any depth. Areas take the element of the surface along every arc; they are
/// left out unless the pair asks for them.
///
/// `outwards` scales the second body about its centre, by at least as much. No value if the error would exceed 1e-8 of
/// the volume.
std::optional<pieces::RoundMeasures> measure_lenses(const pieces::SlicedPair& pair);

/// An ellipsoid and a capsule, a cylinder or a rounded hull. Each part of the other body is a part of a ball or of a
/// cylinder inside planes, or a polytope. The ellipsoid may be a ball.
std::optional<pieces::RoundMeasures> measure_in_parts(const pieces::SlicedPair& pair);

/// The rounding of all terms of a slack, and of all sums of slices, in units of the last bit.
inline constexpr double kRoundings = 16;
/// The error of the rules for a part that walls cut, of its volume. Singular places of the walls are unknown away from
/// the real line. No error above half of this was seen.
inline constexpr double kOfRules = 2e-13;

/// An ellipsoid that the parts of another body are cut with. Coordinates are along the ellipsoid's axes, in units of
/// its half axes, about the inner point.
struct InEllipsoid {
  quadric::Stretch stretch;
  WideVector centre;     ///< of the ellipsoid
  double misplaced = 0;  ///< of surfaces, by double-doubles
  int parts = 1;         ///< of the other body, whose errors add up
  bool with_area = true;
  std::optional<View> view = {};
  double moved = 0;             ///< m: bound of the movement of surfaces by rounding, set by add_part()
  Mat3 ball_moved{{}, {}, {}};  ///< ∫ y Nᵀ dA over the ball's parts, added to by add_part()
  Vec3 second_force{};          ///< ∫ N dA over the other body's parts, likewise
};

/// Whether a ball or a cylinder contains all of the ellipsoid that is inside walls, and more: a ball about the disc
/// that one wall cuts off. Such a round bounds nothing of the common part.
bool contains_part(const InEllipsoid& of, const slicing::Round& round, std::span<const slicing::Wall> walls);

/// Adds what the ellipsoid shares with the part of a ball or a cylinder inside walls. The ellipsoid is body 0, and the
/// patch is of its surface. The radius and the axis of the round are those of the world, along the ellipsoid's axes.
/// False if a part cannot be measured.
bool add_part(InEllipsoid& of, const slicing::Round& round, std::span<const slicing::Wall> walls, pieces::Sums& sums);

}  // namespace overlapper::lenses
