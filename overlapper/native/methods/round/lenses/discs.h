#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "geometry/wide_pose.h"
#include "methods/round/quadric/stretch.h"
#include "methods/round/slicing/wall.h"
#include "shapes/shape.h"

namespace overlapper::lenses {

/// A polynomial of t by its coefficients, of 1, t and t².
using Quadratic = std::array<double, 3>;
inline double at(const Quadratic& p, double t) { return p[0] + t * (p[1] + t * p[2]); }
/// The size of its terms.
inline double size_at(const Quadratic& p, double t) {
  return std::abs(p[0]) + std::abs(t) * (std::abs(p[1]) + std::abs(t * p[2]));
}

/// A vector in the plane of a slice.
struct Flat {
  double x = 0, y = 0;
};
inline Flat operator+(Flat a, Flat b) { return {a.x + b.x, a.y + b.y}; }
inline Flat operator-(Flat a, Flat b) { return {a.x - b.x, a.y - b.y}; }
inline Flat operator*(double s, Flat a) { return {s * a.x, s * a.y}; }
inline double dot(Flat a, Flat b) { return a.x * b.x + a.y * b.y; }
inline double norm(Flat a) { return std::sqrt(dot(a, a)); }
inline double cross(Flat a, Flat b) { return a.x * b.y - a.y * b.x; }

/// A vector that is linear in t.
struct Line {
  Flat start, slope;
  Flat at(double t) const { return start + t * slope; }
};
/// The sizes of the terms of its coordinates.
inline Flat sizes_at(const Line& line, double t) {
  return {std::abs(line.start.x) + std::abs(t * line.slope.x), std::abs(line.start.y) + std::abs(t * line.slope.y)};
}
inline Quadratic dot(const Line& a, const Line& b) {
  return {dot(a.start, b.start), dot(a.start, b.slope) + dot(a.slope, b.start), dot(a.slope, b.slope)};
}
inline Quadratic cross(const Line& a, const Line& b) {
  return {cross(a.start, b.start), cross(a.start, b.slope) + cross(a.slope, b.start), cross(a.slope, b.slope)};
}

/// A ball or an ellipsoid: a stretched and turned unit ball about a centre.
struct StretchedBall {
  WideVector half_axes, centre;  ///< the centre is about the inner point
  WideMatrix rotation;
  bool ball;
};

/// { y : |K y − k| <= 1 } in the coordinates of an ellipsoid: a ball or an ellipsoid, or an endless cylinder. The last
/// row of a cylinder's K is zero.
struct SecondBall {
  WideMatrix k;
  WideVector middle;
  bool cylinder = false;
};

/// A wall in the slices: normal · p <= offset − rate t, with p about the foot. A wall parallel to the slices ends them.
struct Cut {
  Flat normal;
  double length, offset, rate;
  double across;                          ///< the component of the unit normal across the slices
  bool face;                              ///< a face of the second body, not a cut between two parts of it
  double offset_tail = 0, rate_tail = 0;  ///< what doubles cannot hold
  /// A wall nearly parallel to the slices crosses them within a short interval. There, the tail of t counts.
  double side(double t, double tail = 0) const {
    return std::fma(-rate, t, offset) + (offset_tail - rate_tail * t - rate * tail);
  }
};

/// The largest number of walls of a part of a body.
inline constexpr int kMostCuts = 24;

/// An ellipsoid and a second body, in parallel slices in which both are discs. Walls may cut the second body.
///
/// Coordinates are those of the first ellipsoid, along its axes, in units of its half axes: there it is a unit ball.
/// They count from the inner point. The other is { y : |K y − k| <= 1 }. For the principal values l0 <= l1 <= l2 of
/// KᵀK along u0, u1, u2, its section by every plane orthogonal to √(l1 − l0) u0 ± √(l2 − l1) u2 is a disc: that plane
/// contains u1, and the plane's other direction has the same value. For an endless cylinder, l0 is zero.
///
/// In a slice, places count from a foot that moves with t along a tangent of the contact. Then everything that
/// describes a shallow contact is small, found in double-double, and rounded once: the slacks of both discs at the
/// foot, which are radius² − |centre|². The line through the crossings of both circles is where the slacks are equal.
struct Discs {
  Vec3 normal, x, y;  ///< unit, and orthogonal to each other: across the slices, and the axes of the plane
  Flat lean;          ///< of the foot per t
  Line centre;        ///< of the weighted mean of both discs: `share` of the way from the first to the second
  Line apart;         ///< from the first disc to the second
  double share;
  Quadratic slack;                        ///< of that weighted mean
  Quadratic difference;                   ///< slack of the first less that of the second
  Quadratic first_square, second_square;  ///< of the radii
  Quadratic first_slack, second_slack;
  double first_level;    ///< t of the first body's centre
  double oval;           ///< relative deviation of the second body's sections from discs
  double second_rise;    ///< height in the second's own ball per t
  double misplaced = 0;  ///< error of slacks by double-doubles, in units of the last bit
  Mat3 second_ball;      ///< K
  Vec3 second_middle;    ///< k
  WideMatrix first_rotation;
  bool cylinder = false;   ///< the second body is an endless cylinder
  double second_area = 0;  ///< m² of the second surface per angle and t, if that is constant
  std::array<Cut, kMostCuts> cut;
  int cuts = 0;
  std::array<std::optional<Cut>, 2> end;  ///< walls parallel to the slices, at the low and at the high end

  /// A vector across the slices and in their plane, along the axes of the first body.
  Vec3 along_axes(Vec3 v) const { return v.x * normal + v.y * x + v.z * y; }
  /// ∫ y Nᵀ dA along the axes of the first body, from that in the slices' axes.
  Mat3 moved_along_axes(const Mat3& moved) const;
  /// ∫ x × n dA of the stretched ball's surface along its axes, from ∫ y Nᵀ dA of the ball in the slices' axes.
  Vec3 moment(const Mat3& moved, const quadric::Stretch& stretch) const;
  Line first_centre() const { return {centre.start - share * apart.start, centre.slope - share * apart.slope}; }
  Line second_centre() const {
    return {centre.start + (1 - share) * apart.start, centre.slope + (1 - share) * apart.slope};
  }
  /// The common values of t: both discs exist.
  std::array<double, 2> range() const;
  /// The values of t at which either disc ends.
  std::array<double, 4> ends() const;
};

/// No value if the inner point is not inside both.
std::optional<Discs> discs(const StretchedBall& first, const StretchedBall& second);

/// The same for a first body that is the unit ball about `centre`. No value if the inner point is not inside it, or if
/// there are too many walls. Walls are planes in the same coordinates that cut the second body. The point may be
/// outside the second body. With `other`, slices have the other of both possible directions. The foot moves along
/// `leading`, if that is given.
std::optional<Discs> discs(const WideVector& centre, const SecondBall& second, std::span<const slicing::Wall> walls,
                           bool other = false, Vec3 leading = {});

/// Whether sections are closer to discs, relative to rounding, if `first` becomes the ball.
bool better_first(const StretchedBall& first, const StretchedBall& second);

}  // namespace overlapper::lenses
