#include <algorithm>
#include <limits>
#include <utility>

#include "geometry/scratch.h"
#include "methods/round/pieces/piece.h"
#include "methods/round/slicing/nodes.h"
#include "methods/round/slicing/stack.h"
#include "methods/round/slicing/whole_stack.h"

namespace overlapper::pieces {
namespace {

using slicing::Integrals;
using slicing::Stack;

/// Finer rules are tried if a larger fraction of the volume may be missing.
constexpr double kClosed = 1e-12;
/// One piece among many may miss this fraction of the tolerated missing volume, because the missing volumes add up.
constexpr double kShare = 0.02;
/// The largest missing fraction of a piece at which its centroid still tells whether the piece lies outside.
constexpr double kTold = 1e-6;

/// The point of coordinates (x, y, t) in the world.
Vec3 in_world(const Stack& stack, Vec3 v) { return v.x * stack.l + v.y * stack.m + v.z * stack.t; }

/// The best sums over stacks of one piece.
struct BestSum {
  slicing::Sum best, tried;
  double open = 0;  ///< m³: possibly missing volume of the best sum
  slicing::DrawnIntervals intervals;
};

/// A piece, the settings, and the sums so far.
struct PieceContext {
  const SlicedPiece& piece;
  const PieceSetting& setting;
  const Sums& sums;  ///< over the pieces before

