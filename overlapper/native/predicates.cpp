#include "predicates.h"

namespace overlapper {
namespace {

/// The exact sum head + tail of one addition or product (Dekker; Knuth).
struct Two {
  double head, tail;
};

Two two_sum(double a, double b) {
  const double sum = a + b, b_part = sum - a, a_part = sum - b_part;
  return {sum, (a - a_part) + (b - b_part)};
}

Two two_product(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}

/// A sum of doubles that do not overlap, smallest first (Shewchuk 1997, section 2); its sign is that of the last one.
template <int Capacity>
struct Expansion {
  std::array<double, Capacity> term;
  int count = 0;

  void add(double value) {
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      const Two sum = two_sum(value, term[i]);
      value = sum.head;
      if (sum.tail != 0) term[kept++] = sum.tail;
    }
    if (value != 0 || kept == 0) term[kept++] = value;
    count = kept;
  }
  int sign() const { return count == 0 ? 0 : (term[count - 1] > 0) - (term[count - 1] < 0); }
};

/// a - b without rounding.
Two exact_difference(double a, double b) { return two_sum(a, -b); }

/// Adds sign * u * v * w, each factor an exact pair, without rounding: eight products of three doubles, four terms
/// each.
template <int Capacity>
void add_product(Expansion<Capacity>& sum, double sign, Two u, Two v, Two w) {
  for (double p : {u.head, u.tail}) {
    if (p == 0) continue;
    for (double q : {v.head, v.tail}) {
      if (q == 0) continue;
      const Two pq = two_product(sign * p, q);
      for (double r : {w.head, w.tail}) {
        if (r == 0) continue;
        for (double part : {pq.head, pq.tail}) {
          if (part == 0) continue;
          const Two product = two_product(part, r);
          sum.add(product.tail);
          sum.add(product.head);
        }
      }
    }
  }
}

struct ExactVector {
  Two x, y, z;
};

ExactVector exact_difference(Vec3 a, Vec3 b) {
  return {exact_difference(a.x, b.x), exact_difference(a.y, b.y), exact_difference(a.z, b.z)};
}

int exact_orientation(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  const ExactVector u = exact_difference(b, a), v = exact_difference(c, a), w = exact_difference(d, a);
  Expansion<6 * 32> det;  // six products of the determinant, each of at most 32 terms
  add_product(det, +1, u.x, v.y, w.z);
  add_product(det, -1, u.x, v.z, w.y);
  add_product(det, +1, u.y, v.z, w.x);
  add_product(det, -1, u.y, v.x, w.z);
  add_product(det, +1, u.z, v.x, w.y);
  add_product(det, -1, u.z, v.y, w.x);
  return det.sign();
}

/// Double-double arithmetic: each operation is right to about 2^-100 of the larger operand.
struct DoubleDouble {
  double head = 0, tail = 0;
};

DoubleDouble normalised(double head, double tail) {
  const double sum = head + tail;
  return {sum, tail - (sum - head)};
}
DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  const Two high = two_sum(a.head, b.head), low = two_sum(a.tail, b.tail);
  const DoubleDouble partial = normalised(high.head, high.tail + low.head);
  return normalised(partial.head, partial.tail + low.tail);
}
DoubleDouble operator-(DoubleDouble a) { return {-a.head, -a.tail}; }
DoubleDouble operator-(DoubleDouble a, DoubleDouble b) { return a + (-b); }
DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
  const Two product = two_product(a.head, b.head);
  return normalised(product.head, product.tail + (a.head * b.tail + a.tail * b.head));
}

struct WideVector {
  DoubleDouble x, y, z;
};

WideVector wide_difference(Vec3 a, Vec3 b) {
  const auto wide = [](Two t) { return DoubleDouble{t.head, t.tail}; };
  const ExactVector d = exact_difference(a, b);
  return {wide(d.x), wide(d.y), wide(d.z)};
}

WideVector wide_cross(const WideVector& u, const WideVector& v) {
  return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}

Vec3 wide_polar_vertex(Vec3 a, Vec3 b, Vec3 c) {
  const WideVector normal = wide_cross(wide_difference(b, a), wide_difference(c, a));
  const DoubleDouble height =
      normal.x * DoubleDouble{a.x} + normal.y * DoubleDouble{a.y} + normal.z * DoubleDouble{a.z};
  return {normal.x.head / height.head, normal.y.head / height.head, normal.z.head / height.head};
}

}  // namespace

int orientation(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  const Vec3 u = b - a, v = c - a, w = d - a;
  const Vec3 normal = cross(u, v);
  const double det = dot(normal, w);
  const Vec3 bound{std::abs(u.y * v.z) + std::abs(u.z * v.y), std::abs(u.z * v.x) + std::abs(u.x * v.z),
                   std::abs(u.x * v.y) + std::abs(u.y * v.x)};
  // Shewchuk's static bound for orient3d is (7 + 56 eps) eps with eps = 2^-53; 8 covers it.
  constexpr double kRounding = 8 * 0x1p-53;
  const double error = kRounding * dot(bound, abs(w));
  if (det > error) return 1;
  if (det < -error) return -1;
  return exact_orientation(a, b, c, d);
}

Vec3 accurate_normal(Vec3 a, Vec3 b, Vec3 c) {
  const WideVector normal = wide_cross(wide_difference(b, a), wide_difference(c, a));
  return {normal.x.head, normal.y.head, normal.z.head};
}

Vec3 polar_vertex(Vec3 a, Vec3 b, Vec3 c) {
  const Vec3 u = b - a, v = c - a;
  const Vec3 normal = cross(u, v);
  // The differences and products lose about eps |u| |v|. Where the normal is less than a hundredth of that, the points
  // are nearly collinear (three planes nearly share a line), and more digits are needed to place the vertex.
  constexpr double kWellShaped = 1e-2;
  if (!(norm2(normal) > kWellShaped * kWellShaped * norm2(u) * norm2(v))) return wide_polar_vertex(a, b, c);
  // All three have the same product with the normal; the shortest loses least to cancellation.
  const double aa = norm2(a), bb = norm2(b), cc = norm2(c);
  const Vec3 shortest = aa <= bb && aa <= cc ? a : bb <= cc ? b : c;
  return normal / dot(normal, shortest);
}

}  // namespace overlapper
