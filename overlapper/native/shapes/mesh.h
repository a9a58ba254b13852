#pragma once

#include "shapes/shape.h"

namespace overlapper {

/// True if the shape has a Mesh: a box, or a hull that can be climbed.
bool has_graph(const Shape& shape);

/// A box or a hull as it was made, with who is next to whom. Boxes are hulls too, here, of which only the sizes change.
class Mesh {
 public:
  /// The shape must stay.
  void set(const Shape& shape);

  const HullData& data() const { return *data_; }
  const HullGraph& graph() const { return *graph_; }
  /// m: by how much corners may lie off the planes of facets that were merged; 0 where none were.
  double flat() const { return flat_; }

 private:
  void set_box(Vec3 half_extents);

  const HullData* data_ = nullptr;
  const HullGraph* graph_ = nullptr;
  HullData box_;
  HullGraph box_graph_;
  double flat_ = 0;
};

}  // namespace overlapper
