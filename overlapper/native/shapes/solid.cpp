#include "shapes/solid.h"

namespace overlapper {
namespace {

constexpr std::array<Edge, 12> box_edges() {
  std::array<Edge, 12> edges{};
  int n = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    for (int si = 0; si < 2; ++si) {
      for (int sj = 0; sj < 2; ++sj) {
        const int low = si << i | sj << j, facet_i = 2 * i + si, facet_j = 2 * j + sj;
        edges[n++] = {low, low | 1 << k, si == sj ? facet_i : facet_j, si == sj ? facet_j : facet_i};
      }
    }
  }
  return edges;
}
constexpr std::array<Edge, 12> kBoxEdges = box_edges();

/// One coordinate of a box's corners and normals, from that row of its rotation. Both go by the numbers of corner() and
/// side(), and have the bits that placing each alone would give it.
void place_box_coordinate(Vec3 row, Vec3 half, double origin, double* corners, double* normals) {
  constexpr TwoLanes sign{-1, 1};
  const TwoLanes x = sign * (row.x * half.x);
  const double y = row.y * half.y, z = row.z * half.z;
  store(corners, x - y - z + origin);
  store(corners + 2, x + y - z + origin);
  store(corners + 4, x - y + z + origin);
  store(corners + 6, x + y + z + origin);
  const Vec3 zero = 0 * row;  // or minus that
  store(normals, sign * row.x + zero.y + zero.z);
  store(normals + 2, zero.x + sign * row.y + zero.z);
  store(normals + 4, zero.x + zero.y + sign * row.z);
}

void place_box(Solid& solid, Vec3 half, const Pose& pose) {
  const auto& [row0, row1, row2] = pose.rotation;
  const auto& [x, y, z] = pose.translation;
  place_box_coordinate(row0, half, x, solid.x.data(), solid.nx.data());
  place_box_coordinate(row1, half, y, solid.y.data(), solid.ny.data());
  place_box_coordinate(row2, half, z, solid.z.data(), solid.nz.data());
  for (int k = 0; k < 3; ++k) {
    const int f = 2 * k;
    store(&solid.offset[f], half[k] + (load(&solid.nx[f]) * x + load(&solid.ny[f]) * y + load(&solid.nz[f]) * z));
  }
}

void set_box(Solid& solid, const Box& box) {
  for (int i = 0; i < 8; ++i) solid.set_vertex(i, corner(box, i));
  for (int f = 0; f < 6; ++f) solid.set_plane(f, side(box, f).normal, side(box, f).offset);
}

}  // namespace

std::span<const Edge> edges(const Shape& shape) {
  if (std::holds_alternative<Box>(shape)) return kBoxEdges;
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data->edges;
  return {};
}

void set_solid(Solid& solid, const Placed& body, int owner, const Pose* pose, double beyond) {
  const Shape& shape = body.shape;
  const auto place = [&](Vec3 v) { return pose ? *pose * v : v; };
  const auto turn = [&](int f, const Plane& plane) {
    const Plane placed = pose ? *pose * plane : plane;
    solid.set_plane(f, placed.normal, placed.offset);
  };
  if (const Box* box = std::get_if<Box>(&shape)) {
    solid.resize(8, 6, beyond);
    if (pose) place_box(solid, box->half_extents, *pose);
    else set_box(solid, *box);
    solid.edges = kBoxEdges;
  } else if (const Hull* hull = std::get_if<Hull>(&shape)) {
    const HullData& data = *hull->data;
    solid.resize(static_cast<int>(data.vertices.size()), static_cast<int>(data.planes.size()), beyond);
    for (int i = 0; i < solid.vertices; ++i) solid.set_vertex(i, place(data.vertices[i]));
    for (int f = 0; f < solid.facets; ++f) turn(f, data.planes[f]);
    solid.edges = data.edges;
  } else {
    solid.resize(0, 1, beyond);
    turn(0, std::get<HalfSpace>(shape).plane);
    solid.edges = {};
  }
  std::fill(solid.owner.begin(), solid.owner.end(), owner);
  solid.whole = bounded(shape);
}

bool set_part(Solid& solid, const Placed& body, int owner, const Pose& pose, const Ball& ball, double beyond) {
  thread_local Solid whole;
  thread_local std::vector<int> facet_number, vertex_number, chosen;
  set_solid(whole, body, owner, &pose, beyond);
  facet_number.assign(whole.facets, -1);
  vertex_number.assign(whole.vertices, -1);
  chosen.clear();
  int kept = 0;
  for (int f = 0; f < whole.facets; ++f) {
    const double height = dot(whole.normal(f), ball.centre) - whole.offset[f];
    if (height > ball.radius) return false;
    if (height >= -ball.radius) facet_number[f] = kept++;
  }
  solid.own_edges.clear();
  const auto number = [&](int vertex) {
    int& n = vertex_number[vertex];
    if (n < 0) n = static_cast<int>(chosen.size()), chosen.push_back(vertex);
    return n;
  };
  for (const Edge& e : whole.edges) {
    const int left = facet_number[e.left], right = facet_number[e.right];
    if (left >= 0 && right >= 0) solid.own_edges.push_back({number(e.from), number(e.to), left, right});
  }
  solid.resize(static_cast<int>(chosen.size()), kept, beyond);
  for (int i = 0; i < solid.vertices; ++i) solid.set_vertex(i, whole.vertex(chosen[i]));
  for (int f = 0; f < whole.facets; ++f)
    if (facet_number[f] >= 0) solid.set_plane(facet_number[f], whole.normal(f), whole.offset[f]);
  std::fill(solid.owner.begin(), solid.owner.end(), owner);
  solid.edges = solid.own_edges;
  solid.whole = false;
  return true;
}

}  // namespace overlapper
