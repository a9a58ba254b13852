#pragma once

#include <vector>

#include "geometry/wide.h"

namespace overlapper {

struct HullData;

/// The triangles of a hull, prepared for double-double arithmetic. Doubles exclude most of them quickly.
class WideTriangles {
 public:
  /// `hull` must outlive this; empty if it is null.
  explicit WideTriangles(const HullData* hull);

  int size() const { return static_cast<int>(glances_.size()); }
  /// The plane of a triangle moved out by a radius.
  WidePlane plane(int triangle, double radius) const;
  /// The plane of the triangle with the least slack at a point, without a radius.
  WidePlane tightest(const WideVector& point) const;

 private:
  /// A triangle's plane in doubles: enough to exclude it from a search.
  struct Glance {
    Vec3 corner, normal;
    double doubt;  ///< error of the normal's direction
  };

  const HullData* hull_;
  std::vector<Glance> glances_;
};

/// The corner of a hull that is farthest along a direction.
WideVector farthest_corner(const HullData& hull, const WideVector& direction);

}  // namespace overlapper
