#include "shapes/hull.h"

#include <limits>

#include "shapes/mesh.h"
#include "shapes/solid.h"
#include "shapes/wide_body.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

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
  const auto& [i, j, k] = data->facet_corners[f];
  if (i < 0) return std::nullopt;
  const WideVector normal = unit(wide_normal(data->corners[i], data->corners[j], data->corners[k]));
  return WidePlane{normal, dot(normal, wide(data->corners[i]))};
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
