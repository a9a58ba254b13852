#pragma once

#include <cmath>
#include <vector>

#include "geometry/polytope.h"

namespace overlapper {

/// A tree of boxes around normals and offsets of facet planes of a polytope. A few vertices lie close together near
/// these planes. The tree finds a vertex's largest distance from the planes without a look at all planes.
class PlaneTree {
 public:
  /// The vertices are at most `radius` from `centre`.
  PlaneTree(const Polytope& polytope, const std::vector<int>& facets, Vec3 centre, double radius);

  /// The vertex's largest distance from a plane; if one distance is at least `enough`, that distance.
  double misfit(Vec3 vertex, double enough);

 private:
  static constexpr int kLeaf = 8;

  /// A plane, relative to the centre.
  struct CentredPlane {
    Vec3 normal;
    double offset;
    int facet;
  };
  struct Node {
    CentredPlane lower, upper;
    int begin, end;
    int second = -1;  ///< the other child; the first child follows directly; -1 for a leaf
  };

  static double most(const Node& node, Vec3 from_centre);
  int grow(int begin, int end);
  void look(int at, Vec3 vertex, double enough, double& misfit);

  const Polytope& polytope_;
  Vec3 centre_;
  double radius_, rounding_ = 0;
  std::vector<Node> nodes_;
  std::vector<CentredPlane> planes_;  ///< the planes of a box are contiguous
  int last_enough_ = -1;              ///< a facet that excluded the last vertex
};

/// The distance of a vertex from the plane of a facet.
inline double off_plane(const Polytope& p, int facet, Vec3 vertex) {
  return std::abs(dot(p.dual[facet], vertex) - 1) / norm(p.dual[facet]);
}

}  // namespace overlapper
