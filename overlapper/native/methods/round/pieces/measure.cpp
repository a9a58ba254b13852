#include "methods/round/pieces/measure.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/parts.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {
namespace {

/// The fraction of a volume that may lie between planes that are taken for one, and where nothing else closes.
constexpr double kLayer = 1e-12, kWideLayer = 1e-9;

double least_radius(const Pieces& pieces) {
  double least = std::numeric_limits<double>::infinity();
  for (const Round& r : pieces.rounds) least = std::min(least, r.radius);
  return least;
}

/// The pieces of both bodies.
struct BothPieces {
  Pieces a, b;

  /// False if moving the surface of the body with the larger round leaves nothing of something round.
  bool become(const SlicedPair& pair, const EnclosingPolytope* common) {
    a.clear(), b.clear();
    cut(pair.a, pair.b, common, 0, pair.reference, pair.inside, a);
    cut(pair.b, pair.a, common, 1, pair.reference, pair.inside, b);
    return pair.outwards == 0 || grow(least_radius(a) > least_radius(b) ? a : b, pair.outwards);
  }

  /// How many rounds a piece of each have.
  int rounds_of(int i, int j) const { return (a.pieces[i].round >= 0) + (b.pieces[j].round >= 0); }
  void get_rounds(int i, int j, std::vector<Round>& rounds) const {
    rounds.clear();
    if (a.pieces[i].round >= 0) rounds.push_back(a.rounds[a.pieces[i].round]);
    if (b.pieces[j].round >= 0) rounds.push_back(b.rounds[b.pieces[j].round]);
  }
};

double off(const Totals& totals) { return totals.error + open_volume(totals); }

/// Calls add(setting, sums) with the settings that leave the least open. Nothing if there is no volume.
template <class Add>
std::optional<Sums> best_sums(PieceSetting setting, const Sums& none, Add add) {
  Sums best = none;
  if (!add(setting, best)) return std::nullopt;
  const auto try_again = [&] {
    Sums again = none;
    if (add(setting, again) && off(again.totals) < off(best.totals)) best = again;
  };
  const auto is_open = [&] { return !(open_volume(best.totals) <= kMostOpen * best.totals.volume); };
  // If the surface does not close, something is hidden in an interval of which the middle alone was looked at.
  setting.closely = true;
  if (is_open()) try_again();
  // Or faces and cuts lie so near each other that rounding tells which of them is where. Then they are one.
  const auto try_layer = [&](double part) {
    setting.layer = part * best.totals.volume / best.totals.area, setting.surface = best.totals.area;
    try_again();
  };
  if (is_open()) try_layer(kLayer);
  if (!(off(best.totals) <= kMostError * best.totals.volume)) try_layer(kWideLayer);
  return best;
}

std::optional<RoundMeasures> measures_of(const Totals& totals, const BothPieces& both, Vec3 inside) {
  RoundMeasures result;
  result.volume = totals.volume;
  result.volume_error = off(totals);
  if (!(result.volume_error <= kMostError * result.volume)) return std::nullopt;
  result.volume_error += (both.a.flatness + both.b.flatness) * totals.area;
  result.area = totals.area, result.first_area = totals.first_area;
  result.area_error = totals.area_error + missing_area(totals.unbalanced, totals.border);
  result.rounding = rounding_of_surfaces(sum_of(totals.squares) / totals.volume);
  result.centroid = inside + totals.first / totals.volume;
  result.inertia = totals.inertia_about_centroid();
  // If a body is inside the other, what sums to zero is rounding.
  const Vec3 pull = norm(totals.pull) <= slicing::kSummation * totals.border ? Vec3{} : totals.pull;
  result.pull = about(Pull{pull, totals.moment}, inside, {});
  for (const Pieces* pieces : {&both.a, &both.b})
    result.facets_touched += static_cast<int>(
        std::ranges::count_if(pieces->walls, [](const Wall& wall) { return wall.owner != slicing::kCut; }));
  return result;
}

PieceSetting setting_of(const SlicedPair& pair) {
  const Vec3 inside = rounded(pair.inside);
  PieceSetting setting;
  setting.extent = std::min(extent(pair.a, inside), extent(pair.b, inside));
  if (pair.patch) setting.view = PatchView(*pair.patch, pair.owner);
  return setting;
}

/// The measures by add(setting, sums), which adds all pieces. The patch becomes that of the pair.
template <class Add>
std::optional<RoundMeasures> measure_both(const SlicedPair& pair, const PieceSetting& setting, const BothPieces& both,
                                          Add add) {
  const Sums none{{}, pair.patch ? std::optional(*pair.patch) : std::nullopt};
  const std::optional<Sums> sums = best_sums(setting, none, add);
  if (!sums) return std::nullopt;
  if (pair.patch) *pair.patch = *sums->patch;
  return measures_of(sums->totals, both, rounded(pair.inside));
}

using Numbers = std::array<int, 2>;  ///< of a piece of a and one of b

struct FewPieces {
  BothPieces both;
  std::vector<Round> rounds;
  std::vector<Wall> walls;

