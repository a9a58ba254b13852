#pragma once

#include <vector>

#include "geometry/polytope.h"
#include "geometry/vec.h"

namespace overlapper {

/// An affine frame, x = origin + axes * y.
template <class Point>
struct FrameAbout {
  Point origin;
  Mat3 axes;
};
using Frame = FrameAbout<Vec3>;

/// The polytope around the common set, in a frame about a point inside it: world x = reference + frame.origin +
/// frame.axes y. For polyhedra it is the common set. For smooth shapes it contains the common set, and each vertex has
/// a factor that shrinks it to fit inside.
struct Region {
  /// A facet's plane and owner; its polygon is in the polytope.
  struct Facet {
    Vec3 normal;      ///< unit, outward
    double slack;     ///< m: distance of the plane from the frame's origin
    double rounding;  ///< m: possible movement of the plane by rounding
    int owner;        ///< the body of the plane
  };

  Vec3 reference;
  Frame frame;
  Polytope polytope;          ///< in the coordinates y
  std::vector<Facet> facets;  ///< parallel to the polytope's
  std::vector<double> inner;  ///< per vertex y: inner * y lies in the common set; 1 if the vertex itself does
  int facets_touched = 0;     ///< number of planes that entered the dual hull

  Vec3 to_world(Vec3 y) const { return reference + (frame.origin + frame.axes * y); }
};

}  // namespace overlapper
