/* A mathematical library whose results differ from the system's in the last bits, as those of other systems do. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

int most_ulps = 0; /* by which a result is off */

/* The same arguments give the same result. */
static double off(double result, double x, double y) {
  uint64_t hash, other;
  int64_t bits;
  if (most_ulps == 0 || !isfinite(result) || result == trunc(result)) return result;
  memcpy(&hash, &x, 8), memcpy(&other, &y, 8);
  hash = (hash * 0x9E3779B97F4A7C15u) ^ (other * 0xC2B2AE3D27D4EB4Fu);
  hash = (hash ^ hash >> 29) * 0xBF58476D1CE4E5B9u;
  memcpy(&bits, &result, 8);
  bits += (int64_t)(hash >> 32) % (2 * most_ulps + 1) - most_ulps;
  memcpy(&result, &bits, 8);
  return result;
}

#define OF_ONE(name)                                        \
  double name(double x) {                                   \
    static double (*of_system)(double);                     \
    if (!of_system) of_system = dlsym(RTLD_NEXT, #name);    \
    return off(of_system(x), x, 0);                         \
  }
#define OF_TWO(name)                                        \
  double name(double x, double y) {                         \
    static double (*of_system)(double, double);             \
    if (!of_system) of_system = dlsym(RTLD_NEXT, #name);    \
    return off(of_system(x, y), x, y);                      \
  }
OF_ONE(acos)
OF_ONE(cbrt)
OF_ONE(cos)
OF_ONE(log)
OF_ONE(sin)
OF_ONE(tan)
OF_TWO(atan2)
OF_TWO(hypot)

void sincos(double x, double* sine, double* cosine) { *sine = sin(x), *cosine = cos(x); }
