#pragma once

#include "geometry/wide.h"

namespace overlapper {

struct WideMatrix {
  WideVector row0, row1, row2;
};

inline WideVector operator*(const WideMatrix& m, const WideVector& v) {
  return {dot(m.row0, v), dot(m.row1, v), dot(m.row2, v)};
}

inline WideVector scaled(const WideVector& v, DoubleDouble s) { return {v.x * s, v.y * s, v.z * s}; }

inline WideVector apply_transposed(const WideMatrix& m, const WideVector& v) {
  return scaled(m.row0, v.x) + scaled(m.row1, v.y) + scaled(m.row2, v.z);
}

/// The rotation of a quaternion of any length. `ratio_to` takes the squared length and returns a function that divides
/// numbers by it.
template <class RatioTo>
WideMatrix rotation_by_ratios(Quaternion given, RatioTo ratio_to) {
  const Quaternion q = in_range(given);
  const DoubleDouble xx = two_product(q.x, q.x), yy = two_product(q.y, q.y), zz = two_product(q.z, q.z),
                     ww = two_product(q.w, q.w), xy = two_product(q.x, q.y), xz = two_product(q.x, q.z),
                     yz = two_product(q.y, q.z), xw = two_product(q.x, q.w), yw = two_product(q.y, q.w),
                     zw = two_product(q.z, q.w);
  const auto part = ratio_to(xx + yy + zz + ww);
  const auto twice = [&](DoubleDouble value) { return part({2 * value.head, 2 * value.tail}); };
  return {{part(ww + xx - yy - zz), twice(xy - zw), twice(xz + yw)},
          {twice(xy + zw), part(ww - xx + yy - zz), twice(yz - xw)},
          {twice(xz - yw), twice(yz + xw), part(ww - xx - yy + zz)}};
}

/// The error of every entry is at most 2^-98.
inline WideMatrix wide_rotation(Quaternion q) {
  return rotation_by_ratios(
      q, [](DoubleDouble length2) { return [length2](DoubleDouble value) { return value / length2; }; });
}

/// The same in doubles. The error of every entry is half an ulp of the entry, so the matrix is a rotation up to these
/// errors. One division is faster than nine, and its error of 2^-100 is lost in the rounding.
inline Mat3 rotation_matrix(Quaternion q) {
  if (unturned(q)) return {};
  const WideMatrix exactly = rotation_by_ratios(q, [](DoubleDouble length2) {
    return [inverse = DoubleDouble{1} / length2](DoubleDouble value) { return value * inverse; };
  });
  return {rounded(exactly.row0), rounded(exactly.row1), rounded(exactly.row2)};
}

}  // namespace overlapper
