#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "shapes/shape.h"

namespace overlapper::pieces {

/// A convex polytope in doubles. Each corner has three edges and three faces. Planes cut it as in Powell and Abel
/// (2015). They place every new corner on an edge, so no corner is farther out than rounding.
struct EnclosingPolytope {
  /// { X : dot(normal, X) <= slack }, and the number of its wall, or kNoWall.
  struct Face {
    Vec3 normal;
    double slack;
    int wall;
  };
  struct Corner {
    Vec3 at;
    std::array<int, 3> beside;  ///< the corners at the other ends of its edges, counter-clockwise from outside
    std::array<int, 3> face;    ///< between an edge and the next

    /// The number of its edge to another corner.
    int edge_to(int other) const { return beside[0] == other ? 0 : 2 - static_cast<int>(beside[1] == other); }
  };
  /// The number of the next edge of a corner, and of the one before it.
  static int after_edge(int edge) { return edge == 2 ? 0 : edge + 1; }
  static int before_edge(int edge) { return edge == 0 ? 2 : edge - 1; }
  std::vector<Face> faces;  ///< all faces that have cut it; later cuts may have left nothing of some
  std::vector<Corner> corners;

  void become(const Bounds& box);
  /// False if the face leaves nothing; the polytope is then unchanged.
  bool cut(const Face& face);
  /// Removes the faces without a remaining part.
  void drop_faces();
  /// Puts every corner where its three faces meet, to the rounding of its own place. A cut places a corner on an edge,
  /// to the rounding of the ends of that edge, which may lie far outside. Returns the largest remaining distance of a
  /// corner from a face, in m, or 0 if that is only rounding.
  double settle();

  /// Calls use(face, ring) for each remaining face, with its corners counter-clockwise from outside.
  template <class Use>
  void for_faces(Use use) const;
  /// Calls use(corner, edge) around the face to the left of a corner's edge, beginning with these.
  template <class Use>
  void for_ring(int corner, int edge, Use use) const;

  /// Numbers the remaining parts of faces. By rounding, a face may have two parts. `number[i][k]` is the part at corner
  /// i between its edges k and k + 1. `left` gives the face of each part.
  void number_faces(std::vector<std::array<int, 3>>& number, std::vector<int>& left) const;

  /// Whether the point is certainly outside. NaN counts as not certain.
  bool excludes(Vec3 point) const;
  Bounds bounds() const;
  /// The least and the largest dot(direction, X) over the polytope.
  std::pair<double, double> range(Vec3 direction) const;
  double least(Vec3 direction) const { return range(direction).first; }
  Vec3 middle() const;
  double reach(Vec3 point) const;  ///< upper bound of the distance of a corner
  double extent() const { return reach({}); }
  double inner_radius() const;  ///< of the ball about the origin inside it
  double surface() const;       ///< its area
};

inline constexpr int kNoWall = -1;

template <class Use>
void EnclosingPolytope::for_faces(Use use) const {
  thread_local std::pair<std::vector<int>, std::vector<std::array<bool, 3>>> of_thread;
  of_thread.first.resize(corners.size()), of_thread.second.assign(corners.size(), {});
  // Pointers, because each access to a thread_local variable looks it up.
  int* const ring = of_thread.first.data();
  std::array<bool, 3>* const seen = of_thread.second.data();
  for (size_t first = 0; first < corners.size(); ++first)
    for (int k = 0; k < 3; ++k) {
      if (seen[first][k]) continue;
      size_t size = 0;
      for_ring(static_cast<int>(first), k, [&](int corner, int along) {
        ring[size++] = corner;
        seen[corner][along] = true;
      });
      use(faces[corners[first].face[k]], std::span<const int>(ring, size));
    }
}

template <class Use>
void EnclosingPolytope::for_ring(int first, int edge, Use use) const {
  int from = first, along = edge;
  do {
    use(from, along);
    const int to = corners[from].beside[along];
    along = (corners[to].edge_to(from) + 2) % 3;
    from = to;
  } while (from != first || along != edge);
}

}  // namespace overlapper::pieces
