#pragma once

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <optional>

#include "geometry/moments.h"
#include "geometry/patch.h"
#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/quadric/stretch.h"
#include "methods/round/slicing/wall.h"

namespace overlapper::pieces {

/// Integrals over pieces in the axes of the world, about the point inside.
struct Totals : Moments {
  double error = 0, area = 0, area_error = 0;
  double first_area = 0;  ///< m²: of the first body's surface
  double border = 0;      ///< m²: the area of all that area vectors are the sums of
  double open = 0;        ///< m³: what may be missing of pieces whose area vectors do not sum to zero
  Moments sizes;          ///< of the terms of an ellipsoid's moments
  Vec3 pull, moment;
  Vec3 unbalanced;  ///< the sum of both bodies' area vectors: zero if no piece is missing

  void add(const Totals& piece) {
    Moments::operator+=(piece);
    error += piece.error, area += piece.area, border += piece.border, open += piece.open;
    first_area += piece.first_area;
    pull += piece.pull, moment += piece.moment, unbalanced += piece.unbalanced;
  }

  /// Adds to the area what belongs to a body, and not to a cut.
  void add_area(int owner, double more) {
    if (owner != slicing::kCut) area += more;
    if (owner == 0) first_area += more;
  }
};

/// m³: what may be missing if the area vectors of the whole surface do not sum to zero: they, times the size along
/// them.
inline double missing(const Totals& totals) {
  const Vec3 u = totals.unbalanced, s = totals.squares, p = totals.products;
  const double square =
      u.x * u.x * s.x + u.y * u.y * s.y + u.z * u.z * s.z + 2 * (u.y * u.z * p.x + u.z * u.x * p.y + u.x * u.y * p.z);
  const double rounding = slicing::kSummation * totals.border * std::sqrt((s.x + s.y + s.z) / totals.volume);
  return std::max(0.0, std::sqrt(std::max(0.0, square / totals.volume)) - rounding);
}

/// m³: what may be missing of all pieces.
inline double open_volume(const Totals& totals) { return 2 * std::max(totals.open, missing(totals)); }

/// m²: at least as much is missing of a surface whose area vectors do not sum to zero, beyond rounding.
inline double missing_area(Vec3 unbalanced, double border) {
  return std::max(0.0, norm(unbalanced) - slicing::kSummation * border);
}

/// All that is summed over pieces.
struct Sums {
  Totals totals;
  std::optional<PatchSums> patch;  ///< if wanted
};

/// How a patch is seen in the coordinates of pieces: u and v there, and what an area vector adds.
struct PatchView {
  double u0 = 0, v0 = 0;
  Vec3 u, v, normal;
  int owner = 0;  ///< whose surface counts

  PatchView() = default;
  PatchView(const PatchSums& patch, int owner_)
      : u0(-dot(patch.origin(), patch.u())),
        v0(-dot(patch.origin(), patch.v())),
        u(patch.u()),
        v(patch.v()),
        normal(patch.normal()),
        owner(owner_) {}
};

/// Settings that are the same for all pieces of a pair.
struct PieceSetting {
  double extent = 0;                          ///< m: no point of the common set is farther from the one inside
  const quadric::Stretch* stretch = nullptr;  ///< of an ellipsoid: from the ball and the planes that are added
  const EnclosingPolytope* common = nullptr;  ///< what lies outside of it belongs to no piece
  PatchView view;                             ///< of the patch, if one is summed
  bool closely = false;                       ///< all of every interval is looked at
  double layer = 0;                           ///< m: planes no farther from each other are one
  double surface = 0;                         ///< m²: of the common set, where there are such layers
};

/// The fraction of a volume up to which the rounding of a polytope's corners does not matter.
inline constexpr double kSure = 5e-13;

/// Whether slices are to have so many walls: of more, they take long, by the cube of their number.
inline bool sliceable(size_t walls) { return walls <= 28; }

/// Beyond that fraction of a volume, something is wrong. Polytopes of tangent planes take seconds to be as good.
inline constexpr double kMostError = 1e-8;
/// The fraction of a volume that may stay open before slices are looked at more closely, or others are.
inline constexpr double kMostOpen = 1e-11;

/// m: how far rounding may move surfaces whose coordinates, about the point inside, reach as far as the common set. If
/// `mean_square` is the mean square of the distance of a convex set from the point, no point is farther than five times
/// its root: ∫ |x|² dV about the centroid is at least 2 V R² / 45.
inline double rounding_of_surfaces(double mean_square) { return 8 * DBL_EPSILON * 5 * std::sqrt(mean_square); }

inline double sum_of(Vec3 v) { return v.x + v.y + v.z; }

}  // namespace overlapper::pieces
