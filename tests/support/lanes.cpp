// All that rows of doubles do, behind one function that ctypes can call.
#include <cstring>

#include "geometry/wide_lanes.h"

using namespace overlapper;

namespace {

struct Written {
  double* next;

  template <class Lanes>
  void add(const Lanes& lanes) {
    std::memcpy(next, &lanes, sizeof lanes);
    next += sizeof lanes / sizeof(double);
  }
  template <class Bits>
  void add_bits(const Bits& bits) {
    for (size_t i = 0; i < sizeof bits / sizeof(double); ++i) *next++ = static_cast<double>(bits[i]);
  }
  void add(const WideLanes& lanes) { add(lanes.head), add(lanes.tail); }
  void add(const Vec3& v) {
    for (double each : {v.x, v.y, v.z}) *next++ = each;
  }
};

template <class Lanes>
Lanes loaded(const double* from) {
  Lanes lanes{};
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}

template <class Lanes>
void of_lanes(const double* numbers, Written& out) {
  const Lanes a = loaded<Lanes>(numbers), b = loaded<Lanes>(numbers + 4);
  const double c = numbers[8];
  for (const Lanes& each : {Lanes(a + b), Lanes(a - b), Lanes(a * b), Lanes(a / b), Lanes(-a)}) out.add(each);
  for (const Lanes& each : {Lanes(a + c), Lanes(c - a), Lanes(a * c), Lanes(c / a)}) out.add(each);
  Lanes sum = a;
  sum += b, out.add(sum);
  sum -= a, out.add(sum);
  auto bits = (a < b) & (a > c);
  out.add_bits(bits);
  bits |= (a >= c) | (a < c);
  bits <<= 3;
  out.add_bits(bits);
  Lanes chosen{};
  choose(a > b, a, b, chosen);
  out.add(chosen);
}

template <bool fused>
void of_wide_lanes(const double* numbers, Written& out) {
  const Quad a = loaded<Quad>(numbers), b = loaded<Quad>(numbers + 4);
  const double c = numbers[8];
  const WideLanes wide = two_sum(a, b), other(b, 0x1p-60 * a);
  out.add(two_product<fused>(a, b)), out.add(two_product<fused>(a, c));
  out.add(wide), out.add(wide - other), out.add(product<fused>(wide, DoubleDouble{c, 0x1p-55 * c}));
  const WideColumns columns = transposed<fused>(wide, other, -wide, other);
  for (const WideLanes& each : columns) out.add(each);
  WideSum<fused> sum(columns, Vec3{c, 3, -c});
  sum.add(wide), sum.add_product(other, wide.head);
  out.add(sum.lanes()), out.add(sum.rounded());
}

}  // namespace

// Answers how many doubles it wrote of the nine that it was given.
extern "C" int lanes(const double* numbers, double* written) {
  Written out{written};
  of_lanes<TwoLanes>(numbers, out), of_lanes<Quad>(numbers, out);
  of_wide_lanes<kFused>(numbers, out);
  return static_cast<int>(out.next - written);
}
