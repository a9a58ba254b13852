#pragma once

#include <algorithm>
#include <limits>
#include <numbers>

#include "shapes/choices.h"
#include "shapes/inscribed.h"
#include "shapes/limits.h"

namespace overlapper {

/// Around local z, its apex at length / 2 and its base at -length / 2: a shape that joins the core by this file alone.
struct Cone : Bounded,
              Smooth,
              WithoutHullData,
              NotCut,
              NotMitred,
              NotRevolved,
              NotStretched,
              CurvedCore,
              OwnCore<Cone>,
              BoundedBySupports<Cone>,
              EnclosedByBounds<Cone>,
              ReachesToCornerOfBounds<Cone>,
              WidePlanesAcrossAxes,
              OrderedByFields<Cone> {
  static constexpr const char* kName = "Cone";

  static constexpr const char* kAbout = "A cone of `radius` (m) and `length` (m) along local z, about its middle.";

  static constexpr auto fields() {
    return std::tuple{Field{"radius", &Cone::radius, "m"}, Field{"length", &Cone::length, "m"}};
  }

  Cone() = default;
  Cone(double r, double l) : radius(r), length(l) {}

  static Cone make(double radius, double length) {
    require_size(radius, "radius");
    require_size(length, "length");
    return {radius, length};
  }

  Vec3 support(Vec3 d) const {
    const double across = tangents::radial(d);
    if (d.z * length >= radius * across) return apex();
    if (!(across > 0)) return {radius, 0, -length / 2};
    return {radius * d.x / across, radius * d.y / across, -length / 2};
  }

  Plane ray_exit(Vec3 origin, Vec3 d) const {
    // The side is where |q + t d| = k (w - t d.z), for q across the axis and w how far it is below the apex.
    const double k = radius / length, w = length / 2 - origin.z, qq = origin.x * origin.x + origin.y * origin.y;
    const double a = d.x * d.x + d.y * d.y - k * k * d.z * d.z, c = std::min(0.0, qq - k * k * w * w);
    const double b = origin.x * d.x + origin.y * d.y + k * k * w * d.z, root = std::sqrt(std::max(0.0, b * b - a * c));
    const double to_side = b > 0 ? -c / (b + root) : a > 0 ? (root - b) / a : kNever;
    const double to_base = d.z < 0 ? (origin.z + length / 2) / -d.z : kNever;
    return to_base < to_side ? base() : side(origin + to_side * d);
  }

  Plane tightest(Vec3 point) const {
    const Plane beside = side(point);
    return signed_distance(beside, point) > signed_distance(base(), point) ? beside : base();
  }

  CoreKind core_kind() const { return CoreKind::kCurved; }

  Mat3 core_slope(Vec3 direction) const {
    const bool at_apex = direction.z * length >= radius * tangents::radial(direction);
    return at_apex ? Mat3{{}, {}, {}} : tangents::slope_of_circle(radius, direction);
  }

  double volume() const { return std::numbers::pi * radius * radius * length / 3; }

  Vec3 centroid() const { return {0, 0, -length / 4}; }

  double loose_radius() const { return 2 * radius + length; }

  double reach() const { return radius + length / 2; }

  void append_planes(std::vector<Plane>& planes) const { append_box({radius, radius, length / 2}, planes); }

  WideVector wide_core_support(const WideVector& d) const {
    const DoubleDouble across = norm(tangents::across(d));
    if (!(DoubleDouble{length} * d.z < DoubleDouble{radius} * across)) return wide(apex());
    if (!(across.head > 0)) return wide({radius, 0, -length / 2});
    return (DoubleDouble{radius} / across) * tangents::across(d) + WideVector{{}, {}, {-length / 2}};
  }

  WidePlane wide_ray_exit(const WideVector& origin, const WideVector& d) const {
    const DoubleDouble k = DoubleDouble{radius} / DoubleDouble{length}, kk = k * k;
    const DoubleDouble w = DoubleDouble{length / 2} - origin.z, zero{};
    const WideVector q = tangents::across(origin), e = tangents::across(d);
    const DoubleDouble a = dot(e, e) - kk * d.z * d.z, b = dot(q, e) + kk * w * d.z;
    DoubleDouble c = dot(q, q) - kk * w * w, square = b * b - a * c;
    if (c > zero) c = zero, square = b * b;
    const DoubleDouble root = sqrt(square);
    const DoubleDouble never{kNever};
    const DoubleDouble to_side = b > zero ? -c / (b + root) : a > zero ? (root - b) / a : never;
    const DoubleDouble to_base = d.z < zero ? (origin.z + DoubleDouble{length / 2}) / -d.z : never;
    return to_base < to_side ? wide_base() : wide_side(origin + to_side * d);
  }

  WidePlane wide_tightest(const WideVector& point, const WideTriangles&) const {
    const WidePlane beside = wide_side(point);
    return signed_distance(beside, point) > signed_distance(wide_base(), point) ? beside : wide_base();
  }

  Hull inscribed(double tolerance) const {
    std::vector<Vec3> points{apex()};
    append_circle(radius, -length / 2, corners_of_circle(tolerance, "cone"), points);
    return hull_within(points);
  }

  double radius = 0, length = 0;

 private:
  /// Larger than any way through a shape.
  static constexpr double kNever = 1e200;

  Vec3 apex() const { return {0, 0, length / 2}; }
  Plane base() const { return {{0, 0, -1}, length / 2}; }
  WidePlane wide_base() const { return {wide({0, 0, -1}), {length / 2}}; }

  /// The plane through the apex that is tangent on the side of a point.
  Plane side(Vec3 point) const {
    const double across = tangents::radial(point);
    const Vec3 outward = across > 0 ? Vec3{point.x / across, point.y / across, 0} : Vec3{1, 0, 0};
    const Vec3 normal = unit(length * outward + Vec3{0, 0, radius});
    return {normal, normal.z * (length / 2)};
  }
  WidePlane wide_side(const WideVector& point) const {
    const WideVector beside = tangents::across(point);
    const WideVector outward = norm(beside).head > 0 ? unit(beside) : tangents::wide_axis(0);
    const WideVector normal = unit(DoubleDouble{length} * outward + WideVector{{}, {}, {radius}});
    return {normal, normal.z * DoubleDouble{length / 2}};
  }
};

}  // namespace overlapper

#define OVERLAPPER_MORE_KINDS , Cone
