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
  double error = 0;             ///< error of the volume, beside rounding
  double area_error = 0;        ///< error of the area, beside rounding
  int rules = 0;                ///< number of rules applied
  std::vector<Sample> samples;  ///< in the order of t
};

/// Integrates over intervals. Near an end of an interval, a slice is a series in the square root of the distance of t
/// from the end. With t = m − h cos θ it is analytic in θ, and Gauss-Legendre rules converge geometrically. The last
/// terms of the Legendre series of the nodes tell whether a rule is accurate enough. If not, a rule with more nodes
/// follows, or the interval is halved. `volume` and `area` were measured before. Errors are small relative to these
/// plus the result of the first rules; false if they stay larger. The first rules have eight nodes with `few`,
/// otherwise the most. `strictness` divides the usual limits of the last terms. If it is 0, terms in the middle of the
/// series bound the terms beyond its end.
bool integrate(const Stack& stack, std::span<const Interval> intervals, double volume, double area, bool few,
               double strictness, Sum& sum);

/// Whether the volume between two values of t agrees with the samples. The square root of the area of slices of a
/// convex set is concave (Brunn and Minkowski). Chords between samples therefore bound the volume from below, and
/// extended chords from above. A wrong outline or a missed value of t passes only if its effect is below the gap, about
/// a hundredth. Consumes the samples.
bool within_chords(double begin, double end, Sum& sum);

}  // namespace overlapper::slicing
