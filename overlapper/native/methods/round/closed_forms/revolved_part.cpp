#include "methods/round/closed_forms/revolved_part.h"

#include <algorithm>

#include "geometry/constants.h"
#include "methods/round/quadric/shallow_ball.h"

namespace overlapper::closed_forms {
namespace {

RevolvedPart half_ball(double r) {
  const double volume = 2 * kPi / 3 * r * r * r;
  return {volume, {3 * r / 8 * volume, 0, 0}, 0, {}, 2 * kPi * r * r, volume};
}

/// Up to this depth, relative to the radius, a part of a half ball lies within 75° of the place that it is seen from.
constexpr double kShallowHalf = 0.2;

/// Like half_ball_below(), for a shallow part. It is seen from the line where the plane meets x = 0, `edge` deep in the
/// ball.
RevolvedPart shallow_half_ball_below(double r, double sine, double cosine, double cut_radius, double edge) {
  quadric::ShallowBall ball(r, edge);
  // Along the line, then −x, then −y.
  const double width = std::sqrt(edge * (2 * r - edge));
  const Vec3 begin{-width, 0, 0}, end{width, 0, 0}, way{1, 0, 0};
  ball.begin_face({0, 1, 0}, 0, r);
  ball.add_chord(end, begin);
  ball.add_arc(begin, end, way);
  ball.end_face();
  ball.begin_face({0, -sine, -cosine}, 0, cut_radius);
  ball.add_chord(begin, end);
  ball.add_arc(end, begin, -way);
  RevolvedPart part;
  part.flat_area = ball.end_face();
  part.volume = ball.volume();
  const auto about_centre = [&](Vec3 first, double of) { return Vec3{-first.y, -first.z - of * (r - edge), 0}; };
  part.moment = about_centre(ball.first(), part.volume);
  part.flat_moment = about_centre(ball.face_first(), part.flat_area);
  part.curved_area = ball.curved_area();
  part.scale = ball.error() / kSummation;
  return part;
}

/// The part of the half ball x >= 0 where sine * x + cosine * y <= t; `cosine` >= 0. The plane is `height` = r + t
/// into the ball, and `edge` = r cosine + t into its disc, times the cosine.
RevolvedPart half_ball_below(double r, double sine, double cosine, double t, double height, double edge) {
  if (t >= r) return half_ball(r);
  if (height <= 0) return {};
  const Vec3 direction{sine, cosine, 0};
  const double rho = std::sqrt((r - t) * height);
  if (edge <= 0 || t >= r * cosine) {
    // The circle of the cut lies on one side of x = 0.
    if (t == 0 && sine < 0) return cap(r, r, direction);
    if (t * sine < 0) return t >= 0 ? half_ball(r) : RevolvedPart{};
    if (t < 0) return cap(r, height, direction);
    RevolvedPart rest = half_ball(r);
    const RevolvedPart removed = cap(r, r - t, -direction);
    rest.volume -= removed.volume;
    rest.moment -= removed.moment;
    rest.flat_area = removed.flat_area;
    rest.flat_moment = removed.flat_moment;
    rest.curved_area -= removed.curved_area;
    return rest;
  }
  if (height <= kShallowHalf * r) return shallow_half_ball_below(r, sine, cosine, rho, edge / cosine);
  // Half the angle of the cut's arc, half the angle of the arc on x = 0, and the exterior angle of the spherical part
  // where they meet. All three come from the same root, so that its rounding error cancels in the sum.
  const double root = std::sqrt((r * cosine - t) * edge);
  const double arc = std::atan2(root, -t * sine), base_arc = std::atan2(root, -t);
  const double exterior = std::atan2(root, -sine * r);
  // The theorem of Gauss and Bonnet.
  const double spherical = r * r * (2 * kPi - 2 * exterior) + 2 * r * t * arc;
  // Segments of discs: the area, and the second moment about the disc's centre. This moment is that of a sector minus
  // that of a triangle.
  const double width = root / cosine;
  const auto segment = [width](double radius, double half_angle, double over) {
    const double area = radius * radius * half_angle - over * width;
    const double second =
        radius * radius * radius * radius * half_angle / 2 - over * width * (3 * over * over + width * width) / 6;
    return std::pair(area, second);
  };
  const auto [cut, cut_second] = segment(rho, arc, -t * sine / cosine);
  const auto [base, base_second] = segment(r, base_arc, -t / cosine);
  RevolvedPart part;
  part.volume = (r * spherical + t * cut) / 3;
  // ∫ x dV = ½ ∮ |x|² dA, and the area vectors of a closed surface sum to zero.
  const Vec3 along{1, 0, 0};
  part.moment =
      (r * r * (base * along - cut * direction) + (t * t * cut + cut_second) * direction - base_second * along) / 2;
  part.flat_area = cut;
  part.flat_moment = cut * t * direction + 2.0 / 3.0 * width * width * width * Vec3{cosine, -sine, 0};
  part.curved_area = spherical;
  part.scale = 2 * kPi * r * r * r;
  return part;
}

struct CylinderBelow {
  RevolvedPart part;
  double lower_end, upper_end;  ///< m²: remaining area of the flat ends
};

/// The part of the cylinder |x| <= h, y² + z² <= r², where sine * x + cosine * y <= t; both are >= 0. Slices of
/// constant y are rectangles of width 2 √(r² − y²). Their length falls from 2 h to 0 while y crosses the cut. With y =
/// −r cos θ, every integrand is a trigonometric polynomial. `enter` and `leave` are as in PlaneCut.
CylinderBelow cylinder_below(double r, double h, double sine, double cosine, double enter, double leave) {
  CylinderBelow result{{}, 0, 0};
  RevolvedPart& part = result.part;
  if (leave <= 0) return result;
  const double across = 2 * r * cosine;
  const double full = enter >= across ? kPi : enter <= 0 ? 0 : angle_at(r, enter / cosine);
  integrate(0, full, [&](double angle, double, double weight) {
    const double y = -r * std::cos(angle), chord = 2 * r * std::sin(angle) * r * std::sin(angle);
    const double volume = weight * 2 * h * chord;
    part.volume += volume;
    part.moment.y += volume * y;
    part.curved_area += weight * 4 * r * h;
    result.upper_end += weight * chord;
  });
  result.lower_end = result.upper_end;
  if (enter >= across) return result;

  const double start = enter <= 0 ? 0 : enter / cosine;
  const double length = enter <= 0 ? leave / sine : 2 * h;
  const bool open = leave >= across;
  if (sine == 0) {
    // The cut is parallel to the axis: a rectangle.
    part.flat_area = 4 * h * std::sqrt(std::max(0.0, start * (2 * r - start)));
    part.flat_moment.y = part.flat_area * (start - r);
    return result;
  }
  // If only rounding keeps the cut from the far side, the rest is empty, and the formula for the rest is 0 / 0.
  const double rest = kPi - full;
  const double width =
      open ? rest : std::min(rest, angle_between(r, start, (enter <= 0 ? leave : 2 * sine * h) / cosine));
  integrate(full, width, [&](double angle, double advance, double weight) {
    const double y = -r * std::cos(angle), chord = 2 * r * std::sin(angle) * r * std::sin(angle);
    const double risen = 2 * r * std::sin(angle - advance / 2) * std::sin(advance / 2);
    const double here = std::max(0.0, length - cosine / sine * risen);
    const double volume = weight * here * chord;
    part.volume += volume;
    part.moment += volume * Vec3{here / 2 - h, y, 0};
    part.curved_area += weight * 2 * r * here;
    result.lower_end += weight * chord;
    const double cut = weight * chord / sine;
    part.flat_area += cut;
    part.flat_moment += cut * Vec3{here - h, y, 0};
  });
  return result;
}

}  // namespace

RevolvedPart cap(double r, double h, Vec3 direction) {
  const double disc = kPi * h * (2 * r - h);
  const double volume = kPi / 3 * h * h * (3 * r - h);
  const double depth = 0.75 * (2 * r - h) * (2 * r - h) / (3 * r - h);
  return {volume, -volume * depth * direction, disc, disc * (h - r) * direction, 2 * kPi * r * h, volume};
}

double angle_at(double r, double risen) {
  return std::atan2(std::sqrt(std::max(0.0, risen * (2 * r - risen))), r - risen);
}

double angle_between(double r, double risen, double more) {
  const double y = risen - r, end = y + more;
  const double p = std::sqrt(risen * (2 * r - risen));
  const double q = std::sqrt(std::max(0.0, (risen + more) * (2 * r - risen - more)));
  const double sine = y * end > 0 ? more * (y + end) / (end * p + y * q) : (end * p - y * q) / (r * r);
  return std::atan2(sine, (p * q + y * end) / (r * r));
}

PlaneCut cut_of(const Revolved& body, const WideAxis& at, const WidePlane& plane) {
  const DoubleDouble r{body.radius}, h{body.half_length}, t = -signed_distance(plane, at.centre);
  if (body.ball()) return {0, 1, t.head, (r + t).head, (r + t).head, 0, 0};
  const DoubleDouble along = dot(at.axis, plane.normal), sine = abs(along);
  const DoubleDouble cosine = norm(plane.normal - along * at.axis), beside = t + r * cosine, ahead = sine * h;
  return {sine.head,
          cosine.head,
          t.head,
          (r + t - ahead).head,
          (r + t + ahead).head,
          (beside - ahead).head,
          (beside + ahead).head};
}

RevolvedPart below(const Revolved& body, const PlaneCut& cut) {
  const double r = body.radius, h = body.half_length, t = cut.offset;
  if (!body.round) {
    CylinderBelow cylinder = cylinder_below(r, h, cut.sine, cut.cosine, cut.enter, cut.leave);
    cylinder.part.curved_area += cylinder.lower_end + cylinder.upper_end;
    return cylinder.part;
  }
  if (body.ball()) return cap(r, std::clamp(cut.lower, 0.0, 2 * r), {cut.sine, cut.cosine, 0});
  RevolvedPart part = cylinder_below(r, h, cut.sine, cut.cosine, cut.enter, cut.leave).part;
  part += half_ball_below(r, cut.sine, cut.cosine, t - cut.sine * h, cut.upper, cut.enter).shifted(h);
  part += half_ball_below(r, -cut.sine, cut.cosine, t + cut.sine * h, cut.lower, cut.leave).mirrored().shifted(-h);
  return part;
}

}  // namespace overlapper::closed_forms
