#pragma once

#include <cmath>
#include <vector>

#include "geometry/polytope.h"

namespace overlapper {

/// Planes of a polytope's facets, near which a few vertices lie close together, in boxes of their normals and offsets
/// within boxes: by how much a vertex misses them is known without looking at all.
class PlaneTree {
 public:
  /// The vertices are no farther than `radius` from `centre`.
  PlaneTree(const Polytope& polytope, const std::vector<int>& facets, Vec3 centre, double radius);

  /// How far the vertex is from the plane that it misses most, or from another if that is `enough`.
  double misfit(Vec3 vertex, double enough);

 private:
  static constexpr int kLeaf = 8;

  /// About the centre.
  struct Seen {
    Vec3 normal;
    double offset;
    int facet;
  };
  struct Node {
    Seen lower, upper;
    int begin, end;
    int second = -1;  ///< the other child, after the one that follows; -1 of a leaf
  };

  static double most(const Node& node, Vec3 from_centre);
  int grow(int begin, int end);
  void look(int at, Vec3 vertex, double enough, double& misfit);

  const Polytope& polytope_;
  Vec3 centre_;
  double radius_, rounding_ = 0;
  std::vector<Node> nodes_;
  std::vector<Seen> planes_;  ///< those of a box side by side
  int last_enough_ = -1;      ///< a facet that ruled a vertex out
};

/// How far a vertex is from the plane of a facet.
inline double off_plane(const Polytope& p, int facet, Vec3 vertex) {
  return std::abs(dot(p.dual[facet], vertex) - 1) / norm(p.dual[facet]);
}

}  // namespace overlapper
