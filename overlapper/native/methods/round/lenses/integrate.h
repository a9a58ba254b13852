#pragma once

#include "methods/round/lenses/sums.h"

namespace overlapper::lenses {

struct Integral {
  Sums sums;
  double error = 0;       ///< of the volume, beside rounding
  double area_error = 0;  ///< m², likewise
  int nodes = 0;
};

/// Integrates between the changes of outlines, as slicing::integrate() does. With t = m − h cos θ, slices are analytic
/// in θ. If the last terms of a rule's series are too large, a finer rule follows, or the interval is halved.
Integral integrate(const Discs& discs, const Wanted& wanted);

}  // namespace overlapper::lenses
