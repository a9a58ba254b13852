#pragma once

#include "geometry/vec.h"

namespace overlapper {

/// The sum head + tail, where tail is at most half an ulp of head. One addition or product of doubles is exact (Knuth;
/// Dekker). Further operations have an error of about 2^-100 of the larger operand.
struct DoubleDouble {
  double head = 0, tail = 0;
  friend bool operator==(const DoubleDouble&, const DoubleDouble&) = default;
};

inline DoubleDouble two_sum(double a, double b) {
  const double sum = a + b, b_part = sum - a, a_part = sum - b_part;
  return {sum, (a - a_part) + (b - b_part)};
}

inline DoubleDouble two_product(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}

inline DoubleDouble normalised(double head, double tail) {
  const double sum = head + tail;
  return {sum, tail - (sum - head)};
}
inline DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble high = two_sum(a.head, b.head), low = two_sum(a.tail, b.tail);
  const DoubleDouble partial = normalised(high.head, high.tail + low.head);
  return normalised(partial.head, partial.tail + low.tail);
}
inline DoubleDouble operator-(DoubleDouble a) { return {-a.head, -a.tail}; }
inline DoubleDouble operator-(DoubleDouble a, DoubleDouble b) { return a + (-b); }
inline DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble product = two_product(a.head, b.head);
  return normalised(product.head, product.tail + (a.head * b.tail + a.tail * b.head));
}

inline DoubleDouble operator/(DoubleDouble a, DoubleDouble b) {
  const double first = a.head / b.head;
  const DoubleDouble rest = a - DoubleDouble{first} * b;
  return normalised(first, rest.head / b.head);
}

inline bool operator<(DoubleDouble a, DoubleDouble b) {
  return a.head < b.head || (a.head == b.head && a.tail < b.tail);
}
inline bool operator>(DoubleDouble a, DoubleDouble b) { return b < a; }
inline DoubleDouble abs(DoubleDouble a) { return a.head < 0 ? -a : a; }

/// The square root of a number that is not negative.
inline DoubleDouble sqrt(DoubleDouble a) {
  if (!(a.head > 0)) return {};
  const double first = std::sqrt(a.head);
  return normalised(first, (a - two_product(first, first)).head / (2 * first));
}

struct WideVector {
  DoubleDouble x, y, z;
  friend bool operator==(const WideVector&, const WideVector&) = default;
};

/// a - b, exactly.
inline WideVector wide_difference(Vec3 a, Vec3 b) {
  return {two_sum(a.x, -b.x), two_sum(a.y, -b.y), two_sum(a.z, -b.z)};
}

inline WideVector cross(const WideVector& u, const WideVector& v) {
  return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}

/// cross(b - a, c - a), from the two shorter edges. On a needle the two longer edges are nearly parallel, and most of
/// their product cancels.
inline WideVector wide_normal(Vec3 a, Vec3 b, Vec3 c) {
  const double ab = norm2(b - a), bc = norm2(c - b), ca = norm2(a - c);
  if (ab >= bc && ab >= ca) return cross(wide_difference(a, c), wide_difference(b, c));
  if (bc >= ca) return cross(wide_difference(b, a), wide_difference(c, a));
  return cross(wide_difference(c, b), wide_difference(a, b));
}

inline WideVector wide(Vec3 v) { return {{v.x}, {v.y}, {v.z}}; }
inline WideVector operator+(const WideVector& a, const WideVector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline WideVector operator-(const WideVector& a, const WideVector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline DoubleDouble dot(const WideVector& a, const WideVector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline WideVector operator-(const WideVector& v) { return {-v.x, -v.y, -v.z}; }
inline WideVector operator*(DoubleDouble s, const WideVector& v) { return {s * v.x, s * v.y, s * v.z}; }
inline WideVector operator*(double s, const WideVector& v) { return DoubleDouble{s} * v; }
inline WideVector operator/(const WideVector& v, DoubleDouble s) { return {v.x / s, v.y / s, v.z / s}; }
inline double rounded(DoubleDouble a) { return a.head; }
inline Vec3 rounded(const WideVector& v) { return {v.x.head, v.y.head, v.z.head}; }
/// The vector minus its `rounded`, rounded.
inline Vec3 tail(const WideVector& v) { return {v.x.tail, v.y.tail, v.z.tail}; }

// Plain doubles stay as they are, so that one code serves both.
inline double rounded(double a) { return a; }
inline Vec3 rounded(Vec3 v) { return v; }

inline WideVector operator*(const Mat3& m, const WideVector& v) {
  return {dot(wide(m.row0), v), dot(wide(m.row1), v), dot(wide(m.row2), v)};
}
inline WideVector apply_transposed(const Mat3& m, const WideVector& v) {
  return v.x * wide(m.row0) + v.y * wide(m.row1) + v.z * wide(m.row2);
}

/// The length of a vector. Scaling by a power of two first keeps the squares in range, where they would leave it.
inline DoubleDouble norm(const WideVector& v) {
  const double largest = max_component(abs(rounded(v)));
  if (!(largest > 0)) return {};
  if (largest > 1e-100 && largest < 1e100) return sqrt(dot(v, v));
  const int exponent = std::ilogb(largest);
  const DoubleDouble down{std::scalbn(1.0, -exponent)}, up{std::scalbn(1.0, exponent)};
  const WideVector scaled = down * v;
  return up * sqrt(dot(scaled, scaled));
}

/// Scaled to length one; {0, 0, 0} stays as it is.
inline WideVector unit(const WideVector& v) {
  const DoubleDouble length = norm(v);
  return length.head > 0 ? v / length : v;
}

struct WidePlane {
  WideVector normal;  ///< unit
  DoubleDouble offset;
};

/// How far `point` lies outside the plane; negative inside.
inline DoubleDouble signed_distance(const WidePlane& plane, const WideVector& point) {
  return dot(plane.normal, point) - plane.offset;
}

}  // namespace overlapper
