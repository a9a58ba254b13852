#pragma once

#include <optional>
#include <span>

#include "methods/round/pieces/measure.h"
#include "methods/round/pieces/pieces.h"
#include "methods/round/pieces/totals.h"

namespace overlapper::pieces {

/// The pieces of an ellipsoid and of another body, in the coordinates of the ellipsoid's ball.
struct StretchedPieces {
  Pieces of_other, of_ellipsoid;
};

/// Maps an ellipsoid to a ball of radius 1, and maps the pieces with it. The axes are those of the ellipsoid. Radii and
/// axes of rounds stay as long as they are in the world.
void into_ball(const Placed& ellipsoid, Vec3 half_axes, Pieces& pieces);

/// The same view for a ball that is turned and stretched to the ellipsoid. Coordinates of the ball are about `origin`.
PatchView stretched_view(const PatchView& view, const Mat3& turn, const quadric::Stretch& stretch, Vec3 origin);

/// Adds the part of an ellipsoid's ball inside walls. The walls of a fine mesh are too many for slices: the ball is
/// then cut in parts. False if slices give up.
bool add_ball_in_walls(std::span<const Round> ball, std::span<const Wall> walls, const PieceSetting& setting,
                       Sums& sums);

/// The sums of the ball, and their errors.
struct OfBall {
  const Totals& totals;
  double error;                 ///< of the volume, in units of the ball's
  double misplaced;             ///< m: error of surfaces
  std::optional<double> moved;  ///< m: bound of the movement of surfaces by rounding, if known
  Vec3 origin;                  ///< the point that the sums are about, relative to the inner point
};

/// Volumes are multiplied by the determinant. The matrix of cofactors maps area vectors. With `swapped`, owner 0 is the
/// second body of the pair.
RoundMeasures in_world(const OfBall& of, const SlicedPair& pair, const Placed& ellipsoid,
                       const quadric::Stretch& stretch, bool swapped);

}  // namespace overlapper::pieces
