#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace overlapper {

struct Vec3 {
  double x = 0, y = 0, z = 0;

  double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  friend bool operator==(const Vec3&, const Vec3&) = default;
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec3 operator*(Vec3 a, double s) { return s * a; }
inline Vec3 operator/(Vec3 a, double s) { return {a.x / s, a.y / s, a.z / s}; }
inline Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
inline Vec3& operator-=(Vec3& a, Vec3 b) { return a = a - b; }

inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double norm2(Vec3 a) { return dot(a, a); }
inline double norm(Vec3 a) { return std::hypot(a.x, a.y, a.z); }
/// Component by component.
inline Vec3 scaled(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3 abs(Vec3 a) { return {std::abs(a.x), std::abs(a.y), std::abs(a.z)}; }
/// The sums of the absolute terms of cross(a, b), which may cancel.
inline Vec3 sizes_of_cross(Vec3 a, Vec3 b) {
  const Vec3 p = abs(a), q = abs(b);
  return {p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x};
}
inline double max_component(Vec3 a) { return std::max({a.x, a.y, a.z}); }
inline Vec3 min(Vec3 a, Vec3 b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
inline Vec3 max(Vec3 a, Vec3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }
inline bool finite(Vec3 a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

/// `a` scaled to length one; {0, 0, 0} stays as it is. Dividing by the largest component first keeps the squares in
/// range.
inline Vec3 unit(Vec3 a) {
  const double largest = max_component(abs(a));
  if (!(largest > 0)) return a;
  const Vec3 scaled = a / largest;
  return scaled / std::sqrt(norm2(scaled));
}

/// Some unit vector orthogonal to the unit vector `a`.
inline Vec3 any_orthogonal(Vec3 a) {
  const Vec3 other = std::abs(a.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  return unit(cross(a, other));
}

/// A 3 × 3 matrix by rows.
struct Mat3 {
  Vec3 row0{1, 0, 0}, row1{0, 1, 0}, row2{0, 0, 1};
};

inline Vec3 operator*(const Mat3& m, Vec3 v) { return {dot(m.row0, v), dot(m.row1, v), dot(m.row2, v)}; }
inline Mat3 transposed(const Mat3& m) {
  return {{m.row0.x, m.row1.x, m.row2.x}, {m.row0.y, m.row1.y, m.row2.y}, {m.row0.z, m.row1.z, m.row2.z}};
}
/// transposed(m) * v, without forming the transpose.
inline Vec3 apply_transposed(const Mat3& m, Vec3 v) { return v.x * m.row0 + v.y * m.row1 + v.z * m.row2; }
inline double determinant(const Mat3& m) { return dot(m.row0, cross(m.row1, m.row2)); }
inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {apply_transposed(b, a.row0), apply_transposed(b, a.row1), apply_transposed(b, a.row2)};
}

inline Mat3 operator+(const Mat3& a, const Mat3& b) { return {a.row0 + b.row0, a.row1 + b.row1, a.row2 + b.row2}; }
inline Mat3 operator-(const Mat3& a, const Mat3& b) { return {a.row0 - b.row0, a.row1 - b.row1, a.row2 - b.row2}; }
/// a bᵀ.
inline Mat3 outer(Vec3 a, Vec3 b) { return {a.x * b, a.y * b, a.z * b}; }

/// Scalar last as in pybullet. A quaternion of any length but 0 stands for the rotation M(q) / |q|², which is rational.
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};

/// True if it turns nothing, whatever its length.
inline bool unturned(Quaternion q) { return q.x == 0 && q.y == 0 && q.z == 0; }

/// The same rotation from a quaternion whose largest component is in [1, 2): a power of two rounds nothing, and the
/// squares neither overflow nor underflow.
inline Quaternion in_range(Quaternion q) {
  const double largest = std::max({std::abs(q.x), std::abs(q.y), std::abs(q.z), std::abs(q.w)});
  if (largest >= 1 && largest < 2) return q;
  const int down = -std::ilogb(largest);
  return {std::scalbn(q.x, down), std::scalbn(q.y, down), std::scalbn(q.z, down), std::scalbn(q.w, down)};
}

/// Maps a point x of the body to rotation * x + translation.
struct Pose {
  Mat3 rotation;
  Vec3 translation;
};

inline Vec3 operator*(const Pose& pose, Vec3 point) { return pose.rotation * point + pose.translation; }

/// Maps a point of the one body to the coordinates of the other.
inline Pose relative_pose(const Pose& to, const Pose& of) {
  const Mat3 back = transposed(to.rotation);
  return {back * of.rotation, back * (of.translation - to.translation)};
}

/// The closed half-space { x : dot(normal, x) <= offset }. `normal` is unit and points out of the solid.
struct Plane {
  Vec3 normal;
  double offset = 0;
};

/// How far `point` lies outside the plane; negative inside.
inline double signed_distance(const Plane& plane, Vec3 point) { return dot(plane.normal, point) - plane.offset; }

inline Plane operator*(const Pose& pose, const Plane& plane) {
  const Vec3 normal = pose.rotation * plane.normal;
  return {normal, plane.offset + dot(normal, pose.translation)};
}

}  // namespace overlapper