  /// Adds what every piece of a shares with every piece of b, those without rounds first.
  bool add_all(const PieceSetting& setting, Sums& sums) {
    for (const int round_ones : {0, 1, 2})
      for (int i = 0; i < static_cast<int>(both.a.pieces.size()); ++i)
        for (int j = 0; j < static_cast<int>(both.b.pieces.size()); ++j) {
          cancellation_point();
          if (both.rounds_of(i, j) == round_ones && !add(i, j, setting, sums)) return false;
        }
    return sums.totals.volume > 0;
  }

 private:
  bool add(int i, int j, const PieceSetting& setting, Sums& sums) {
    both.get_rounds(i, j, rounds);
    walls.clear();
    const Piece &p = both.a.pieces[i], &q = both.b.pieces[j];
    walls.insert(walls.end(), both.a.walls.begin() + p.first_wall, both.a.walls.begin() + p.first_wall + p.walls);
    walls.insert(walls.end(), both.b.walls.begin() + q.first_wall, both.b.walls.begin() + q.first_wall + q.walls);
    return add_piece(rounds, walls, nullptr, setting, sums);
  }
};

struct ManyPieces {
  BothPieces both;
  EnclosingPolytope around;  ///< the common set
  Culling culling;
  std::vector<Numbers> near;  ///< pairs of pieces that may share something

  bool add_all(const PieceSetting& setting, Sums& sums) {
    rest_.clear();
    // Pieces without rounds first: others then need to be exact only to a fraction of what these hold.
    for (const int round_ones : {0, 1, 2})
      for (const auto& [i, j] : near) {
        cancellation_point();
        if (both.rounds_of(i, j) != round_ones) continue;
        if (round_ones == 2 || (meet(i, j) && !add_in_closed_form(setting, sums))) rest_.push_back({i, j});
      }
    // A piece that was not sure to a fraction of the pieces before it may be sure to a fraction of all.
    for (const auto& [i, j] : rest_)
      if (meet(i, j) && !add_in_closed_form(setting, sums) && !add_sliced(setting, sums)) return false;
    return sums.totals.volume > 0;
  }

 private:
  /// Fills in what two pieces may share; false if that is nothing.
  bool meet(int i, int j) {
    both.get_rounds(i, j, rounds_);
    return culling.meet(i, j, meeting_);
  }

  /// True if that is nothing, or is added.
  bool add_in_closed_form(const PieceSetting& setting, Sums& sums) {
    if (!culling.share(meeting_, polytope_)) return true;
    distinct_.walls.assign(meeting_.walls.begin(), meeting_.walls.end());
    if (is_flat(distinct_.walls, setting, sums.totals.error)) return true;
    find_repeated(distinct_, setting, sums.totals.error);
    // Where the surface of the whole is open, slices look at all of it, until what is but a layer is nothing.
    const Round* round = rounds_.empty() ? nullptr : &rounds_[0];
    const bool sliced = rounds_.size() > 1 || (round && setting.closely && setting.layer == 0);
    if (!sliced && add_in_polytope(round, polytope_, distinct_, setting, sums)) return true;
    return culling.outside(polytope_, meeting_);
  }

  /// In parts of which slices are to have the walls; false if that gives up.
  bool add_sliced(const PieceSetting& setting, Sums& sums) {
    parts_.resize(1);
    std::swap(parts_[0].polytope, polytope_);
    find_walls(distinct_, meeting_.walls, parts_[0]);
    if (!sliceable(parts_[0].walls.size())) cut_in_parts(distinct_, meeting_.walls, parts_);
    return std::ranges::all_of(
        parts_, [&](const SlicedPart& part) { return add_piece(rounds_, part.walls, &part.polytope, setting, sums); });
  }

  std::vector<Numbers> rest_;  ///< such as are not measured in closed form
  // For the two pieces that meet.
  std::vector<Round> rounds_;
  Culling::Meeting meeting_;
  EnclosingPolytope polytope_;  ///< around what they share
  DistinctWalls distinct_;
  std::vector<SlicedPart> parts_;
};

}  // namespace

std::optional<RoundMeasures> measure_pieces(const SlicedPair& pair) {
  const Scratch<FewPieces> pieces;
  if (!pieces->both.become(pair, nullptr)) return std::nullopt;
  return measure_both(pair, setting_of(pair), pieces->both,
                      [&](const PieceSetting& setting, Sums& sums) { return pieces->add_all(setting, sums); });
}

std::optional<RoundMeasures> measure_culled_pieces(const SlicedPair& pair) {
  const Scratch<ManyPieces> pieces;
  enclose(pair.a, pair.b, rounded(pair.inside), pieces->around);
  if (!pieces->both.become(pair, &pieces->around)) return std::nullopt;
  pieces->culling.look_at(pieces->both.a, pieces->both.b, pieces->around);
  pieces->near.clear();
  pieces->culling.near(pieces->near);
  PieceSetting setting = setting_of(pair);
  setting.common = &pieces->around;
  return measure_both(pair, setting, pieces->both,
                      [&](const PieceSetting& with, Sums& sums) { return pieces->add_all(with, sums); });
}

}  // namespace overlapper::pieces
