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

/// The rotation that a quaternion of any length stands for.
inline WideMatrix wide_rotation(Quaternion q) {
  const DoubleDouble xx = two_product(q.x, q.x), yy = two_product(q.y, q.y), zz = two_product(q.z, q.z),
                     ww = two_product(q.w, q.w), xy = two_product(q.x, q.y), xz = two_product(q.x, q.z),
                     yz = two_product(q.y, q.z), xw = two_product(q.x, q.w), yw = two_product(q.y, q.w),
                     zw = two_product(q.z, q.w);
  const DoubleDouble length2 = xx + yy + zz + ww, two{2};
  const auto part = [&](DoubleDouble value) { return value / length2; };
  return {{part(ww + xx - yy - zz), part(two * (xy - zw)), part(two * (xz + yw))},
          {part(two * (xy + zw)), part(ww - xx + yy - zz), part(two * (yz - xw))},
          {part(two * (xz - yw)), part(two * (yz + xw)), part(ww - xx - yy + zz)}};
}

}  // namespace overlapper
