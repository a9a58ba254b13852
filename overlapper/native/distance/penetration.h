#pragma once

#include "distance/least_translation.h"
#include "shapes/shape.h"

namespace overlapper {

/// The least translation that separates two bodies. Boxes and half-spaces have closed forms. Polytopes of few facets
/// use facet normals and the arcs between these. All others use EPA (van den Bergen 2001) on the difference of the
/// cores. EPA's polytope may start beside the origin: it pushes out the facet of least offset until this facet lies on
/// the boundary of A - B, and only then counts its offset. The returned depth is the support of A - B along `normal`.
/// The translation therefore separates the bodies, even if rounding tilted the facet.
Penetration penetration(const Placed& a, const Placed& b);

/// The normal from b to a of a translation that separates two bounded bodies. It is the least one if the cores have no
/// common point, and otherwise the least of some.
Vec3 some_way_out(const Placed& a, const Placed& b);

/// A direction out of A - B, of the cores.
struct LocalWay {
  Vec3 outward;
  bool least;  ///< false if no local minimum was found, and the direction is the last one
};
/// A local minimum of the support function where two curved surfaces meet, by Newton's method from a direction near it.
LocalWay local_way_out(const Placed& a, const Placed& b, Vec3 outward);

/// The least translation of two bodies that overlap, of the cores, where two curved surfaces meet. EPA only looks for
/// the local minima, and Newton's method finds each of them.
Penetration curved_depth(const Placed& a, const Placed& b);

/// The depth of the cores of two bodies by EPA, and the depth of EPA's inner polytope. The inner depth is a lower bound
/// of the least translation, for all shapes.
struct EnclosedDepth {
  Penetration depth;
  double lower;
};
EnclosedDepth enclosed_depth(const Placed& a, const Placed& b);

}  // namespace overlapper
