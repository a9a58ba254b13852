#pragma once

#include <array>

#include "geometry/vec.h"

namespace overlapper {

/// Integrals over a solid of 1, of coordinates, and of their squares and products, about a point that the caller knows.
struct Moments {
  double volume = 0;       ///< m³
  Vec3 first;              ///< ∫ x dV
  Vec3 squares, products;  ///< ∫ x², y², z² dV and ∫ yz, zx, xy dV

  Moments& operator+=(const Moments& other) {
    volume += other.volume, first += other.first, squares += other.squares, products += other.products;
    return *this;
  }

  /// The same moments about another point; `offset` leads from the other point to the present one.
  Moments seen_from(Vec3 offset) const {
    const Vec3 f = first, o = offset, g = 2.0 * f + volume * o;
    return {volume, f + volume * o, squares + scaled(o, g),
            products + Vec3{f.y * o.z + f.z * o.y + volume * o.y * o.z, f.z * o.x + f.x * o.z + volume * o.z * o.x,
                            f.x * o.y + f.y * o.x + volume * o.x * o.y}};
  }

  /// Maps moments of coordinates along three axes to the coordinates in which the axes are given.
  Moments along(const std::array<Vec3, 3>& axes) const {
    const double second[3][3] = {
        {squares.x, products.z, products.y}, {products.z, squares.y, products.x}, {products.y, products.x, squares.z}};
    Moments result{volume, first.x * axes[0] + first.y * axes[1] + first.z * axes[2], {}, {}};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double w = second[i][j];
        const Vec3 a = axes[i], b = axes[j];
        result.squares += w * scaled(a, b);
        result.products += w * Vec3{a.y * b.z, a.z * b.x, a.x * b.y};
      }
    return result;
  }

  /// The inertia tensor at unit density, about the centroid.
  Mat3 inertia_about_centroid() const {
    const Vec3 c = first / volume, f = first;
    const Vec3 s = squares - scaled(f, c);
    const Vec3 p = products - Vec3{f.y * c.z, f.z * c.x, f.x * c.y};
    return {{s.y + s.z, -p.z, -p.y}, {-p.z, s.z + s.x, -p.x}, {-p.y, -p.x, s.x + s.y}};
  }

  /// The squared distance of the centroid over the squared width: the factor by which second moments lose digits.
  double remoteness() const {
    const Vec3 c = first / volume, q = squares / volume;
    return norm2(c) / (q.x + q.y + q.z - norm2(c));
  }
};

}  // namespace overlapper
