#pragma once

#include "distance/least_translation.h"
#include "geometry/measures.h"
#include "methods/choose.h"
#include "shapes/shape.h"

namespace overlapper {

/// Depth or distance of a pair, with its normal.
struct Contact {
  double distance = 0;  ///< m; 0 unless separated
  double depth = 0;     ///< m; 0 unless overlapping
  Vec3 normal;          ///< unit, from b to a
  Vec3 witness_a, witness_b;
  Plane separating;  ///< dot(normal, x) >= offset for a, <= for b; meaningless if overlapping
};

/// The contact of a pair that certainly overlaps.
Penetration penetration_in_order(const Placed& a, const Placed& b);

/// The contact of any other pair; `doubtful` if doubles could not decide the status. Method "paper" may report a pair
/// as separated that is not.
Contact contact_of(const Arrangement& at, Status status, bool as_in_paper, bool doubtful);

/// True if the rounding error of a depth or distance, in coordinates about one of the two bodies, is above kClear.
bool in_doubt(double length, const Placed& a, const Placed& b);

/// True for a bounded pair with a cylinder or an ellipsoid. EPA only approaches a curved surface, and finds its
/// direction to half of the digits.
bool has_curved_core(const Placed& a, const Placed& b);

/// Error bounds of the numbers of a contact, in m.
struct ContactErrors {
  double depth = 0, distance = 0;
  /// Bounds both the distance of each witness outside its body, and the excess of the witnesses' distance over the
  /// bodies' distance.
  double witnesses = 0;
};

/// Bounds by double-double arithmetic, independent of the way that found the contact. `a` and `b` are the bodies as
/// given.
ContactErrors errors_of(const Contact& contact, const Placed& a, const Placed& b, Status status);

}  // namespace overlapper
