#pragma once

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

class Mesh;
struct Hull;
struct Solid;

struct Box : Bounded,
             Flat,
             CentredAtOrigin,
             WithoutHullData,
             CutByFacets<Box>,
             NotRevolved,
             NotStretched,
             PolytopeCore,
             OwnCore<Box>,
             BoundedBySupports<Box>,
             WidePlanesAcrossAxes,
             OrderedByFields<Box> {
  static constexpr const char* kName = "Box";
  static constexpr const char* kAbout = R"(A box about the origin.

Parameters
----------
half_extents : (3,) array_like
    Half of the side lengths along x, y, z, m.

Examples
--------
>>> from overlapper import Box
>>> Box([0.5, 0.5, 1.0]).volume
2.0)";
  static constexpr auto fields() {
    return std::tuple{Field{"half_extents", &Box::half_extents, "(3,) half of the side lengths, m."}};
  }

  Box() = default;
  explicit Box(Vec3 h) : half_extents(h) {}
  /// Throws std::invalid_argument with one sentence that names the argument.
  static Box make(Vec3 half_extents);

  Vec3 support(Vec3 d) const {
    return {std::copysign(half_extents.x, d.x), std::copysign(half_extents.y, d.y), std::copysign(half_extents.z, d.z)};
  }
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  double volume() const { return 8 * half_extents.x * half_extents.y * half_extents.z; }
  double bounding_radius() const { return norm(half_extents); }
  double loose_radius() const { return half_extents.x + half_extents.y + half_extents.z; }
  double reach() const { return norm(half_extents); }
  Bounds enclosing_box(const Pose& pose) const {
    const Mat3& r = pose.rotation;
    const Vec3 h = half_extents, reach{dot(abs(r.row0), h), dot(abs(r.row1), h), dot(abs(r.row2), h)};
    return {pose.translation - reach, pose.translation + reach};
  }
  void append_planes(std::vector<Plane>& planes) const { append_box(half_extents, planes); }

  /// Corners and sides by number. Bit k of a corner's number is its side of axis k. Sides 2 k and 2 k + 1 are across
  /// axis k.
  int vertex_count() const { return 8; }
  int facet_count() const { return 6; }
  Vec3 vertex(int i) const {
    const Vec3 h = half_extents;
    return {i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z};
  }
  Plane facet(int f) const {
    const double sign = f & 1 ? 1 : -1;
    const int k = f / 2;
    return {{k == 0 ? sign : 0, k == 1 ? sign : 0, k == 2 ? sign : 0}, half_extents[k]};
  }
  std::span<const int> ring(int f) const;
  std::span<const Edge> edges() const;
  bool edges_known() const { return true; }
  std::optional<WidePlane> wide_facet(int f) const {
    return WidePlane{wide((f & 1 ? 1.0 : -1.0) * tangents::axis(f / 2)), {half_extents[f / 2]}};
  }
  std::optional<WidePlane> unit_facet(int f) const { return WidePlane{wide(facet(f).normal), {facet(f).offset}}; }
  bool has_graph() const { return true; }
  void place(Solid& solid, const Pose* pose, double beyond) const;
  void give(Mesh& mesh) const;

  std::vector<Vec3> core_corners() const;
  void append_core_surface(const std::vector<char>& kept, CoreSurface& surface) const;
  WideVector wide_core_support(const WideVector& direction) const;
  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const;

  Hull inscribed(double tolerance) const;

  Vec3 half_extents;
};

}  // namespace overlapper
