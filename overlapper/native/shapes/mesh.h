#pragma once

#include <utility>

#include "shapes/shape.h"

namespace overlapper {

/// A shape with a graph as it was made, with who is next to whom. Boxes are hulls too, here, of which only the sizes
/// change.
class Mesh {
 public:
  /// The shape must stay, and have a graph.
  void set(const Shape& shape);

  const HullData& data() const { return *data_; }
  const HullGraph& graph() const { return *graph_; }
  /// m: by how much corners may lie off the planes of facets that were merged; 0 where none were.
  double flat() const { return flat_; }

  // For shapes that give themselves.

  void look_at(const HullData& data, const HullGraph& graph, double flat) {
    data_ = &data, graph_ = &graph, flat_ = flat;
  }
  /// Room for a shape that has no data of its own; it holds what it held.
  std::pair<HullData, HullGraph>& own() { return own_; }

 private:
  const HullData* data_ = nullptr;
  const HullGraph* graph_ = nullptr;
  std::pair<HullData, HullGraph> own_;
  double flat_ = 0;
};

}  // namespace overlapper
