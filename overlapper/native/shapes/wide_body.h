#pragma once

#include <vector>

#include "geometry/wide_pose.h"
#include "shapes/shape.h"

namespace overlapper {

/// A placed shape in double-double, from its defining numbers: corners, sizes, position and orientation. The
/// orientation is the exact rotation of its quaternion of any length. Coordinates are relative to `about`, which need
/// not be a double. Near a small common set, planes and points rounded to doubles are then accurate relative to the
/// size of that set.
class WideBody {
 public:
  WideBody(const Placed& body, const WideVector& about);

  /// Only for a smooth shape.
  WidePlane ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane tightest(const WideVector& point) const;
  WideVector support(const WideVector& direction) const;
  WideVector core_support(const WideVector& direction) const;
  WideVector position() const { return translation_; }

  /// Maps a point or a direction from the body's own coordinates; for hulls, these are about HullData::origin.
  WideVector placed(const WideVector& point) const { return rotation_ * point + translation_; }
  WideVector turned(const WideVector& direction) const { return rotation_ * direction; }

  /// Size of the numbers behind the body's points: the unit of rounding errors.
  double reach() const { return reach_; }

  /// All planes of a polytope, one for each triangle of its hull; for a smooth shape a few tangent planes that bound
  /// it.
  void append_planes(std::vector<WidePlane>& planes) const;

  // For the shapes' append_wide_planes().

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
