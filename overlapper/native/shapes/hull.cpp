#include "shapes/hull.h"

#include <algorithm>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "shapes/cutter.h"
#include "shapes/mesh.h"
#include "shapes/solid.h"
#include "shapes/wide_body.h"

namespace overlapper {
namespace {

/// If facets contain their corners only up to rounding, the planes of at most so many triangles are faces instead.
constexpr size_t kMostTriangles = 256;

/// The plane among `planes` with the largest `value(plane)`.
template <class Value>
Plane best_plane(const std::vector<Plane>& planes, Value value) {
  int best = 0;
  double largest = -kInfinity;
  for (int i = 0; i < static_cast<int>(planes.size()); ++i) {
    const double v = value(planes[i]);
    if (v > largest) largest = v, best = i;
  }
  return planes[best];
}

WidePlane plane_through(const HullData& hull, const std::array<int, 3>& corners) {
  const auto [a, b, c] = corners;
  const WideVector normal = unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
  return {normal, dot(normal, wide(hull.corners[a]))};
}

}  // namespace

Vec3 Hull::support(Vec3 direction) const {
  const std::vector<Vec3>& vertices = data->vertices;
  if (data->graph) return vertices[data->graph->farthest_vertex(*data, direction)];
  int best = 0;
  double largest = -kInfinity;
  for (int i = 0; i < static_cast<int>(vertices.size()); ++i) {
    const double value = dot(vertices[i], direction);
    if (value > largest) largest = value, best = i;
  }
  return vertices[best];
}

Plane Hull::ray_exit(Vec3 origin, Vec3 direction) const {
  double rate;
  if (data->graph) return data->planes[data->graph->ray_exit(*data, origin, direction, rate)];
  return best_plane(data->planes,
                    [&](const Plane& p) { return dot(p.normal, direction) / -signed_distance(p, origin); });
}

Plane Hull::tightest(Vec3 point) const {
  return best_plane(data->planes, [&](const Plane& p) { return signed_distance(p, point); });
}

std::optional<WidePlane> Hull::wide_facet(int f) const {
  const auto& [i, j, k] = data->facet_corners[f];
  if (i < 0) return std::nullopt;
  const WideVector normal = wide_normal(data->corners[i], data->corners[j], data->corners[k]);
  return WidePlane{normal, dot(normal, wide(data->corners[i]))};
}

std::optional<WidePlane> Hull::unit_facet(int f) const {
  const auto& corners = data->facet_corners[f];
  if (corners[0] < 0) return std::nullopt;
  return plane_through(*data, corners);
}

double Hull::unexact() const {
  const bool exact = std::ranges::none_of(data->facet_corners, [](const auto& corners) { return corners[0] < 0; });
  return exact ? 0 : std::max(data->flatness, 0x1p-52 * data->radius);
}

WidePlane Hull::plane_through_corners(int f) const {
  const Plane& plane = data->planes[f];
  if (data->facet_corners[f][0] < 0) return {unit(wide(plane.normal)), {plane.offset}};
  return plane_through(*data, data->facet_corners[f]);
}

/// One piece, inside the planes of facets. If these are not exact, it is inside the planes of all triangles, unless
/// too many planes matter.
void Hull::give_pieces(Cutter& cutter) const {
  const double inexact = unexact();
  cutter.begin();
  if (inexact > 0 && data->triangles.size() <= kMostTriangles) {
    for (const auto& triangle : data->triangles) cutter.face(plane_through(*data, triangle));
    if (cutter.few()) return cutter.end();
    cutter.begin_again();
  }
  for (int f = 0; f < facet_count() && !cutter.empty(); ++f) {
    cancellation_point();
    if (!(cutter.heights(facet(f)).second < 0)) cutter.face(plane_through_corners(f));
  }
  cutter.off(inexact);
  cutter.end();
}

void Hull::place(Solid& solid, const Pose* pose, double beyond) const {
  solid.resize(static_cast<int>(data->vertices.size()), facet_count(), beyond);
  for (int i = 0; i < solid.vertices; ++i) solid.set_vertex(i, pose ? *pose * data->vertices[i] : data->vertices[i]);
  for (int f = 0; f < solid.facets; ++f) {
    const Plane placed = pose ? *pose * data->planes[f] : data->planes[f];
    solid.set_plane(f, placed.normal, placed.offset);
  }
  solid.edges = data->edges;
}

void Hull::give(Mesh& mesh) const {
  // Facets are merged, and points on edges dropped, where corners lie within 32 half-ulps of the largest coordinate.
  const double flat = data->graph->triangular ? 0 : data->flatness + 32 * 0x1p-53 * data->radius;
  mesh.look_at(*data, *data->graph, flat);
}

void Hull::append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) const {
  body.append_triangles(0, planes);
}

}  // namespace overlapper
