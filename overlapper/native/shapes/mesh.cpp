#include "shapes/mesh.h"

namespace overlapper {

bool has_graph(const Shape& shape) {
  const Hull* hull = std::get_if<Hull>(&shape);
  return hull ? hull->data->graph != nullptr : std::holds_alternative<Box>(shape);
}

void Mesh::set(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) {
    data_ = hull->data.get();
    graph_ = data_->graph.get();
    // Facets are merged, and points on edges dropped, where corners lie within 32 half-ulps of the largest coordinate.
    flat_ = graph_->triangular ? 0 : data_->flatness + 32 * 0x1p-53 * data_->radius;
  } else {
    set_box(std::get<Box>(shape).half_extents);
    flat_ = 0;
  }
}

void Mesh::set_box(Vec3 h) {
  if (box_.vertices.empty()) {
    std::vector<Vec3> cube;
    for (double x : {-1.0, 1.0})
      for (double y : {-1.0, 1.0})
        for (double z : {-1.0, 1.0}) cube.push_back({x, y, z});
    box_ = *make_hull(cube).data;
    box_graph_ = *box_.graph;
  }
  for (Vec3& v : box_.vertices) v = {std::copysign(h.x, v.x), std::copysign(h.y, v.y), std::copysign(h.z, v.z)};
  for (size_t f = 0; f < box_.planes.size(); ++f) {
    Plane& plane = box_.planes[f];
    plane.offset = dot(abs(plane.normal), h);
    box_graph_.dual[f] = plane.normal / plane.offset;
  }
  box_.radius = box_graph_.circumradius = norm(h);
  box_graph_.inradius = std::min({h.x, h.y, h.z});
  data_ = &box_;
  graph_ = &box_graph_;
}

}  // namespace overlapper
