#pragma once

#include <array>

namespace overlapper {

/// Three coordinates of a force or a velocity of a patch. They are along its normal and about two axes in its plane, or
/// along these axes and about the normal.
using Three = std::array<double, 3>;
using ThreeByThree = std::array<Three, 3>;

inline Three operator+(const Three& a, const Three& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Three operator-(const Three& a, const Three& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Three operator*(double s, const Three& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double dot(const Three& a, const Three& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Three operator*(const ThreeByThree& m, const Three& v) { return {dot(m[0], v), dot(m[1], v), dot(m[2], v)}; }

inline ThreeByThree operator*(const ThreeByThree& a, const ThreeByThree& b) {
  ThreeByThree product{};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) product[i][j] += a[i][k] * b[k][j];
  return product;
}

inline ThreeByThree operator*(double s, const ThreeByThree& m) { return {s * m[0], s * m[1], s * m[2]}; }

inline ThreeByThree operator+(const ThreeByThree& a, const ThreeByThree& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

inline ThreeByThree transposed(const ThreeByThree& m) {
  return {{{m[0][0], m[1][0], m[2][0]}, {m[0][1], m[1][1], m[2][1]}, {m[0][2], m[1][2], m[2][2]}}};
}

/// The matrix with these rows: each component of `a` times `b`.
inline ThreeByThree outer(const Three& a, const Three& b) { return {a[0] * b, a[1] * b, a[2] * b}; }

constexpr ThreeByThree kIdentity{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

/// The inverse of a regular matrix.
ThreeByThree inverse(const ThreeByThree& m);

/// The largest eigenvalue of the product of two symmetric matrices that have no negative eigenvalues.
double largest_eigenvalue(const ThreeByThree& a, const ThreeByThree& b);

}  // namespace overlapper
