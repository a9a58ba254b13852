#pragma once

#include <cmath>

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

class Mesh;
struct Solid;

/// { x : dot(plane.normal, x) <= plane.offset }. Unbounded: its support is infinite in all directions but one.
struct HalfSpace : Flat,
                   WithoutHullData,
                   CutByFacets<HalfSpace>,
                   NotRevolved,
                   NotStretched,
                   PolytopeCore,
                   OrderedByFields<HalfSpace> {
  static constexpr bool kBounded = false;
  static constexpr const char* kName = "HalfSpace";
  static constexpr const char* kAbout = R"(The closed half-space of all points x with normal · x <= offset.

The half-space is exactly that of the given numbers. The attributes `normal` and `offset` are divided by the length of
the normal, which rounds.

Parameters
----------
normal : (3,) array_like
    Normal out of the solid, of any length but 0.
offset : float
    Offset along the normal as given, m if the normal has length 1.

Examples
--------
>>> from overlapper import HalfSpace, Placed, Sphere, distance
>>> distance(Placed(Sphere(0.1), (0, 0, 1)), HalfSpace([0, 0, 1], 0))
0.9)";
  static constexpr auto fields() {
    return std::tuple{Field{"normal", &HalfSpace::given_normal, "(3,) as given, of any length"},
                      Field{"offset", &HalfSpace::given_offset, "As given, along the normal as given."}};
  }

  HalfSpace() = default;
  HalfSpace(const Plane& p, Vec3 normal, double offset) : plane(p), given_normal(normal), given_offset(offset) {}
  /// Throws std::invalid_argument with one sentence that names the argument.
  static HalfSpace make(Vec3 normal, double offset);

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3, Vec3) const { return plane; }
  Plane tightest(Vec3) const { return plane; }

  double core_radius() const { return 0; }
  Vec3 core_support(const Pose& pose, Vec3 direction) const {
    return pose * support(apply_transposed(pose.rotation, direction));
  }
  std::vector<Vec3> core_corners() const { return {{}}; }
  void append_core_surface(const std::vector<char>&, CoreSurface&) const {}

  double volume() const;
  Vec3 centroid() const { return plane.offset * plane.normal; }
  double bounding_radius() const { return std::abs(plane.offset); }
  double loose_radius() const { return std::abs(plane.offset); }
  double reach() const { return std::abs(plane.offset); }
  Bounds bounds(const Pose& pose) const;
  Bounds enclosing_box(const Pose& pose) const { return bounds(pose); }
  void append_planes(std::vector<Plane>& planes) const { planes.push_back(plane); }

  int vertex_count() const { return 0; }
  int facet_count() const { return 1; }
  Vec3 vertex(int) const { return {}; }
  Plane facet(int) const { return plane; }
  std::span<const int> ring(int) const { return {}; }
  std::span<const Edge> edges() const { return {}; }
  bool edges_known() const { return true; }
  std::optional<WidePlane> wide_facet(int) const { return WidePlane{wide(given_normal), {given_offset}}; }
  std::optional<WidePlane> unit_facet(int) const;
  bool has_graph() const { return false; }
  void place(Solid& solid, const Pose* pose, double beyond) const;
  void give(Mesh&) const {}

  /// The point of the plane that is nearest to the origin. Only the direction of the normal has a farthest point.
  WideVector wide_core_support(const WideVector&) const;
  WidePlane wide_tightest(const WideVector&, const WideTriangles&) const;
  void append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes) const;

  Plane plane;
  Vec3 given_normal;  ///< as given, of any length, for wider arithmetic: normalizing rounds
  double given_offset = 0;
};

}  // namespace overlapper
