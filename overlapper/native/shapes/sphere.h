#pragma once

#include "shapes/choices.h"
#include "shapes/wide_triangles.h"

namespace overlapper {

struct Hull;

struct Sphere : Bounded,
                NotMitred,
                Smooth,
                CentredAtOrigin,
                WithoutHullData,
                NotStretched,
                PointCore,
                BoundedBySupports<Sphere>,
                EnclosedByBounds<Sphere>,
                ReachesToCornerOfBounds<Sphere>,
                WidePlanesAcrossAxes,
                OrderedByFields<Sphere> {
  static constexpr const char* kName = "Sphere";
  static constexpr const char* kAbout = R"(A ball about the origin.

Parameters
----------
radius : float
    Radius, m.

Examples
--------
>>> from overlapper import Sphere
>>> round(Sphere(0.5).volume, 6)
0.523599)";
  static constexpr auto fields() { return std::tuple{Field{"radius", &Sphere::radius, "Radius, m."}}; }

  Sphere() = default;
  explicit Sphere(double r) : radius(r) {}
  /// Throws std::invalid_argument with one sentence that names the argument.
  static Sphere make(double radius);

  Vec3 support(Vec3 direction) const { return radius * unit(direction); }
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  double core_radius() const { return radius; }
  std::optional<Revolution> revolution() const { return Revolution{radius, 0, true}; }

  double volume() const;
  double loose_radius() const { return radius; }
  double reach() const { return radius; }
  void append_planes(std::vector<Plane>& planes) const { append_box({radius, radius, radius}, planes); }

  WidePlane wide_ray_exit(const WideVector& origin, const WideVector& direction) const;
  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const;

  void give_pieces(Cutter& cutter) const;
  Hull inscribed(double tolerance) const;

  double radius = 0;
};

}  // namespace overlapper
