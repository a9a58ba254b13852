#include "methods/round/pieces/enclosed_part.h"

#include <algorithm>
#include <utility>

#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {

bool EnclosedPart::add_in_closed_form(double margin, const PieceSetting& setting, Sums& sums) {
  distinct_.walls = walls;
  if (is_flat(distinct_.walls, setting, sums.totals.error)) return true;
  find_repeated(distinct_, setting, sums.totals.error);
  // If the surface of the whole does not close, slices also measure the round pieces, until nearby planes count as one.
  const Round* round = rounds.empty() ? nullptr : &rounds[0];
  const bool sliced = rounds.size() > 1 || (round && setting.closely && setting.layer == 0);
  if (!sliced && add_in_polytope(round, polytope, distinct_, setting, sums)) return true;
  const Vec3 middle = polytope.middle();
  return std::ranges::any_of(rounds,
                             [&](const Round& each) { return PlainRound(each).misses(polytope, middle, margin); });
}

bool EnclosedPart::add_sliced(const PieceSetting& setting, Sums& sums) {
  small_.resize(1);
  std::swap(small_[0].polytope, polytope);
  find_walls(distinct_, walls, small_[0]);
  if (!sliceable(small_[0].walls.size())) cut_in_parts(distinct_, walls, small_);
  return std::ranges::all_of(
      small_, [&](const SlicedPart& part) { return add_piece(rounds, part.walls, &part.polytope, setting, sums); });
}

}  // namespace overlapper::pieces
