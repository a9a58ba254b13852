#include <algorithm>
#include <cfloat>

#include "methods/round/lenses/integrate.h"
#include "methods/round/lenses/lenses.h"

namespace overlapper::lenses {
namespace {

WideVector scaled_by(Vec3 a, const WideVector& b) {
  return {DoubleDouble{a.x} * b.x, DoubleDouble{a.y} * b.y, DoubleDouble{a.z} * b.z};
}

SecondBall second_ball(const slicing::Round& round, Vec3 half_axes) {
  const DoubleDouble radius{round.radius};
  SecondBall second;
  if (round.ball) {
    second.k = {{DoubleDouble{half_axes.x} / radius, {}, {}},
                {{}, DoubleDouble{half_axes.y} / radius, {}},
                {{}, {}, DoubleDouble{half_axes.z} / radius}};
  } else {
    const WideVector u = unit(cross(round.axis, wide(any_orthogonal(rounded(round.axis)))));
    second.k = {scaled_by(half_axes, u) / radius, scaled_by(half_axes, cross(round.axis, u)) / radius, {}};
    second.cylinder = true;
  }
  second.middle = second.k * round.centre;
  return second;
}

/// m² of the round's surface per angle and distance between slices. In the world, too, sections of the round are
/// circles, and angles are the same.
double area_rate(const slicing::Round& round, Vec3 across, Vec3 half_axes) {
  const Vec3 steep{across.x / half_axes.x, across.y / half_axes.y, across.z / half_axes.z};
  return round.radius / (round.ball ? norm(steep) : std::abs(dot(steep, rounded(round.axis))));
}

}  // namespace

bool contains_part(const InEllipsoid& of, const slicing::Round& round, std::span<const slicing::Wall> walls) {
  const Vec3 centre = rounded(of.centre);
  Vec3 middle = centre;
  double square = 1;
  for (const slicing::Wall& wall : walls) {
    const Vec3 normal = rounded(wall.normal);
    const double beyond = overlapper::dot(normal, centre) - wall.slack.head;
    if (beyond > 0 && 1 - beyond * beyond < square) square = 1 - beyond * beyond, middle = centre - beyond * normal;
  }
  const SecondBall second = second_ball(round, of.stretch.half_axes);
  const Vec3 off = rounded(second.k * wide(middle) - second.middle);
  double stretch = 0;  // bound of the square of the length of K u for a unit vector u
  for (const WideVector& row : {second.k.row0, second.k.row1, second.k.row2}) stretch += norm2(rounded(row));
  constexpr double kShallow = 0.05, kInside = 1 - 1e-6;
  return square <= kShallow && norm(off) + std::sqrt(std::max(0.0, square) * stretch) <= kInside;
}

namespace {

/// A part by slices of one direction.
struct Measured {
  Discs discs;
  Integral integral;
  pieces::Totals totals;
};

/// No value if the part cannot be measured.
std::optional<Measured> measured(const InEllipsoid& of, const slicing::Round& round,
                                 std::span<const slicing::Wall> walls, const Wanted& wanted, bool other) {
  std::optional<Discs> found = discs(of.centre, second_ball(round, of.stretch.half_axes), walls, other);
  if (!found) return std::nullopt;
  found->misplaced = of.misplaced / (kRoundings * DBL_EPSILON);
  found->second_area = area_rate(round, found->normal, of.stretch.half_axes);
  Measured result{*found, integrate(*found, wanted), {}};
  const Sums& part = result.integral.sums;
  const double volume = part.moments.volume;
  if (!(volume > 0)) return result;
  pieces::Totals& totals = result.totals;
  static_cast<Moments&>(totals) = part.moments.along({found->normal, found->x, found->y});
  totals.error = result.integral.error + kRoundings * DBL_EPSILON * (part.blur + volume) + kOfRules * volume +
                 2 * found->oval * part.oval;
  totals.border = part.border;
  totals.unbalanced = found->along_axes(part.force + part.second_force + part.cut_force);
  totals.open = pieces::missing(totals);
  return result;
}

}  // namespace

bool add_part(InEllipsoid& of, const slicing::Round& round, std::span<const slicing::Wall> walls, pieces::Sums& sums) {
  pieces::Totals& totals = sums.totals;
  Wanted wanted;
  if (of.with_area) wanted.first = &of.stretch;
  wanted.view = of.view;
  wanted.closing = true;
  wanted.volume = totals.volume, wanted.border = totals.border;
  std::optional<Measured> found = measured(of, round, walls, wanted, false);
  if (!found) return false;
  // A part of the surface may be hidden between slices of one direction.
  if (const auto off = [](const Measured& m) { return m.totals.open + m.totals.error; };
      found->totals.open > pieces::kMostOpen * (totals.volume + found->totals.volume))
    if (auto other = measured(of, round, walls, wanted, true);
        other && other->totals.volume > 0 && off(*other) < off(*found))
      found = std::move(other);
  const Discs& discs = found->discs;
  const Sums& part = found->integral.sums;
  pieces::Totals more = found->totals;
  if (!(more.volume > 0)) return true;
  more.unbalanced = discs.along_axes(part.force + part.second_force);
  more.area = part.first_area + part.second_area;
  more.first_area = part.first_area;
  more.pull = discs.along_axes(part.force);
  more.moment = discs.moment(part.moved, of.stretch);
  of.ball_moved = of.ball_moved + discs.moved_along_axes(part.moved);
  of.second_force += discs.along_axes(part.second_force);
  totals.add(more);
  totals.sizes += Moments{more.volume, abs(more.first), more.squares, abs(more.products)};
  totals.area_error += found->integral.area_error;
  of.moved = std::max(of.moved, round.radius * (kRoundings * DBL_EPSILON + 2 * discs.oval) * part.terms);
  if (sums.patch) {
    const auto& p = part.patch;
    sums.patch->add(p[0], p[1], p[2], p[3], p[4], p[5]);
  }
  return true;
}

}  // namespace overlapper::lenses
