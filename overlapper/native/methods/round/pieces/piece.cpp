#include "methods/round/pieces/piece.h"

#include <algorithm>

#include "geometry/constants.h"
#include "methods/round/slicing/stack.h"

namespace overlapper::pieces {
namespace {

/// The centre of a ball, or the point of a cylinder's axis that is nearest to the origin.
WideVector middle(const Round& round) { return round.ball ? round.centre : foot(round); }

/// Planes at most this far from each other, relative to the extent, are in one slab.
constexpr double kOneSlab = 1e-6;

/// 1 if a wall leaves nothing of one of the rounds. -1 if the wall leaves all of one of them, beyond rounding.
int side_of(const Wall& wall, std::span<const Round> rounds) {
  int side = 0;
  for (const Round& r : rounds) {
    const Vec3 n = rounded(wall.normal);
    const double at = dot(n, rounded(r.centre)) - wall.slack.head;
    double reach = r.radius;
    if (!r.ball) {
      const double along = dot(n, rounded(r.axis));
      // The borders of a piece are also walls, and they are orthogonal to the axis. These walls must stay.
      if (1 - along * along < 1e-20) continue;
      reach = r.radius * std::sqrt(1 - along * along) + std::abs(along) * r.half_length;
    }
    const double margin = 1e-13 * (std::abs(at) + reach);
    if (at - reach > margin) return 1;
    if (at + reach < -margin) side = -1;
  }
  return side;
}

/// Whether a wall only touches a ball, so that the disc of their crossing is negligible. Rounding would make this disc
/// appear in some slices and vanish in others. The part that the wall cuts off counts as an error.
bool nicks(const Wall& wall, std::span<const Round> rounds, double extent, Totals& totals) {
  const auto cut_off = [&](const Round& r) {
    const Vec3 n = rounded(wall.normal), c = rounded(r.centre);
    const double rounding = 4 * DBL_EPSILON * (std::abs(wall.slack.head) + norm(c) + r.radius);
    const double height = std::max(0.0, dot(n, c) - wall.slack.head + r.radius) + rounding;
    const double disc = 2 * kPi * r.radius * height;
    return disc * extent <= kSure * totals.volume ? disc * height : kInfinity;
  };
  double least = kInfinity;
  for (const Round& r : rounds)
    if (r.ball) least = std::min(least, cut_off(r));
  if (!(least < kInfinity)) return false;
  totals.error += least;
  return true;
}

/// Drops a cylinder that contains the other round, because it cuts nothing off. Where the cylinder touches that round
/// from outside along a line, slices would show only rounding. The part that sticks out counts as an error.
void drop_around(std::vector<Round>& rounds, Totals& totals) {
  if (rounds.size() != 2) return;
  for (int i = 0; i < 2; ++i) {
    const Round &outer = rounds[i], &inner = rounds[1 - i];
    if (outer.ball) continue;
    WideVector between = inner.centre - outer.centre;
    between = between - dot(between, outer.axis) * outer.axis;
    const double tilt = inner.ball ? 0 : norm(rounded(cross(outer.axis, inner.axis)));
    if (tilt > 1e-24) continue;
    const double beyond = (norm(between) + DoubleDouble{inner.radius} - DoubleDouble{outer.radius}).head;
    if (beyond > 1e-14 * inner.radius) continue;
    const double length = inner.ball ? 2 * inner.radius : 2 * inner.half_length;
    totals.error += std::max(0.0, beyond) * 2 * kPi * inner.radius * length;
    rounds.erase(rounds.begin() + i);
    return;
  }
}

/// If two balls cross, each part on a side of their radical plane is the part of one ball.
bool add_balls(const Round& a, const Round& b, std::span<const Wall> walls, const EnclosingPolytope* around,
               const PieceSetting& setting, Sums& sums) {
  const std::optional<Wall> between = radical_plane(a, b);
  if (!between) return add_piece(std::span(a.radius < b.radius ? &a : &b, 1), walls, around, setting, sums);
  std::vector<Wall> with(walls.begin(), walls.end());
  with.push_back(*between);
  if (!add_piece(std::span(&a, 1), with, around, setting, sums)) return false;
  with.back() = {-between->normal, -between->slack, slicing::kCut};
  return add_piece(std::span(&b, 1), with, around, setting, sums);
}

/// Adds the part where the first wall is nearer, within the first wall. Then adds the rest, within the second wall.
bool add_beside(const Fold& fold, const SlicedPiece& piece, const PieceSetting& setting, Sums& sums) {
  for (const bool first : {true, false}) {
    std::vector<Wall> with = piece.walls;
    with[first ? fold.second : fold.first] =
        first ? fold.nearer : Wall{-fold.nearer.normal, -fold.nearer.slack, slicing::kCut};
    if (!add_piece(piece.rounds, with, piece.around, setting, sums)) return false;
  }
  return true;
}

/// Cuts the piece into slabs between planes whose lines rush across slices. In each slab, coordinates are relative to a
/// point beside one of these planes.
bool add_slabs(std::span<const slicing::Rushing> rushing, const SlicedPiece& piece, const PieceSetting& setting,
               Sums& sums) {
  const WideVector across = unit(cross(piece.rounds[0].axis, piece.rounds[1].axis));
  const auto level = [&](size_t i) { return rushing[i].level; };
  std::optional<Wall> lower;
  for (size_t first = 0, last; first < rushing.size(); first = last + 1) {
    last = first;
    while (last + 1 < rushing.size() && level(last + 1) - level(last) <= kOneSlab * piece.extent) ++last;
    SlicedPiece slab = piece;
    if (lower) slab.walls.push_back(*lower);
    if (last + 1 < rushing.size()) {
      const DoubleDouble middle{level(last) + (level(last + 1) - level(last)) / 2};
      slab.walls.push_back({across, middle, slicing::kCut});
      lower = {-across, -middle, slicing::kCut};
    }
    if (!add_slices(slab.moved(rushing[first].beside), setting, sums)) return false;
  }
  return true;
}

/// Adds nothing and returns false if slices about the inner point are too inaccurate relative to the whole.
bool add_surely(const SlicedPiece& piece, const PieceSetting& setting, Sums& sums) {
  Sums with = sums;
  if (!add_slices(piece, setting, with)) return false;
  const Totals &before = sums.totals, &after = with.totals;
  if (!(after.error + after.open <= before.error + before.open + kSure * after.volume)) return false;
  sums = with;
  return true;
}

/// The point that coordinates are relative to determines the axes of slices. If a shallow piece lies beside the inner
/// point, that point gives more digits than the middle of the enclosing polytope.
bool add_placed(const SlicedPiece& piece, const PieceSetting& setting, Sums& sums) {
  if (!piece.around) return add_slices(piece, setting, sums);
  const Vec3 middle = piece.around->middle();
  if (const auto rushing = slicing::rushing(piece.rounds, piece.walls, middle, setting.closely); !rushing.empty())
    return add_slabs(rushing, piece, setting, sums);
  if (!piece.around->excludes({})) return add_slices(piece, setting, sums);
  return (norm(middle) <= piece.around->reach(middle) && add_surely(piece, setting, sums)) ||
         add_slices(piece.moved(middle), setting, sums);
}

}  // namespace

std::optional<Wall> radical_plane(const Round& a, const Round& b) {
  const WideVector p = middle(a), q = middle(b), between = p - q;
  const DoubleDouble distance = norm(between);
  if (!(distance.head > std::abs(a.radius - b.radius))) return std::nullopt;
  const auto power = [](const WideVector& centre, double r) {
    const DoubleDouble d = norm(centre), radius{r};
    return (d - radius) * (d + radius);
  };
  const DoubleDouble slack = (power(p, a.radius) - power(q, b.radius)) / (DoubleDouble{2} * distance);
  return Wall{unit(between), slack, slicing::kCut};
}

bool add_piece(std::span<const Round> rounds, std::span<const Wall> walls, const EnclosingPolytope* around,
               const PieceSetting& setting, Sums& sums) {
  if (rounds.size() == 2 && rounds[0].ball && rounds[1].ball)
    return add_balls(rounds[0], rounds[1], walls, around, setting, sums);
  DistinctWalls distinct;
  for (const Wall& wall : walls) {
    const int cuts = side_of(wall, rounds);
    if (cuts > 0) return true;
    if (cuts == 0 && !nicks(wall, rounds, setting.extent, sums.totals)) distinct.walls.push_back(wall);
  }
  if (is_flat(distinct.walls, setting, sums.totals.error)) return true;
  // Keeps one wall per plane. Two lines of one plane cross nowhere, or anywhere by rounding.
  find_repeated(distinct, setting, sums.totals.error);
  SlicedPiece piece{{rounds.begin(), rounds.end()}, std::move(distinct.walls), setting.extent, around};
  std::erase_if(piece.walls, [](const Wall& wall) { return wall.owner == DistinctWalls::kSuperseded; });
  if (distinct.folded)
    if (const std::optional<Fold> fold = find_fold(piece.walls, piece.rounds, setting.extent))
      return add_beside(*fold, piece, setting, sums);
  drop_around(piece.rounds, sums.totals);
  if (piece.rounds.size() == 1 && piece.rounds[0].ball && piece.walls.size() <= 1) {
    add_cap(piece.rounds[0], piece.walls.empty() ? nullptr : &piece.walls[0], setting, sums);
    return true;
  }
  return add_placed(piece, setting, sums);
}

}  // namespace overlapper::pieces