  /// The size that missing volume and errors of a piece are compared with.
  double share_of(double size) const { return piece.around || setting.of_many ? kShare * size : size; }
  bool closed(const BestSum& sum, double part = 1) const {
    return sum.open <= part * kClosed * (share_of(sums.totals.volume) + sum.best.integrals.volume);
  }
  /// Pieces with a remaining part are convex, so a piece with its centroid outside has no common part.
  bool outside(Vec3 centroid) const { return setting.common && setting.common->excludes(centroid + piece.offset); }
};

/// The view of the patch in coordinates of the stack.
slicing::View view_of(const Stack& stack, const PatchView& seen, Vec3 offset) {
  slicing::View view;
  view.owner = seen.owner;
  view.rest = stack.ball >= 0 && stack.quadric[stack.ball].owner == seen.owner;
  view.u0 = seen.u0 + dot(offset, seen.u), view.v0 = seen.v0 + dot(offset, seen.v);
  view.u = {dot(stack.l, seen.u), dot(stack.m, seen.u), dot(stack.t, seen.u)};
  view.v = {dot(stack.l, seen.v), dot(stack.m, seen.v), dot(stack.t, seen.v)};
  const double side = view.rest ? -1 : 1;
  view.normal = side * Vec3{dot(stack.l, seen.normal), dot(stack.m, seen.normal), dot(stack.n, seen.normal)};
  return view;
}

/// The stack for direction number `way` of the slices. No value if there are fewer directions.
std::optional<Stack> stack_of(const PieceContext& at, int way) {
  const SlicedPiece& piece = at.piece;
  std::optional<Stack> stack = slicing::stack_of(piece.rounds, piece.walls, piece.extent, way, piece.long_axis);
  if (!stack) return std::nullopt;
  stack->stretch = at.setting.stretch, stack->areas = at.setting.areas, stack->cuts = at.setting.cuts;
  if (piece.around) {
    const auto [least, most] = piece.around->range(stack->n);
    const double here = dot(piece.offset, stack->n), margin = 1e-9 * (most - least) + 1e-13 * piece.extent;
    stack->low = std::max(stack->low, least - here - margin);
    stack->high = std::min(stack->high, most - here + margin);
  }
  if (at.sums.patch) stack->view = view_of(*stack, at.setting.view, piece.offset);
  return stack;
}

/// Returns the new missing volume divided by the missing volume before.
double keep_better(const Stack& stack, const PieceContext& at, bool few, double strictness, BestSum& sum) {
  const Totals& before = at.sums.totals;
  const double volume = at.share_of(before.volume), area = at.share_of(before.area);
  const double open = slicing::integrate_whole(stack, sum.intervals, volume, area, few, strictness, sum.tried);
  const double ratio = open / sum.open;
  if (open < sum.open) sum.open = open, std::swap(sum.best, sum.tried);
  return ratio;
}

void refine(const Stack& stack, const PieceContext& at, BestSum& sum) {
  if (!at.closed(sum) && !at.setting.stretch) keep_better(stack, at, false, 0, sum);
  // The rules stop once the volume is accurate. If the areas are not accurate yet, the surface does not close.
  if (!at.closed(sum) && !slicing::find_drawn_intervals(stack, true, sum.intervals)) return;
  for (double strictness = 1; strictness < 1e9 && !at.closed(sum); strictness *= 1e3)
    if (!(keep_better(stack, at, false, strictness, sum) < 0.5) && strictness > 1e3) break;
}

/// A point about which the piece has more digits. It is given if the piece is small along one of the axes, relative to
/// its distance from its own point. No value if its own point is near the piece already.
std::optional<Vec3> nearer_point(const Stack& stack, const SlicedPiece& piece, const Integrals& s) {
  const Vec3 mean = s.first / s.volume, offset = in_world(stack, mean);
  const Vec3 away = scaled(mean, mean), spread = s.squares / s.volume - away;
  const bool far = away.x > 25 * spread.x || away.y > 25 * spread.y || away.z > 25 * spread.z;
  if (piece.near || !far || !(norm(offset) <= piece.extent)) return std::nullopt;
  return offset;
}

/// The line through the centroids of the slices, by least squares. Along it, a long piece stays near the origin of
/// every slice.
Vec3 long_axis(const Stack& stack, const Integrals& s) {
  const Vec3 mean = s.first / s.volume;
  const double square = s.squares.z / s.volume - mean.z * mean.z;
  if (!(square > 0)) return stack.t;
  return in_world(stack, {(s.products.y / s.volume - mean.z * mean.x) / square,
                          (s.products.x / s.volume - mean.y * mean.z) / square, 1});
}

bool add_near(const SlicedPiece& piece, Vec3 step, const std::optional<Vec3>& along, const PieceSetting& setting,
              Sums& sums) {
  SlicedPiece nearer = piece.moved(step);
  nearer.near = true, nearer.long_axis = along;
  return add_slices(nearer, setting, sums);
}

/// Whether the moments are possible within the extent. If not, the piece is only rounding.
bool sound(const Stack& stack, const Integrals& s, double extent) {
  const double far = 8 * extent * (1 + std::abs(stack.shear.x) + std::abs(stack.shear.y)), volume = std::abs(s.volume);
  return norm(s.first) <= far * volume && std::abs(s.squares.x + s.squares.y + s.squares.z) <= far * far * volume;
}

/// The error of a volume that slices have summed: rounding, and the error of the rules.
double error_of(const slicing::Sum& sum) {
  const Integrals& s = sum.integrals;
  return sum.error + s.uneven + 8 * DBL_EPSILON * s.blur + 32 * DBL_EPSILON * std::abs(s.volume);
}

/// Adds a piece by slices about its centroid, if less is missing or uncertain then. The inner point may be at one end
/// of a long piece, near a surface that is far from the rest. Slices then suit that end, and the rest has fewer digits.
/// A piece may also move so fast across the slices that most digits of a place only tell where its slice is.
bool add_about_centroid(const PieceContext& at, const Stack& stack, const BestSum& sum, Sums& sums) {
  const Integrals& s = sum.best.integrals;
  const double most = kMostOpen * (at.share_of(sums.totals.volume) + s.volume);
  double off = sum.open + error_of(sum.best);
  if (at.closed(sum) && off <= most) return false;
  const Vec3 offset = in_world(stack, s.first / s.volume);
  if (at.piece.near || !(norm(offset) <= at.piece.extent)) return false;
  const Sums before = sums;
  bool added = false;
  for (const std::optional<Vec3>& along : {std::optional<Vec3>{}, std::optional(long_axis(stack, s))}) {
    // Missing volume counts twice.
    if (along && (!at.setting.closely || off <= most / 2)) break;
    Sums with = before;
    if (!add_near(at.piece, offset, along, at.setting, with)) continue;
    const Totals &less = before.totals, &more = with.totals;
    const double left = more.open + more.error - less.open - less.error;
    if (!(more.volume > less.volume && left < off)) continue;
    sums = with, off = left, added = true;
  }
  return added;
}

void add_sum(const Stack& stack, const slicing::Sum& sum, Vec3 offset, const quadric::Stretch* stretch, Sums& sums) {
  const Integrals& s = sum.integrals;
  Totals& totals = sums.totals;
  const auto turned = [&](Vec3 v) { return v.x * stack.l + v.y * stack.m + v.z * stack.n; };
  totals += s.along({stack.l, stack.m, stack.t}).seen_from(offset);
  if (stretch)
    totals.sizes += Moments{s.volume, abs(s.first), s.squares, abs(s.products)}
                        .along({abs(stack.l), abs(stack.m), abs(stack.t)})
                        .seen_from(abs(offset));
  totals.volume += s.correction;
  totals.error += error_of(sum);
  totals.area += s.area, totals.first_area += s.first_area, totals.area_error += sum.area_error;
  totals.border += s.border, totals.closed_border += s.border - s.cut_border;
  const Vec3 pull = turned(s.pull[0]);
  totals.pull += pull;
  // The moment of a stretched ball's own surface is opposite to that of all other surface, as both close.
  const bool of_stretched = stretch && stack.ball >= 0 && stack.quadric[stack.ball].owner == 0;
  const Vec3 moment = of_stretched ? -(s.moment[1] + s.moment[2]) : s.moment[0];
  totals.moment += turned(moment) + (stretch ? stretch->moment(offset, pull) : cross(offset, pull));
  totals.unbalanced += turned(s.pull[0] + s.pull[1]);
  totals.left += turned(s.pull[0] + s.pull[1] + s.pull[2]);
  if (sums.patch) sums.patch->add(s.seen[0], s.seen[1], s.seen[2], s.seen[3], s.seen[4], s.seen[5]);
}

/// Finds the intervals of a stack, with close sampling if the setting says so. If close sampling finds too many
/// changes, the middle of every interval is used instead.
bool look_at(const Stack& stack, bool closely, slicing::DrawnIntervals& intervals) {
  return slicing::find_drawn_intervals(stack, closely, intervals) ||
         (closely && slicing::find_drawn_intervals(stack, false, intervals));
}

/// Tries slices across other axes, where touching surfaces may be less hidden. `stack` becomes the stack of the best
/// sum. True if intervals were found for at least one of these axes.
bool try_other_axes(const PieceContext& at, Stack& stack, BestSum& sum) {
  bool told = false;
  for (int other = 1; other < slicing::kAxes && !at.closed(sum, 2); ++other) {
    std::optional<Stack> across = stack_of(at, other);
    if (!across) break;
    if (!slicing::find_drawn_intervals(*across, true, sum.intervals) || sum.intervals.intervals.empty()) continue;
    told = true;
    const double before = sum.open;
    refine(*across, at, sum);
    if (sum.open < before) stack = *across;
  }
  return told;
}

}  // namespace

SlicedPiece SlicedPiece::moved(Vec3 step) const {
  SlicedPiece result = *this;
  if (step == Vec3{}) return result;
  for (Round& r : result.rounds) r.centre = r.centre - wide(step);
  for (Wall& wall : result.walls) wall.slack = wall.slack - dot(wall.normal, wide(step));
  result.offset += step, result.extent += norm(step);
  return result;
}

bool add_slices(const SlicedPiece& piece, const PieceSetting& setting, Sums& sums) {
  const PieceContext at{piece, setting, sums};
  std::optional<Stack> stack = stack_of(at, 0);
  if (!stack) return false;
  const Scratch<BestSum> scratch;
  BestSum& sum = *scratch;
  sum.best.integrals = {}, sum.open = std::numeric_limits<double>::infinity();
  const bool told = look_at(*stack, setting.closely || (setting.many_walls && stack->quadrics > 1), sum.intervals);
  if (told && sum.intervals.intervals.empty()) {
    sums.totals.open += slicing::beyond_ends(*stack);
    return true;
  }
  if (told) {
    // With few nodes, the terms say too little about a stretched area.
    keep_better(*stack, at, !setting.stretch, 0, sum);
    if (!at.closed(sum, 0.1))
      if (const auto step = nearer_point(*stack, piece, sum.best.integrals))
        if (add_near(piece, *step, {}, setting, sums)) return true;
    refine(*stack, at, sum);
    if (add_about_centroid(at, *stack, sum, sums)) return true;
  }
  if (!try_other_axes(at, *stack, sum) && !told) return false;
  // Inaccurate slices may show another piece.
  const double volume = sum.best.integrals.volume;
  if (sum.open <= kTold * volume && at.outside(in_world(*stack, sum.best.integrals.first) / volume)) return true;
  sums.totals.open += sum.open;
  if (sound(*stack, sum.best.integrals, piece.extent)) add_sum(*stack, sum.best, piece.offset, setting.stretch, sums);
  else sums.totals.open += std::abs(volume);
  return true;
}

}  // namespace overlapper::pieces
