#include <algorithm>
#include <cmath>

#include "geometry/scratch.h"
#include "methods/round/lenses/lenses.h"
#include "methods/round/pieces/piece.h"
#include "methods/round/pieces/planar_part.h"
#include "methods/round/pieces/stretched.h"

namespace overlapper::lenses {
namespace {

/// The part of an ellipsoid's ball that a piece of a rounded hull leaves.
struct BallInPiece {
  double volume;  ///< of the common part
  Mat3 moved;     ///< ∫ y Nᵀ dA over the ball's part of its surface
  Vec3 force;     ///< ∫ N dA over the round's part
};

/// The surface of a ball or a cylinder inside an ellipsoid.
///
/// Over all of the surface of the common part, ∫ y Nᵀ dA is the volume times the identity. Parts of walls that contain
/// the axis of a cylinder are plane sections of the ball, and end where planes touch the cylinder. Other walls and
/// their normals are orthogonal to the axis, and give nothing to ∫ s n dA.
pieces::RoundSurface surface_in_ellipsoid(const slicing::Round& round, std::span<const slicing::Wall> walls,
                                          const slicing::Round& ball, const BallInPiece& part,
                                          const quadric::Stretch& stretch, const Mat3& turn) {
  const Vec3 h = stretch.half_axes, centre = scaled(h, rounded(round.centre)), force = stretch.normal(part.force);
  pieces::RoundSurface surface{round.ball, turn * centre, turn * force, {}, {}};
  if (round.ball) return surface;
  const Vec3 axis = rounded(round.axis);
  std::vector<slicing::Wall> within(walls.begin(), walls.end());
  for (const slicing::Wall& wall : walls) {
    const Vec3 normal = rounded(wall.normal), own = unit(Vec3{normal.x / h.x, normal.y / h.y, normal.z / h.z});
    constexpr double kAcross = 0.5;  // walls contain the axis or are orthogonal to it
    if (std::abs(dot(own, axis)) > kAcross) continue;
    const Vec3 outwards = scaled(h, unit(cross(axis, own)));
    for (const Vec3 side : {outwards, -outwards}) {
      const WideVector unit_side = unit(wide(side));
      const DoubleDouble reach{round.radius / norm(side)};
      within.push_back({unit_side, dot(unit_side, round.centre) + reach, slicing::kCut});
    }
  }
  const double v = part.volume;
  const Mat3 of_walls = pieces::moved_by_walls(ball, within, walls.size());
  const Mat3 moved = stretch.moved(Mat3{{v, 0, 0}, {0, v, 0}, {0, 0, v}} - part.moved - of_walls);
  const Vec3 along = transposed(moved) * axis - dot(centre, axis) * force;
  surface.along = turn * (along - dot(along, axis) * axis), surface.axis = turn * axis;
  return surface;
}

/// Whether the ellipsoid contains a ball, or a cylinder that is rounded at both its ends.
bool contains_round(const InEllipsoid& of, const slicing::Round& round) {
  constexpr double kInside = 1 - 1e-9;
  const Vec3 h = of.stretch.half_axes, centre = rounded(round.centre - of.centre), axis = rounded(round.axis);
  const Vec3 along = round.ball ? Vec3{} : round.half_length * Vec3{axis.x / h.x, axis.y / h.y, axis.z / h.z};
  const double reach = round.radius / std::min({h.x, h.y, h.z});
  return std::max(norm(centre + along), norm(centre - along)) + reach <= kInside;
}

/// Adds a part of a round that the ellipsoid contains: the part is measured alone. Its coordinates are along the axes
/// of the ellipsoid, in m. False if slices give up.
bool add_contained_part(const slicing::Round& round, std::span<const slicing::Wall> walls,
                        const pieces::PieceSetting& setting, const quadric::Stretch& stretch, pieces::Sums& sums) {
  pieces::Sums alone;
  if (!pieces::add_piece(std::span(&round, 1), walls, nullptr, setting, alone)) return false;
  const pieces::Totals& part = alone.totals;
  const Vec3 h = stretch.half_axes;
  const quadric::Stretch into_ball({1 / h.x, 1 / h.y, 1 / h.z});
  pieces::Totals more;
  static_cast<Moments&>(more) = into_ball.moments(part);
  more.error = into_ball.volume * part.error, more.open = into_ball.volume * part.open;
  more.area = part.area;
  more.border = max_component(into_ball.cofactors) * part.border;
  more.unbalanced = into_ball.normal(part.unbalanced);
  sums.totals.add(more);
  sums.totals.sizes += Moments{more.volume, abs(more.first), more.squares, abs(more.products)};
  sums.totals.area_error += part.area_error;
  return true;
}

}  // namespace

std::optional<pieces::RoundMeasures> measure_in_parts(const pieces::SlicedPair& pair) {
  // A ball may be in the ellipsoid's place.
  const auto half_axes = [](const Placed& body) {
    if (const Ellipsoid* own = stretched(body.shape)) return std::optional(own->half_axes);
    const auto round = revolution(body.shape);
    return round && round->round_ends && round->half_length == 0 ? std::optional(round->radius * Vec3{1, 1, 1})
                                                                 : std::nullopt;
  };
  const bool swapped = stretched(pair.b.shape) || !half_axes(pair.a);
  const Placed &other = swapped ? pair.a : pair.b, &ellipsoid = swapped ? pair.b : pair.a;
  const Scratch<pieces::StretchedPieces> scratch;
  auto& [of_other, of_ellipsoid] = *scratch;
  of_other.clear(), of_ellipsoid.clear();
  pieces::EnclosingPolytope common;
  const bool many = facets(other.shape) > 0;
  if (many) pieces::enclose(std::to_array({&other, &ellipsoid}), rounded(pair.inside), common);
  pieces::cut(other, ellipsoid, many ? &common : nullptr, 1, pair.reference, pair.inside, of_other);
  pieces::cut(ellipsoid, other, nullptr, 0, pair.reference, pair.inside, of_ellipsoid);
  if (pair.outwards != 0 && !pieces::grow(of_other, pair.outwards)) return std::nullopt;
  const Vec3 h = *half_axes(ellipsoid);
  // Many parts of a rounded hull within the ellipsoid are measured alone.
  std::optional<pieces::Pieces> unstretched;
  if (polytope_of(other.shape) && !pair.rounds) pieces::into_ball(ellipsoid, {1, 1, 1}, unstretched.emplace(of_other));
  pieces::into_ball(ellipsoid, h, of_other);
  pieces::into_ball(ellipsoid, h, of_ellipsoid);
  of_ellipsoid.rounds[0].radius = 1;
  const Mat3& turn = ellipsoid.pose.rotation;
  const quadric::Stretch stretch(h);
  const double misplaced = of_other.misplaced() + of_ellipsoid.rounding;

  pieces::PieceSetting setting;
  setting.stretch = &stretch;
  setting.of_many = polytope_of(other.shape) != nullptr;
  setting.extent = norm(rounded(of_ellipsoid.rounds[0].centre)) + 1;
  pieces::Sums sums;
  sums.patch = pair.patch ? std::optional(*pair.patch) : std::nullopt;
  pieces::PieceSetting alone;
  alone.extent = std::min(pieces::extent(other, rounded(pair.inside)), pieces::extent(ellipsoid, rounded(pair.inside)));
  alone.cuts = true;
  InEllipsoid in{stretch, of_ellipsoid.rounds[0].centre, misplaced / std::min({h.x, h.y, h.z})};
  in.parts = static_cast<int>(of_other.pieces.size());
  in.with_area = pair.with_area;
  if (pair.patch) {
    setting.view = pieces::stretched_view(pieces::PatchView(*pair.patch, 0), turn, stretch, {});
    in.view = View{setting.view.u0, setting.view.v0, setting.view.u, setting.view.v, setting.view.normal};
  }
  if (pair.rounds) pair.rounds->clear();
  bool contained = false;
  for (size_t i = 0; i < of_other.pieces.size(); ++i) {
    const int number = of_other.pieces[i].round;
    const slicing::Round* round = number < 0 ? nullptr : &of_other.rounds[number];
    const std::span<const slicing::Wall> walls = of_other.of(static_cast<int>(i));
    if (round && contains_part(in, *round, walls)) round = nullptr, contained = true;
    const double before = sums.totals.volume;
    if (round && unstretched && contains_round(in, *round)) {
      if (!add_contained_part(unstretched->rounds[number], unstretched->of(static_cast<int>(i)), alone, stretch, sums))
        return std::nullopt;
      contained = true;
      continue;
    }
    const Mat3 moved_before = in.ball_moved;
    const Vec3 force_before = in.second_force;
    if (round ? !add_part(in, *round, walls, sums)
              : !pieces::add_ball_in_walls(of_ellipsoid.rounds, walls, setting, sums))
      return std::nullopt;
    if (pair.rounds && round) {
      const BallInPiece part{sums.totals.volume - before, in.ball_moved - moved_before, in.second_force - force_before};
      if (part.volume > 0)
        pair.rounds->push_back(surface_in_ellipsoid(*round, walls, of_ellipsoid.rounds[0], part, stretch, turn));
    }
    if (pair.moved && !round) {
      const double more = sums.totals.volume - before;
      const Mat3 flat = pieces::moved_by_walls(of_ellipsoid.rounds[0], walls, walls.size());
      if (more > 0) in.ball_moved = in.ball_moved + (Mat3{{more, 0, 0}, {0, more, 0}, {0, 0, more}} - flat);
    }
  }
  const pieces::Totals& totals = sums.totals;
  const double volume = totals.volume,
               error = totals.error + pieces::open_volume(totals) + of_other.gaps / stretch.volume;
  if (!(volume > 0 && error <= pieces::kMostError * volume)) return std::nullopt;
  if (pair.patch) {
    // The patch is that of the ellipsoid's surface. Seen from the other body, it has the opposite sign.
    const PatchSums none = *pair.patch;
    const bool same = (pair.owner == 0) != swapped;
    pair.patch->add_difference(same ? *sums.patch : none, same ? none : *sums.patch);
  }
  pieces::OfBall of{totals, error, misplaced, in.moved, {}};
  if (contained && in.moved == 0) of.moved = std::nullopt;
  pieces::RoundMeasures result = pieces::in_world(of, pair, ellipsoid, stretch, swapped);
  if (pair.moved) pair.set_moved(stretch.moved(in.ball_moved), turn, result.volume, swapped);
  result.area_error += of_other.gap_area;
  result.area_known = pair.with_area;
  return result;
}

}  // namespace overlapper::lenses
