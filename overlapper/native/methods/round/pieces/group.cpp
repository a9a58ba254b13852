#include "methods/round/pieces/group.h"

#include <algorithm>
#include <iterator>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/best_sums.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/enclosed_part.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {
namespace {

/// The common set of one piece of each body, with owners by kFirstBody.
struct CommonPart {
  std::vector<Round> rounds;
  std::vector<Wall> walls;
  EnclosingPolytope around;  ///< within the walls, but for rounding
};

/// While parts are looked for, the owner of a surface is this number plus that of its body.
constexpr int kFirstBody = slicing::kCut + 1;

/// Whether the rounds are two balls, or two cylinders with parallel axes.
bool alike(const Round& a, const Round& b) {
  constexpr double kOneDirection = 1e-24;
  return a.ball == b.ball && (a.ball || norm(rounded(cross(a.axis, b.axis))) <= kOneDirection);
}

class GroupPieces {
 public:
  bool become(const SlicedGroup& group, const MovedOut& moved) {
    const std::span<const Placed> bodies = group.bodies;
    std::vector<const Placed*> each;
    for (const Placed& body : bodies) each.push_back(&body);
    enclose_closely(each, rounded(group.inside), around);
    of_body.resize(bodies.size());
    for (size_t i = 0; i < bodies.size(); ++i) {
      const int body = static_cast<int>(i);
      of_body[i].clear();
      pieces::cut(bodies[i], bodies[i == 0 ? 1 : 0], &around, kFirstBody + body, group.reference, group.inside,
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
    find_boxes();
    if (!find_parts(0, around, {})) return false;
    std::ranges::stable_sort(parts_, {}, [](const CommonPart& part) { return part.rounds.size(); });
    return true;
  }

  /// Adds all parts. Surfaces of the body `first` have the owner 0, and those of all other bodies have the owner 1.
  bool add_all(int first, const PieceSetting& setting, Sums& sums) {
    first_ = first;
    std::vector<const CommonPart*> rest;
    for (const CommonPart& part : parts_) {
      cancellation_point();
      if (!add_in_closed_form(part, setting, sums)) rest.push_back(&part);
    }
    for (const CommonPart* part : rest)
      if (!add_in_closed_form(*part, setting, sums) && !part_.add_sliced(setting, sums)) return false;
    return sums.totals.volume > 0;
  }

  std::vector<Pieces> of_body;
  EnclosingPolytope around;  ///< the common set

 private:
  /// A piece of a body, and the box around its part of the common set's polytope.
  struct Boxed {
    int piece;
    Bounds box;
  };

  void find_boxes() {
    boxed_.resize(of_body.size());
    for (size_t i = 0; i < of_body.size(); ++i) {
      boxed_[i].clear();
      for (int piece = 0; piece < static_cast<int>(of_body[i].pieces.size()); ++piece) {
        cancellation_point(around.corners.size());
        EnclosingPolytope left = around;
        if (cut(left, of_body[i].of(piece))) boxed_[i].push_back({piece, left.bounds()});
      }
    }
  }

  bool find_parts(size_t body, const EnclosingPolytope& within, const CommonPart& before) {
    if (body == of_body.size()) {
      CommonPart part = before;
      std::erase_if(part.rounds, [&](const Round& round) { return PlainRound(round).contains(within, margin_); });
      return separate(std::move(part), within);
    }
    const Pieces& pieces = of_body[body];
    const Bounds room = within.bounds();
    for (const auto& [i, box] : boxed_[body]) {
      cancellation_point();
      const Vec3 lower = max(room.lower, box.lower), upper = min(room.upper, box.upper);
      if (!(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z)) continue;
      EnclosingPolytope left = within;
      CommonPart part = before;
      if (!cut(left, pieces.of(i), &part.walls)) continue;
      if (const int round = pieces.pieces[i].round; round >= 0) {
        if (PlainRound(pieces.rounds[round]).misses(left, left.middle(), margin_)) continue;
        part.rounds.push_back(pieces.rounds[round]);
      }
      if (!find_parts(body + 1, left, part)) return false;
    }
    return true;
  }

  /// Cuts a polytope; false if nothing is left. Adds the walls that are not certainly beyond it to `met`.
  bool cut(EnclosingPolytope& polytope, std::span<const Wall> walls, std::vector<Wall>* met = nullptr) const {
    return std::ranges::all_of(walls, [&](const Wall& wall) {
      const Vec3 normal = rounded(wall.normal);
      const double slack = wall.slack.head;
      if (met && polytope.range(normal).second < slack - margin_) return true;
      if (met) met->push_back(wall);
      return polytope.cut({normal, slack + margin_, kNoWall});
    });
  }

  /// Separates rounds that are alike, until a part has at most one ball and no parallel cylinders.
  bool separate(CommonPart part, const EnclosingPolytope& within) {
    for (size_t i = 0; i < part.rounds.size(); ++i) {
      const auto is_alike = [&, one = part.rounds[i]](const Round& round) { return alike(one, round); };
      if (std::ranges::count_if(part.rounds, is_alike) < 2) continue;
      std::vector<Round> group;
      std::ranges::copy_if(part.rounds, std::back_inserter(group), is_alike);
      std::erase_if(part.rounds, is_alike);
      for (size_t each = 0; each < group.size(); ++each)
        if (!separate(part, group, each, within)) return false;
      return true;
    }
    // Slices are parallel to at most two axes that are not parallel to each other.
    if (std::ranges::count(part.rounds, false, &Round::ball) > 2) return false;
    std::stable_partition(part.rounds.begin(), part.rounds.end(), [](const Round& round) { return !round.ball; });
    parts_.push_back(std::move(part));
    parts_.back().around = within;
    parts_.back().around.drop_faces();
    return true;
  }

  /// Adds the part that one round of a group bounds: the part where the round is the nearest of the group, by power.
  bool separate(CommonPart part, std::span<const Round> group, size_t one, EnclosingPolytope within) {
    for (size_t other = 0; other < group.size(); ++other) {
      if (other == one) continue;
      const std::optional<Wall> wall = radical_plane(group[one], group[other]);
      // The larger of two rounds contains the smaller one, and bounds nothing. If both are equal, the first one counts.
      const double larger = group[one].radius - group[other].radius;
      if (!wall && (larger > 0 || (larger == 0 && other < one))) return true;
      if (!wall) continue;
      if (!cut(within, std::span(&*wall, 1))) return true;
      part.walls.push_back(*wall);
    }
    if (PlainRound(group[one]).misses(within, within.middle(), margin_)) return true;
    part.rounds.push_back(group[one]);
    return separate(std::move(part), within);
  }

  /// True if the part is empty or was added. Its surfaces get their owners.
  bool add_in_closed_form(const CommonPart& part, const PieceSetting& setting, Sums& sums) {
    part_.polytope = part.around;
    for (size_t i = 0; i < part.walls.size(); ++i) {
      cancellation_point(part_.polytope.corners.size());
      const Wall& wall = part.walls[i];
      if (!part_.polytope.cut({rounded(wall.normal), wall.slack.head, static_cast<int>(i)})) return true;
    }
    part_.rounds = part.rounds, part_.walls = part.walls;
    const auto set_owner = [&](auto& surface) {
      if (surface.owner != slicing::kCut) surface.owner = surface.owner == kFirstBody + first_ ? 0 : 1;
    };
    std::ranges::for_each(part_.rounds, set_owner), std::ranges::for_each(part_.walls, set_owner);
    return part_.add_in_closed_form(margin_, setting, sums);
  }

  std::vector<std::vector<Boxed>> boxed_;  ///< per body
  std::vector<CommonPart> parts_;
  int first_ = 0;      ///< the body with owner 0
  double margin_ = 0;  ///< m: for rounding
  EnclosedPart part_;  ///< the part that was tried last
};

}  // namespace

std::optional<std::vector<RoundMeasures>> measure_group(const SlicedGroup& group, std::span<const int> firsts,
                                                        const MovedOut& moved) {
  const Scratch<GroupPieces> pieces;
  if (!pieces->become(group, moved)) return std::nullopt;
  const Vec3 inside = rounded(group.inside);
  PieceSetting setting;
  setting.extent = kInfinity;
  double margin = norm(inside);
  for (const Placed& body : group.bodies) {
    setting.extent = std::min(setting.extent, extent(body, inside));
    margin += norm(body.pose.translation);
  }
  setting.common = &pieces->around;
  setting.many_walls = true;
  if (!pieces->find_parts(1e-12 * (margin + pieces->around.extent()))) return std::nullopt;
  std::vector<const Pieces*> each;
  for (const Pieces& body : pieces->of_body) each.push_back(&body);
  std::vector<RoundMeasures> answers;
  for (const int first : firsts) {
    const std::optional<Sums> sums = best_sums(
        setting, {}, [&](const PieceSetting& with, Sums& found) { return pieces->add_all(first, with, found); });
    auto answer = sums ? measures_of(sums->totals, each, inside) : std::nullopt;
    if (!answer) return std::nullopt;
    answers.push_back(std::move(*answer));
  }
  return answers;
}

}  // namespace overlapper::pieces
