#pragma once

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

struct Hull;

/// About the origin, its axes along x, y and z: a stretched ball.
struct Ellipsoid : Bounded,
                   NotMitred,
                   Smooth,
                   CentredAtOrigin,
                   WithoutHullData,
                   BoundedBySupports<Ellipsoid>,
                   EnclosedByBounds<Ellipsoid>,
                   ReachesToCornerOfBounds<Ellipsoid>,
                   WidePlanesAcrossAxes,
                   OrderedByFields<Ellipsoid> {
  static constexpr const char* kName = "Ellipsoid";
  static constexpr const char* kAbout =
      R"(An ellipsoid about the origin: all points with (x / a)² + (y / b)² + (z / c)² <= 1.

An ellipsoid with equal half axes gives the results of the sphere. With a box, a hull or a half-space, an ellipsoid is
measured as the affine image of a ball. With other round bodies, it is measured between polytopes, as closely as
`tolerance` demands.

Parameters
----------
half_axes : (3,) array_like
    Half axes a, b, c along x, y, z, m.

Examples
--------
>>> from overlapper import Ellipsoid
>>> round(Ellipsoid([0.1, 0.1, 0.2]).volume, 6)
0.008378)";
  static constexpr auto fields() { return std::tuple{Field{"half_axes", &Ellipsoid::half_axes, "(3,) half axes, m."}}; }

  Ellipsoid() = default;
  explicit Ellipsoid(Vec3 h) : half_axes(h) {}
  /// Throws std::invalid_argument with one sentence that names the argument.
  static Ellipsoid make(Vec3 half_axes);

  /// An ellipsoid with equal axes gives the answers of a sphere.
  bool ball() const { return half_axes.x == half_axes.y && half_axes.y == half_axes.z; }

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
  /// The supporting plane whose normal is along `outward`.
  Plane supporting(Vec3 outward) const;
  /// The outward unit normals where the distance between the point and the surface has a local minimum. The first is at
  /// the nearest point. A second minimum may lie across the shortest axis.
  std::vector<Vec3> ways_out(Vec3 point) const;

  CoreKind core_kind() const { return ball() ? CoreKind::kPolytope : CoreKind::kCurved; }
  double core_radius() const { return ball() ? half_axes.x : 0; }
  Vec3 core_support(const Pose& pose, Vec3 direction) const {
    return ball() ? pose.translation : pose * support(apply_transposed(pose.rotation, direction));
  }
  Mat3 core_slope(Vec3 direction) const;
  std::vector<Vec3> core_corners() const { return {{}}; }
  void append_core_surface(const std::vector<char>&, CoreSurface&) const {}
  std::optional<Revolution> revolution() const {
    return ball() ? std::optional(Revolution{half_axes.x, 0, true}) : std::nullopt;
  }
  const Ellipsoid* stretched() const { return ball() ? nullptr : this; }

  double volume() const;
  double loose_radius() const { return half_axes.x + half_axes.y + half_axes.z; }
  double reach() const { return max_component(half_axes); }
  void append_planes(std::vector<Plane>& planes) const { append_box(half_axes, planes); }

  WideVector wide_core_support(const WideVector& direction) const;
  WidePlane wide_ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const;

  void give_pieces(Cutter& cutter) const;
  Hull inscribed(double tolerance) const;

  Vec3 half_axes;
};

}  // namespace overlapper
