#pragma once

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <optional>
#include <vector>

#include "geometry/measures.h"
#include "geometry/moments.h"
#include "geometry/patch.h"
#include "methods/round/pieces/enclosing_polytope.h"
#include "methods/round/quadric/polyhedron.h"
#include "methods/round/quadric/stretch.h"
#include "methods/round/slicing/wall.h"

namespace overlapper::pieces {

/// Integrals over pieces in the axes of the world, relative to the inner point.
struct Totals : Moments {
  double error = 0, area = 0, area_error = 0;
  double first_area = 0;  ///< m²: area of the first body's part of the surface
  double border = 0;      ///< m²: area of all surface that is in the sums of area vectors
  double open = 0;        ///< m³: possibly missing volume of pieces whose area vectors do not sum to zero
  Moments sizes;          ///< sizes of the terms of an ellipsoid's moments
  Vec3 pull, moment;
  Vec3 unbalanced;           ///< the sum of both bodies' area vectors: zero if no piece is missing
  double closed_border = 0;  ///< m²: the part of `border` from sliced pieces, without their cuts
  Vec3 left;                 ///< the part of `unbalanced` from the whole surfaces of sliced pieces, which are closed

  void add(const Totals& piece) {
    Moments::operator+=(piece);
    error += piece.error, area += piece.area, border += piece.border, open += piece.open;
    first_area += piece.first_area, closed_border += piece.closed_border, left += piece.left;
    pull += piece.pull, moment += piece.moment, unbalanced += piece.unbalanced;
  }

  /// Adds more - less, which both contain this already. Errors of both add up.
  void add_difference(const Totals& more, const Totals& less) {
    const auto sum = [](auto& of, const auto& plus, const auto& minus) { of = of + (plus - minus); };
    const auto errors = [](double& of, double plus, double minus) { of = plus + (minus - of); };
    sum(volume, more.volume, less.volume), sum(first, more.first, less.first);
    sum(squares, more.squares, less.squares), sum(products, more.products, less.products);
    sum(area, more.area, less.area), sum(first_area, more.first_area, less.first_area);
    sum(pull, more.pull, less.pull), sum(moment, more.moment, less.moment);
    sum(unbalanced, more.unbalanced, less.unbalanced), sum(left, more.left, less.left);
    errors(error, more.error, less.error), errors(area_error, more.area_error, less.area_error);
    errors(border, more.border, less.border), errors(closed_border, more.closed_border, less.closed_border);
    errors(open, more.open, less.open);
  }

  /// Adds to the area if the surface belongs to a body, and not to a cut.
  void add_area(int owner, double more) {
    if (owner != slicing::kCut) area += more;
    if (owner == 0) first_area += more;
  }
};

/// m³: bound of the missing volume if the area vectors of the whole surface do not sum to zero: their sum times the
/// extent along it. If the set is so thin that the rounding of that sum hides it, only cuts are summed, and pieces in
/// closed form: `open` bounds what sliced pieces leave. The whole volume if rounding hides this sum, too.
inline double missing(const Totals& totals) {
  const Vec3 s = totals.squares, p = totals.products;
  const auto volume_of = [&](Vec3 u, double border) -> std::optional<double> {
    const double square =
        u.x * u.x * s.x + u.y * u.y * s.y + u.z * u.z * s.z + 2 * (u.y * u.z * p.x + u.z * u.x * p.y + u.x * u.y * p.z);
    const double rounding = slicing::kSummation * border * std::sqrt((s.x + s.y + s.z) / totals.volume);
    constexpr double kThin = 1e-3;
    if (!(rounding <= kThin * totals.volume)) return std::nullopt;
    return std::max(0.0, std::sqrt(std::max(0.0, square / totals.volume)) - rounding);
  };
  if (const auto found = volume_of(totals.unbalanced, totals.border)) return *found;
  return volume_of(totals.unbalanced - totals.left, totals.border - totals.closed_border).value_or(totals.volume);
}

/// m³: bound of the missing volume of all pieces.
inline double open_volume(const Totals& totals) { return 2 * std::max(totals.open, missing(totals)); }

/// m²: lower bound of the missing area of a surface whose area vectors do not sum to zero, beyond rounding.
inline double missing_area(Vec3 unbalanced, double border) {
  return std::max(0.0, norm(unbalanced) - slicing::kSummation * border);
}

/// All sums over pieces.
struct Sums {
  Totals totals;
  std::optional<PatchSums> patch;  ///< if wanted
  std::vector<Pull> of_pieces;     ///< on each piece of the first body, about the inner point; empty unless wanted
};

/// A patch in the coordinates of pieces: its u and v, and the contribution of an area vector.
struct PatchView : quadric::SectionView {
  int owner = 0;  ///< the body whose surface counts

  PatchView() = default;
  PatchView(const PatchSums& patch, int owner_) : SectionView(patch, {}, {}), owner(owner_) {}
};

/// Below this fraction of the volume, the rounding of a polytope's corners does not matter.
inline constexpr double kSure = 5e-13;

/// Settings for all pieces of a pair.
struct PieceSetting {
  double extent = 0;                          ///< m: upper bound of the distance of common points from the inner point
  const quadric::Stretch* stretch = nullptr;  ///< for an ellipsoid: maps the ball and its planes to the world
  const EnclosingPolytope* common = nullptr;  ///< no piece lies outside of it
  PatchView view;                             ///< of the patch, if one is summed
  bool areas = true;                          ///< wanted; otherwise, those of an ellipsoid may be bounds
  bool of_many = false;                       ///< each piece is one of many, whose missing volumes add up
  bool closely = false;                       ///< sample all of every interval
  bool cuts = false;                          ///< also integrate cuts through bodies accurately
  bool many_walls = false;                    ///< the same for two or more rounds: many planes meet their corners
  double sure = kSure;                        ///< negligible rounding of a polytope's corners, relative to the volume
  double layer = 0;                           ///< m: planes at most this far apart count as one
  double surface = 0;                         ///< m²: of the common set, if there are such layers
};

/// Whether slices suit so many walls: their time grows with the cube of the number of walls.
inline bool sliceable(size_t walls) { return walls <= 28; }

/// A larger relative error of the volume means a failure. Polytopes of tangent planes take seconds for this accuracy.
inline constexpr double kMostError = 1e-8;
/// If a larger fraction of the volume is missing, slices are sampled more closely, or placed otherwise.
inline constexpr double kMostOpen = 1e-11;

/// m: bound of the movement of surfaces by rounding, for coordinates relative to the inner point up to the extent of
/// the common set. `mean_square` is the mean squared distance of a convex set from that point. No point is farther than
/// five times its root: ∫ |x|² dV about the centroid is at least 2 V R² / 45.
inline double rounding_of_surfaces(double mean_square) { return 8 * DBL_EPSILON * 5 * std::sqrt(mean_square); }

inline double sum_of(Vec3 v) { return v.x + v.y + v.z; }

}  // namespace overlapper::pieces
