#include "overlap/revolved_surface.h"

#include <algorithm>
#include <cmath>

#include "geometry/constants.h"
#include "methods/round/quadric/gauss.h"

namespace overlapper {
namespace {

void add(SurfaceSums& sums, double weight, const SurfaceSums& more) {
  sums.distance += weight * more.distance, sums.moment += weight * more.moment;
  sums.by_radius += weight * more.by_radius, sums.by_length += weight * more.by_length;
  sums.area += weight * more.area;
}

/// Coordinates q are those of the body, about its position, divided by the half axes of an ellipsoid.
class RevolvedSurface {
 public:
  RevolvedSurface(const Placed& body, const Placed& other, Vec3 inside, std::span<const BorderNode> border)
      : rotation_(body.pose.rotation), other_(other.seen_from(inside)) {
    if (const Ellipsoid* ellipsoid = stretched(body.shape)) {
      scale_ = ellipsoid->half_axes;
    } else {
      const Revolution of = *revolution(body.shape);
      radius_ = of.radius, half_length_ = of.half_length, round_ends_ = of.round_ends;
    }
    inside_ = own(inside - body.position);
    for (const BorderNode& node : border) border_.push_back({inside_ + own(node.place), own(node.step), {}});
  }

  SurfaceSums sums() {
    choose_axis();
    const bool begin_within = within(1), end_within = within(-1);
    const double far = norm(border_upper_ - border_lower_);
    const bool apart = nearest(1) > far;
    begin_ = 0;
    if (!border_.empty() && !begin_within && !end_within && apart) {
      double least = kInfinity, most = -kInfinity;
      for (const BorderNode& node : border_) {
        const double s = parameter(node.place);
        least = std::min(least, s), most = std::max(most, s);
      }
      begin_ = least / 2 + most / 2;
    }
    SurfaceSums found;
    for (const BorderNode& node : border_) {
      const Vec3 away = node.place - dot(axis_, node.place) * axis_;
      const double square = norm2(away);
      if (!(square > 0)) continue;
      const double s = parameter(node.place);
      if (!round_ends_ && s > 2) {
        add_on_far_end(node, away, found);
        continue;
      }
      const double angle = dot(axis_, cross(away, node.step)) / square;
      add(found, angle, along_meridian(away / std::sqrt(square), s));
    }
    if (end_within) {
      const Vec3 u = any_orthogonal(axis_), v = cross(axis_, u);
      constexpr int kMeridians = 8;  // exact for polynomials up to the seventh degree
      for (int i = 0; i < kMeridians; ++i) {
        const double angle = 2 * kPi * i / kMeridians;
        add(found, 2 * kPi / kMeridians, along_meridian(std::cos(angle) * u + std::sin(angle) * v, kEnd));
      }
    }
    return found;
  }

 private:
  static constexpr double kEnd = 3;

  /// A point of a meridian: place and normal across and along the axis, and the length per parameter.
  struct Point {
    double across, along, normal_across, normal_along, speed;
  };

  Vec3 own(Vec3 v) const {
    const Vec3 turned = apply_transposed(rotation_, v);
    return {turned.x / scale_.x, turned.y / scale_.y, turned.z / scale_.z};
  }
  Vec3 pole(double side) const {
    const Vec3 on_axis = side * (half_length_ + (round_ends_ ? radius_ : 0)) * axis_;
    return side < 0 ? on_axis + aside_ : on_axis;
  }
  double nearest(double side) const {
    double square = kInfinity;
    for (const BorderNode& node : border_) square = std::min(square, norm2(node.place - pole(side)));
    return std::sqrt(square);
  }
  /// Whether the other body has a pole.
  bool within(double side) const {
    const Vec3 x = rotation_ * scaled(scale_, pole(side) - inside_);
    return !(signed_distance(other_.ray_exit({}, x), x) > 0);
  }

  /// Adds a node on the flat end where meridians end. They go on from its rim to the pole by straight lines.
  void add_on_far_end(const BorderNode& node, Vec3 away, SurfaceSums& sums) const {
    const Vec3 out = away - aside_;
    const double distance = norm(out);
    if (!(distance > 0)) return;
    const Vec3 u = out / distance;
    const double middle = dot(aside_, u);
    const double rim = std::sqrt(middle * middle + radius_ * radius_ - norm2(aside_)) - middle;
    const Vec3 at_rim = aside_ + rim * u;
    const double angle = dot(axis_, cross(out, node.step)) / (distance * distance);
    add(sums, angle * rim / dot(at_rim, u), along_meridian(at_rim / radius_, 2));
    const double half = (rim - distance) / 2;
    for (int i = 0; i < 16; ++i) {
      const double far = distance + half * (1 + gauss_node(i));
      const Vec3 place = aside_ + far * u - half_length_ * axis_;
      add_point(place, -axis_, angle * far * half * quadric::kGaussWeight[i / 2], sums);
    }
  }

