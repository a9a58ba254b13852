#include "methods/tracing/close_body.h"

#include <limits>

#include "shapes/planes_asked.h"

namespace overlapper {

CloseFrame close_frame(const Placed& first, const Placed& second, Vec3 origin) {
  const auto own_origin = [](const Placed& body) { return data_origin(body.shape); };
  const WideMatrix a = wide_rotation(first.orientation), b = wide_rotation(second.orientation);
  const WideVector from_second =
      a * wide_difference(origin, -own_origin(first)) + wide_difference(first.position, second.position);
  const WideVector in_second = apply_transposed(b, from_second) - wide(own_origin(second));
  const auto row = [&](DoubleDouble x, DoubleDouble y, DoubleDouble z) {
    return rounded(apply_transposed(b, WideVector{x, y, z}));
  };
  CloseFrame frame;
  frame.turn = {row(a.row0.x, a.row1.x, a.row2.x), row(a.row0.y, a.row1.y, a.row2.y),
                row(a.row0.z, a.row1.z, a.row2.z)};
  frame.origin = origin;
  frame.origin_in_second = rounded(in_second);
  frame.rest_in_second = {in_second.x.tail, in_second.y.tail, in_second.z.tail};
  return frame;
}

void CloseBody::set(const Mesh& mesh, const CloseFrame& frame, bool is_second) {
  mesh_ = &mesh;
  turned_ = is_second;
  turn_ = frame.turn;
  origin_ = is_second ? frame.origin_in_second : frame.origin;
  rest_ = is_second ? frame.rest_in_second : Vec3{};
  const size_t vertices = data().vertices.size(), facets = data().planes.size();
  if (++now_ == std::numeric_limits<int>::max()) {
    std::fill(corner_placed_.begin(), corner_placed_.end(), 0);
    std::fill(side_placed_.begin(), side_placed_.end(), 0);
    now_ = 1;
  }
  if (corner_placed_.size() < vertices) corner_placed_.resize(vertices, 0), corners_.resize(vertices);
  if (side_placed_.size() < facets) side_placed_.resize(facets, 0), sides_.resize(facets);
  // Rounding of a point of either body, rotated and translated, and of a dual point, whose plane merging may have
  // tilted.
  const double rounding = 64 * 0x1p-53 * (data().radius + graph().circumradius) + 2 * mesh.flat();
  doubt_ = rounding / graph().inradius;
  const double inside = std::max(0.0, graph().inradius - rounding);
  surely_inside2_ = inside * inside;
  last_ = -1;
}

void CloseBody::place_corner(int vertex) {
  const Vec3 at = placed(vertex);
  corners_[vertex] = {at, std::sqrt(norm2(at))};
  corner_placed_[vertex] = now_;
}

void CloseBody::place_side(int facet) {
  ++planes_asked;
  const Vec3 normal = data().planes[facet].normal;
  Side side{turned_ ? turn_ * normal : normal, {}, std::numeric_limits<double>::infinity(), 0};
  for (int v : data().facet(facet)) {
    const PlacedCorner& c = corner(v);
    if (c.size < side.size) side.through = c.at, side.size = c.size;
    side.farthest = std::max(side.farthest, c.size);
  }
  sides_[facet] = side;
  side_placed_[facet] = now_;
}

int CloseBody::holds(Vec3 at) {
  const Vec3 own = own_point(at);
  if (norm2(own - data().centroid) < surely_inside2_) return 1;
  double gauge;
  last_ = last_ < 0 ? graph().facet_towards(data(), own, gauge) : graph().facet_towards(data(), own, gauge, last_);
  return gauge < 1 - doubt_ ? 1 : gauge > 1 + doubt_ ? -1 : 0;
}

}  // namespace overlapper
