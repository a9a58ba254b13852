#pragma once

#include <array>
#include <optional>
#include <span>

#include "methods/round/lenses/outlines.h"

namespace overlapper::lenses {

/// A circle { p : |p|² − 2 centre · p = slack }.
struct Circle {
  Circle() = default;
  Circle(Flat centre_, double slack_, double radius_);

  Flat centre;
  double slack = 0, radius = 0;

  /// The point of the circle beside a point, with the same distance from the line through origin and centre. Near the
  /// origin, its place along that line has all digits.
  Flat on(Flat near) const;

 private:
  double away_ = 0;      ///< of the centre from the origin
  Flat ahead_ = {1, 0};  ///< from the centre to the origin
};

/// The part of a slice inside the walls, by its corners, counter-clockwise. Coordinates are along the slice's own axes
/// about an origin beside the arcs, so that thin parts keep their digits.
struct Region {
  static constexpr int kMostCorners = 2 * kMostCuts + 2;
  /// The curve from this corner to the next one: the first or the second circle, or 2 and the number of the wall.
  struct Corner {
    double x, y;
    int curve;

    Flat at() const { return {x, y}; }
  };
  std::array<Corner, kMostCorners> corner;  ///< entries beyond `corners` are not set
  int corners = 0;
  std::optional<int> whole;  ///< the circle, if the region is its whole disc
  std::array<Circle, 2> circle;
  bool about_foot = false;  ///< the origin is the foot
  Flat origin;              ///< about the foot, in the slice's plane
  Flat ahead;               ///< the x axis

  bool empty() const { return corners == 0 && !whole; }
  Flat aside() const { return {-ahead.y, ahead.x}; }
  Flat next(int i) const { return corner[i + 1 < corners ? i + 1 : 0].at(); }
};
Region region(const Discs& discs, const Section& section, double t, double tail = 0);

/// Adds the values of t where a wall touches a circle or meets a crossing of both circles. Also adds those where an
/// edge of two walls meets a circle or a third wall.
void add_changes_by_walls(const Discs& discs, double low, double high, Changes& result);

}  // namespace overlapper::lenses
