#include "methods/round/pieces/measure.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/best_sums.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/enclosed_part.h"
#include "methods/round/pieces/mitred.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {
namespace {

/// If a body has more planes, only the planes near the common set are used. The time of slices grows with the cube of
/// the number of planes.
constexpr int kManyPlanes = 8;

double least_radius(const Pieces& pieces) {
  double least = std::numeric_limits<double>::infinity();
  for (const Round& r : pieces.rounds) least = std::min(least, r.radius);
  return least;
}

/// The pieces of both bodies.
struct BothPieces {
  Pieces a, b;

  /// False if nothing of a round shape is left after the surface of the body with the larger round was moved.
  bool become(const SlicedPair& pair, const EnclosingPolytope* common) {
    a.clear(), b.clear();
    cut(pair.a, pair.b, common, 0, pair.reference, pair.inside, a);
    cut(pair.b, pair.a, common, 1, pair.reference, pair.inside, b);
    if (pair.counted) count(pair);
    return grown(pair.outwards);
  }

  /// The same with mitred bodies; false also for bodies that are not.
  bool become_mitred(const SlicedPair& pair, const EnclosingPolytope& common) {
    a.clear(), b.clear();
    return cut_mitred(pair.a, pair.b, common, 0, pair.reference, pair.inside, a) &&
           cut_mitred(pair.b, pair.a, common, 1, pair.reference, pair.inside, b) && grown(pair.outwards);
  }

  /// The number of rounds of a pair of pieces.
  int rounds_of(int i, int j) const { return (a.pieces[i].round >= 0) + (b.pieces[j].round >= 0); }
  /// Owner 0 for the counted surface, owner 1 for all other surface.
  void count(const SlicedPair& pair) {
    const auto [body, axis] = *pair.counted;
    const Placed& placed = body == 0 ? pair.a : pair.b;
    const Vec3 middle = placed.pose.translation - rounded(pair.inside);
    for (Pieces* pieces : {&a, &b}) {
      const bool of_body = pieces == (body == 0 ? &a : &b);
      for (Wall& wall : pieces->walls) {
        constexpr double kAcross = 0.5;  // faces of boxes and cylinders are across the axis, or along it
        const bool across = std::abs(dot(rounded(wall.normal), axis)) > kAcross;
        if (wall.owner != slicing::kCut) wall.owner = of_body && across ? 0 : 1;
      }
      for (Round& round : pieces->rounds)
        round.owner = of_body && round.ball && dot(rounded(round.centre) - middle, axis) > 0 ? 0 : 1;
    }
  }
  bool grown(double outwards) { return outwards == 0 || grow(least_radius(a) > least_radius(b) ? a : b, outwards); }
  void get_rounds(int i, int j, std::vector<Round>& rounds) const {
    rounds.clear();
    if (a.pieces[i].round >= 0) rounds.push_back(a.rounds[a.pieces[i].round]);
    if (b.pieces[j].round >= 0) rounds.push_back(b.rounds[b.pieces[j].round]);
  }
};

PieceSetting setting_of(const SlicedPair& pair) {
  const Vec3 inside = rounded(pair.inside);
  PieceSetting setting;
  setting.extent = std::min(extent(pair.a, inside), extent(pair.b, inside));
  if (pair.patch) setting.view = PatchView(*pair.patch, pair.owner);
  return setting;
}

std::vector<RoundSurface> surfaces_of(const Pieces& body, std::span<const Pull> of_pieces) {
  std::vector<RoundSurface> found;
  for (size_t i = 0; i < of_pieces.size(); ++i) {
    if (body.pieces[i].round < 0) continue;
    const Round& round = body.rounds[body.pieces[i].round];
    const Vec3 centre = rounded(round.centre), axis = rounded(round.axis);
    // The moment about the centre is the axis × ∫ s n dA. All normals are orthogonal to the axis.
    const Pull own = about(of_pieces[i], {}, centre);
    found.push_back({round.ball, centre, own.force, cross(own.moment, axis), axis});
  }
  return found;
}

/// The measures by add(setting, sums), which adds all pieces. Also sets the patch of the pair.
template <class Add>
std::optional<RoundMeasures> measure_both(const SlicedPair& pair, const PieceSetting& setting, const BothPieces& both,
                                          Add add) {
  Sums none{{}, pair.patch ? std::optional(*pair.patch) : std::nullopt, {}};
  if (pair.rounds) none.of_pieces.resize(both.a.pieces.size());
  const std::optional<Sums> sums = best_sums(setting, none, add);
  if (!sums) return std::nullopt;
  if (pair.patch) *pair.patch = *sums->patch;
  if (pair.rounds) *pair.rounds = surfaces_of(both.a, sums->of_pieces);
  return measures_of(sums->totals, std::to_array<const Pieces*>({&both.a, &both.b}), rounded(pair.inside));
}

using Numbers = std::array<int, 2>;  ///< of a piece of a and one of b

struct FewPieces {
  BothPieces both;
  EnclosingPolytope around;  ///< the common set, if one body has many planes
  std::vector<Round> rounds;
  std::vector<Wall> walls;

