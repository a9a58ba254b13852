#include "geometry/predicates.h"

#include "geometry/thresholds.h"
#include "geometry/wide.h"

namespace overlapper {
namespace {

/// A sum of doubles that do not overlap, smallest first (Shewchuk 1997, section 2). Its sign is that of the last
/// double.
template <int Capacity>
struct Expansion {
  std::array<double, Capacity> term;
  int count = 0;

  void add(double value) {
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      const DoubleDouble sum = two_sum(value, term[i]);
      value = sum.head;
      if (sum.tail != 0) term[kept++] = sum.tail;
    }
    if (value != 0 || kept == 0) term[kept++] = value;
    count = kept;
  }
  int sign() const { return count == 0 ? 0 : (term[count - 1] > 0) - (term[count - 1] < 0); }
};

/// Adds sign * u * v * w without rounding. Each factor is an exact pair. There are eight products of three doubles,
/// with four terms each.
template <int Capacity>
void add_product(Expansion<Capacity>& sum, double sign, DoubleDouble u, DoubleDouble v, DoubleDouble w) {
  for (double p : {u.head, u.tail}) {
    if (p == 0) continue;
    for (double q : {v.head, v.tail}) {
      if (q == 0) continue;
      const DoubleDouble pq = two_product(sign * p, q);
      for (double r : {w.head, w.tail}) {
        if (r == 0) continue;
        for (double part : {pq.head, pq.tail}) {
          if (part == 0) continue;
          const DoubleDouble product = two_product(part, r);
          sum.add(product.tail);
          sum.add(product.head);
        }
      }
    }
  }
}

int exact_orientation(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  const WideVector u = wide_difference(b, a), v = wide_difference(c, a), w = wide_difference(d, a);
  Expansion<6 * 32> det;  // six products of the determinant, each of at most 32 terms
  add_product(det, +1, u.x, v.y, w.z);
  add_product(det, -1, u.x, v.z, w.y);
  add_product(det, +1, u.y, v.z, w.x);
  add_product(det, -1, u.y, v.x, w.z);
  add_product(det, +1, u.z, v.x, w.y);
  add_product(det, -1, u.z, v.y, w.x);
  return det.sign();
}

Vec3 wide_polar_vertex(Vec3 a, Vec3 b, Vec3 c) {
  const WideVector normal = wide_normal(a, b, c);
  const DoubleDouble height = dot(normal, wide(a));
  return {normal.x.head / height.head, normal.y.head / height.head, normal.z.head / height.head};
}

}  // namespace

int orientation(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  const Vec3 u = b - a, v = c - a, w = d - a;
  const Vec3 normal = cross(u, v);
  const double det = dot(normal, w);
  const Vec3 bound{std::abs(u.y * v.z) + std::abs(u.z * v.y), std::abs(u.z * v.x) + std::abs(u.x * v.z),
                   std::abs(u.x * v.y) + std::abs(u.y * v.x)};
  constexpr double kHalfUlp = 0x1p-53, kRounding = 8 * kHalfUlp;
  static_assert(kRounding > (7 + 56 * kHalfUlp) * kHalfUlp, "the static bound of orient3d (Shewchuk 1997)");
  const double error = kRounding * dot(bound, abs(w));
  if (det > error) return 1;
  if (det < -error) return -1;
  return exact_orientation(a, b, c, d);
}

Vec3 accurate_normal(Vec3 a, Vec3 b, Vec3 c) { return rounded(wide_normal(a, b, c)); }

Vec3 polar_vertex(Vec3 a, Vec3 b, Vec3 c) {
  const Vec3 u = b - a, v = c - a;
  const Vec3 normal = cross(u, v);
  // The differences and products lose about 2^-53 |u| |v|. A normal shorter than kWellShaped |u| |v| has lost more than
  // two digits: the points are nearly collinear, as three planes nearly share a line.
  static_assert(kWellShaped == 1e-2, "the comment says two digits");
  if (!(norm2(normal) > kWellShaped * kWellShaped * norm2(u) * norm2(v))) return wide_polar_vertex(a, b, c);
  // All three have the same product with the normal; the shortest loses least to cancellation.
  const double aa = norm2(a), bb = norm2(b), cc = norm2(c);
  const Vec3 shortest = aa <= bb && aa <= cc ? a : bb <= cc ? b : c;
  return normal / dot(normal, shortest);
}

}  // namespace overlapper
