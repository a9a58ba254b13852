#include "motion/swept_support.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace overlapper {
namespace {

/// Radians of a turn that are looked at in one piece at first.
constexpr double kPiece = 0.5;

/// A piece of the motion is not halved more often.
constexpr int kMostHalvings = 40;

struct Piece {
  double start, end;
  double first, last;  ///< m: how far the body reaches at both ends
  int halvings;
};

}  // namespace

SweptSupport swept_support(Mover& body, Vec3 velocity, double duration, Vec3 direction, double within) {
  // A second derivative of the height of any point, and the rounding of heights.
  const double curvature = norm(cross(body.spin, direction)) * body.speed * body.reach_axis * kRoundedUp;
  const double lost =
      0x1p-53 * (136 * duration * norm(velocity) + (body.reach + body.radius) * (192 + 4 * body.speed * duration));
  SweptSupport found{-std::numeric_limits<double>::infinity(), {}};
  double best = found.upper;
  const auto reach = [&](double time) {
    body.move_to({}, time);
    const Vec3 moved = time * velocity;
    const Vec3 point = moved + body.body.core_support(direction) - body.body.position + body.radius * direction;
    const double height = dot(direction, point);
    if (height > best) best = height, found.point = point;
    return height;
  };
  const int pieces = 1 + static_cast<int>(std::min(body.speed * duration / kPiece, 1e5));
  std::vector<Piece> left;
  double start = 0, first = reach(0);
  for (int k = 1; k <= pieces; ++k) {
    const double end = duration * k / pieces, last = reach(end);
    left.push_back({start, end, first, last, 0});
    start = end, first = last;
  }
  while (!left.empty()) {
    const Piece piece = left.back();
    left.pop_back();
    const double length = piece.end - piece.start;
    const double bound = std::max(piece.first, piece.last) + curvature / 8 * length * length;
    if (bound <= best + within || piece.halvings == kMostHalvings) {
      found.upper = std::max(found.upper, bound + lost);
      continue;
    }
    const double middle = piece.start + length / 2, height = reach(middle);
    left.push_back({piece.start, middle, piece.first, height, piece.halvings + 1});
    left.push_back({middle, piece.end, height, piece.last, piece.halvings + 1});
  }
  return found;
}

}  // namespace overlapper
