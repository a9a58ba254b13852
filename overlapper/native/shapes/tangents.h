#pragma once

#include <algorithm>
#include <cmath>

#include "geometry/wide.h"

/// Geometry that several shapes share: exits of rays from balls and discs, with their tangent planes.
namespace overlapper::tangents {

inline double sign(double x) { return x < 0 ? -1 : 1; }
inline double sign(DoubleDouble x) { return x.head < 0 ? -1 : 1; }

inline Vec3 axis(int i) { return {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0}; }
inline WideVector wide_axis(int i) { return wide(axis(i)); }

inline double radial(Vec3 v) { return std::hypot(v.x, v.y); }
/// A vector without its component along z.
inline WideVector across(const WideVector& v) { return {v.x, v.y, {}}; }

/// The smallest t >= 0 with |q + t d|² = r², for q inside. Uses the one of the two usual forms that does not cancel.
inline double leave_disc(double qq, double qd, double dd, double r) {
  const double inside = std::max(0.0, r * r - qq);
  const double root = std::sqrt(qd * qd + dd * inside);
  return qd > 0 ? inside / (qd + root) : (root - qd) / dd;
}

/// The exit of the ray from q, inside, from the ball about the origin; from the disc for vectors with z = 0.
inline WideVector leave_ball(const WideVector& q, const WideVector& d, double radius) {
  const DoubleDouble length = norm(q), r{radius}, dd = dot(d, d), qd = dot(q, d);
  DoubleDouble inside = (r - length) * (r + length);
  if (inside.head < 0) inside = {};
  const DoubleDouble root = sqrt(qd * qd + dd * inside);
  const DoubleDouble t = qd.head > 0 ? inside / (qd + root) : (root - qd) / dd;
  return q + t * d;
}

inline Plane tangent(Vec3 outward, Vec3 centre, double radius) {
  const Vec3 normal = unit(outward);
  return {normal, dot(normal, centre) + radius};
}
inline WidePlane tangent(const WideVector& outward, const WideVector& centre, double radius,
                         const WideVector& otherwise) {
  const WideVector direction = norm(outward).head > 0 ? unit(outward) : otherwise;
  return {direction, dot(direction, centre) + DoubleDouble{radius}};
}

/// The derivative, by the direction, of the farthest point of a circle about z along the direction.
inline Mat3 slope_of_circle(double radius, Vec3 direction) {
  const Vec3 tangent{-direction.y, direction.x, 0};
  const double across = radial(direction), curved = radius / (across * across * across);
  return {curved * tangent.x * tangent, curved * tangent.y * tangent, curved * tangent.z * tangent};
}

}  // namespace overlapper::tangents
