#include "methods/round/pieces/group.h"

#include <algorithm>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/best_sums.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/parts.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {
namespace {

/// The common part of one piece of each body.
struct CommonPart {
  std::vector<Round> rounds;
  std::vector<Wall> walls;
};

/// Whether the rounds are two balls, or two cylinders with parallel axes.
bool alike(const Round& a, const Round& b) {
  constexpr double kOneDirection = 1e-24;
  return a.ball == b.ball && (a.ball || norm(rounded(cross(a.axis, b.axis))) <= kOneDirection);
}

class GroupPieces {
 public:
  bool become(const SlicedGroup& group, int first, const MovedOut& moved) {
    const std::span<const Placed> bodies = group.bodies;
    std::vector<const Placed*> each;
    for (const Placed& body : bodies) each.push_back(&body);
    enclose_closely(each, rounded(group.inside), around);
    of_body.resize(bodies.size());
    for (size_t i = 0; i < bodies.size(); ++i) {
      const int body = static_cast<int>(i);
      of_body[i].clear();
      pieces::cut(bodies[i], bodies[i == 0 ? 1 : 0], &around, body == first ? 0 : 1, group.reference, group.inside,
                  of_body[i]);
      if (moved.outwards != 0 && (moved.only < 0 || moved.only == body) && !grow(of_body[i], moved.outwards))
        return false;
    }
    return true;
  }

  /// Finds the parts that pieces of all bodies share. Parts without rounds come first: the error of other parts then
  /// only needs to be small relative to these. False if a part has too many rounds.
  bool find_parts(double margin) {
    margin_ = margin;
    parts_.clear();
    if (!find_parts(0, around, {})) return false;
    std::ranges::stable_sort(parts_, {}, [](const CommonPart& part) { return part.rounds.size(); });
    return true;
  }

  bool add_all(const PieceSetting& setting, Sums& sums) {
    std::vector<const CommonPart*> rest;
    for (const CommonPart& part : parts_) {
      cancellation_point();
      if (!add_in_closed_form(part, setting, sums)) rest.push_back(&part);
    }
    for (const CommonPart* part : rest)
      if (!add_in_closed_form(*part, setting, sums) && !add_sliced(*part, setting, sums)) return false;
    return sums.totals.volume > 0;
  }

  std::vector<Pieces> of_body;
  EnclosingPolytope around;  ///< the common set

 private:
  bool find_parts(size_t body, const EnclosingPolytope& within, const CommonPart& before) {
    if (body == of_body.size()) {
      CommonPart part = before;
      std::erase_if(part.rounds, [&](const Round& round) { return PlainRound(round).contains(within, margin_); });
      return separate(part, within);
    }
    const Pieces& pieces = of_body[body];
    for (size_t i = 0; i < pieces.pieces.size(); ++i) {
      cancellation_point(within.corners.size());
      const std::span<const Wall> walls = pieces.of(static_cast<int>(i));
      EnclosingPolytope left = within;
      if (!cut(left, walls)) continue;
      CommonPart part = before;
      part.walls.insert(part.walls.end(), walls.begin(), walls.end());
      if (const int round = pieces.pieces[i].round; round >= 0) {
        if (PlainRound(pieces.rounds[round]).misses(left, left.middle(), margin_)) continue;
        part.rounds.push_back(pieces.rounds[round]);
      }
      if (!find_parts(body + 1, left, part)) return false;
    }
    return true;
  }

  bool cut(EnclosingPolytope& polytope, std::span<const Wall> walls) const {
    return std::ranges::all_of(walls, [&](const Wall& wall) {
      return polytope.cut({rounded(wall.normal), wall.slack.head + margin_, kNoWall});
    });
  }

  /// Separates rounds that are alike, until a part has at most one ball and no parallel cylinders.
  bool separate(const CommonPart& part, const EnclosingPolytope& within) {
    const std::vector<Round>& rounds = part.rounds;
    for (size_t i = 0; i < rounds.size(); ++i)
      for (size_t j = i + 1; j < rounds.size(); ++j)
        if (alike(rounds[i], rounds[j])) return separate(part, i, j, within);
    // Slices are parallel to at most two axes that are not parallel to each other.
    if (std::ranges::count(rounds, false, &Round::ball) > 2) return false;
    parts_.push_back(part);
    std::ranges::stable_partition(parts_.back().rounds, [](const Round& round) { return !round.ball; });
    return true;
  }

