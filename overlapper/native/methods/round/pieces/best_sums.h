#pragma once

#include <optional>
#include <span>

#include "methods/round/pieces/measure.h"
#include "methods/round/pieces/pieces.h"
#include "methods/round/pieces/totals.h"

namespace overlapper::pieces {

/// Largest fraction of a volume between planes that count as one. The second limit applies if nothing else closes the
/// surface.
inline constexpr double kLayer = 1e-12, kWideLayer = 1e-9;

/// m³: the error of a volume, and the volume that may be missing.
inline double off(const Totals& totals) { return totals.error + open_volume(totals); }

/// Calls add(setting, sums) with several settings and keeps the sums with the least missing volume. No value if there
/// is no volume.
template <class Add>
std::optional<Sums> best_sums(PieceSetting setting, const Sums& none, Add add) {
  Sums best = none;
  if (!add(setting, best)) return std::nullopt;
  const auto try_again = [&] {
    Sums again = none;
    if (add(setting, again) && off(again.totals) < off(best.totals)) best = again;
  };
  const auto is_off = [&] { return !(off(best.totals) <= kMostOpen * best.totals.volume); };
  // If the surface does not close, something is hidden in an interval that was sampled in its middle only. Or cuts are
  // less accurate than the volumes on their two sides. If it closes, the errors of closed forms add up.
  setting.closely = setting.cuts = true;
  if (is_off()) try_again();
  // Or faces and cuts lie so near each other that only rounding orders them. They then count as one.
  const auto try_layer = [&](double part) {
    setting.layer = part * best.totals.volume / best.totals.area, setting.surface = best.totals.area;
    try_again();
  };
  if (is_off()) try_layer(kLayer);
  if (!(off(best.totals) <= kMostError * best.totals.volume)) try_layer(kWideLayer);
  return best;
}

/// The measures by the sums over the pieces of some bodies, relative to the inner point. No value if the error of the
/// volume is larger than kMostError of it.
std::optional<RoundMeasures> measures_of(const Totals& totals, std::span<const Pieces* const> bodies, Vec3 inside);

}  // namespace overlapper::pieces
