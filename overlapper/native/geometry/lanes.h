#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>

/// Rows of doubles for simultaneous operations, and the compiler features for them. Nothing else in the core is written
/// for one compiler.
///
/// GCC and clang have vector types. They can compile a function for machines with more instructions than the rest of
/// the code needs. On Windows, GCC aligns the stack less than wide vectors need, so vectors are not used there.
/// Elsewhere rows are arrays, and the compiler handles loops over them. The bits are the same.
#if defined(__GNUC__) && !defined(_WIN32) && !defined(OVERLAPPER_PLAIN_LANES)
#define OVERLAPPER_VECTORS
#ifdef __x86_64__
#include <immintrin.h>
#endif
#endif

#if defined(__MINGW32__) && !defined(__FMA__)
#error "The fma of MinGW's library rounds twice, by which exact signs would be wrong: use another compiler, or -mfma"
#endif

namespace overlapper {

#ifdef OVERLAPPER_VECTORS

/// Two doubles; every machine adds, multiplies and compares both at once.
using TwoLanes = double __attribute__((vector_size(16)));

/// Four doubles, in the form that the machine has. The alignment is that of the widest machines, because functions
/// compiled for these share data with others.
using Quad = double __attribute__((vector_size(32), aligned(32)));

/// Selects one or the other in each lane. A quad is not returned, because machines return it in different ways.
template <class Which, class Lanes>
inline void choose(const Which& which, const Lanes& one, const Lanes& other, Lanes& result) {
  result = which ? one : other;
}

#else

template <class T, int count>
struct LanesOf {
  T lane[count];

  constexpr T& operator[](int i) { return lane[i]; }
  constexpr const T& operator[](int i) const { return lane[i]; }
};

/// Operations work lane by lane, or with one number for all lanes. As in a vector, true is all bits set.
template <class T, int count, class Operation>
constexpr auto each_of(const LanesOf<T, count>& a, const LanesOf<T, count>& b, Operation operation) {
  LanesOf<decltype(operation(T{}, T{})), count> row{};
  for (int i = 0; i < count; ++i) row.lane[i] = operation(a.lane[i], b.lane[i]);
  return row;
}
template <int count>
constexpr LanesOf<double, count> in_each(double number) {
  LanesOf<double, count> row{};
  for (double& lane : row.lane) lane = number;
  return row;
}
constexpr std::int64_t all_bits(bool is) { return -static_cast<std::int64_t>(is); }

#define OVERLAPPER_IN_LANES(sign, expression)                                                  \
  template <class T, int count>                                                                \
  constexpr auto operator sign(const LanesOf<T, count>& one, const LanesOf<T, count>& other) { \
    return each_of(one, other, [](T a, T b) { return expression; });                           \
  }                                                                                            \
  template <int count>                                                                         \
  constexpr auto operator sign(const LanesOf<double, count>& one, double b) {                  \
    return one sign in_each<count>(b);                                                         \
  }                                                                                            \
  template <int count>                                                                         \
  constexpr auto operator sign(double a, const LanesOf<double, count>& other) {                \
    return in_each<count>(a) sign other;                                                       \
  }
OVERLAPPER_IN_LANES(+, a + b)
OVERLAPPER_IN_LANES(-, a - b)
OVERLAPPER_IN_LANES(*, a* b)
OVERLAPPER_IN_LANES(/, a / b)
OVERLAPPER_IN_LANES(<, all_bits(a < b))
OVERLAPPER_IN_LANES(>, all_bits(a > b))
OVERLAPPER_IN_LANES(>=, all_bits(a >= b))
OVERLAPPER_IN_LANES(&, a& b)
OVERLAPPER_IN_LANES(|, a | b)
#undef OVERLAPPER_IN_LANES

template <class T, int count>
constexpr LanesOf<T, count> operator-(const LanesOf<T, count>& row) {
  return each_of(row, row, [](T a, T) { return -a; });
}
template <class T, int count>
constexpr void operator+=(LanesOf<T, count>& row, const LanesOf<T, count>& other) {
  row = row + other;
}
template <class T, int count>
constexpr void operator-=(LanesOf<T, count>& row, const LanesOf<T, count>& other) {
  row = row - other;
}
template <class T, int count>
constexpr void operator|=(LanesOf<T, count>& row, const LanesOf<T, count>& other) {
  row = row | other;
}
template <class T, int count>
constexpr void operator<<=(LanesOf<T, count>& row, int by) {
  for (T& lane : row.lane) lane <<= by;
}

using TwoLanes = LanesOf<double, 2>;
using Quad = LanesOf<double, 4>;

template <int count>
constexpr void choose(const LanesOf<std::int64_t, count>& which, const LanesOf<double, count>& one,
                      const LanesOf<double, count>& other, LanesOf<double, count>& result) {
  for (int i = 0; i < count; ++i) result.lane[i] = which.lane[i] ? one.lane[i] : other.lane[i];
}

#endif

// A function marked OVERLAPPER_WIDER is compiled, with all functions that it calls, for AVX2 and FMA. It is called if
// is_wider(): if the processor has both, and the variable OVERLAPPER_NARROW of the environment is not set. If the macro
// is not defined, all functions are compiled for the same machine.
#if defined(OVERLAPPER_VECTORS) && defined(__x86_64__)
#define OVERLAPPER_FUSING __attribute__((target("avx2,fma")))
#if !(defined(__AVX2__) && defined(__FMA__))
#define OVERLAPPER_WIDER __attribute__((target("avx2,fma"), flatten))
inline bool is_wider() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && !std::getenv("OVERLAPPER_NARROW");
}
#endif
#else
#define OVERLAPPER_FUSING
#endif

