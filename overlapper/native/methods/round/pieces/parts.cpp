#include "methods/round/pieces/parts.h"

#include <algorithm>
#include <array>

#include "geometry/cancellation.h"

namespace overlapper::pieces {

void find_walls(const DistinctWalls& distinct, std::span<const Wall> walls, SlicedPart& part) {
  thread_local std::vector<char> of_thread;
  std::vector<char>& has_face = of_thread;  // avoids repeated lookups of thread_local
  has_face.assign(walls.size(), false);
  for (const EnclosingPolytope::Corner& corner : part.polytope.corners)
    for (const int f : corner.face)
      if (const int w = part.polytope.faces[f].wall; w != kNoWall) has_face[w] = has_face[distinct.telling(w)] = true;
  part.walls.clear();
  for (size_t w = 0; w < walls.size(); ++w)
    if (has_face[w]) part.walls.push_back(walls[w]);
}

namespace {

/// The halves of a part on either side of its middle along an axis, and the larger number of walls of a half.
struct Halves {
  std::array<SlicedPart, 2> half;
  size_t most = 0;

  Halves(const DistinctWalls& distinct, const SlicedPart& part, Vec3 axis, Vec3 middle, std::vector<Wall>& walls)
      : half{part, part} {
    for (const int side : {0, 1}) {
      const Vec3 normal = side == 0 ? axis : -axis;
      const double slack = dot(normal, middle);
      walls.push_back({wide(normal), {slack}, slicing::kCut});
      half[side].polytope.cut({normal, slack, static_cast<int>(walls.size()) - 1});
      find_walls(distinct, walls, half[side]);
      most = std::max(most, half[side].walls.size());
    }
  }
};

/// The halves with the fewest walls; no value if along no axis both halves have fewer walls than the part.
std::optional<std::array<SlicedPart, 2>> fewest_walls(const DistinctWalls& distinct, const SlicedPart& part,
                                                      std::vector<Wall>& walls) {
  if (sliceable(part.walls.size())) return std::nullopt;
  std::optional<std::array<SlicedPart, 2>> best;
  size_t fewest = part.walls.size();
  const auto [lower, upper] = part.polytope.bounds();
  const Vec3 middle = 0.5 * (lower + upper);
  for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    cancellation_point();
    Halves halves(distinct, part, axis, middle, walls);
    if (halves.most < fewest) fewest = halves.most, best = std::move(halves.half);
  }
  return best;
}

}  // namespace

void cut_in_parts(const DistinctWalls& distinct, std::vector<Wall>& walls, std::vector<SlicedPart>& parts) {
  for (size_t i = 0; i < parts.size();) {
    auto halves = fewest_walls(distinct, parts[i], walls);
    if (!halves) {
      ++i;
      continue;
    }
    parts[i] = std::move((*halves)[0]);
    parts.push_back(std::move((*halves)[1]));
  }
}

}  // namespace overlapper::pieces
