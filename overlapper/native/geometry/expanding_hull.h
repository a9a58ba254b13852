#pragma once

#include <span>
#include <vector>

#include "geometry/vec.h"

namespace overlapper {

/// Convex hull that grows by one point at a time: find a facet that sees the point, walk over all facets that do,
/// remove them, and close the horizon with a cone to the point (de Berg et al., Computational Geometry, ch. 11).
///
/// Every decision is the exact sign of a determinant of the given doubles, so the facets always form a closed, convex
/// surface: coplanar and nearly coincident points need no tolerance, and growth always ends. A point on the surface is
/// not outside and is left out. The same structure serves dual points (the overlap), support points of A - B (the
/// penetration depth) and mesh vertices (a `Hull`).
class ExpandingHull {
 public:
  /// A triangle, counter-clockwise from outside; neighbour[i] shares the ridge vertex[i] -> vertex[i + 1].
  struct Facet {
    std::array<int, 3> vertex{-1, -1, -1};
    std::array<int, 3> neighbour{-1, -1, -1};
    Vec3 normal;           ///< outward, of length twice the facet's area, rounded
    Vec3 normal_rounding;  ///< sums of the absolute products in `normal`, which its rounding error is a fraction of
    int first_conflict = -1, farthest_conflict = -1;
    double farthest_height = 0;

    bool removed() const { return vertex[0] < 0; }
  };

  std::vector<Vec3> points;
  std::vector<Facet> facets;  ///< with gaps: skip those that are removed()

  /// Starts from a tetrahedron among `points`, found at the extremes; false if all the points lie in one plane.
  /// Coordinates below 2^-200 of the largest are set to zero first: products of three of them would underflow, and
  /// signs with them.
  bool start();

  /// Takes triangles, of indices of `points`, for its facets, in that order; false unless they are one closed convex
  /// surface: two run along every ridge, each the other way, and neither sees the third corner of the other.
  bool assemble(std::span<const std::array<int, 3>> triangles);

  /// Adds a point to be inserted later; its number. Coordinates are flushed as by start().
  int add(Vec3 point);

  /// Starts, then inserts every point. Each point outside waits with one facet that it sees (its conflict), and the
  /// farthest of a facet's conflicts is inserted next. One edge per point of the paper's conflict graph is enough,
  /// because the facets that see a point are connected. O(n log n) expected.
  ///
  /// With `negligible`, the origin must be inside, and a point p is left out if it rises above each facet that it sees
  /// by no more than the fraction negligible[p] of that facet's distance from the origin: a plane that cuts nothing but
  /// rounding.
  bool build(std::span<const double> negligible = {});

  /// True if point `p` lies strictly outside the plane of the facet. Exact.
  bool sees(int facet, int p) const;

  /// Replaces all facets that see `p`, among them `seen`, by the cone from the horizon to `p`.
  void insert(int p, int seen);

  std::span<const int> cone() const { return cone_; }        ///< the facets made by the last insert()
  std::span<const int> removed() const { return removed_; }  ///< the facets it removed
  int inserted() const { return inserted_; }                 ///< how many points have been vertices so far

  /// Any facet with that vertex, for each point; -1 for points that are not vertices.
  std::vector<int> facet_at_vertex() const;

  /// The next facet around `vertex`, counter-clockwise from outside.
  int next_around(int facet, int vertex) const;

 private:
  int make_facet(int a, int b, int c);
  double height(int facet, int p) const;
  void wait(int facet, int p);
  /// Takes the conflicts of a facet but for `except`, and calls `wait_elsewhere` with each.
  template <class Wait>
  void hand_on_conflicts(int facet, int except, Wait wait_elsewhere);
  void hand_on_to_cone(int apex);
  int first_that_sees(std::span<const int> candidates, int p) const;
  int cone_facet_that_sees(int p) const;
  /// The cone in its order around the apex, if it is large.
  void order_cone();
  /// A facet of the cone so ordered that sees `p`, or -1: by bisection from facet number `base` on.
  int fan_facet_that_sees(int p, size_t base) const;
  bool rises_above_facet(int facet, int p, double fraction) const;
  bool rises_above(int facet, int p, double fraction);
  void collect_visible(int p, int seen);
  void link_cone(int p);
  /// Reuses the facets that the last insert() removed. Callers must not see the difference.
  void vacate_removed();
  /// Restores the order of facets as if none had been reused, but without gaps.
  void order_by_birth();

  static constexpr size_t kLeastReused = 1024;  ///< facets, before which caches hold the removed ones as well

  std::vector<int> cone_, fan_, removed_, stack_, cone_start_, next_conflict_, visited_;
  std::vector<int> vacant_;  ///< numbers of facets
  std::vector<int> born_;    ///< per facet, how many have been made before, once one is vacant
  int made_ = 0;
  struct HorizonRidge {
    int from, to, outside;
  };
  std::vector<HorizonRidge> horizon_;
  int visit_ = 0, inserted_ = 0;
  double negligible_coordinate_ = 0;
};

}  // namespace overlapper
