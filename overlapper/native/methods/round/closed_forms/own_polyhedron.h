#pragma once

#include <vector>

#include "methods/round/quadric/polyhedron.h"
#include "shapes/shape.h"

namespace overlapper::closed_forms {

/// The corners, planes and edges of a box or a hull, in coordinates of its own.
class OwnPolyhedron {
 public:
  explicit OwnPolyhedron(const Shape& shape) {
    if (edges(shape).empty()) return;
    if (const HullData* hull = polytope_of(shape)) {
      polyhedron_ = {hull->vertices, hull->planes, edges(shape), hull->planes.size()};
      return;
    }
    ask_flat(shape, [&](const auto& s) {
      for (int i = 0; i < s.vertex_count(); ++i) corners_.push_back(s.vertex(i));
      for (int f = 0; f < s.facet_count(); ++f) planes_.push_back(s.facet(f));
    });
    polyhedron_ = {corners_, planes_, edges(shape), planes_.size()};
  }
  /// Empty if the shape has no edges.
  const quadric::Polyhedron& operator*() const { return polyhedron_; }

 private:
  std::vector<Vec3> corners_;
  std::vector<Plane> planes_;
  quadric::Polyhedron polyhedron_;
};

}  // namespace overlapper::closed_forms
