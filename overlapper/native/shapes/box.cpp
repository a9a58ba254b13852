#include "shapes/box.h"

#include <algorithm>

#include "geometry/constants.h"
#include "shapes/inscribed.h"
#include "shapes/limits.h"
#include "shapes/mesh.h"
#include "shapes/solid.h"

namespace overlapper {

using namespace tangents;

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

/// The corners around each side of a box, by number.
constexpr std::array<std::array<int, 4>, 6> box_rings() {
  std::array<std::array<int, 4>, 6> rings{};
  for (int k = 0; k < 3; ++k) {
    const int i = 1 << (k + 1) % 3, j = 1 << (k + 2) % 3, up = 1 << k;
    rings[2 * k] = {0, j, i | j, i};
    rings[2 * k + 1] = {up, up | i, up | i | j, up | j};
  }
  return rings;
}
constexpr auto kBoxRings = box_rings();

/// One coordinate of all corners and normals of a box, from one row of its rotation, in the order of their numbers. The
/// bits are the same as if each corner and normal were placed alone.
void place_box_coordinate(Vec3 row, Vec3 half, double origin, double* corners, double* normals) {
  constexpr TwoLanes sign{-1, 1};
  const TwoLanes x = sign * (row.x * half.x);
  const double y = row.y * half.y, z = row.z * half.z;
  store(corners, x - y - z + origin);
  store(corners + 2, x + y - z + origin);
  store(corners + 4, x - y + z + origin);
  store(corners + 6, x + y + z + origin);
  const Vec3 zero = 0 * row;  // or -0
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
  for (int i = 0; i < 8; ++i) solid.set_vertex(i, box.vertex(i));
  for (int f = 0; f < 6; ++f) solid.set_plane(f, box.facet(f).normal, box.facet(f).offset);
}

/// The order is that of hulls of cubes in recorded answers.
std::vector<Vec3> corners_along_axes(Vec3 h) {
  std::vector<Vec3> corners;
  for (double x : {-1.0, 1.0})
    for (double y : {-1.0, 1.0})
      for (double z : {-1.0, 1.0}) corners.push_back({x * h.x, y * h.y, z * h.z});
  return corners;
}

}  // namespace

Box Box::make(Vec3 half_extents) {
  for (int i = 0; i < 3; ++i) require_size(half_extents[i], "half_extents");
  require_ratio(std::min({half_extents.x, half_extents.y, half_extents.z}), max_component(half_extents),
                "half_extents");
  return Box(half_extents);
}

Plane Box::ray_exit(Vec3 origin, Vec3 direction) const {
  int first = 0;
  double soonest = kInfinity;
  for (int i = 0; i < 3; ++i) {
    if (direction[i] == 0) continue;
    const double t = (half_extents[i] - sign(direction[i]) * origin[i]) / std::abs(direction[i]);
    if (t < soonest) soonest = t, first = i;
  }
  return {sign(direction[first]) * axis(first), half_extents[first]};
}

Plane Box::tightest(Vec3 point) const {
  const Vec3 outside = abs(point) - half_extents;
  const int i = outside.x >= outside.y && outside.x >= outside.z ? 0 : outside.y >= outside.z ? 1 : 2;
  return {sign(point[i]) * axis(i), half_extents[i]};
}

std::span<const Edge> Box::edges() const { return kBoxEdges; }

std::span<const int> Box::ring(int f) const { return kBoxRings[f]; }

void Box::place(Solid& solid, const Pose* pose, double beyond) const {
  solid.resize(8, 6, beyond);
  if (pose) place_box(solid, half_extents, *pose);
  else set_box(solid, *this);
  solid.edges = kBoxEdges;
}

void Box::give(Mesh& mesh) const {
  const Vec3 h = half_extents;
  auto& [hull, graph] = mesh.own();
  if (hull.vertices.empty()) {
    hull = *make_hull(corners_along_axes({1, 1, 1})).data;
    graph = *hull.graph;
  }
  for (Vec3& v : hull.vertices) v = {std::copysign(h.x, v.x), std::copysign(h.y, v.y), std::copysign(h.z, v.z)};
  for (size_t f = 0; f < hull.planes.size(); ++f) {
    Plane& plane = hull.planes[f];
    plane.offset = dot(abs(plane.normal), h);
    graph.dual[f] = plane.normal / plane.offset;
  }
  hull.radius = graph.circumradius = norm(h);
  graph.inradius = std::min({h.x, h.y, h.z});
  mesh.look_at(hull, graph, 0);
}

std::vector<Vec3> Box::core_corners() const {
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i) corners.push_back(vertex(i));
  return corners;
}

void Box::append_core_surface(const std::vector<char>& kept, CoreSurface& surface) const {
  for (int f = 0; f < 6; ++f) surface.facets.push_back({f / 2, f & 1, -1});
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 3; ++k) {
      const int j = i | 1 << k;
      if (j == i || !(kept[i] || kept[j])) continue;
      const auto side_of = [&](int along) { return 2 * along + (i >> along & 1); };
      surface.ridges.push_back({i, j, side_of((k + 1) % 3), side_of((k + 2) % 3)});
    }
}

WideVector Box::wide_core_support(const WideVector& d) const {
  return {{sign(d.x) * half_extents.x}, {sign(d.y) * half_extents.y}, {sign(d.z) * half_extents.z}};
}

WidePlane Box::wide_tightest(const WideVector& p, const WideTriangles&) const {
  const auto component = [&](int i) { return i == 0 ? p.x : i == 1 ? p.y : p.z; };
  int nearest = 0;
  DoubleDouble least{-kInfinity};
  for (int i = 0; i < 3; ++i) {
    const DoubleDouble outside = abs(component(i)) - DoubleDouble{half_extents[i]};
    if (outside > least) least = outside, nearest = i;
  }
  return {DoubleDouble{sign(component(nearest))} * wide_axis(nearest), {half_extents[nearest]}};
}

Hull Box::inscribed(double) const { return hull_within(corners_along_axes(half_extents)); }

}  // namespace overlapper
