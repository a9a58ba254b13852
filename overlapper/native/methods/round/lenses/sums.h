#pragma once

#include <optional>

#include "geometry/moments.h"
#include "methods/round/lenses/outlines.h"
#include "methods/round/quadric/stretch.h"

namespace overlapper::lenses {

/// A patch in the first body's ball: u, v and the weight of an area vector are linear there.
struct View {
  double u0 = 0, v0 = 0;
  Vec3 u, v, weight;
};

/// The wanted sums besides volume, moments and area vectors.
struct Wanted {
  const quadric::Stretch *first = nullptr, *second = nullptr;  ///< for areas, if they are wanted
  std::optional<View> view;
  bool closing = false;
  bool closely = false;           ///< the border is bounded by terms that fall as slowly as where a root is near
  double volume = 0, border = 0;  ///< measured before; errors are small relative to these plus the sums
};

/// Integrals over slices, in the coordinates of Discs. The surface is the first body's within the second.
struct Sums {
  Moments moments;
  Vec3 force;              ///< ∫ N dA over the unit sphere's part
  Mat3 moved{{}, {}, {}};  ///< ∫ y Nᵀ dA
  double border = 0;       ///< ∫ dA over all of the surface, with `closing`
  double blur = 0;         ///< volume change by slacks as large as their terms; rounding is a fraction of it
  double oval = 0;         ///< the same for squares of places: non-circular sections move the surface relative to these
  double terms = 0;        ///< the largest of those terms
  double first_area = 0, second_area = 0;  ///< m²
  std::array<double, 6> patch{};           ///< ∫ 1, u, v, u², uv, v² of the weight
  Vec3 second_force;                       ///< ∫ N dA over the second surface and its faces, with `closing`
  Vec3 cut_force;                          ///< the same over walls that are no faces; with all other surface it closes

  /// Only what is wanted counts.
  void add(double weight, const Sums& other, const Wanted& wanted);
};

/// The integrals of the slice at t + tail per unit of t. The volume is `moments.volume`.
Sums slice(const Discs& discs, double t, const Wanted& wanted, double tail = 0);

/// Adds the part of a wall parallel to the slices, which ends them.
void add_end(const Discs& discs, const Cut& end, double area, const Wanted& wanted, Sums& sums);

}  // namespace overlapper::lenses
