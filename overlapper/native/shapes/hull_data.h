#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "geometry/vec.h"
#include "shapes/choices.h"
#include "shapes/hull_graph.h"
#include "shapes/offset_surface.h"

namespace overlapper {

/// A convex polytope. Facet f is the polygon ring[ring_start[f] .. ring_start[f + 1]) of vertices, counter-clockwise
/// from outside, in the plane planes[f]. Coordinates are relative to `origin`. Subtracting `origin` was exact, and
/// keeps the digits of a hull far from the origin of its points.
struct HullData {
  Vec3 origin;
  std::vector<Vec3> vertices;
  std::vector<Plane> planes;
  std::vector<int> ring, ring_start{0};
  /// The surface before coplanar triangles are merged, for wider arithmetic.
  std::vector<Vec3> corners;
  std::vector<std::array<int, 3>> triangles;
  /// Three corners of each facet. Their plane holds all corners of the facet's triangles exactly. -1 if there are no
  /// such corners.
  std::vector<std::array<int, 3>> facet_corners;
  double volume = 0;
  Vec3 centroid;
  std::shared_ptr<const HullGraph> graph;  ///< for climbing; null where rounding left no closed convex surface

  std::vector<Edge> edges;                      ///< empty if merging facets has left a ridge with one side only
  std::vector<std::array<int, 3>> facets_meet;  ///< per vertex: three of its facets with well-spread normals
  double radius = 0;                            ///< of a ball about the coordinates' origin that holds all vertices
  double flatness = 0;  ///< m: most that vertices of a facet lie inside its plane, or neighbouring vertices outside

  KeptOffsetSurface offset_surface;  ///< of the hull grown by any radius

  std::span<const int> facet(int f) const {
    return std::span(ring).subspan(ring_start[f], ring_start[f + 1] - ring_start[f]);
  }
};

/// The hull of finite points, or null if they are flat. `source[i]` becomes the index of vertex i among the points.
std::shared_ptr<HullData> hull_of(std::span<const Vec3> points, std::vector<int>* source = nullptr);

/// The hull with this surface of triangles about `origin`, before coplanar triangles are merged. Its facets have the
/// same numbers as in the hull that the surface came from. Throws std::invalid_argument if there is no such hull.
std::shared_ptr<HullData> hull_of_surface(Vec3 origin, std::span<const Vec3> corners,
                                          std::span<const std::array<int, 3>> triangles);
/// The hull of points, with its graph. Interior, duplicate, collinear and coplanar points are allowed; coplanar
/// triangles become one facet. Throws std::invalid_argument with one sentence that names the argument.
std::shared_ptr<HullData> hull_of_vertices(std::span<const Vec3> points);

/// Computes all other fields from vertices, planes and rings.
void complete(HullData& data);

/// The largest height of a facet's corners above the plane across its edge number `edge`; 0 if none is above. The ring
/// is convex but for rounding. From either end of the edge, heights therefore fall along the ring until they rise again
/// towards the other end. The search ends once heights are below all rounding. This avoids a walk around a large facet
/// for each of its many neighbours.
double rise_beside(const HullData& data, const Plane& across, std::span<const int> ring, size_t edge, double rounding);

/// The triangles with a kept corner, and the ridges with one kept end between these triangles, by numbers of corners.
void append_core_surface(const HullData& hull, const std::vector<char>& kept, CoreSurface& surface);

/// Orders two polytopes by volume, and at equal volume by their numbers.
std::partial_ordering order_of(const HullData& a, const HullData& b);

struct HullMeasures {
  double volume = 0, area = 0;
  Vec3 centroid;
};
HullMeasures measure(const HullData& hull);

}  // namespace overlapper
