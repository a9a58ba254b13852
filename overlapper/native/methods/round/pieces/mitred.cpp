#include "methods/round/pieces/mitred.h"

#include <algorithm>
#include <array>

#include "geometry/cancellation.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/pieces/piece.h"

namespace overlapper::pieces {
namespace {

/// With more faces, cuts that visit every corner take too long.
constexpr int kMostFaces = 64;

/// Cuts a polytope by walls; the first has this number. False if nothing is left.
bool cut_by(std::span<const Wall> walls, int first, EnclosingPolytope& polytope) {
  for (const Wall& wall : walls) {
    cancellation_point(polytope.corners.size());
    if (!polytope.cut({rounded(wall.normal), wall.slack.head, first++})) return false;
  }
  return true;
}

}  // namespace

bool Mitred::add_all(const Pieces& a, const Pieces& b, const EnclosingPolytope& around, const PieceSetting& setting,
                     Sums& sums) {
  if (a.pieces.empty() || a.pieces[0].round >= 0 || b.pieces.empty() || b.pieces[0].round >= 0) return false;
  const std::span<const Wall> of_a = a.of(0), of_b = b.of(0);
  if (of_a.size() + of_b.size() > kMostFaces) return false;
  distinct_.walls.assign(of_a.begin(), of_a.end());
  distinct_.walls.insert(distinct_.walls.end(), of_b.begin(), of_b.end());
  walls_ = distinct_.walls;
  const int end_a = static_cast<int>(of_a.size());
  loose_a_ = around;
  if (!cut_by(of_b, end_a, loose_a_)) return false;
  common_ = loose_a_, loose_b_ = around;
  if (!cut_by(of_a, 0, common_) || !cut_by(of_a, 0, loose_b_)) return false;
  find_repeated(distinct_, setting, sums.totals.error);
  // A mitred vertex reaches out of the box of its body. The box cuts off nothing of the body, but it cuts rounds of the
  // other body there.
  const int no_surface = static_cast<int>(walls_.size());
  walls_.push_back({{}, {}, slicing::kCut}), distinct_.walls.push_back(walls_.back());
  for (EnclosingPolytope* polytope : {&common_, &loose_a_, &loose_b_})
    for (EnclosingPolytope::Face& face : polytope->faces)
      if (face.wall == kNoWall) face.wall = no_surface;
  if (!add_in_polytope(nullptr, common_, distinct_, setting, sums)) return false;
  more_ = less_ = sums, common_volume_ = sums.totals.volume;
  slots_a_ = slots_b_ = 0;
  if (!add_slots(a, loose_a_, of_a_, slots_a_, setting) || !add_slots(b, loose_b_, of_b_, slots_b_, setting))
    return false;
  for (size_t i = 0; i < slots_a_; ++i)
    for (size_t j = 0; j < slots_b_; ++j)
      if (meet(of_a_[i].box, of_b_[j].box) && !add_both(of_a_[i], of_b_[j], setting)) return false;
  sums.totals.add_difference(more_.totals, less_.totals);
  if (sums.patch) sums.patch->add_difference(*more_.patch, *less_.patch);
  return sums.totals.volume > 0;
}

bool Mitred::add_slots(const Pieces& pieces, const EnclosingPolytope& loose, std::vector<Slot>& slots, size_t& count,
                       const PieceSetting& setting) {
  for (size_t i = 1; i < pieces.pieces.size(); ++i) {
    if (count == slots.size()) slots.emplace_back();
    Slot& slot = slots[count];
    const std::span<const Wall> walls = pieces.of(static_cast<int>(i));
    slot.polytope = common_, slot.loose = loose;
    slot.first_wall = static_cast<int>(walls_.size());
    if (!cut_by(walls, slot.first_wall, slot.polytope)) continue;
    slot.walls = walls, slot.round = pieces.rounds[pieces.pieces[i].round], slot.box = slot.polytope.bounds();
    walls_.insert(walls_.end(), walls.begin(), walls.end());
    distinct_.walls.insert(distinct_.walls.end(), walls.begin(), walls.end());
    ++count;
    if (!add_in_polytope(nullptr, slot.polytope, distinct_, setting, less_)) return false;
    if (cut_by(walls, slot.first_wall, slot.loose) &&
        !add_rounds(std::span(&slot.round, 1), slot.loose, setting, more_))
      return false;
    if (!(more_.totals.error + less_.totals.error <= kMostOpen * common_volume_)) return false;
  }
  return true;
}

bool Mitred::add_both(const Slot& one, const Slot& other, const PieceSetting& setting) {
  part_ = one.polytope;
  if (!cut_by(other.walls, other.first_wall, part_)) return true;
  loose_part_of_one_ = one.loose, loose_part_of_other_ = other.loose;
  if (!cut_by(other.walls, other.first_wall, loose_part_of_one_) ||
      !cut_by(one.walls, one.first_wall, loose_part_of_other_))
    return false;
  const std::array<Round, 2> rounds{one.round, other.round};
  return add_in_polytope(nullptr, part_, distinct_, setting, more_) &&
         add_rounds(std::span(rounds).first(1), loose_part_of_one_, setting, less_) &&
         add_rounds(std::span(rounds).last(1), loose_part_of_other_, setting, less_) &&
         add_rounds(rounds, loose_part_of_one_, setting, more_);
}

bool Mitred::add_rounds(std::span<const Round> rounds, EnclosingPolytope& polytope, const PieceSetting& setting,
                        Sums& sums) {
  const Vec3 middle = polytope.middle();
  const double margin = 1e-13 * polytope.extent();
  const auto missed = [&](const Round& round) { return PlainRound(round).misses(polytope, middle, margin); };
  if (std::ranges::any_of(rounds, missed)) return true;
  if (rounds.size() == 1) return add_in_polytope(&rounds[0], polytope, distinct_, setting, sums);
  parts_.resize(1);
  parts_[0].polytope = polytope;
  find_walls(distinct_, walls_, parts_[0]);
  // The faces of a body touch its rounds. Rounding would make them cut.
  std::erase_if(parts_[0].walls, [&](const Wall& wall) {
    return std::ranges::any_of(rounds, [&](const Round& round) { return wall.owner == round.owner; });
  });
  return add_piece(rounds, parts_[0].walls, &parts_[0].polytope, setting, sums);
}

}  // namespace overlapper::pieces
