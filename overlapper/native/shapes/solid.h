#pragma once

#include <cstring>
#include <span>
#include <vector>

#include "geometry/lanes.h"
#include "shapes/shape.h"

namespace overlapper {

inline TwoLanes load(const double* p) {
  TwoLanes v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

template <class Lanes>
inline void store(double* p, const Lanes& v) {
  std::memcpy(p, &v, sizeof v);
}

/// A convex polytope, or some of its facets with the edges between these facets, as columns.
struct Solid {
  bool whole = false;
  int vertices = 0, facets = 0;
  int stride = 0;                          ///< number of facets, padded by planes with everything inside
  std::vector<double> x, y, z;             ///< of vertices
  std::vector<double> nx, ny, nz, offset;  ///< of planes
  std::vector<double> doubt;               ///< m: error of each vertex, beside the rounding of all numbers
  std::vector<int> owner;                  ///< of planes: number of the body
  std::span<const Edge> edges;
  std::vector<Edge> own_edges;  ///< memory for `edges`, unless the shape has them

  Vec3 vertex(int i) const { return {x[i], y[i], z[i]}; }
  Vec3 normal(int f) const { return {nx[f], ny[f], nz[f]}; }

  void resize(int vertex_count, int facet_count, double beyond) {
    vertices = vertex_count, facets = facet_count, stride = (facet_count + 3) / 4 * 4;
    const auto resize_each = [](int size, auto&... columns) { (columns.resize(size), ...); };
    resize_each(vertices, x, y, z);
    doubt.assign(vertices, 0);
    owner.resize(facets);
    resize_each(stride, nx, ny, nz, offset);
    for (int f = facets; f < stride; ++f) set_plane(f, {}, beyond);
  }
  void set_vertex(int i, Vec3 v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
  void set_plane(int f, Vec3 normal, double height) {
    nx[f] = normal.x, ny[f] = normal.y, nz[f] = normal.z, offset[f] = height;
  }
};

struct Ball {
  Vec3 centre;
  double radius;
};

/// A bounded polytope in the coordinates of `pose`, or a half-space. Planes that pad the stride are `beyond` away.
void set_solid(Solid& solid, const Placed& body, int owner, const Pose* pose, double beyond);

/// Keeps the planes and edges of a body that a ball reaches; false if the ball is outside one of the planes.
bool set_part(Solid& solid, const Placed& body, int owner, const Pose& pose, const Ball& ball, double beyond);

}  // namespace overlapper
