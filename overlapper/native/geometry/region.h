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
/// frame.axes y. For polyhedra it is the common set; for smooth shapes it contains it, and shrinks to fit inside vertex
/// by vertex.
struct Region {
  /// A facet's plane and owner; its polygon is in the polytope.
  struct Facet {
    Vec3 normal;      ///< unit, outward
    double slack;     ///< m: distance of the plane from the frame's origin
    double rounding;  ///< m: by how much rounding may have moved the plane
    int owner;        ///< the body that it is a plane of
  };

  Vec3 reference;
  Frame frame;
  Polytope polytope;          ///< in the coordinates y
  std::vector<Facet> facets;  ///< parallel to the polytope's
  std::vector<double> inner;  ///< per vertex y: inner * y lies in the common set; 1 where the vertex itself does
  int facets_touched = 0;     ///< how many planes entered the dual hull

  Vec3 to_world(Vec3 y) const { return reference + (frame.origin + frame.axes * y); }
};

}  // namespace overlapper