  bool separate(const CommonPart& part, size_t i, size_t j, const EnclosingPolytope& within) {
    const Round &a = part.rounds[i], &b = part.rounds[j];
    const auto without = [&](size_t gone) {
      CommonPart left = part;
      left.rounds.erase(left.rounds.begin() + static_cast<std::ptrdiff_t>(gone));
      return left;
    };
    const std::optional<Wall> wall = radical_plane(a, b);
    if (!wall) return separate(without(a.radius < b.radius ? j : i), within);
    for (const bool first : {true, false}) {
      const Wall side = first ? *wall : Wall{-wall->normal, -wall->slack, slicing::kCut};
      EnclosingPolytope left = within;
      if (!cut(left, std::span(&side, 1))) continue;
      CommonPart half = without(first ? j : i);
      half.walls.push_back(side);
      if (PlainRound(first ? a : b).misses(left, left.middle(), margin_)) continue;
      if (!separate(half, left)) return false;
    }
    return true;
  }

  /// The polytope of a part; false if it is empty.
  bool find_polytope(const CommonPart& part) {
    polytope_ = around;
    for (size_t i = 0; i < part.walls.size(); ++i) {
      cancellation_point(polytope_.corners.size());
      const Wall& wall = part.walls[i];
      if (!polytope_.cut({rounded(wall.normal), wall.slack.head, static_cast<int>(i)})) return false;
    }
    return true;
  }

  /// True if the part is empty or was added.
  bool add_in_closed_form(const CommonPart& part, const PieceSetting& setting, Sums& sums) {
    if (!find_polytope(part)) return true;
    distinct_.walls.assign(part.walls.begin(), part.walls.end());
    if (is_flat(distinct_.walls, setting, sums.totals.error)) return true;
    find_repeated(distinct_, setting, sums.totals.error);
    const Round* round = part.rounds.empty() ? nullptr : &part.rounds[0];
    const bool sliced = part.rounds.size() > 1 || (round && setting.closely && setting.layer == 0);
    if (!sliced && add_in_polytope(round, polytope_, distinct_, setting, sums)) return true;
    const Vec3 at = polytope_.middle();
    return std::ranges::any_of(part.rounds,
                               [&](const Round& each) { return PlainRound(each).misses(polytope_, at, margin_); });
  }

  /// Adds a part by slices, in smaller parts whose walls suit slices; false if slices give up.
  bool add_sliced(const CommonPart& part, const PieceSetting& setting, Sums& sums) {
    std::vector<Wall> walls = part.walls;
    small_.resize(1);
    std::swap(small_[0].polytope, polytope_);
    find_walls(distinct_, walls, small_[0]);
    if (!sliceable(small_[0].walls.size())) cut_in_parts(distinct_, walls, small_);
    return std::ranges::all_of(small_, [&](const SlicedPart& small) {
      return add_piece(part.rounds, small.walls, &small.polytope, setting, sums);
    });
  }

  std::vector<CommonPart> parts_;
  double margin_ = 0;  ///< m: for rounding
  EnclosingPolytope polytope_;
  DistinctWalls distinct_;
  std::vector<SlicedPart> small_;
};

}  // namespace

std::optional<RoundMeasures> measure_group(const SlicedGroup& group, int first, const MovedOut& moved) {
  const Scratch<GroupPieces> pieces;
  if (!pieces->become(group, first, moved)) return std::nullopt;
  const Vec3 inside = rounded(group.inside);
  PieceSetting setting;
  setting.extent = kInfinity;
  double margin = norm(inside);
  for (const Placed& body : group.bodies) {
    setting.extent = std::min(setting.extent, extent(body, inside));
    margin += norm(body.pose.translation);
  }
  setting.common = &pieces->around;
  if (!pieces->find_parts(1e-12 * (margin + pieces->around.extent()))) return std::nullopt;
  const std::optional<Sums> sums =
      best_sums(setting, {}, [&](const PieceSetting& with, Sums& found) { return pieces->add_all(with, found); });
  if (!sums) return std::nullopt;
  std::vector<const Pieces*> each;
  for (const Pieces& body : pieces->of_body) each.push_back(&body);
  return measures_of(sums->totals, each, inside);
}

}  // namespace overlapper::pieces