#if defined(OVERLAPPER_VECTORS) && defined(__x86_64__) && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define OVERLAPPER_SHUFFLES
#endif
#endif

/// The lanes of two quads with these numbers: 0 to 3 are of `one`, 4 to 7 of `other`. `wider` in functions for AVX2:
/// there GCC goes through memory for a quad of single lanes, and elsewhere for a shuffle of whole quads.
template <bool wider, int i, int j, int k, int l>
inline void pick(const Quad& one, const Quad& other, Quad& result) {
#ifdef OVERLAPPER_SHUFFLES
  if constexpr (wider) {
    result = __builtin_shufflevector(one, other, i, j, k, l);
    return;
  }
#endif
  result = Quad{(i < 4 ? one : other)[i % 4], (j < 4 ? one : other)[j % 4], (k < 4 ? one : other)[k % 4],
                (l < 4 ? one : other)[l % 4]};
}

/// Bit k is set if lane k of a comparison is true.
template <class Mask>
inline unsigned bits_of(const Mask& mask) {
  unsigned bits = 0;
  for (unsigned k = 0; k < sizeof(Mask) / sizeof(mask[0]); ++k) bits |= static_cast<unsigned>(mask[k] & 1) << k;
  return bits;
}
#if defined(OVERLAPPER_VECTORS) && defined(__x86_64__)
inline unsigned bits_of(const std::int64_t __attribute__((vector_size(16))) & mask) {
  return static_cast<unsigned>(_mm_movemask_pd(reinterpret_cast<const __m128d&>(mask)));
}
OVERLAPPER_FUSING inline unsigned bits_of(const std::int64_t __attribute__((vector_size(32))) & mask) {
  return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<const __m256d&>(mask)));
}
#endif

#if defined(__AVX2__)
using MostLanes = Quad;
#else
using MostLanes = TwoLanes;
#endif

#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
inline constexpr bool kFused = true;
#else
inline constexpr bool kFused = false;
#endif

/// a * b - c, rounded once.
OVERLAPPER_FUSING inline void fused_difference(const Quad& a, const Quad& b, const Quad& c, Quad& result) {
#if defined(OVERLAPPER_VECTORS) && defined(__x86_64__)
  result = _mm256_fmsub_pd(a, b, c);
#else
  for (int i = 0; i < 4; ++i) result[i] = std::fma(a[i], b[i], -c[i]);
#endif
}

}  // namespace overlapper
