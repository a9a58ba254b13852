#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "geometry/vec.h"
#include "shapes/choices.h"
#include "shapes/hull_graph.h"

namespace overlapper {

/// What a convex polytope is made of. Facet f is the polygon ring[ring_start[f] .. ring_start[f + 1]) of vertices,
/// counter-clockwise from outside, in the plane planes[f]. Coordinates are relative to `origin`: subtracting it rounded
/// no bit, and it keeps the digits of a hull that lies far from where its points are counted from.
struct HullData {
  Vec3 origin;
  std::vector<Vec3> vertices;
  std::vector<Plane> planes;
  std::vector<int> ring, ring_start{0};
  /// The surface as it is before coplanar triangles are merged and what rounding moved is forgotten, for wider
  /// arithmetic.
  std::vector<Vec3> corners;
  std::vector<std::array<int, 3>> triangles;
  /// Three corners of each facet whose plane holds all corners of its triangles without any rounding; -1 if there are
  /// none.
  std::vector<std::array<int, 3>> facet_corners;
  double volume = 0;
  Vec3 centroid;
  std::shared_ptr<const HullGraph> graph;  ///< for climbing; null where rounding left no closed convex surface

  std::vector<Edge> edges;                      ///< none if merging facets has left a ridge without its other side
  std::vector<std::array<int, 3>> facets_meet;  ///< per vertex: three of its facets, as far from a common line as any
  double radius = 0;                            ///< of a ball about the coordinates' origin that holds all vertices
  double flatness = 0;  ///< m: how far vertices of a facet lie inside its plane, or those beside it outside, at most

  std::span<const int> facet(int f) const {
    return std::span(ring).subspan(ring_start[f], ring_start[f + 1] - ring_start[f]);
  }
};

/// The hull of finite points, or null if they are flat; `source[i]` becomes the index of vertex i among the points.
std::shared_ptr<HullData> hull_of(std::span<const Vec3> points, std::vector<int>* source = nullptr);

/// The hull whose surface, before coplanar triangles are merged, is that of these corners about `origin`: as it was
/// built, so that its facets have the same numbers. Throws std::invalid_argument if there is no such hull.
std::shared_ptr<HullData> hull_of_surface(Vec3 origin, std::span<const Vec3> corners,
                                          std::span<const std::array<int, 3>> triangles);
/// The hull of points, with its graph. Interior, duplicate, collinear and coplanar points are welcome; coplanar
/// triangles become one facet. Throws std::invalid_argument with one sentence that names the argument.
std::shared_ptr<HullData> hull_of_vertices(std::span<const Vec3> points);

/// Fills in what follows from vertices, planes and rings.
void complete(HullData& data);

/// How far corners of a facet rise above the plane of the one across its edge number `edge`, at most; 0 if none does.
/// From either end of the edge, heights fall along the ring until they rise again towards the other end, as the ring is
/// convex but for rounding: once they are below all that rounding may do, none beyond counts. So the ring of a large
/// facet is not walked for each of the many around it.
double rise_beside(const HullData& data, const Plane& across, std::span<const int> ring, size_t edge, double rounding);

/// The triangles with a corner that is kept, and the ridges between them of which one end is, by numbers of corners.
void append_core_surface(const HullData& hull, const std::vector<char>& kept, CoreSurface& surface);

/// Of two, the one of less volume comes first, or else the one with the lower numbers.
std::partial_ordering order_of(const HullData& a, const HullData& b);

struct HullMeasures {
  double volume = 0, area = 0;
  Vec3 centroid;
};
HullMeasures measure(const HullData& hull);

}  // namespace overlapper
