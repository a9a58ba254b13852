#pragma once

#include <memory>
#include <span>
#include <vector>

#include "geometry/vec.h"
#include "shapes/point_tree.h"

namespace overlapper {

struct HullData;

/// The nearest element to each of some directions, spread over the faces of a cube: the starts of climbs.
class DirectionMap {
 public:
  DirectionMap() = default;
  /// A map with about one direction for two elements.
  explicit DirectionMap(int elements);

  int near(Vec3 direction) const { return nearest_[cell(direction)]; }
  int cells() const { return static_cast<int>(nearest_.size()); }
  Vec3 centre(int cell) const;
  void set(int cell, int element) { nearest_[cell] = element; }

 private:
  int cell(Vec3 direction) const;
  int side_ = 0;  ///< cells along an edge of the cube
  std::vector<int> nearest_;
};

/// The neighbours of an element with many neighbours, in their order around it. Each step to a neighbour is divided by
/// the neighbour's distance inwards. The scaled steps end on a convex polygon, and bisection around this polygon finds
/// the steepest step.
struct NeighbourFan {
  int element;
  std::vector<int> neighbour;
  std::vector<double> inverse;  ///< per neighbour, 1 / its distance inwards
};

/// The neighbours of each element of a hull. A query climbs from neighbour to neighbour instead of a scan of all
/// elements. Dobkin and Kirkpatrick (1983) use a hierarchy of ever smaller polytopes; here one map from directions to
/// remote elements replaces it. A linear function over a polytope has no local maximum but the global one, which
/// several elements may share. Over facets this holds for rays from an interior point: their exit is the support
/// function of the polar dual.
struct HullGraph {
  // Half-edge h runs along facet[h] from ring[h] to ring[next[h]]; twin[h] runs back along the facet beside it.
  std::vector<int> next, twin, facet;
  std::vector<int> leaving;               ///< per vertex, a half-edge that begins there
  std::vector<int> around, around_start;  ///< per vertex: its neighbours along edges
  std::vector<int> beside;                ///< per half-edge: the facet of its twin
  std::vector<Vec3> dual;                 ///< per facet: its dual point about the centroid
  double inradius = 0;                    ///< m, of the ball about the centroid
  double circumradius = 0;                ///< m, about the centroid
  bool triangular = false;                ///< no facet was merged from several triangles; rounding tilts none
  DirectionMap vertex_near, facet_near;   ///< about the centroid; empty where a scan is faster
  /// The fans of elements with more neighbours than a scan handles faster than bisection. Per element: the number of
  /// its fan, -1 for none; empty without any fans.
  std::vector<NeighbourFan> vertex_fans, facet_fans;
  std::vector<int> fan_of_vertex, fan_of_facet;
  /// Trees of vertices and of dual points, about the centroid. They exist only where neighbouring cells of the map are
  /// many steps apart, as around a rim. A climb there would take about the root of the number of elements.
  PointTree vertex_tree, facet_tree;

  /// The number of a farthest vertex along `direction`.
  int farthest_vertex(const HullData& hull, Vec3 direction) const;
  int farthest_vertex(const HullData& hull, Vec3 direction, int start) const;

  /// The number of the facet through which the ray from the centroid through `point` leaves. `gauge` becomes the
  /// fraction of the ray up to the point: 1 on the surface, less inside.
  int facet_towards(const HullData& hull, Vec3 point, double& gauge) const;
  int facet_towards(const HullData& hull, Vec3 point, double& gauge, int start) const;

  /// The number of the facet through which the ray leaves; `origin` is strictly inside. `rate` becomes 1 / the length
  /// of the ray, in multiples of `direction`.
  int ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate) const;
  int ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate, int start) const;
};

/// Null if rounding has left facets that do not make one closed convex surface.
std::shared_ptr<const HullGraph> graph_of(const HullData& hull);

}  // namespace overlapper
