#pragma once

#include "geometry/once.h"
#include "shapes/facet_tree.h"
#include "shapes/hull.h"

namespace overlapper {

/// All points within `radius` of a polytope: its Minkowski sum with a ball.
struct RoundedHull : Bounded,
                     Smooth,
                     NotRevolved,
                     NotStretched,
                     PolytopeCore,
                     BoundedBySupports<RoundedHull>,
                     EnclosedByBounds<RoundedHull>,
                     ReachesToCornerOfBounds<RoundedHull> {
  static constexpr const char* kName = "RoundedHull";
  static constexpr const char* kAbout = R"(All points within a distance of the convex hull of points.

It is the Minkowski sum of the hull and a ball. Bullet collides with such shapes where a convex mesh has a margin. The
method 'paper' does not accept it. It has no certificate with an ellipsoid that it overlaps, nor among three or more
bodies that overlap.

Parameters
----------
vertices : (n, 3) array_like
    Four points or more, m.
radius : float
    Radius of the ball, m.

Raises
------
ValueError
    If `Hull` refuses the points, or `Sphere` refuses the radius.

Examples
--------
>>> from overlapper import RoundedHull
>>> RoundedHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], 0.5).bounds.tolist()
[[-0.5, -0.5, -0.5], [1.5, 1.5, 1.5]])";

  RoundedHull() = default;
  RoundedHull(Hull hull, double r) : core(std::move(hull)), radius(r) {}

  Vec3 support(Vec3 direction) const { return core.support(direction) + radius * unit(direction); }
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
  /// The supporting plane whose normal is along `outward`.
  Plane supporting(Vec3 outward) const;

  const HullData* polytope() const { return core.polytope(); }
  double core_radius() const { return radius; }
  Vec3 core_support(const Pose& pose, Vec3 direction) const { return core.core_support(pose, direction); }
  std::vector<Vec3> core_corners() const { return core.core_corners(); }
  void append_core_surface(const std::vector<char>& kept, CoreSurface& surface) const {
    core.append_core_surface(kept, surface);
  }

  double volume() const;  ///< m³, by Steiner's formula
  Vec3 centroid() const;  ///< about the core's origin
  double loose_radius() const { return core.bounding_radius() + radius; }
  double reach() const { return core.bounding_radius() + radius; }
  void append_planes(std::vector<Plane>& planes) const;
  std::partial_ordering order(const RoundedHull& other) const {
    const auto by_radius = radius <=> other.radius;
    return by_radius != 0 ? by_radius : core.order(other.core);
  }

  WideVector wide_core_support(const WideVector& direction) const { return core.wide_core_support(direction); }
  WidePlane wide_ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const;
  void append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) const;

  void give_pieces(Cutter& cutter) const;
  bool give_mitred(Cutter& cutter) const;  ///< false also if facets are not exact or an edge is sharp
  Hull inscribed(double tolerance) const;

  Hull core;
  double radius = 0;
  std::shared_ptr<const Once<FacetTree>> parts = std::make_shared<Once<FacetTree>>();  ///< of the core
};

RoundedHull make_rounded_hull(std::span<const Vec3> points, double radius);

}  // namespace overlapper
