#include "methods/round/lenses/lenses.h"

#include <algorithm>
#include <cfloat>

#include "geometry/rounding.h"
#include "methods/round/lenses/integrate.h"
#include "methods/round/pieces/totals.h"

namespace overlapper::lenses {
namespace {

using pieces::RoundMeasures;
using pieces::SlicedPair;

StretchedBall stretched_ball(const Placed& body, const SlicedPair& pair) {
  const Ellipsoid* ellipsoid = stretched(body.shape);
  const double radius = ellipsoid ? 0 : revolution(body.shape)->radius;
  return {wide(ellipsoid ? ellipsoid->half_axes : Vec3{radius, radius, radius}),
          wide(body.position) - wide(pair.reference) - pair.inside,
          ellipsoid ? wide_rotation(body.orientation) : WideMatrix{}, !ellipsoid};
}

/// m: how far double-doubles may misplace the surface of a body.
double misplaced(const Placed& body, const SlicedPair& pair) {
  const double size = norm(body.position - pair.reference) + norm(rounded(pair.inside)) + reach(body.shape);
  return wide_placing(reach(body, size), !unturned(body.orientation));
}

double shortest(Vec3 v) { return std::min({v.x, v.y, v.z}); }

/// A half axis that grows by `outwards`, if it is the shortest.
void scale(StretchedBall& body, double outwards) {
  const DoubleDouble by = DoubleDouble{1} + DoubleDouble{outwards / shortest(rounded(body.half_axes))};
  body.half_axes = by * body.half_axes;
}

/// From the coordinates of Discs to the world about the inner point.
struct ToWorld {
  const Discs& discs;
  quadric::Stretch stretch;
  Mat3 turn;

  Vec3 point(Vec3 v) const { return turn * scaled(stretch.half_axes, discs.along_axes(v)); }
  Vec3 area_vector(Vec3 v) const { return turn * stretch.normal(discs.along_axes(v)); }
  Moments moments(const Moments& m) const {
    const Moments own = m.along({discs.normal, discs.x, discs.y});
    const Vec3 h = stretch.half_axes;
    return {stretch.volume * own.volume, stretch.volume * scaled(h, own.first),
            stretch.volume * scaled(scaled(h, h), own.squares),
            stretch.volume * scaled(stretch.cofactors, own.products)};
  }
};

/// The patch as the first body's ball sees it.
View view_of(const PatchSums& patch, const ToWorld& to) {
  const Vec3 h = to.stretch.half_axes;
  const auto own = [&](Vec3 v) { return apply_transposed(to.turn, v); };
  return {-dot(patch.origin(), patch.u()), -dot(patch.origin(), patch.v()), scaled(h, own(patch.u())),
          scaled(h, own(patch.v())), to.stretch.normal(own(patch.normal()))};
}

}  // namespace

std::optional<RoundMeasures> measure_lenses(const SlicedPair& pair) {
  StretchedBall first = stretched_ball(pair.a, pair), second = stretched_ball(pair.b, pair);
  const bool swapped = !better_first(first, second);
  if (swapped) std::swap(first, second);
  const double least = shortest(rounded(second.half_axes));
  if (!(pair.outwards > -least)) return std::nullopt;
  if (pair.outwards != 0) scale(second, pair.outwards);
  std::optional<Discs> found = discs(first, second);
  if (!found) return std::nullopt;
  found->misplaced = 2 * (misplaced(pair.a, pair) + misplaced(pair.b, pair)) /
                     (shortest(rounded(first.half_axes)) * kRoundings * DBL_EPSILON);
  const ToWorld to{
      *found,
      quadric::Stretch(rounded(first.half_axes)),
      {rounded(found->first_rotation.row0), rounded(found->first_rotation.row1), rounded(found->first_rotation.row2)}};
  const quadric::Stretch of_second(rounded(second.half_axes));
  Wanted wanted;
  if (pair.with_area) wanted.first = &to.stretch, wanted.second = &of_second;
  if (pair.patch) wanted.view = view_of(*pair.patch, to);
  const Integral integral = integrate(*found, wanted);
  const Sums& sums = integral.sums;
  const double volume = sums.moments.volume;
  const double error = integral.error + kRoundings * DBL_EPSILON * (sums.blur + volume) + 2 * found->oval * sums.oval;
  if (!(volume > 0 && error <= pieces::kMostError * volume)) return std::nullopt;

  RoundMeasures result;
  const Moments whole = to.moments(sums.moments);
  result.volume = whole.volume, result.volume_error = to.stretch.volume * error;
  result.centroid = rounded(pair.inside) + to.point(sums.moments.first / volume);
  result.inertia = to.turn * whole.inertia_about_centroid() * transposed(to.turn);
  const Vec3 squares = sums.moments.squares;
  const double longest = max_component(to.stretch.half_axes);
  result.inertia_error = 64 * DBL_EPSILON * to.stretch.volume * longest * longest * (squares.x + squares.y + squares.z);
  result.rounding = least * (kRoundings * DBL_EPSILON + 2 * found->oval) * sums.terms;
  const double side = swapped ? -1 : 1;
  result.pull = about({side * to.area_vector(sums.force), side * (to.turn * found->moment(sums.moved, to.stretch))},
                      rounded(pair.inside), {});
  if (pair.moved)
    pair.set_moved(to.stretch.moved(found->moved_along_axes(sums.moved)), to.turn, result.volume, swapped);
  result.area_known = pair.with_area;
  if (pair.with_area) {
    result.area = sums.first_area + sums.second_area;
    result.first_area = swapped ? sums.second_area : sums.first_area;
    result.area_error = integral.area_error + std::max(to.stretch.open(), of_second.open()) * result.area;
  }
  if (pair.patch) {
    const double of_owner = (pair.owner == 0) != swapped ? 1 : -1;
    const auto& p = sums.patch;
    pair.patch->add(of_owner * p[0], of_owner * p[1], of_owner * p[2], of_owner * p[3], of_owner * p[4],
                    of_owner * p[5]);
  }
  return result;
}

}  // namespace overlapper::lenses
