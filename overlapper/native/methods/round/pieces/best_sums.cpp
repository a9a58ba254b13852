#include "methods/round/pieces/best_sums.h"

#include <algorithm>

namespace overlapper::pieces {

std::optional<RoundMeasures> measures_of(const Totals& totals, std::span<const Pieces* const> bodies, Vec3 inside) {
  RoundMeasures result;
  result.volume = totals.volume;
  result.volume_error = off(totals);
  for (const Pieces* body : bodies) result.volume_error += body->gaps;
  if (!(result.volume_error <= kMostError * result.volume)) return std::nullopt;
  double misplaced = 0;
  for (const Pieces* body : bodies) misplaced += body->misplaced();
  result.volume_error += misplaced * totals.area;
  result.area = totals.area, result.first_area = totals.first_area;
  result.area_error = totals.area_error + missing_area(totals.unbalanced, totals.border);
  result.rounding = rounding_of_surfaces(sum_of(totals.squares) / totals.volume);
  for (const Pieces* body : bodies) result.area_error += body->gap_area, result.rounding += body->rounding;
  result.centroid = inside + totals.first / totals.volume;
  result.inertia = totals.inertia_about_centroid();
  // If a body is inside the other, the sum is zero but for rounding.
  const Vec3 pull = norm(totals.pull) <= slicing::kSummation * totals.border ? Vec3{} : totals.pull;
  result.pull = about(Pull{pull, totals.moment}, inside, {});
  for (const Pieces* pieces : bodies)
    result.facets_touched += static_cast<int>(
        std::ranges::count_if(pieces->walls, [](const Wall& wall) { return wall.owner != slicing::kCut; }));
  return result;
}

}  // namespace overlapper::pieces
