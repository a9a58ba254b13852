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
      something = part.around.cut({rounded(wall.normal), wall.slack.head + margin_, w});
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

bool Culling::keep_walls(const Side& side, int piece, const Part& other, std::vector<Wall>& walls) const {
  for (const int w : side.parts[piece].walls) {
    const Wall& wall = side.pieces->walls[w];
    const Vec3 normal = rounded(wall.normal);
    if (other.around.least(normal) > wall.slack.head + margin_) return false;
    if (other.around.most(normal) >= wall.slack.head - margin_) walls.push_back(wall);
  }
  return true;
}

bool Culling::beyond(const Round& round, const Part& other) const {
  const Vec3 normal = outward(round, other.middle);
  return normal != Vec3{} && other.around.least(normal) > reach(round, normal) + margin_;
}

bool Culling::meet(int p, int q, std::vector<Wall>& walls, Bounds& box) const {
  const Part &one = a_.parts[p], &two = b_.parts[q];
  if (one.empty || two.empty) return false;
  box = {max(one.box.lower, two.box.lower), min(one.box.upper, two.box.upper)};
  if (box.lower.x > box.upper.x || box.lower.y > box.upper.y || box.lower.z > box.upper.z ||
      !keep_walls(a_, p, two, walls) || !keep_walls(b_, q, one, walls))
    return false;
  const int r = a_.pieces->pieces[p].round, s = b_.pieces->pieces[q].round;
  return !(r >= 0 && beyond(a_.pieces->rounds[r], two)) && !(s >= 0 && beyond(b_.pieces->rounds[s], one));
}

}  // namespace overlapper::slicing
