#include "methods/round/culling.h"

#include <algorithm>

#include "geometry/cancellation.h"

namespace overlapper::slicing {
namespace {

/// From a round's centre or axis to a point; unit, or zero.
Vec3 outward(const Round& round, Vec3 point) {
  Vec3 from = point - rounded(round.centre);
  if (!round.ball) {
    const Vec3 axis = rounded(round.axis);
    from = from - dot(from, axis) * axis;
  }
  const double length = norm(from);
  return length > 0 ? from / length : Vec3{};
}

double reach(const Round& round, Vec3 outward) { return dot(outward, rounded(round.centre)) + round.radius; }

}  // namespace

void Culling::look_at(const Pieces& a, const Pieces& b, const Enclosure& common) {
  margin_ = 1e-13 * common.extent();
  enclose(a, common, a_);
  enclose(b, common, b_);
}

void Culling::enclose(const Pieces& pieces, const Enclosure& common, Side& side) const {
  side.pieces = &pieces;
  if (side.parts.size() < pieces.pieces.size()) side.parts.resize(pieces.pieces.size());
  for (size_t i = 0; i < pieces.pieces.size(); ++i) {
    cancellation_point(common.corners.size());
    const Piece& piece = pieces.pieces[i];
    Part& part = side.parts[i];
    part.around = common;
    part.walls.clear();
    bool something = true;
    for (int w = piece.first_wall; something && w < piece.first_wall + piece.walls; ++w) {
      cancellation_point(part.around.corners.size());
      const Wall& wall = pieces.walls[w];
      something = part.around.cut({rounded(wall.normal), wall.slack.head, w});
    }
    // Planes that touch a round where the rest is: the second time, less of that is left.
    for (int again = 0; something && piece.round >= 0 && again < 2; ++again) {
      const Round& round = pieces.rounds[piece.round];
      const Vec3 normal = outward(round, part.around.middle());
      if (normal != Vec3{}) something = part.around.cut({normal, reach(round, normal) + margin_, kNoWall});
    }
    part.empty = !something;
    if (part.empty) continue;
    part.middle = part.around.middle(), part.box = part.around.bounds();
    for (const Enclosure::Corner& corner : part.around.corners)
      for (const int face : corner.face)
        if (const int wall = part.around.faces[face].wall; wall != kNoWall) part.walls.push_back(wall);
    std::ranges::sort(part.walls);
    part.walls.erase(std::unique(part.walls.begin(), part.walls.end()), part.walls.end());
  }
}

bool Culling::keep_walls(const Side& side, int piece, const Part& other, std::vector<int>& kept,
                         std::vector<Wall>& walls) const {
  kept.clear();
  for (const int w : side.parts[piece].walls) {
    const Wall& wall = side.pieces->walls[w];
    const auto [least, most] = other.around.range(rounded(wall.normal));
    if (least > wall.slack.head + margin_) return false;
    if (most >= wall.slack.head - margin_) kept.push_back(w), walls.push_back(wall);
  }
  return true;
}

bool Culling::beyond(const Round& round, const Part& other) const {
  const Vec3 normal = outward(round, other.middle);
  return normal != Vec3{} && other.around.least(normal) > reach(round, normal) + margin_;
}

bool Culling::meet(int p, int q, Meeting& meeting) const {
  const Part &one = a_.parts[p], &two = b_.parts[q];
  if (one.empty || two.empty) return false;
  const Vec3 lower = max(one.box.lower, two.box.lower), upper = min(one.box.upper, two.box.upper);
  meeting.p = p, meeting.q = q, meeting.walls.clear();
  if (lower.x > upper.x || lower.y > upper.y || lower.z > upper.z ||
      !keep_walls(a_, p, two, meeting.of_p, meeting.walls) || !keep_walls(b_, q, one, meeting.of_q, meeting.walls))
    return false;
  const int r = a_.pieces->pieces[p].round, s = b_.pieces->pieces[q].round;
  return !(r >= 0 && beyond(a_.pieces->rounds[r], two)) && !(s >= 0 && beyond(b_.pieces->rounds[s], one));
}

bool Culling::share(const Meeting& meeting, Enclosure& polytope) const {
  // The fewer cuts, the better.
  const bool from_p = meeting.of_p.size() >= meeting.of_q.size();
  polytope = (from_p ? a_.parts[meeting.p] : b_.parts[meeting.q]).around;
  const std::vector<int>& known = from_p ? meeting.of_p : meeting.of_q;
  const int size = static_cast<int>(meeting.walls.size()), of_p = static_cast<int>(meeting.of_p.size());
  for (Enclosure::Face& face : polytope.faces) {
    const auto at = std::ranges::find(known, face.wall);
    face.wall = at == known.end() ? kNoWall : static_cast<int>(at - known.begin()) + (from_p ? 0 : of_p);
  }
  for (int w = from_p ? of_p : 0; w < (from_p ? size : of_p); ++w) {
    cancellation_point(polytope.corners.size());
    const Wall& wall = meeting.walls[w];
    if (!polytope.cut({rounded(wall.normal), wall.slack.head, w})) return false;
  }
  return true;
}

}  // namespace overlapper::slicing