  void choose_axis() {
    for (const BorderNode& node : border_) {
      border_lower_ = min(border_lower_, node.place), border_upper_ = max(border_upper_, node.place);
    }
    axis_ = {0, 0, 1};
    if (half_length_ > 0 || !round_ends_) {
      if (nearest(-1) < nearest(1)) axis_ = -axis_;
      if (!round_ends_) choose_end();
      return;
    }
    // Towards the common set, or else wherever the border is farthest from the end.
    constexpr double kFar = 0.3;
    if (norm2(inside_) > 0) axis_ = unit(inside_);
    double farthest = nearest(-1);
    Vec3 best = axis_;
    for (int i = 0; i < 27 && !(farthest > kFar * radius_); ++i) {
      if (i == 13) continue;
      axis_ = unit(Vec3{i % 3 - 1.0, i / 3 % 3 - 1.0, i / 9 - 1.0});
      if (nearest(-1) > farthest) farthest = nearest(-1), best = axis_;
    }
    axis_ = best;
  }

  /// The pole in the far end of a cylinder, wherever the border is farthest from it.
  void choose_end() {
    const Vec3 u = any_orthogonal(axis_), v = cross(axis_, u);
    double farthest = nearest(-1);
    Vec3 best;
    for (int i = 0; i < 8 && farthest < radius_; ++i) {
      aside_ = 0.6 * radius_ * (std::cos(i * kPi / 4) * u + std::sin(i * kPi / 4) * v);
      if (nearest(-1) > farthest) farthest = nearest(-1), best = aside_;
    }
    aside_ = best;
  }

  static double gauss_node(int i) { return (i % 2 == 0 ? -1 : 1) * quadric::kGaussNode[i / 2]; }

  /// From 0 to 1 on the end where meridians begin, to 2 on the side, and to 3 on the other end.
  Point point(double s) const {
    const double quarter = kPi / 2;
    if (s >= 1 && s <= 2) return {radius_, half_length_ * (3 - 2 * s), 1, 0, 2 * half_length_};
    const double side = s < 1 ? 1 : -1, t = s < 1 ? s : kEnd - s;
    if (!round_ends_) return {radius_ * t, side * half_length_, 0, side, radius_};
    const double sine = std::sin(quarter * t), cosine = std::cos(quarter * t);
    return {radius_ * sine, side * (half_length_ + radius_ * cosine), sine, side * cosine, quarter * radius_};
  }

  double parameter(Vec3 q) const {
    const double along = dot(axis_, q), across = norm(q - along * axis_), beyond = std::abs(along) - half_length_;
    double t = 1;
    if (round_ends_ && beyond > 0) t = std::atan2(across, beyond) / (kPi / 2);
    if (!round_ends_ && std::abs(beyond) < std::abs(across - radius_)) t = std::min(1.0, across / radius_);
    if (t < 1) return along > 0 ? t : kEnd - t;
    return half_length_ > 0 ? std::clamp(1.5 - along / half_length_ / 2, 1.0, 2.0) : 1;
  }

  /// The integral along the meridian in a direction from the axis, per angle.
  SurfaceSums along_meridian(Vec3 direction, double end) const {
    SurfaceSums found;
    double from = begin_;
    const double sign = end < from ? -1 : 1;
    while (from != end) {
      const double next = sign > 0 ? std::floor(from) + 1 : std::ceil(from) - 1;
      const double to = sign > 0 ? std::min(end, next) : std::max(end, next);
      const double middle = from / 2 + to / 2, half = (to - from) / 2;
      for (int i = 0; i < 16; ++i) {
        const Point at = point(middle + half * gauss_node(i));
        const double area = half * quadric::kGaussWeight[i / 2] * at.speed * at.across;
        add_point(at.across * direction + at.along * axis_, at.normal_across * direction + at.normal_along * axis_,
                  area, found);
      }
      from = to;
    }
    return found;
  }

  void add_point(Vec3 place, Vec3 normal, double area, SurfaceSums& sums) const {
    const Vec3 q = place - inside_, x = rotation_ * scaled(scale_, q);
    const double distance = scale_.x * scale_.y * scale_.z * area * dot(q, normal);
    sums.distance += distance, sums.moment += distance * x;
    sums.by_radius += area * x, sums.by_length += area / 2 * std::abs(dot(axis_, normal)) * x;
    sums.area += area;
  }

  Mat3 rotation_;
  Placed other_;  ///< about the inner point
  Vec3 scale_{1, 1, 1};
  double radius_ = 1, half_length_ = 0;
  bool round_ends_ = true;
  Vec3 inside_;
  std::vector<BorderNode> border_;
  Vec3 border_lower_{kInfinity, kInfinity, kInfinity}, border_upper_{-kInfinity, -kInfinity, -kInfinity};
  Vec3 axis_;
  Vec3 aside_;        ///< of the pole where meridians of a cylinder end, from the axis
  double begin_ = 0;  ///< where meridians begin
};

}  // namespace

SurfaceSums revolved_surface(const Placed& body, const Placed& other, Vec3 inside, std::span<const BorderNode> border) {
  return RevolvedSurface(body, other, inside, border).sums();
}

}  // namespace overlapper
