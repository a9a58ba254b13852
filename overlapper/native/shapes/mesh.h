#pragma once

#include <utility>

#include "shapes/shape.h"

namespace overlapper {

/// A shape that has a graph, as vertices, facets and neighbours. Boxes are hulls here, too; only their sizes change.
class Mesh {
 public:
  /// The shape must outlive the mesh, and have a graph.
  void set(const Shape& shape);

  const HullData& data() const { return *data_; }
  const HullGraph& graph() const { return *graph_; }
  /// m: largest distance of corners from the planes of merged facets; 0 without merged facets.
  double flat() const { return flat_; }

  // For the shapes' give().

  void look_at(const HullData& data, const HullGraph& graph, double flat) {
    data_ = &data, graph_ = &graph, flat_ = flat;
  }
  /// Memory for a shape without hull data; it keeps its previous contents.
  std::pair<HullData, HullGraph>& own() { return own_; }

 private:
  const HullData* data_ = nullptr;
  const HullGraph* graph_ = nullptr;
  std::pair<HullData, HullGraph> own_;
  double flat_ = 0;
};

}  // namespace overlapper
