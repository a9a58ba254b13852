#pragma once

#include <vector>

#include "geometry/wide_pose.h"
#include "shapes/shape.h"

namespace overlapper {

/// A placed shape in double-double, from the numbers that define it: corners, sizes, position, and orientation taken as
/// the exact rotation that its quaternion stands for at any length. Coordinates are counted from `about`, which need
/// not be a double: so near a small common set, what doubles hold of planes and points is right relative to its size.
class WideBody {
 public:
  WideBody(const Placed& body, const WideVector& about);

  /// Only of a smooth shape.
  WidePlane ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane tightest(const WideVector& point) const;
  WideVector support(const WideVector& direction) const;
  WideVector core_support(const WideVector& direction) const;
  WideVector position() const { return translation_; }

  /// A point and a direction of the body's own coordinates, for hulls those about HullData::origin.
  WideVector placed(const WideVector& point) const { return rotation_ * point + translation_; }
  WideVector turned(const WideVector& direction) const { return rotation_ * direction; }

  /// How large the numbers are that its points are computed from: what an operation loses is measured by that.
  double reach() const { return reach_; }

  /// All planes of a polytope, of each triangle of its hull; for a smooth shape a few tangent planes that bound it.
  void append_planes(std::vector<WidePlane>& planes) const;

  // For shapes that append their planes.

  /// The planes of all triangles of its hull, moved out by a radius.
  void append_triangles(double radius, std::vector<WidePlane>& planes) const;
  /// Its supporting planes across its own axes.
  void append_planes_across_axes(std::vector<WidePlane>& planes) const;

  Shape shape;

 private:
  WidePlane in_world(const WidePlane& local) const;
  WideVector local(const WideVector& point) const;

  WideTriangles triangles_;
  WideMatrix rotation_;
  WideVector translation_;
  double reach_;
};

}  // namespace overlapper
