#pragma once

#include <span>
#include <vector>

#include "geometry/vec.h"

namespace overlapper {

/// Convex hull that grows by one point at a time. An insertion finds a facet that sees the point, walks over all facets
/// that see it, and removes them. A cone to the point then closes the horizon (de Berg et al., Computational Geometry,
/// ch. 11).
///
/// Every decision is the exact sign of a determinant of the given doubles. The facets therefore always form a closed,
/// convex surface. Coplanar and nearly coincident points need no tolerance, and growth always ends. A point on the
/// surface is not outside and is left out. The same structure serves dual points (the overlap), support points of A - B
/// (the penetration depth) and mesh vertices (a `Hull`).
class ExpandingHull {
 public:
  /// A triangle, counter-clockwise from outside; neighbour[i] shares the ridge vertex[i] -> vertex[i + 1].
  struct Facet {
    std::array<int, 3> vertex{-1, -1, -1};
    std::array<int, 3> neighbour{-1, -1, -1};
    Vec3 normal;           ///< outward, of length twice the facet's area, rounded
    Vec3 normal_rounding;  ///< sums of the absolute products in `normal`; its rounding error is a fraction of these
    int first_conflict = -1, farthest_conflict = -1;
    double farthest_height = 0;

    bool removed() const { return vertex[0] < 0; }
  };

  std::vector<Vec3> points;
  std::vector<Facet> facets;  ///< with gaps: skip those that are removed()

  /// Starts from a tetrahedron of extreme points; false if all points lie in one plane. Coordinates below 2^-200 of the
  /// largest coordinate are first set to zero. Products of three such coordinates would underflow, and their signs
  /// would be lost.
  bool start();

  /// Uses triangles, given by indices of `points`, as its facets, in that order. False unless they form one closed
  /// convex surface: along every ridge two triangles run in opposite directions, and neither sees the third corner of
  /// the other.
  bool assemble(std::span<const std::array<int, 3>> triangles);

  /// Adds a point to be inserted later, and returns its number. Coordinates are flushed as by start().
  int add(Vec3 point);

  /// Starts, then inserts every point. Each point outside waits with one facet that it sees (its conflict). The
  /// farthest conflict of a facet is inserted next. The paper's conflict graph needs only one edge per point, because
  /// the facets that see a point are connected. O(n log n) expected.
  ///
  /// With `negligible`, the origin must be inside. A point p is left out if it rises only slightly above each facet
  /// that it sees: at most the fraction negligible[p] of the facet's distance from the origin. Such a plane cuts off
  /// only rounding.
  bool build(std::span<const double> negligible = {});

  /// True if point `p` lies strictly outside the plane of the facet. Exact.
  bool sees(int facet, int p) const;

  /// Replaces all facets that see `p`, including `seen`, by the cone from the horizon to `p`.
  void insert(int p, int seen);

  std::span<const int> cone() const { return cone_; }        ///< the facets made by the last insert()
  std::span<const int> removed() const { return removed_; }  ///< the facets it removed
  int inserted() const { return inserted_; }                 ///< number of points that have been vertices so far

  /// Any facet with that vertex, for each point; -1 for points that are not vertices.
  std::vector<int> facet_at_vertex() const;

  /// The next facet around `vertex`, counter-clockwise from outside.
  int next_around(int facet, int vertex) const;

 private:
  int make_facet(int a, int b, int c);
  double height(int facet, int p) const;
  void wait(int facet, int p);
  /// Takes all conflicts of a facet except `except`, and calls `wait_elsewhere` with each.
  template <class Wait>
  void hand_on_conflicts(int facet, int except, Wait wait_elsewhere);
  void hand_on_to_cone(int apex);
  int first_that_sees(std::span<const int> candidates, int p) const;
  int cone_facet_that_sees(int p) const;
  /// The cone in its order around the apex, if it is large.
  void order_cone();
  /// A facet of the ordered cone that sees `p`, or -1, by bisection from facet number `base`.
  int fan_facet_that_sees(int p, size_t base) const;
  bool rises_above_facet(int facet, int p, double fraction) const;
  bool rises_above(int facet, int p, double fraction);
  void collect_visible(int p, int seen);
  void link_cone(int p);
  /// Reuses the facets that the last insert() removed. Callers must not notice the reuse.
  void vacate_removed();
  /// Restores the order of facets as if none had been reused, but without gaps.
  void order_by_birth();

  static constexpr size_t kLeastReused = 1024;  ///< number of facets; with fewer, caches also hold the removed ones

  std::vector<int> cone_, fan_, removed_, stack_, cone_start_, next_conflict_, visited_;
  std::vector<int> vacant_;  ///< numbers of facets
  std::vector<int> born_;    ///< per facet: number of facets made before it; used once a facet is vacant
  int made_ = 0;
  struct HorizonRidge {
    int from, to, outside;
  };
  std::vector<HorizonRidge> horizon_;
  int visit_ = 0, inserted_ = 0;
  double negligible_coordinate_ = 0;
};

}  // namespace overlapper