  /// Adds the common part of every piece of a and every piece of b, pairs without rounds first.
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
    const std::span<const Wall> of_a = both.a.of(i), of_b = both.b.of(j);
    walls.assign(of_a.begin(), of_a.end()), walls.insert(walls.end(), of_b.begin(), of_b.end());
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
    // Pieces without rounds first: the error of other pieces then only needs to be small relative to these.
    for (const int round_ones : {0, 1, 2})
      for (const auto& [i, j] : near) {
        cancellation_point();
        if (both.rounds_of(i, j) != round_ones) continue;
        const Pull before = pull_of(sums.totals);
        if (round_ones == 2 || (meet(i, j) && !add_in_closed_form(setting, sums))) rest_.push_back({i, j});
        credit(i, before, sums);
      }
    // A piece that was too inaccurate relative to the pieces before it may be accurate enough relative to all.
    for (const auto& [i, j] : rest_) {
      const Pull before = pull_of(sums.totals);
      if (meet(i, j) && !add_in_closed_form(setting, sums) && !part_.add_sliced(setting, sums)) return false;
      credit(i, before, sums);
    }
    return sums.totals.volume > 0;
  }

 private:
  static Pull pull_of(const Totals& totals) { return {totals.pull, totals.moment}; }
  /// Adds to the pull on piece i of a, if it is wanted.
  static void credit(int i, const Pull& before, Sums& sums) {
    if (sums.of_pieces.empty()) return;
    sums.of_pieces[i] += {sums.totals.pull - before.force, sums.totals.moment - before.moment};
  }

  /// Fills in the data of two pieces; false if their common part is empty.
  bool meet(int i, int j) {
    both.get_rounds(i, j, part_.rounds);
    return culling.meet(i, j, meeting_);
  }

  /// True if the common part is empty or was added.
  bool add_in_closed_form(const PieceSetting& setting, Sums& sums) {
    if (!culling.share(meeting_, part_.polytope)) return true;
    part_.walls.swap(meeting_.walls);
    return part_.add_in_closed_form(culling.margin(), setting, sums);
  }

  std::vector<Numbers> rest_;  ///< not measured in closed form
  // For the two pieces that meet.
  Culling::Meeting meeting_;
  EnclosedPart part_;  ///< their common part
};

struct MitredPieces {
  BothPieces both;
  Mitred mitred;
};

/// No value if a body is neither a polytope nor a rounded hull, or if doubles are not accurate enough.
std::optional<RoundMeasures> measure_mitred(const SlicedPair& pair, const EnclosingPolytope& around) {
  // If margins are much larger than the contact is deep, doubles rarely give what rounds leave out.
  constexpr double kMostMargin = 16;
  if (pair.counted || pair.rounds) return std::nullopt;
  const double margin = std::max(core_radius(pair.a.shape), core_radius(pair.b.shape));
  if (!(margin <= kMostMargin * around.inner_radius())) return std::nullopt;
  const Scratch<MitredPieces> pieces;
  BothPieces& both = pieces->both;
  if (!both.become_mitred(pair, around)) return std::nullopt;
  PieceSetting setting = setting_of(pair);
  setting.common = &around;
  // Other ways take much longer.
  setting.sure = kMostOpen / 2;
  Sums sums{{}, pair.patch ? std::optional(*pair.patch) : std::nullopt, {}};
  if (!pieces->mitred.add_all(both.a, both.b, around, setting, sums)) return std::nullopt;
  const Totals& totals = sums.totals;
  if (!(off(totals) <= kMostOpen * totals.volume)) return std::nullopt;
  if (pair.patch) *pair.patch = *sums.patch;
  return measures_of(totals, std::to_array<const Pieces*>({&both.a, &both.b}), rounded(pair.inside));
}

}  // namespace

std::optional<RoundMeasures> measure_pieces(const SlicedPair& pair) {
  const Scratch<FewPieces> pieces;
  const bool many = facets(pair.a.shape) + facets(pair.b.shape) > kManyPlanes;
  if (many) enclose_closely(std::to_array({&pair.a, &pair.b}), rounded(pair.inside), pieces->around);
  if (!pieces->both.become(pair, many ? &pieces->around : nullptr)) return std::nullopt;
  return measure_both(pair, setting_of(pair), pieces->both,
                      [&](const PieceSetting& setting, Sums& sums) { return pieces->add_all(setting, sums); });
}

std::optional<RoundMeasures> measure_culled_pieces(const SlicedPair& pair) {
  const Scratch<ManyPieces> pieces;
  enclose(std::to_array({&pair.a, &pair.b}), rounded(pair.inside), pieces->around);
  if (auto measures = measure_mitred(pair, pieces->around)) return measures;
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
