#include "methods/round/seam/seam.h"

#include <algorithm>
#include <array>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/seam/part.h"

namespace overlapper::seam {
namespace {

struct BothPieces {
  std::array<pieces::Pieces, 2> of;
  pieces::EnclosingPolytope common;
  pieces::Culling culling;
  std::vector<std::array<int, 2>> near;
};

/// The quadrics of a body's pieces, by their numbers.
std::vector<Quadric> quadrics_of(const Placed& body, const pieces::Pieces& of, Vec3 inside) {
  std::vector<Quadric> found;
  for (const slicing::Round& round : of.rounds) {
    const Ellipsoid* ellipsoid = stretched(body.shape);
    found.push_back(ellipsoid ? quadric_of(body, ellipsoid->half_axes, inside) : quadric_of(round));
  }
  return found;
}

/// False if a part of the lines is missing.
bool closed(std::span<const SeamPoint> points) {
  constexpr double kMostGap = 1e-4;
  Vec3 gap;
  double length = 0;
  for (const SeamPoint& point : points) {
    const Vec3 step = point.weight * cross(point.outward[0], point.outward[1]);
    gap += step, length += norm(step);
  }
  return norm(gap) <= kMostGap * length;
}

}  // namespace

std::optional<std::vector<SeamPoint>> seam_of(const Placed& a, const Placed& b, Vec3 inside,
                                              std::array<std::vector<SeamPoint>, 2>* rims) {
  const Scratch<BothPieces> both;
  auto& [of, common, culling, near] = *both;
  of[0].clear(), of[1].clear(), near.clear();
  pieces::enclose(std::to_array({&a, &b}), inside, common);
  pieces::cut(a, b, &common, 0, {}, wide(inside), of[0]);
  pieces::cut(b, a, &common, 1, {}, wide(inside), of[1]);
  const bool culled = !stretched(a.shape) && !stretched(b.shape);
  if (culled) {
    culling.look_at(of[0], of[1], common);
    culling.near(near);
  } else {
    for (int i = 0; i < static_cast<int>(of[0].pieces.size()); ++i)
      for (int j = 0; j < static_cast<int>(of[1].pieces.size()); ++j) near.push_back({i, j});
  }
  const std::array quadrics{quadrics_of(a, of[0], inside), quadrics_of(b, of[1], inside)};
  Part part;
  part.extent = std::min(pieces::extent(a, inside), pieces::extent(b, inside));
  part.misplaced = of[0].misplaced() + of[1].misplaced();
  std::vector<SeamPoint> points;
  pieces::Culling::Meeting meeting;
  for (const auto& numbers : near) {
    cancellation_point();
    part.walls.clear();
    std::array<size_t, 2> counts{of[0].of(numbers[0]).size(), of[1].of(numbers[1]).size()};
    for (const int i : {0, 1}) {
      const int round = of[i].pieces[numbers[i]].round;
      part.round[i] = round < 0 ? nullptr : &quadrics[i][round];
      const auto walls = of[i].of(numbers[i]);
      if (!culled) part.walls.insert(part.walls.end(), walls.begin(), walls.end());
    }
    if (culled) {
      if (!culling.meet(numbers[0], numbers[1], meeting)) continue;
      part.walls = meeting.walls;
      counts = {meeting.of_p.size(), meeting.of_q.size()};
    }
    part.add(points);
    if (rims) {
      part.add_rims(0, 0, counts[0], (*rims)[0]);
      part.add_rims(1, counts[0], counts[0] + counts[1], (*rims)[1]);
    }
    if (part.touching()) return std::nullopt;
  }
  if (!closed(points)) return std::nullopt;
  return points;
}

}  // namespace overlapper::seam
