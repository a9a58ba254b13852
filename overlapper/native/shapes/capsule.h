#pragma once

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

struct Hull;

/// Around the local z axis; `length` is the distance between the centres of the caps.
struct Capsule : Bounded,
                 NotMitred,
                 Smooth,
                 CentredAtOrigin,
                 WithoutHullData,
                 NotStretched,
                 PolytopeCore,
                 BoundedBySupports<Capsule>,
                 EnclosedByBounds<Capsule>,
                 ReachesToCornerOfBounds<Capsule>,
                 WidePlanesAcrossAxes,
                 OrderedByFields<Capsule> {
  static constexpr const char* kName = "Capsule";
  static constexpr const char* kAbout =
      R"(All points within a distance of a segment on the z axis: a cylinder with half balls as ends.

Parameters
----------
radius : float
    Radius, m.
length : float
    Length between the centres of the half balls as in pybullet, m. It may be 0.

Examples
--------
>>> from overlapper import Capsule
>>> Capsule(0.1, 0.4).bounds.round(6).tolist()
[[-0.1, -0.1, -0.3], [0.1, 0.1, 0.3]])";
  static constexpr auto fields() {
    return std::tuple{Field{"radius", &Capsule::radius, "Radius, m."},
                      Field{"length", &Capsule::length, "Length between the centres of the half balls, m."}};
  }

  Capsule() = default;
  Capsule(double r, double l) : radius(r), length(l) {}
  /// Throws std::invalid_argument with one sentence that names the argument.
  static Capsule make(double radius, double length);

  Vec3 support(Vec3 d) const { return Vec3{0, 0, tangents::sign(d.z) * length / 2} + radius * unit(d); }
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  double core_radius() const { return radius; }
  Vec3 core_support(const Pose& pose, Vec3 direction) const {
    const Vec3 along = pose.rotation * Vec3{0, 0, length / 2};
    return pose.translation + (dot(along, direction) < 0 ? -along : along);
  }
  std::vector<Vec3> core_corners() const;
  void append_core_surface(const std::vector<char>& kept, CoreSurface& surface) const;
  std::optional<Revolution> revolution() const { return Revolution{radius, length / 2, true}; }

  double volume() const;
  double loose_radius() const { return radius + length; }
  double reach() const { return radius + length / 2; }
  void append_planes(std::vector<Plane>& planes) const { append_box({radius, radius, radius + length / 2}, planes); }

  WideVector wide_core_support(const WideVector& direction) const;
  WidePlane wide_ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const;

  void give_pieces(Cutter& cutter) const;
  Hull inscribed(double tolerance) const;

  double radius = 0, length = 0;
};

}  // namespace overlapper
