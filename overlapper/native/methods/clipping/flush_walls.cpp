#include "methods/clipping/flush_walls.h"

#include <algorithm>
#include <cmath>

#include "geometry/constants.h"

namespace overlapper {
namespace {

/// A wall is flush if the other solid reaches beyond it by at most so many doubts. Walls that are tilted by more have
/// certain signs.
constexpr double kFlush = 16;

/// Walls move so many doubts outward, far beyond the other solid.
constexpr double kOutward = 0x1p16;

double height(const Solid& solid, int plane, Vec3 point) {
  return dot(solid.normal(plane), point) - solid.offset[plane];
}

bool move_wall(Solid& solid, int wall, double way, double doubt) {
  // Per vertex: -1 off the wall, otherwise the number of edges that leave the wall.
  thread_local std::vector<int> edges;
  edges.assign(solid.vertices, -1);
  for (const Edge& e : solid.edges)
    if (e.left == wall || e.right == wall) edges[e.from] = edges[e.to] = 0;
  const Vec3 normal = solid.normal(wall);
  bool found = false;
  for (const Edge& e : solid.edges) {
    if ((edges[e.from] < 0) == (edges[e.to] < 0)) continue;
    const int corner = edges[e.from] < 0 ? e.to : e.from, inner = edges[e.from] < 0 ? e.from : e.to;
    const Vec3 at = solid.vertex(corner), along = at - solid.vertex(inner);
    const double rise = dot(normal, along);
    if (++edges[corner] > 1 || !(rise > way)) return false;
    solid.set_vertex(corner, at + (way / rise) * along);
    found = true;
  }
  solid.offset[wall] += way;
  for (int i = 0; i < solid.vertices; ++i) {
    if (edges[i] < 0) continue;
    int near = 0;
    for (int f = 0; f < solid.facets; ++f) near += !(height(solid, f, solid.vertex(i)) < -2 * doubt);
    if (edges[i] == 0 || near != 3) return false;
  }
  return found;
}

/// False if a wall cannot be moved.
bool move_walls(Solid& solid, const Solid& other, double doubt, std::vector<MovedWall>& moved) {
  for (int f = 0; f < solid.facets; ++f) {
    double highest = -kInfinity;
    for (int i = 0; i < other.vertices; ++i) highest = std::max(highest, height(solid, f, other.vertex(i)));
    if (highest < -doubt || highest > kFlush * doubt) continue;
    moved.push_back({solid.normal(f), std::max(highest, 0.0) + doubt});
    if (!move_wall(solid, f, kOutward * doubt, doubt)) return false;
  }
  return true;
}

}  // namespace

bool move_flush_walls(Solid& first, Solid& second, double doubt, std::vector<MovedWall>& moved) {
  moved.clear();
  if (first.vertices == 0 || second.vertices == 0) return false;  // a half-space
  return move_walls(second, first, doubt, moved) && move_walls(first, second, doubt, moved) && !moved.empty();
}

}  // namespace overlapper
