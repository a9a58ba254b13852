#pragma once

#include "distance/least_translation.h"
#include "geometry/measures.h"
#include "methods/choose.h"
#include "shapes/shape.h"

namespace overlapper {

/// How a pair touches, or how far it is apart.
struct Contact {
  double distance = 0;  ///< m; 0 unless separated
  double depth = 0;     ///< m; 0 unless overlapping
  Vec3 normal;          ///< unit, from b to a
  Vec3 witness_a, witness_b;
  Plane separating;  ///< a where dot(normal, x) >= offset, b on the other side; meaningless if overlapping
};

/// The contact of a pair that overlaps beyond the doubt of its signs.
Penetration penetration_in_order(const Placed& a, const Placed& b);

/// The contact of a pair of which more is in doubt; `doubtful` if doubles could not even tell the status. Method
/// "paper" may call apart what is not.
Contact contact_of(const Arrangement& at, Status status, bool as_in_paper, bool doubtful);

/// True if doubles leave more of a depth or distance, of bodies in coordinates about one of them, in doubt than kClear.
bool in_doubt(double length, const Placed& a, const Placed& b);

/// True of a cylinder or an ellipsoid and another bounded body: EPA approaches a curved surface, and knows its
/// direction to half of the digits.
bool has_curved_core(const Placed& a, const Placed& b);

/// How far the figures of a contact may be off, in m.
struct ContactErrors {
  double depth = 0, distance = 0;
  /// Neither witness is farther outside of its body, nor are the two farther apart than the bodies: both together.
  double witnesses = 0;
};

/// Bounds from double-doubles, whatever way the contact came; `a` and `b` are the bodies as given.
ContactErrors errors_of(const Contact& contact, const Placed& a, const Placed& b, Status status);

}  // namespace overlapper
