#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/polytope.h"
#include "methods/dual/deepest_ball.h"
#include "shapes/shape.h"

namespace overlapper {

/// The relative error of a volume beyond which it is worth computing in another way.
inline constexpr double kEnough = 1e-12;

/// The polytope around the common set, in a frame about a point inside it: world x = reference + frame.origin +
/// frame.axes y. For polyhedra it is the common set; for smooth shapes it contains it, and shrinks to fit inside vertex
/// by vertex.
struct Region {
  /// What is known of a facet besides its polygon.
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

/// Grows the dual hull of the bodies' common set, whose round frame is given, until vertices reach out of smooth bodies
/// by no more than the fraction `tolerance`. Bodies, planes and frame relative to `reference`; `rounding` is how far a
/// plane may be off, in m. For Placed and for WideBody.
template <class Body>
Region grow(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
            const FrameAbout<PointOf<Body>>& frame, double tolerance, double rounding, Vec3 reference);

/// The region of polytopes and half-spaces once more in the same frame, from dual points that are right to the last
/// bit: planes, poses and the distance from the origin are taken in double-double, and unmerged facets from their
/// corners as given, whatever `bodies` are relative to. Nothing if the frame's origin turns out not to be inside.
std::optional<Region> widened(std::span<const Placed> bodies, const Region& region);

/// What is computed from the region, all in world coordinates.
struct Quantities {
  double volume = 0, volume_error = 0, area = 0;
  Vec3 centroid;
  Mat3 inertia;  ///< about the centroid, unit density; of no meaning for a closed form
  /// A facet's pull: the derivative of the volume by moving the body that owns it.
  struct Pull {
    int owner;
    Vec3 area_vector;  ///< outward, of length the facet's area
    Vec3 centroid;
  };
  std::vector<Pull> pulls;   ///< one per facet
  bool widened = false;      ///< double arithmetic was not enough
  bool closed_form = false;  ///< without a polytope: see closed_forms.h
  int facets_touched = 0;    ///< how many planes of the bodies entered
};
Quantities measure(const Region& region);

}  // namespace overlapper
