#pragma once

#include "methods/round/pieces/measure.h"
#include "methods/round/pieces/pieces.h"
#include "methods/round/pieces/totals.h"

namespace overlapper::pieces {

/// Beyond that fraction of a volume, something is wrong. Polytopes of tangent planes take seconds to be as good.
inline constexpr double kMostError = 1e-8;
/// The fraction of a volume that may stay open before slices are looked at more closely, or others are.
inline constexpr double kMostOpen = 1e-11;

/// m: how far rounding may move surfaces whose coordinates, about the point inside, reach as far as the common set. If
/// `mean_square` is the mean square of the distance of a convex set from the point, no point is farther than five times
/// its root: ∫ |x|² dV about the centroid is at least 2 V R² / 45.
inline double rounding_of_surfaces(double mean_square) { return 8 * DBL_EPSILON * 5 * std::sqrt(mean_square); }

inline double sum_of(Vec3 v) { return v.x + v.y + v.z; }

/// Moves the surface of a body out, but not the cuts through it; false if that leaves nothing of something round.
bool grow(Pieces& pieces, double outwards);

}  // namespace overlapper::pieces
