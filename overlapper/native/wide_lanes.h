#pragma once

#include "wide.h"

namespace overlapper {

/// Four doubles that are added and multiplied at once, by whatever the machine has.
using Quad = double __attribute__((vector_size(32)));

/// Four numbers in double-double.
struct WideLanes {
  Quad head{}, tail{};
};

inline WideLanes two_sum(const Quad& a, const Quad& b) {
  const Quad sum = a + b, b_part = sum - a, a_part = sum - b_part;
  return {sum, (a - a_part) + (b - b_part)};
}

/// Halves of doubles, whose products are exact (Veltkamp).
template <class T>
struct Halves {
  explicit Halves(const T& a) : high(134217729.0 * a), low() {  // 2^27 + 1
    high = high - (high - a);
    low = a - high;
  }
  T high, low;
};

/// Dekker's: without a fused multiply-add, which not every machine has.
template <class T>
WideLanes two_product(const Quad& a, const T& b) {
  const Quad product = a * b;
  const Halves<Quad> p(a);
  const Halves<T> q(b);
  return {product, ((p.high * q.high - product) + p.high * q.low + p.low * q.high) + p.low * q.low};
}

inline DoubleDouble lane(const WideLanes& v, int i) { return {v.head[i], v.tail[i]}; }
inline WideVector vector(const WideLanes& v) { return {lane(v, 0), lane(v, 1), lane(v, 2)}; }

/// A sum of products right to a few 2^-104 of the largest of them (Ogita, Rump and Oishi 2005, Dot2).
struct WideSum {
  Quad head{}, tail{};

  void add(const Quad& a) {
    const WideLanes sum = two_sum(head, a);
    head = sum.head;
    tail += sum.tail;
  }
  void add(const WideLanes& a) {
    add(a.head);
    tail += a.tail;
  }
  void add_product(const Quad& a, double b) {
    const WideLanes product = two_product(a, b);
    add(product.head);
    tail += product.tail;
  }
  void add_product(const WideLanes& a, double b) {
    add_product(a.head, b);
    tail += a.tail * b;
  }
  void add_product(const WideLanes& a, DoubleDouble b) {
    add_product(a.head, b.head);
    tail += a.tail * b.head + a.head * b.tail;
  }

  Vec3 rounded() const {
    const Quad sum = head + tail;
    return {sum[0], sum[1], sum[2]};
  }
  WideLanes lanes() const {
    const Quad sum = head + tail;
    return {sum, tail - (sum - head)};
  }
};

/// Three or four vectors side by side, a coordinate of each in a lane: x * column[0] + y * column[1] + z * column[2].
using WideColumns = std::array<WideLanes, 3>;

template <class Vector>
WideLanes operator*(const WideColumns& m, const Vector& v) {
  WideSum sum;
  sum.add_product(m[0], v.x);
  sum.add_product(m[1], v.y);
  sum.add_product(m[2], v.z);
  return sum.lanes();
}

}  // namespace overlapper
