#include "methods/round/pieces/culling.h"

#include <algorithm>

#include "geometry/cancellation.h"

namespace overlapper::pieces {
namespace {

/// Up to so many walls, a piece is cut in their order. Every cut visits all corners. With more walls, the deepest cuts
/// come first, a few at a time, and walls that do not reach the rest are dropped.
constexpr size_t kMostInOrder = 128;
constexpr size_t kDeepest = 16;
/// With more corners, a piece of many walls is cut no further: all walls that may matter stay.
constexpr size_t kMostCorners = 512;

}  // namespace

PlainRound::PlainRound(const Round& round) : radius(round.radius) {
  if (!round.ball) axis = rounded(round.axis);
  centre = rounded(round.ball ? round.centre : foot(round));
}

Vec3 PlainRound::outward(Vec3 point) const {
  Vec3 from = point - centre;
  // If the point is far along the axis, the first subtraction leaves rounding.
  for (int again = 0; again < 2; ++again) from -= dot(from, axis) * axis;
  const double length = std::sqrt(norm2(from));
  return length > 0 ? from / length : Vec3{};
}

bool PlainRound::misses(const EnclosingPolytope& polytope, Vec3 middle, double margin) const {
  if (!(radius > 0)) return false;
  const Vec3 normal = outward(middle);
  return normal != Vec3{} && polytope.least(normal) > reach(normal) + margin;
}

bool PlainRound::contains(const EnclosingPolytope& polytope, double margin) const {
  return std::ranges::all_of(polytope.corners, [&](const EnclosingPolytope::Corner& corner) {
    const Vec3 from = corner.at - centre;
    return norm(from - dot(from, axis) * axis) < radius - margin;
  });
}

void Culling::look_at(const Pieces& a, const Pieces& b, const EnclosingPolytope& common) {
  margin_ = 1e-13 * common.extent();
  enclose(a, common, a_);
  enclose(b, common, b_);
}

bool Culling::cut_around(const Pieces& pieces, const Piece& piece) {
  uncut_.clear();
  for (int w = piece.first_wall; w < piece.first_wall + piece.walls; ++w)
    uncut_.push_back({{rounded(pieces.walls[w].normal), pieces.walls[w].slack.head, w}, 0});
  while (uncut_.size() > kMostInOrder) {
    for (WallCut& cut : uncut_) {
      cancellation_point(around_.corners.size());
      cut.depth = around_.range(cut.face.normal).second - cut.face.slack;
    }
    std::erase_if(uncut_, [&](const WallCut& cut) { return cut.depth < -margin_; });
    if (around_.corners.size() > kMostCorners) return true;
    const size_t few = std::min(kDeepest, uncut_.size());
    std::ranges::partial_sort(uncut_, uncut_.begin() + few, std::ranges::greater{}, &WallCut::depth);
    for (size_t i = 0; i < few; ++i)
      if (!around_.cut(uncut_[i].face)) return false;
    uncut_.erase(uncut_.begin(), uncut_.begin() + few);
  }
  for (const WallCut& cut : uncut_) {
    cancellation_point(around_.corners.size());
    if (!around_.cut(cut.face)) return false;
  }
  uncut_.clear();
  return true;
}

void Culling::enclose(const Pieces& pieces, const EnclosingPolytope& common, EnclosedBody& side) {
  side.pieces = &pieces;
  if (side.parts.size() < pieces.pieces.size()) side.parts.resize(pieces.pieces.size());
  for (size_t i = 0; i < pieces.pieces.size(); ++i) {
    cancellation_point(common.corners.size());
    const Piece& piece = pieces.pieces[i];
    EnclosedPiece& part = side.parts[i];
    around_ = common;
    part.round = piece.round < 0 ? PlainRound{} : PlainRound(pieces.rounds[piece.round]);
    bool something = cut_around(pieces, piece);
    // Cuts with planes that touch the round beside the remaining part. Less of it remains the second time.
    for (int again = 0; something && piece.round >= 0 && again < 2; ++again) {
      const Vec3 normal = part.round.outward(around_.middle());
      if (normal != Vec3{}) something = around_.cut({normal, part.round.reach(normal) + margin_, kNoWall});
    }
    part.empty = !something;
    if (part.empty) continue;
    around_.drop_faces();
    part.around = around_;
    part.middle = around_.middle(), part.reach = around_.reach(part.middle), part.box = around_.bounds();
    part.walls.clear(), part.uncut.clear(), part.planes.clear();
    for (const WallCut& cut : uncut_) part.uncut.push_back(cut.face.wall);
    std::ranges::sort(part.uncut);
    part.walls = part.uncut;
    for (const EnclosingPolytope::Face& face : around_.faces)
      if (face.wall != kNoWall) part.walls.push_back(face.wall);
    std::ranges::sort(part.walls);
    for (const int w : part.walls) part.planes.push_back({rounded(pieces.walls[w].normal), pieces.walls[w].slack.head});
  }
}

void Culling::sweep(const EnclosedBody& side, std::vector<Swept>& swept) {
  swept.clear();
  for (size_t i = 0; i < side.pieces->pieces.size(); ++i) {
    const EnclosedPiece& part = side.parts[i];
    if (!part.empty) swept.push_back({part.box.lower.x, part.box.upper.x, static_cast<int>(i)});
  }
  std::ranges::sort(swept, {}, &Swept::low);
}

void Culling::near(std::vector<std::array<int, 2>>& pairs) {
  sweep(a_, swept_a_), sweep(b_, swept_b_);
  const auto add = [&](int p, int q) {
    const Bounds &one = a_.parts[p].box, &two = b_.parts[q].box;
    if (one.lower.y <= two.upper.y && two.lower.y <= one.upper.y && one.lower.z <= two.upper.z &&
        two.lower.z <= one.upper.z)
      pairs.push_back({p, q});
  };
  // If two boxes meet, the one that begins later begins within the other.
  const auto begin_within = [](const std::vector<Swept>& ones, const std::vector<Swept>& others, bool equal, auto use) {
    size_t first = 0;
    for (const Swept& one : ones) {
      while (first < others.size() && (equal ? others[first].low < one.low : others[first].low <= one.low)) ++first;
      for (size_t i = first; i < others.size() && others[i].low <= one.high; ++i) {
        cancellation_point();
        use(one.piece, others[i].piece);
      }
    }
  };
  begin_within(swept_a_, swept_b_, true, add);
  begin_within(swept_b_, swept_a_, false, [&](int q, int p) { add(p, q); });
  std::ranges::sort(pairs);
}

bool Culling::keep_walls(const EnclosedBody& side, int piece, const EnclosedPiece& other, std::vector<int>& kept,
                         std::vector<Wall>& walls) const {
  kept.clear();
  const EnclosedPiece& part = side.parts[piece];
  cancellation_point(part.walls.size());
  for (size_t i = 0; i < part.walls.size(); ++i) {
    const auto& [normal, slack] = part.planes[i];
    if (slack - dot(normal, other.middle) > other.reach + margin_) continue;
    const auto [least, most] = other.around.range(normal);
    if (least > slack + margin_) return false;
    if (most >= slack - margin_) kept.push_back(part.walls[i]), walls.push_back(side.pieces->walls[part.walls[i]]);
  }
  return true;
}

bool Culling::meet(int p, int q, Meeting& meeting) const {
  const EnclosedPiece &one = a_.parts[p], &two = b_.parts[q];
  meeting.p = p, meeting.q = q, meeting.walls.clear();
  if (!keep_walls(a_, p, two, meeting.of_p, meeting.walls) || !keep_walls(b_, q, one, meeting.of_q, meeting.walls))
    return false;
  return !one.round.misses(two.around, two.middle, margin_) && !two.round.misses(one.around, one.middle, margin_);
}

bool Culling::share(const Meeting& meeting, EnclosingPolytope& polytope) const {
  // Every cut visits all corners.
  const auto work = [](const EnclosedPiece& part, const std::vector<int>& of_other) {
    return part.around.corners.size() * (of_other.size() + part.uncut.size() + 1);
  };
  const EnclosedPiece &p = a_.parts[meeting.p], &q = b_.parts[meeting.q];
  const bool from_p = work(p, meeting.of_q) <= work(q, meeting.of_p);
  polytope = (from_p ? p : q).around;
  const std::vector<int>&known = from_p ? meeting.of_p : meeting.of_q, &uncut = (from_p ? p : q).uncut;
  const int size = static_cast<int>(meeting.walls.size()), of_p = static_cast<int>(meeting.of_p.size());
  // The walls of p come before those of q.
  const int first = from_p ? 0 : of_p, first_other = from_p ? of_p : 0, end_other = from_p ? size : of_p;
  for (EnclosingPolytope::Face& face : polytope.faces) {
    const auto at = std::ranges::find(known, face.wall);
    face.wall = at == known.end() ? kNoWall : static_cast<int>(at - known.begin()) + first;
  }
  const auto cut = [&](int w) {
    cancellation_point(polytope.corners.size());
    return polytope.cut({rounded(meeting.walls[w].normal), meeting.walls[w].slack.head, w});
  };
  for (size_t i = 0; i < known.size() && !uncut.empty(); ++i)
    if (std::ranges::binary_search(uncut, known[i]) && !cut(static_cast<int>(i) + first)) return false;
  for (int w = first_other; w < end_other; ++w)
    if (!cut(w)) return false;
  return true;
}

}  // namespace overlapper::pieces
