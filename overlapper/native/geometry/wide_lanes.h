#pragma once

#include "geometry/lanes.h"
#include "geometry/wide.h"

namespace overlapper {

/// Four numbers in double-double. Copied quad by quad: the compiler alone would copy smaller pieces, and the next load
/// of a quad would wait for all of them.
struct WideLanes {
  constexpr WideLanes() : head{}, tail{} {}
  constexpr WideLanes(const Quad& heads, const Quad& tails) : head(heads), tail(tails) {}
  constexpr WideLanes(const WideLanes& other) : head(other.head), tail(other.tail) {}
  WideLanes& operator=(const WideLanes& other) {
    head = other.head;
    tail = other.tail;
    return *this;
  }

  Quad head, tail;
};

inline WideLanes two_sum(const Quad& a, const Quad& b) {
  const Quad sum = a + b, b_part = sum - a, a_part = sum - b_part;
  return {sum, (a - a_part) + (b - b_part)};
}

/// Splits doubles into halves whose products are exact (Veltkamp).
template <class T>
struct Halves {
  explicit Halves(const T& a) : high(134217729.0 * a), low() {  // 2^27 + 1
    high = high - (high - a);
    low = a - high;
  }
  T high, low;
};

OVERLAPPER_FUSING inline WideLanes fused_product(const Quad& a, const Quad& b) {
  WideLanes product(a * b, Quad{});
  fused_difference(a, b, product.head, product.tail);
  return product;
}

/// The exact product, by fused multiply-adds, or by Dekker's way on machines without them. The bits are the same,
/// unless something underflows.
template <bool fused, class T>
WideLanes two_product(const Quad& a, const T& b) {
  if constexpr (fused) {
    const Quad factor = b - Quad{};
    return fused_product(a, factor);
  } else {
    const Quad product = a * b;
    const Halves p(a);
    const Halves q(b);
    return {product, ((p.high * q.high - product) + p.high * q.low + p.low * q.high) + p.low * q.low};
  }
}

inline WideLanes normalised(const Quad& head, const Quad& tail) {
  const Quad sum = head + tail;
  return {sum, tail - (sum - head)};
}
inline WideLanes operator+(const WideLanes& a, const WideLanes& b) {
  const WideLanes high = two_sum(a.head, b.head), low = two_sum(a.tail, b.tail);
  const WideLanes partial = normalised(high.head, high.tail + low.head);
  return normalised(partial.head, partial.tail + low.tail);
}
inline WideLanes operator-(const WideLanes& a) { return {-a.head, -a.tail}; }
inline WideLanes operator-(const WideLanes& a, const WideLanes& b) { return a + (-b); }
template <bool fused>
WideLanes product(const WideLanes& a, DoubleDouble b) {
  const WideLanes product = two_product<fused>(a.head, b.head);
  return normalised(product.head, product.tail + (a.head * b.tail + a.tail * b.head));
}

inline DoubleDouble lane(const WideLanes& v, int i) { return {v.head[i], v.tail[i]}; }
inline WideVector vector(const WideLanes& v) { return {lane(v, 0), lane(v, 1), lane(v, 2)}; }
inline WideLanes in_lanes(Vec3 v) { return {Quad{v.x, v.y, v.z}, Quad{}}; }
inline WideLanes in_lanes(const WideVector& v, DoubleDouble last = {}) {
  return {Quad{v.x.head, v.y.head, v.z.head, last.head}, Quad{v.x.tail, v.y.tail, v.z.tail, last.tail}};
}

/// Four vectors side by side, with a coordinate of each in a lane; or the columns of a matrix.
using WideColumns = std::array<WideLanes, 4>;

/// The transpose of a 4 × 4 matrix, in two steps of one or two instructions each.
template <bool wider>
inline void transpose(Quad& a, Quad& b, Quad& c, Quad& d) {
  Quad ab02, ab13, cd02, cd13;
  pick<wider, 0, 4, 2, 6>(a, b, ab02);
  pick<wider, 1, 5, 3, 7>(a, b, ab13);
  pick<wider, 0, 4, 2, 6>(c, d, cd02);
  pick<wider, 1, 5, 3, 7>(c, d, cd13);
  pick<wider, 0, 1, 4, 5>(ab02, cd02, a);
  pick<wider, 0, 1, 4, 5>(ab13, cd13, b);
  pick<wider, 2, 3, 6, 7>(ab02, cd02, c);
  pick<wider, 2, 3, 6, 7>(ab13, cd13, d);
}
template <bool wider>
inline WideColumns transposed(const WideLanes& a, const WideLanes& b, const WideLanes& c, const WideLanes& d = {}) {
  WideColumns m{a, b, c, d};
  transpose<wider>(m[0].head, m[1].head, m[2].head, m[3].head);
  transpose<wider>(m[0].tail, m[1].tail, m[2].tail, m[3].tail);
  return m;
}

inline const Quad& rounded(const Quad& a) { return a; }
inline const Quad& rounded(const WideLanes& a) { return a.head; }

/// A sum of products with an error of a few 2^-104 of the largest product (Ogita, Rump and Oishi 2005, Dot2).
template <bool fused>
struct WideSum {
  Quad head, tail;

  explicit WideSum(const WideLanes& a) : head(a.head), tail(a.tail) {}
  template <class A, class B>
  WideSum(const A& a, const B& b) : WideSum(two_product<fused>(overlapper::rounded(a), overlapper::rounded(b))) {
    add_tails(a, b);
  }
  /// x * column[0] + y * column[1] + z * column[2]
  template <class Vector>
  WideSum(const WideColumns& columns, const Vector& v) : WideSum(columns[0], v.x) {
    add_product(columns[1], v.y);
    add_product(columns[2], v.z);
  }

  void add(const Quad& a) {
    const WideLanes sum = two_sum(head, a);
    head = sum.head;
    tail += sum.tail;
  }
  void add(const WideLanes& a) {
    add(a.head);
    tail += a.tail;
  }
  template <class A, class B>
  void add_product(const A& a, const B& b) {
    add(two_product<fused>(overlapper::rounded(a), overlapper::rounded(b)));
    add_tails(a, b);
  }

  Vec3 rounded() const {
    const Quad sum = head + tail;
    return {sum[0], sum[1], sum[2]};
  }
  WideLanes lanes() const { return normalised(head, tail); }

 private:
  void add_tails(const Quad&, double) {}
  void add_tails(const WideLanes& a, double b) { tail += a.tail * b; }
  void add_tails(const WideLanes& a, const Quad& b) { tail += a.tail * b; }
  void add_tails(const WideLanes& a, DoubleDouble b) { tail += a.tail * b.head + a.head * b.tail; }
};

}  // namespace overlapper
