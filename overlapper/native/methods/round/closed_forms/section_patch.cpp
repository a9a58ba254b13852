#include <algorithm>

#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/revolved_part.h"

namespace overlapper::closed_forms {
namespace {

/// Integrals over a section of a body of revolution: p along its line of symmetry, z across it.
struct SymmetricSection {
  double area = 0, first = 0, along = 0, across = 0;  ///< ∫ 1, p, p² and z² dA

  /// Adds a strip of this area at p. It extends by `half` to either side.
  void add(double strip, double p, double half) {
    area += strip, first += strip * p, along += strip * p * p, across += strip * half * half / 3;
  }
};

/// Adds the section of a cylinder. p is measured from the place under the lowest point of its lower end, plus `from`.
void add_side(double r, double h, const PlaneCut& cut, double from, SymmetricSection& section) {
  const double sine = cut.sine, cosine = cut.cosine, wide = 2 * r * cosine;
  if (cut.leave <= 0 || cut.enter >= wide) return;
  const double start = cut.enter <= 0 ? 0 : cut.enter / cosine;
  if (sine == 0) {
    const double half = std::sqrt(std::max(0.0, start * (2 * r - start))), area = 4 * h * half;
    section.add(area, from + h, half);
    section.along += area * h * h / 3;
    return;
  }
  const double length = cut.enter <= 0 ? cut.leave / sine : 2 * h;
  const double full = cut.enter <= 0 ? 0 : angle_at(r, start), rest = kPi - full;
  const double more = (cut.enter <= 0 ? cut.leave : 2 * sine * h) / cosine;
  const double width = cut.leave >= wide ? rest : std::min(rest, angle_between(r, start, more));
  integrate(full, width, [&](double angle, double advance, double weight) {
    const double half = r * std::sin(angle), up = 2 * r * std::sin(angle / 2) * std::sin(angle / 2);
    const double risen = 2 * r * std::sin(angle - advance / 2) * std::sin(advance / 2);
    const double here = std::max(0.0, length - cosine / sine * risen);
    section.add(weight * 2 * half * half / sine, from + here * cosine - up * sine, half);
  });
}

/// Adds the section of a half ball that looks along `side`. `from` is the p of its centre. The plane is `height` deep
/// in the ball. It is `edge` deep in the ball's disc, times the cosine.
void add_end(double r, double sine, double cosine, double t, double height, double edge, double side, double from,
             SymmetricSection& section) {
  if (height <= 0 || t >= r) return;
  const double radius = std::sqrt((r - t) * height);
  double half_angle = kPi;
  if (edge > 0 && t < r * cosine) half_angle = std::atan2(std::sqrt((r * cosine - t) * edge), -t * sine);
  else if (t * sine < 0) return;
  integrate(0, half_angle, [&](double angle, double, double weight) {
    const double half = radius * std::sin(angle);
    section.add(weight * 2 * half * half, from + side * radius * std::cos(angle), half);
  });
}

/// The patch of a box or a hull and a round body.
std::optional<Patch> patch_of_faces(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area) {
  const Placed first = a.seen_from(centroid), second = b.seen_from(centroid);
  const double magnitude =
      std::max(norm(first.pose.translation) + reach(first.shape), norm(second.pose.translation) + reach(second.shape));
  const RoundPair pair = round_pair(first, second, rounding(magnitude), {});
  if (smooth(pair.flat_body().shape) || !smooth(pair.round_body().shape)) return std::nullopt;
  PatchSums sums({}, area);
  const auto& revolved = pair.revolved[pair.self];
  const bool known = stretched(pair.round_body().shape) ? add_sections_of_ellipsoid(pair, sums)
                     : !revolved                        ? false
                     : revolved->ball()                 ? add_sections_of_ball(pair, sums)
                                                        : add_sections_of_long_body(pair, sums);
  if (!known) return std::nullopt;
  Patch patch = sums.patch();
  patch.centre += centroid;
  return patch;
}

}  // namespace

std::optional<Patch> section_patch(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area) {
  const bool first = !bounded(b.shape);
  const Placed &placed = first ? a : b, &other = first ? b : a;
  const std::optional<Revolved> body = revolved(placed);
  const Plane* plane = only_plane(other.shape);
  if (bounded(a.shape) && bounded(b.shape)) return patch_of_faces(a, b, centroid, area);
  if (!body || !plane) return std::nullopt;
  const Vec3 normal = (other.pose * *plane).normal;
  const PlaneCut cut = cut_of(*body, seen_from(other, *body), *unit_facet(other.shape, 0));
  const bool ball = body->ball();
  const double r = body->radius, h = body->half_length, sine = cut.sine, cosine = cut.cosine;
  const auto [axis, sideways] = SymmetryFrame(*body, normal);
  // Under the centre of the lower end's ball, or under the lowest point of the lower end.
  const double under = cut.offset + sine * h;
  const Vec3 foot = body->centre - h * axis + (body->round ? under * normal : cut.leave * normal - r * sideways);
  SymmetricSection section;
  if (ball) {
    add_end(r, 0, 1, cut.offset, cut.lower, 0, 1, 0, section);
  } else {
    add_side(r, h, cut, body->round ? r * sine : 0, section);
    if (body->round) {
      add_end(r, sine, cosine, cut.offset - sine * h, cut.upper, cut.enter, 1, 2 * h * cosine, section);
      add_end(r, -sine, cosine, under, cut.lower, cut.leave, -1, 0, section);
    }
  }
  PatchSums sums(centroid, area);
  const Vec3 along = cosine * axis - sine * sideways, across = cross(normal, along);
  const auto [one, p, pp, zz] = section;
  const double u0 = dot(foot - centroid, sums.u()), pu = dot(along, sums.u()), zu = dot(across, sums.u());
  const double v0 = dot(foot - centroid, sums.v()), pv = dot(along, sums.v()), zv = dot(across, sums.v());
  sums.add(one, one * u0 + p * pu, one * v0 + p * pv, (one * u0 + 2 * p * pu) * u0 + pp * pu * pu + zz * zu * zu,
           (one * u0 + p * pu) * v0 + p * pv * u0 + pp * pu * pv + zz * zu * zv,
           (one * v0 + 2 * p * pv) * v0 + pp * pv * pv + zz * zv * zv);
  return sums.patch();
}

}  // namespace overlapper::closed_forms
