#pragma once

#include "shapes/choices.h"
#include "shapes/hull_data.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

class Mesh;
struct Solid;

/// The convex hull of points; shared, and constant once built.
struct Hull : Bounded,
              Flat,
              NotRevolved,
              NotStretched,
              PolytopeCore,
              OwnCore<Hull>,
              BoundedBySupports<Hull>,
              EnclosedByBounds<Hull> {
  static constexpr const char* kName = "Hull";
  static constexpr const char* kAbout = R"(The convex hull of points.

Points may lie inside the hull, occur twice or be coplanar. Coplanar triangles become one facet.

Parameters
----------
vertices : (n, 3) array_like
    Four points or more, m.

Raises
------
ValueError
    If there are fewer than four points, a point is not finite, or all points lie in one plane.

Examples
--------
>>> from overlapper import Hull
>>> round(Hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]).volume, 6)
0.166667)";

  Hull() = default;
  explicit Hull(std::shared_ptr<const HullData> hull) : data(std::move(hull)) {}

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  const HullData* polytope() const { return data.get(); }
  std::vector<Vec3> core_corners() const { return data->corners; }
  void append_core_surface(const std::vector<char>& kept, CoreSurface& surface) const {
    overlapper::append_core_surface(*data, kept, surface);
  }

  double volume() const { return data->volume; }
  Vec3 centroid() const { return data->centroid; }
  double bounding_radius() const { return data->radius; }
  double loose_radius() const { return data->radius; }
  double reach() const { return data->radius; }
  void append_planes(std::vector<Plane>& planes) const {
    planes.insert(planes.end(), data->planes.begin(), data->planes.end());
  }
  std::partial_ordering order(const Hull& other) const { return order_of(*data, *other.data); }

  int vertex_count() const { return static_cast<int>(data->vertices.size()); }
  int facet_count() const { return static_cast<int>(data->planes.size()); }
  Vec3 vertex(int i) const { return data->vertices[i]; }
  Plane facet(int f) const { return data->planes[f]; }
  std::span<const int> ring(int f) const { return data->facet(f); }
  std::span<const Edge> edges() const { return data->edges; }
  bool edges_known() const { return !data->edges.empty(); }
  std::optional<WidePlane> wide_facet(int f) const;
  std::optional<WidePlane> unit_facet(int f) const;
  bool has_graph() const { return data->graph != nullptr; }
  void place(Solid& solid, const Pose* pose, double beyond) const;
  void give(Mesh& mesh) const;

  WideVector wide_core_support(const WideVector& direction) const { return farthest_corner(*data, direction); }
  WidePlane wide_tightest(const WideVector& point, const WideTriangles& triangles) const {
    return triangles.tightest(point);
  }
  void append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) const;

  /// m: bound of the distance of corners from the planes of their facets; 0 if exact numbers give every facet.
  double unexact() const;
  /// The plane of a facet through three of its corners, exactly. Other corners may be off the plane by the flatness.
  WidePlane plane_through_corners(int f) const;
  void give_pieces(Cutter& cutter) const;
  bool give_mitred(Cutter& cutter) const { return give_pieces(cutter), true; }
  Hull inscribed(double) const { return *this; }

  std::shared_ptr<const HullData> data;
};

/// Interior, duplicate, collinear and coplanar points are allowed; coplanar triangles become one facet. Throws
/// std::invalid_argument with one sentence that names the argument.
inline Hull make_hull(std::span<const Vec3> points) { return Hull(hull_of_vertices(points)); }

}  // namespace overlapper
