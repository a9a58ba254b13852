#pragma once

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

struct Hull;

/// Around the local z axis.
struct Cylinder : Bounded,
                  NotMitred,
                  Smooth,
                  CentredAtOrigin,
                  WithoutHullData,
                  NotStretched,
                  CurvedCore,
                  OwnCore<Cylinder>,
                  BoundedBySupports<Cylinder>,
                  EnclosedByBounds<Cylinder>,
                  ReachesToCornerOfBounds<Cylinder>,
                  WidePlanesAcrossAxes,
                  OrderedByFields<Cylinder> {
  static constexpr const char* kName = "Cylinder";
  static constexpr const char* kAbout = R"(A cylinder about the origin, along the z axis.

Parameters
----------
radius : float
    Radius, m.
length : float
    Length along z, m.

Examples
--------
>>> from overlapper import Cylinder
>>> round(Cylinder(0.1, 0.4).volume, 6)
0.012566)";
  static constexpr auto fields() {
    return std::tuple{Field{"radius", &Cylinder::radius, "Radius, m."},
                      Field{"length", &Cylinder::length, "Length along z, m."}};
  }

  Cylinder() = default;
  Cylinder(double r, double l) : radius(r), length(l) {}
  /// Throws std::invalid_argument with one sentence that names the argument.
  static Cylinder make(double radius, double length);

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  CoreKind core_kind() const { return CoreKind::kRims; }
  Mat3 core_slope(Vec3 direction) const { return tangents::slope_of_circle(radius, direction); }
  std::optional<Revolution> revolution() const { return Revolution{radius, length / 2, false}; }

  double volume() const;
  double loose_radius() const { return radius + length; }
  double reach() const { return radius + length / 2; }
  void append_planes(std::vector<Plane>& planes) const { append_box({radius, radius, length / 2}, planes); }

  WideVector wide_core_support(const WideVector& direction) const;
  WidePlane wide_ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const;

  void give_pieces(Cutter& cutter) const;
  Hull inscribed(double tolerance) const;

  double radius = 0, length = 0;
};

}  // namespace overlapper
