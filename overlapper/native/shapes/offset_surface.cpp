#include "shapes/offset_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/constants.h"
#include "geometry/wide.h"
#include "shapes/hull_data.h"

namespace overlapper {

double OffsetSurface::volume(double radius) const {
  return core_volume + radius * (area + radius * (mean_width + radius * (4.0 / 3.0) * kPi));
}

namespace {

OffsetSurface measured(const HullData& hull) {
  OffsetSurface surface;
  surface.exact = std::ranges::none_of(hull.facet_corners, [](const auto& corners) { return corners[0] < 0; });
  surface.core_volume = hull.volume;
  surface.facets.resize(hull.planes.size()), surface.edges.resize(hull.edges.size());
  surface.vertices.assign(hull.vertices.size(), {{}, 2 * kPi});
  for (int f = 0; f < static_cast<int>(surface.facets.size()); ++f) {
    OffsetSurface::Facet& facet = surface.facets[f];
    const auto [a, b, c] = hull.facet_corners[f];
    facet.normal =
        a < 0 ? hull.planes[f].normal : rounded(unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c])));
    const auto ring = hull.facet(f);
    const size_t n = ring.size();
    for (size_t i = 0; i < n; ++i) {
      const Vec3 at = hull.vertices[ring[i]];
      const Vec3 before = hull.vertices[ring[(i + n - 1) % n]] - at, after = hull.vertices[ring[(i + 1) % n]] - at;
      const double sine = norm(cross(after, before));
      surface.vertices[ring[i]].solid_angle -= std::atan2(sine, dot(after, before));
      if (i > 0 && i + 1 < n) {
        const Vec3 apex = hull.vertices[ring[0]];
        facet.area += norm(cross(at - apex, hull.vertices[ring[i + 1]] - apex)) / 2;
      }
    }
    surface.area += facet.area;
  }
  for (size_t e = 0; e < surface.edges.size(); ++e) {
    const Edge& given = hull.edges[e];
    OffsetSurface::Edge& edge = surface.edges[e];
    edge.from = given.from, edge.to = given.to, edge.left = given.left, edge.right = given.right;
    const Vec3 way = hull.vertices[given.to] - hull.vertices[given.from];
    edge.length = norm(way), edge.along = unit(way);
    const Vec3 left = surface.facets[given.left].normal, right = surface.facets[given.right].normal;
    const double sine = dot(cross(left, right), edge.along);
    if (!(sine > 0)) surface.exact = false;
    edge.angle = std::atan2(sine, dot(left, right));
    // Normals may be nearly opposite, as those of a thin plate. Their difference then has all digits.
    if (dot(left, right) < 0) edge.across = unit(right - left), edge.middle = cross(edge.across, edge.along);
    else edge.middle = unit(left + right), edge.across = cross(edge.along, edge.middle);
    edge.chord = 2 * std::sin(edge.angle / 2);
    edge.of_middle = (edge.angle + std::sin(edge.angle)) / 2, edge.of_across = (edge.angle - std::sin(edge.angle)) / 2;
    surface.mean_width += edge.length * edge.angle / 2;
    // By the theorem of Gauss over the cone of normals: the arc of an edge lies across the edge.
    const Vec3 half = edge.angle / 2 * edge.along;
    surface.vertices[edge.from].normals -= half;
    surface.vertices[edge.to].normals += half;
  }
  surface.first_edge.assign(surface.vertices.size() + 1, 0);
  for (const Edge& edge : hull.edges) ++surface.first_edge[edge.from], ++surface.first_edge[edge.to];
  int before = 0;
  for (int& count : surface.first_edge) before += std::exchange(count, before);
  surface.edges_by_vertex.resize(before);
  std::vector<int> next(surface.first_edge);
  for (int e = 0; e < static_cast<int>(hull.edges.size()); ++e)
    for (const int v : {hull.edges[e].from, hull.edges[e].to}) surface.edges_by_vertex[next[v]++] = e;
  surface.sides.assign(hull.ring.size(), -1);
  for (int e = 0; e < static_cast<int>(surface.edges.size()); ++e) {
    OffsetSurface::Edge& edge = surface.edges[e];
    for (const bool right : {false, true}) {
      const int facet = right ? edge.right : edge.left, begin = right ? edge.to : edge.from;
      const auto ring = hull.facet(facet);
      const int n = static_cast<int>(ring.size());
      const int k = static_cast<int>(std::ranges::find(ring, begin) - ring.begin());
      if (k == n || ring[(k + 1) % n] != (right ? edge.from : edge.to)) continue;
      const int here = hull.ring_start[facet] + k, after = hull.ring_start[facet] + (k + 1) % n;
      surface.sides[here] = 2 * e + right;
      edge.corners[right ? 3 : 0] = here, edge.corners[right ? 2 : 1] = after;
    }
  }
  if (std::ranges::find(surface.sides, -1) != surface.sides.end()) surface.exact = false;
  return surface;
}

}  // namespace

const OffsetSurface& offset_surface(const HullData& core) {
  return core.offset_surface.get([&] { return measured(core); });
}

}  // namespace overlapper
