#pragma once

#include <span>
#include <vector>

#include "methods/round/pieces/measure.h"

namespace overlapper::pieces {

/// Three or more bodies that overlap: balls, capsules, cylinders, rounded hulls and polyhedra.
struct SlicedGroup {
  std::span<const Placed> bodies;  ///< about the reference
  Vec3 reference;
  WideVector inside;  ///< a point of the common set about the reference, as deep inside as known
};

/// How far the surfaces of a group are moved out.
struct MovedOut {
  double outwards = 0;  ///< m
  int only = -1;        ///< the only body that is moved; -1 for all bodies
};

/// The measures of a group, one for each of the bodies `firsts`. `pull` and `first_area` are those of this body; all
/// others count as one body.
///
/// Bodies are cut into pieces as for pairs. A plane separates the parts that two balls bound, and the parts that two
/// parallel cylinders bound (power diagram; Aurenhammer 1987). If a part has more than two cylinders after that, there
/// is no value.
std::optional<std::vector<RoundMeasures>> measure_group(const SlicedGroup& group, std::span<const int> firsts,
                                                        const MovedOut& moved = {});

}  // namespace overlapper::pieces
