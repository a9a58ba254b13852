#pragma once

#include <memory>
#include <span>
#include <vector>

#include "geometry/vec.h"
#include "shapes/point_tree.h"

namespace overlapper {

struct HullData;

/// The element nearest to each of some directions, spread over the faces of a cube: where to start climbing.
class DirectionMap {
 public:
  DirectionMap() = default;
  /// A map of about one direction for every `elements` / 2 elements.
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

/// The neighbours of one element that has many, in their order around it. Divided by how far each is on the way inside,
/// the steps to them end on a convex polygon, around which the step that climbs most is found by bisection.
struct NeighbourFan {
  int element;
  std::vector<int> neighbour;
  std::vector<double> inverse;  ///< per neighbour, one over its distance on the way inside
};

/// Who is next to whom on a hull, so that a query climbs from neighbour to neighbour instead of looking at everything
/// (Dobkin and Kirkpatrick 1983; their hierarchy of ever smaller polytopes is here one map from directions to remote
/// elements). A linear function over a polytope has no local maximum but the global one, which several elements may
/// share; over the facets this holds for rays from a point inside, whose exit is the support function of the polar
/// dual.
struct HullGraph {
  // Half-edge h runs along facet[h] from ring[h] to ring[next[h]]; twin[h] runs back along the facet beside it.
  std::vector<int> next, twin, facet;
  std::vector<int> leaving;               ///< per vertex, a half-edge that begins there
  std::vector<int> around, around_start;  ///< per vertex, the vertices it shares an edge with
  std::vector<int> beside;                ///< per half-edge: the facet of its twin
  std::vector<Vec3> dual;                 ///< per facet: its dual point about the centroid
  double inradius = 0;                    ///< m, of the ball about the centroid
  double circumradius = 0;                ///< m, about the centroid
  bool triangular = false;               ///< no facet was merged from several triangles, and none is tilted by rounding
  DirectionMap vertex_near, facet_near;  ///< about the centroid; empty where a scan is faster
  /// Of the elements with more neighbours than are looked at sooner than bisected, and per element which is its own, -1
  /// for none; empty if there is none at all.
  std::vector<NeighbourFan> vertex_fans, facet_fans;
  std::vector<int> fan_of_vertex, fan_of_facet;
  /// Of vertices, and of dual points, about the centroid, where neighbours are many steps from what lies beside in the
  /// map, as around a rim, and a climb would take as many as the root of their number; empty where it does not.
  PointTree vertex_tree, facet_tree;

  /// Number of a farthest vertex along `direction`.
  int farthest_vertex(const HullData& hull, Vec3 direction) const;
  int farthest_vertex(const HullData& hull, Vec3 direction, int start) const;

  /// Number of the facet through which the ray from the centroid through `point` leaves; `gauge` becomes how far along
  /// the point lies: 1 on the surface, less inside.
  int facet_towards(const HullData& hull, Vec3 point, double& gauge) const;
  int facet_towards(const HullData& hull, Vec3 point, double& gauge, int start) const;

  /// Number of the facet through which the ray leaves; `origin` strictly inside. `rate` becomes one over the length of
  /// the ray, in multiples of `direction`.
  int ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate) const;
  int ray_exit(const HullData& hull, Vec3 origin, Vec3 direction, double& rate, int start) const;
};

/// Null if rounding has left facets that do not close up to one convex surface.
std::shared_ptr<const HullGraph> graph_of(const HullData& hull);

}  // namespace overlapper
