#pragma once

#include <vector>

#include "geometry/wide.h"

namespace overlapper {

struct HullData;

/// The triangles of a hull, made ready for double-double arithmetic. Doubles rule out most of them at a glance.
class WideTriangles {
 public:
  /// Of no hull if that is null; it must stay.
  explicit WideTriangles(const HullData* hull);

  int size() const { return static_cast<int>(glances_.size()); }
  /// The plane of a triangle moved out by a radius.
  WidePlane plane(int triangle, double radius) const;
  /// The plane among these, of the triangles themselves, with the least slack at a point.
  WidePlane tightest(const WideVector& point) const;

 private:
  /// A facet's triangle, as doubles know it: enough to tell that it is not the one looked for.
  struct Glance {
    Vec3 corner, normal;
    double doubt;  ///< of the normal's direction
  };

  const HullData* hull_;
  std::vector<Glance> glances_;
};

/// The corner of a hull that is farthest along a direction.
WideVector farthest_corner(const HullData& hull, const WideVector& direction);

}  // namespace overlapper
