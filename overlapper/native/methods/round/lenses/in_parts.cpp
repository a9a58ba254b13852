#include <algorithm>

#include "geometry/scratch.h"
#include "methods/round/lenses/lenses.h"
#include "methods/round/pieces/planar_part.h"
#include "methods/round/pieces/stretched.h"

namespace overlapper::lenses {

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
  pieces::into_ball(ellipsoid, h, of_other);
  pieces::into_ball(ellipsoid, h, of_ellipsoid);
  of_ellipsoid.rounds[0].radius = 1;
  const Mat3& turn = ellipsoid.pose.rotation;
  const quadric::Stretch stretch(h);
  const double misplaced = of_other.misplaced() + of_ellipsoid.rounding;

  pieces::PieceSetting setting;
  setting.stretch = &stretch;
  setting.extent = norm(rounded(of_ellipsoid.rounds[0].centre)) + 1;
  pieces::Sums sums;
  sums.patch = pair.patch ? std::optional(*pair.patch) : std::nullopt;
  InEllipsoid in{stretch, of_ellipsoid.rounds[0].centre, misplaced / std::min({h.x, h.y, h.z})};
  in.with_area = pair.with_area;
  if (pair.patch) {
    setting.view = pieces::stretched_view(pieces::PatchView(*pair.patch, 0), turn, stretch, {});
    in.view = View{setting.view.u0, setting.view.v0, setting.view.u, setting.view.v, setting.view.normal};
  }
  bool contained = false;
  for (size_t i = 0; i < of_other.pieces.size(); ++i) {
    const int number = of_other.pieces[i].round;
    const slicing::Round* round = number < 0 ? nullptr : &of_other.rounds[number];
    const std::span<const slicing::Wall> walls = of_other.of(static_cast<int>(i));
    if (round && contains_part(in, *round, walls)) round = nullptr, contained = true;
    const double before = sums.totals.volume;
    if (round ? !add_part(in, *round, walls, sums)
              : !pieces::add_ball_in_walls(of_ellipsoid.rounds, walls, setting, sums))
      return std::nullopt;
    if (pair.moved && !round) {
      const double more = sums.totals.volume - before;
      const Mat3 flat = pieces::moved_by_walls(of_ellipsoid.rounds[0], walls);
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
