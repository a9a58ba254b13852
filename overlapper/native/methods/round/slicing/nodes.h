#pragma once

#include <array>

#include "methods/round/slicing/slice.h"

namespace overlapper::slicing {

inline constexpr int kMostNodes = 32;

/// One number for each of eight slices; compilers process two or four at once.
inline constexpr int kRow = 8;
using Row = std::array<double, kRow>;

/// Half the chord of each slice, per quadric, and the sides of a cylinder or the disc.
struct Sides {
  std::array<Row, kMostRounds> half, upper, lower;
  Row centre_x, centre_y, slack;  ///< of the disc; |centre|² − radius²
};
/// Each t has a tail, as in double-double. Near the ends of a round, half a chord is the square root of the distance of
/// t from the end.
void find_sides(const Stack& stack, const Row& t, const Row& tail, Sides& sides);

/// The nodes of a rule, and their weights.
struct Nodes {
  int size = 0;
  std::array<double, kMostNodes> t, tail, weight;  ///< the tail is the part of t that a double cannot hold

  void append(double at, double counts) { t[size] = at, tail[size] = 0, weight[size] = counts, ++size; }
};

/// The area of each slice, and the area of the surface and of cuts per unit of t.
struct Slices {
  std::array<double, kMostNodes> volume, area, cut;
};

/// The weighted sum over slices that all have this outline.
Integrals measure(const Stack& stack, const Outline& outline, const Nodes& nodes, Slices& slices);

/// The integrals of a single slice per unit of t.
Integrals measure(const Stack& stack, const Outline& outline, double t);

/// Adds the face in a plane parallel to the slices. It has the outline of the slice beside it, at `t`.
void add_face(const Line& plane, const Stack& stack, const Outline& outline, double t, Integrals& sum);

/// m³: a bound of the volume between the two planes that end a stack, if their order is reversed at its origin. They
/// are tilted against each other, so that they pass each other elsewhere.
double beyond_ends(const Stack& stack);

}  // namespace overlapper::slicing
