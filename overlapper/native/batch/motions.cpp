#include "batch/motions.h"

#include <algorithm>

#include "batch/box_tree.h"
#include "batch/parallel.h"

namespace overlapper {
namespace {

/// A half-space that contains every box.
constexpr double kEverywhere = 1e300;

/// The box around all poses of a motion. A half-space that turns meets every box.
Enclosure swept(const MovingBody& body, double duration) {
  const Enclosure first = enclosure(body.start), last = enclosure(body.end);
  const bool turns = norm2(body.velocity.angular) > 0;
  if (first.open) {
    Plane plane = first.plane;
    plane.offset = turns ? kEverywhere : std::max(plane.offset, last.plane.offset);
    return {first.box, true, plane};
  }
  // A point that turns about the position at a constant rate is at most angle² / 8 times its distance from the line
  // between both ends.
  const Vec3 p = body.start.position;
  const double angle = norm(body.velocity.angular) * duration;
  const double beside = angle * angle / 8 * norm(max(abs(first.box.lower - p), abs(first.box.upper - p))) * (1 + 1e-9);
  const Vec3 margin{beside, beside, beside};
  return {{min(first.box.lower, last.box.lower) - margin, max(first.box.upper, last.box.upper) + margin}, false, {}};
}

}  // namespace

std::vector<IndexPair> swept_pairs(std::span<const MovingBody> bodies, double duration) {
  std::vector<Enclosure> boxes;
  boxes.reserve(bodies.size());
  for (const MovingBody& body : bodies) boxes.push_back(swept(body, duration));
  std::vector<IndexPair> pairs;
  BoxTree().pairs(boxes, nullptr, pairs);
  return pairs;
}

bool times_of_impact(std::span<const MovingBody> bodies, std::span<const IndexPair> pairs, double duration,
                     double width, int threads, std::span<Impact> found) {
  return for_each_in_parallel(pairs.size(), threads, [&](size_t i, int) {
    const MovingBody &a = bodies[pairs[i][0]], &b = bodies[pairs[i][1]];
    found[i] = time_of_impact(a.start, b.start, a.velocity, b.velocity, duration, width);
    return false;
  });
}

}  // namespace overlapper
