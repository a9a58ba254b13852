#include "methods/round/pieces/stretched.h"

#include <algorithm>
#include <limits>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/parts.h"
#include "methods/round/pieces/piece.h"
#include "methods/round/slicing/slice.h"

namespace overlapper::pieces {

void into_ball(const Placed& ellipsoid, Vec3 h, Pieces& pieces) {
  const WideMatrix rotation = wide_rotation(ellipsoid.orientation);
  for (Round& r : pieces.rounds) {
    const WideVector centre = apply_transposed(rotation, r.centre);
    r.centre = {centre.x / DoubleDouble{h.x}, centre.y / DoubleDouble{h.y}, centre.z / DoubleDouble{h.z}};
    if (!r.ball) r.axis = apply_transposed(rotation, r.axis);
  }
  for (Wall& wall : pieces.walls) {
    const WideVector own = apply_transposed(rotation, wall.normal);
    const WideVector normal{DoubleDouble{h.x} * own.x, DoubleDouble{h.y} * own.y, DoubleDouble{h.z} * own.z};
    const DoubleDouble length = norm(normal);
    wall.normal = normal / length, wall.slack = wall.slack / length;
  }
}

PatchView stretched_view(const PatchView& view, const Mat3& turn, const quadric::Stretch& stretch, Vec3 origin) {
  PatchView result;
  result.owner = view.owner;
  result.u = scaled(stretch.half_axes, apply_transposed(turn, view.u));
  result.v = scaled(stretch.half_axes, apply_transposed(turn, view.v));
  result.normal = stretch.normal(apply_transposed(turn, view.normal));
  result.u0 = view.u0 + dot(origin, result.u), result.v0 = view.v0 + dot(origin, result.v);
  return result;
}

namespace {

struct PartsOfBall {
  DistinctWalls distinct;
  std::vector<Wall> walls;
  std::vector<SlicedPart> parts;
};

/// Cuts a box around a ball with walls, and with planes that touch the ball beside the rest; false if nothing is left.
bool enclose_in_walls(const Round& ball, std::span<const Wall> walls, EnclosingPolytope& around) {
  const PlainRound plain(ball);
  const double margin = 1e-12 * (plain.radius + norm(plain.centre));
  const Vec3 reach = (plain.radius + margin) * Vec3{1, 1, 1};
  around.become({plain.centre - reach, plain.centre + reach});
  for (size_t w = 0; w < walls.size(); ++w) {
    cancellation_point(around.corners.size());
    if (!around.cut({rounded(walls[w].normal), walls[w].slack.head, static_cast<int>(w)})) return false;
  }
  for (int again = 0; again < 2; ++again) {
    const Vec3 normal = plain.outward(around.middle());
    if (normal != Vec3{} && !around.cut({normal, plain.reach(normal) + margin, kNoWall})) return false;
  }
  around.drop_faces();
  return true;
}

}  // namespace

bool add_ball_in_walls(std::span<const Round> ball, std::span<const Wall> walls, const PieceSetting& setting,
                       Sums& sums) {
  if (walls.size() <= slicing::kMostWalls) return add_piece(ball, walls, nullptr, setting, sums);
  const Scratch<PartsOfBall> scratch;
  auto& [distinct, with_cuts, parts] = *scratch;
  parts.resize(1);
  if (!enclose_in_walls(ball[0], walls, parts[0].polytope)) return true;
  with_cuts.assign(walls.begin(), walls.end());
  find_walls(distinct, with_cuts, parts[0]);
  cut_in_parts(distinct, with_cuts, parts);
  return std::ranges::all_of(
      parts, [&](const SlicedPart& part) { return add_piece(ball, part.walls, &part.polytope, setting, sums); });
}

namespace {

/// The best sums of a ball and planes.
struct BallSums {
  Sums sums;
  double error = std::numeric_limits<double>::infinity();
  Vec3 moved;  ///< the point that the sums are about
};

/// Moves the origin of coordinates.
void move(std::span<Round> rounds, std::vector<Wall>& walls, Vec3 step) {
  for (Round& r : rounds) r.centre = r.centre - wide(step);
  for (Wall& wall : walls) wall.slack = wall.slack - dot(wall.normal, wide(step));
}

/// Slices about the centroid are different ones, and may be accurate where the first slices are not.
BallSums best_of_ball(std::span<Round> rounds, std::vector<Wall>& walls, const SlicedPair& pair, int owner,
                      const Mat3& turn, const quadric::Stretch& stretch) {
  BallSums best;
  PieceSetting setting;
  setting.stretch = &stretch, setting.areas = pair.with_area;
  for (int attempt = 0; attempt < 2 && !(best.error <= kMostOpen * best.sums.totals.volume); ++attempt) {
    const Vec3 step = attempt > 0 ? best.sums.totals.first / best.sums.totals.volume : Vec3{};
    if (!(norm(step) <= 2)) break;
    move(rounds, walls, step);
    setting.extent = norm(rounded(rounds[0].centre)) + 1;
    Sums sums;
    if (pair.patch) {
      sums.patch = *pair.patch;
      setting.view = stretched_view(PatchView(*pair.patch, owner), turn, stretch, step);
    }
    if (!add_ball_in_walls(rounds, walls, setting, sums)) break;
    const Totals& found = sums.totals;
    const double off = found.error + open_volume(found);
    if (!(found.volume > 0 && off < best.error)) break;
    best = {sums, off, step};
  }
  return best;
}

/// The error of each entry of the inertia. Half axes may differ by as large a factor as a cap is shallow. The rounding
/// of one term may then be as large as all others.
double inertia_error(const Totals& totals, const quadric::Stretch& stretch) {
  const Vec3 h = stretch.half_axes;
  const Moments& sizes = totals.sizes;
  const Vec3 mean = sizes.first / totals.volume, f = sizes.first;
  const Vec3 squares = sizes.squares + scaled(f, mean);
  const Vec3 products = sizes.products + Vec3{f.y * mean.z, f.z * mean.x, f.x * mean.y};
  return 64 * DBL_EPSILON * stretch.volume *
         (dot(scaled(h, h), squares) + dot(Vec3{h.y * h.z, h.z * h.x, h.x * h.y}, products));
}

}  // namespace

RoundMeasures in_world(const OfBall& of, const SlicedPair& pair, const Placed& ellipsoid,
                       const quadric::Stretch& stretch, bool swapped) {
  const Totals& totals = of.totals;
  const Vec3 h = stretch.half_axes;
  const Mat3& turn = ellipsoid.pose.rotation;
  const Moments whole = stretch.moments(totals);
  RoundMeasures result;
  result.volume = whole.volume;
  result.area = totals.area;
  result.first_area = swapped ? totals.area - totals.first_area : totals.first_area;
  result.area_error =
      totals.area_error + stretch.open() * totals.area + missing_area(stretch.normal(totals.unbalanced), totals.area);
  result.volume_error = stretch.volume * (of.error + 4 * DBL_EPSILON * totals.volume) + of.misplaced * totals.area;
  const Vec3 origin = rounded(pair.inside) + turn * scaled(h, of.origin);
  result.centroid = origin + turn * scaled(h, totals.first / totals.volume);
  result.inertia = turn * whole.inertia_about_centroid() * transposed(turn);
  result.inertia_error = inertia_error(totals, stretch);
  result.rounding =
      of.moved ? *of.moved : rounding_of_surfaces(sum_of(whole.squares) / result.volume + norm2(scaled(h, of.origin)));
  const double side = swapped ? -1 : 1;
  const Pull pull{side * (turn * stretch.normal(totals.pull)), side * (turn * totals.moment)};
  result.pull = about(pull, origin, {});
  return result;
}

std::optional<RoundMeasures> measure_stretched(const SlicedPair& pair) {
  const bool swapped = stretched(pair.b.shape) == nullptr;
  const Placed &flat = swapped ? pair.b : pair.a, &ellipsoid = swapped ? pair.a : pair.b;
  const Scratch<StretchedPieces> scratch;
  auto& [of_flat, of_ellipsoid] = *scratch;
  of_flat.clear(), of_ellipsoid.clear();
  cut(flat, ellipsoid, nullptr, 0, pair.reference, pair.inside, of_flat);
  cut(ellipsoid, flat, nullptr, 1, pair.reference, pair.inside, of_ellipsoid);
  if (pair.outwards != 0) grow(of_flat, pair.outwards);
  const Vec3 h = stretched(ellipsoid.shape)->half_axes;
  into_ball(ellipsoid, h, of_flat);
  into_ball(ellipsoid, h, of_ellipsoid);
  const quadric::Stretch stretch(h);
  const BallSums best = best_of_ball(of_ellipsoid.rounds, of_flat.walls, pair, swapped ? 1 - pair.owner : pair.owner,
                                     ellipsoid.pose.rotation, stretch);
  const double volume = best.sums.totals.volume;
  if (!(volume > 0 && best.error <= kMostError * volume)) return std::nullopt;
  if (pair.patch) *pair.patch = *best.sums.patch;
  RoundMeasures result =
      in_world({best.sums.totals, best.error, of_flat.misplaced() + of_ellipsoid.rounding, {}, best.moved}, pair,
               ellipsoid, stretch, swapped);
  // Until the area is asked for, it is an upper bound.
  result.area_known = pair.with_area;
  result.facets_touched = static_cast<int>(of_flat.walls.size());
  return result;
}

}  // namespace overlapper::pieces
