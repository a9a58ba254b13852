#pragma once

#include <span>
#include <vector>

#include "methods/round/slicing/breakpoints.h"

namespace overlapper::slicing {

/// The area of a slice.
struct Sample {
  double t, area;
};

struct Sum {
  Integrals integrals;
  double about = 0;             ///< m³: the volume by the first rules
  double error = 0;             ///< of the volume, beside rounding
  double area_error = 0;        ///< likewise of the area
  int rules = 0;                ///< how many were applied
  std::vector<Sample> samples;  ///< in the order of t
};

/// Integrates over intervals. At the ends of one a slice is a series in the square root of what t is away from them, so
/// that with t = m − h cos θ it is analytic in θ, and rules of Gauss and Legendre converge geometrically. The last
/// terms of the Legendre series that the nodes give tell whether a rule will do; where it will not, one of more nodes
/// is taken, or the interval is halved. `volume` and `area` are those of what has been measured before, to which and to
/// what the first rules give errors are small; false if they do not become so. The first rules have eight nodes, or
/// unless `few` as many as there are. `strictness` is what to divide the usual limits of the last terms by; if 0, terms
/// in the middle of the series tell how much smaller those beyond its end are.
bool integrate(const Stack& stack, std::span<const Interval> intervals, double volume, double area, bool few,
               double strictness, Sum& sum);

/// Whether the volume between two values of t agrees with the samples. The root of the area of slices of a convex set
/// is concave (Brunn and Minkowski), so that chords between samples bound the volume from below, and chords drawn out
/// beyond them from above: no wrong outline and no value of t missed passes unless what it makes is smaller than the
/// gap, about a hundredth. Uses the samples up.
bool within_chords(double begin, double end, Sum& sum);

}  // namespace overlapper::slicing
