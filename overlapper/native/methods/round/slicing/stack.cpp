#include "methods/round/slicing/stack.h"

#include <algorithm>
#include <limits>

namespace overlapper::slicing {
namespace {

/// Two axes are one direction for double-doubles if the sine between them is not larger.
constexpr double kOneDirection = 1e-24;
/// A plane ends the stack if the sine of its tilt against the slices is not larger. The tilt counts to first order.
constexpr double kParallel = 1e-11;
/// The border of a plane with a tilt between kParallel and kRushing would move too fast from slice to slice.
constexpr double kRushing = 1e-3;
/// Planes with a smaller tilt may count as such, too. Their lines lose up to 1 / tilt times the digits of the places.
constexpr double kRushingAtAll = 0.2;
/// A ridge with a smaller sine against the slices counts as parallel to the slices.
constexpr double kSteep = 0.05;
/// If the distance to the walls is shorter than the distance to the round by this factor, slices are strips along a
/// wall. In axes along the wall, the width of the strips has all digits.
constexpr double kThin = 1e-3;
/// Tangents of the angles by which slices are turned, in the order of trial.
constexpr std::array<double, kAxes> kTurns{0, 0.3, -0.3, 0.7, -0.7};

/// Axes of the slices: l, m and n are orthonormal, and t = n + x l + y m for the shear (x, y).
struct Axes {
  WideVector l, m, n, t;
  DoubleDouble x{}, y{};
};

WideVector across(const WideVector& v, const WideVector& unit_axis) { return v - dot(v, unit_axis) * unit_axis; }

/// The shortest way from the origin to a surface.
struct WayOut {
  WideVector normal;  ///< unit; zero if all directions are nearly as short
  double slack;       ///< m: the length of the way
};

WayOut way_out(const Round& r) {
  const WideVector from = r.ball ? -r.centre : across(-r.centre, r.axis);
  const double length = rounded(norm(from));
  if (length > 1e-3 * r.radius) return {unit(from), r.radius - length};
  return {{}, r.radius - length};
}

/// The way to the nearest surface, and the nearest ridge of that surface and another one, by their tangent planes.
struct Nearest {
  WayOut way{{}, std::numeric_limits<double>::infinity()};
  WideVector ridge;  ///< of any length; zero if all surfaces are parallel
  double ridge_distance = std::numeric_limits<double>::infinity();  ///< m

  bool thin() const { return way.slack < kThin * ridge_distance; }
};

Nearest nearest(std::span<const Round> rounds, std::span<const Wall> walls) {
  // The tangent plane of a round that is nearly parallel to another plane meets it far from the round.
  constexpr double kAcross = 1e-2;
  Nearest result;
  WayOut wall_way = result.way;
  const auto each_wall = [&](auto use) {
    for (const Wall& wall : walls)
      if (wall.owner != kCut) use(WayOut{wall.normal, wall.slack.head});
  };
  const auto keep_nearer = [](const WayOut& way, WayOut& best) {
    if (way.slack < best.slack) best = way;
  };
  each_wall([&](const WayOut& way) { keep_nearer(way, wall_way); });
  result.way = wall_way;
  for (const Round& r : rounds) keep_nearer(way_out(r), result.way);
  const auto add_ridge = [&](const WayOut& a, const WayOut& b, double least) {
    const Vec3 p = rounded(a.normal), q = rounded(b.normal);
    const double square = norm2(cross(p, q));  // of the sine
    if (!(square > least)) return;
    const double distance = norm(b.slack * p - a.slack * q) / std::sqrt(square);
    if (distance < result.ridge_distance) result.ridge = cross(a.normal, b.normal), result.ridge_distance = distance;
  };
  for (const Round& r : rounds) add_ridge(result.way, way_out(r), kAcross);
  each_wall([&](const WayOut& way) {
    add_ridge(result.way, way, kAcross);
    add_ridge(wall_way, way, kOneDirection);
  });
  return result;
}

/// A unit vector orthogonal to `axis`, and parallel to the nearest wall that is not orthogonal to the axis, if there is
/// one.
WideVector along_an_edge(const WideVector& axis, std::span<const Wall> walls) {
  WideVector best = wide(any_orthogonal(rounded(axis)));
  double least = std::numeric_limits<double>::infinity();
  for (const Wall& wall : walls) {
    const WideVector edge = cross(axis, wall.normal);
    if (norm2(rounded(edge)) < 0.01 || wall.slack.head >= least) continue;
    best = edge, least = wall.slack.head;
  }
  return unit(across(best, axis));
}

/// Whether a ridge, of any length, is not nearly parallel to the slices across a unit vector.
bool steep(const WideVector& ridge, const WideVector& n) {
  return std::abs(rounded(dot(ridge, n))) > kSteep * rounded(norm(ridge));
}

/// Axes with t along a direction.
Axes sheared(const WideVector& l, const WideVector& m, const WideVector& n, const WideVector& along) {
  const DoubleDouble rise = dot(along, n), x = dot(along, l) / rise, y = dot(along, m) / rise;
  return {l, m, n, n + x * l + y * m, x, y};
}

/// Axes with m turned about l, away from m0, which is orthogonal to l. t is along a steep ridge, or else orthogonal to
/// m0.
Axes turned(const WideVector& l, const WideVector& m0, double tangent_of_angle, std::span<const Round> rounds,
            std::span<const Wall> walls) {
  const WideVector n0 = cross(l, m0);
  const DoubleDouble tangent{tangent_of_angle}, cosine = DoubleDouble{1} / sqrt(DoubleDouble{1} + tangent * tangent);
  const WideVector m = cosine * (m0 - tangent * n0), n = cosine * (n0 + tangent * m0);
  const Nearest near = nearest(rounds, walls);
  return sheared(l, m, n, !near.thin() && steep(near.ridge, n) ? near.ridge : n0);
}

/// The same slices, with m across the strips that the slices form along a wall.
Axes along_strips(const Axes& axes, const WideVector& normal) {
  const WideVector flat = across(normal, axes.n);
  if (!(norm2(rounded(flat)) > kSteep * kSteep)) return axes;
  const WideVector m = unit(flat);
  return sheared(cross(m, axes.n), m, axes.n, axes.t);
}

/// Chooses slices parallel to the way out, and to the axis of a cylinder. The slices of two cylinders follow the long
/// axis of the part, if that is known.
Axes choose(std::span<const Round> rounds, std::span<const Wall> walls, double tangent_of_angle,
            const std::optional<Vec3>& long_axis) {
  const Round *one = nullptr, *two = nullptr;
  for (const Round& r : rounds)
    if (!r.ball) (one ? two : one) = &r;
  if (two) {
    const WideVector both = cross(one->axis, two->axis);
    const DoubleDouble sine = norm(both);
    if (sine.head > kOneDirection) {
      const WideVector n = unit(both);
      const Nearest near = nearest(rounds, walls);
      const WideVector out = near.way.normal, flat = across(out, n);
      const double width = rounded(norm(flat)), radius = std::min(one->radius, two->radius);
      if (!(width > 1e-3)) return {cross(unit(cross(one->axis, n)), n), unit(cross(one->axis, n)), n, n, {}, {}};
      const WideVector m = unit(flat), l = cross(m, n);
      WideVector along = n;
      // If the shortest way out is nearly across the slices, the slices are as wide as the common set.
      if (long_axis) along = wide(*long_axis);
      else if (steep(near.ridge, n)) along = near.ridge;
      else if (width > 8 * std::sqrt(std::max(0.0, 2 * near.way.slack / radius))) along = across(n, out);
      return sheared(l, m, n, along);
    }
  }
  if (one) {
    const WayOut nearest_way = nearest(rounds, walls).way, of_side = way_out(*one);
    WideVector out = of_side.normal;
    const bool thin = nearest_way.slack < kThin * of_side.slack;
    if (thin && norm2(rounded(across(nearest_way.normal, one->axis))) > kSteep * kSteep) out = nearest_way.normal;
    if (!(norm2(rounded(out)) > 0)) out = along_an_edge(one->axis, walls);
    const Axes axes = turned(one->axis, unit(across(out, one->axis)), tangent_of_angle, rounds, walls);
    return thin ? along_strips(axes, nearest_way.normal) : axes;
  }
  const WayOut nearest_way = nearest(rounds, walls).way;
  WideVector out = nearest_way.normal;
  if (!rounds.empty()) {
    const WayOut of_ball = way_out(rounds[0]);
    if (norm2(rounded(of_ball.normal)) > 0 && !(nearest_way.slack < kThin * of_ball.slack)) out = of_ball.normal;
  }
  if (!(norm2(rounded(out)) > 0)) out = wide(Vec3{0, 0, 1});
  out = unit(out);
  const WideVector n = along_an_edge(out, walls);
  return turned(cross(out, n), out, tangent_of_angle, rounds, walls);
}

/// False if a wall is nearly parallel to the slices, but not parallel, or if the stack would be a wedge of two planes
/// that end it.
bool even(const Axes& axes, std::span<const Wall> walls, double extent) {
  /// Up to this tilt of the wedge, relative to the distance of its planes, the second order of the tilt is negligible.
  constexpr double kOfWedge = 1e-6;
  const Vec3 l = rounded(axes.l), m = rounded(axes.m), up = rounded(axes.n);
  const Wall *low = nullptr, *high = nullptr;
  for (const Wall& wall : walls) {
    const Vec3 n = rounded(wall.normal);
    const double size = std::max(std::abs(dot(n, l)), std::abs(dot(n, m)));
    if (size > kParallel && size < kRushing) return false;
    if (size > kParallel) continue;
    const Wall*& end = dot(n, up) > 0 ? high : low;
    if (!end || wall.slack.head < end->slack.head) end = &wall;
  }
  if (!low || !high) return true;
  const double tilt = norm(rounded(low->normal + high->normal)), gap = (low->slack + high->slack).head;
  return !(tilt > kOneDirection && tilt * extent > kOfWedge * std::abs(gap));
}

bool two_cylinders(std::span<const Round> rounds) { return rounds.size() > 1 && !rounds[0].ball && !rounds[1].ball; }

/// The axes number `way` among the suitable turns. If no turn is suitable, number 0 is the first turn. The slices of
/// two cylinders whose axes are not parallel cannot be turned.
std::optional<Axes> axes_of(std::span<const Round> rounds, std::span<const Wall> walls, double extent, int way,
                            const std::optional<Vec3>& long_axis) {
  const Axes first = choose(rounds, walls, 0, long_axis);
  const bool fixed = two_cylinders(rounds) && norm(cross(rounds[0].axis, rounds[1].axis)).head > kOneDirection;
  int suit = 0;
  for (const double tangent : kTurns) {
    const Axes axes = tangent == 0 ? first : choose(rounds, walls, tangent, {});
    if (even(axes, walls, extent) && suit++ == way) return axes;
    if (fixed) break;
  }
  return way == 0 ? std::optional(first) : std::nullopt;
}

/// The component of a unit vector along another one. It is 0 if it is only the rounding of double-doubles, because such
/// rounding would make parallel lines cross.
DoubleDouble along(const WideVector& unit, const WideVector& axis) {
  const DoubleDouble component = dot(unit, axis);
  return std::abs(component.head) > 1e-30 ? component : DoubleDouble{};
}

Line line_of(const Wall& wall, const Axes& axes) {
  const DoubleDouble x = along(wall.normal, axes.l), y = along(wall.normal, axes.m), rate = dot(wall.normal, axes.t);
  Line line;
  line.normal = {x.head, y.head};
  line.normal_tail = {x.tail, y.tail};
  line.length = std::hypot(x.head, y.head);
  line.offset = wall.slack.head, line.offset_tail = wall.slack.tail;
  line.rate = rate.head, line.rate_tail = rate.tail;
  line.owner = wall.owner;
  return line;
}

/// Ends the stack at a plane parallel to the slices.
void end_stack(Stack& stack, const Line& line) {
  const double end = line.offset / line.rate;
  const bool upper = line.rate > 0, nearer = upper ? end < stack.high : end > stack.low;
  std::optional<Line>& plane = upper ? stack.high_plane : stack.low_plane;
  if (!nearer || plane) stack.farther.push_back(nearer ? *plane : line);
  if (nearer) (upper ? stack.high : stack.low) = end, plane = line;
}

void add_round(Stack& stack, const Round& r, const Axes& axes) {
  Quadric& q = stack.quadric[stack.quadrics];
  q.ball = r.ball;
  q.owner = r.owner;
  q.radius = r.radius;
  const DoubleDouble level = dot(r.centre, axes.n), radius{r.radius};
  q.level = level.head;
  q.low = (level - radius).head, q.high = (level + radius).head;
  stack.low = std::max(stack.low, q.low), stack.high = std::min(stack.high, q.high);
  if (r.ball) {
    stack.ball = stack.quadrics++;
    q.shear = stack.shear;
    q.centre = {dot(r.centre, axes.l).head, dot(r.centre, axes.m).head};
    q.along = dot(r.centre, axes.t).head;
    const DoubleDouble distance = norm(r.centre);
    q.slack = ((distance - radius) * (distance + radius)).head;
    return;
  }
  const WideVector side = unit(cross(r.axis, axes.n));
  const DoubleDouble x = along(side, axes.l), y = along(side, axes.m), centre = dot(side, r.centre),
                     shear = axes.x * x + axes.y * y;
  q.across = {x.head, y.head};
  q.shear = {shear.head, 0};
  q.centre = {centre.head, 0};
  q.along = (level + shear * centre).head;
  const DoubleDouble distance = sqrt(centre * centre + level * level);
  q.slack = ((distance - radius) * (distance + radius)).head;
  for (const bool upper : {true, false}) {
    Line line;
    const double sign = upper ? 1 : -1;
    line.normal = sign * q.across;
    line.normal_tail = {sign * x.tail, sign * y.tail};
    line.length = 1;
    line.quadric = stack.quadrics;
    line.upper = upper;
    line.owner = r.owner;
    stack.line[stack.lines++] = line;
  }
  ++stack.quadrics;
}

}  // namespace

std::vector<Rushing> rushing(std::span<const Round> rounds, std::span<const Wall> walls, Vec3 point, bool all) {
  std::vector<Rushing> found;
  if (!two_cylinders(rounds)) return found;
  const Vec3 across = rounded(unit(cross(rounds[0].axis, rounds[1].axis)));
  const double most = all ? kRushingAtAll : kRushing;
  for (const Wall& wall : walls) {
    const Vec3 normal = rounded(wall.normal);
    const double tilt = norm(cross(normal, across));
    if (!(tilt > kParallel && tilt < most)) continue;
    const Vec3 beside = point + (wall.slack.head - dot(normal, point)) * normal;
    found.push_back({dot(across, beside), beside});
  }
  std::ranges::sort(found, {}, &Rushing::level);
  return found;
}

std::optional<Stack> stack_of(std::span<const Round> rounds, std::span<const Wall> walls, double extent, int way,
                              const std::optional<Vec3>& long_axis) {
  if (walls.size() > kMostWalls) return std::nullopt;
  const std::optional<Axes> chosen = axes_of(rounds, walls, extent, way, long_axis);
  if (!chosen) return std::nullopt;
  const Axes& axes = *chosen;
  Stack stack;
  stack.l = rounded(axes.l), stack.m = rounded(axes.m), stack.n = rounded(axes.n), stack.t = rounded(axes.t);
  stack.shear = {axes.x.head, axes.y.head};
  stack.low = -extent, stack.high = extent;
  for (const Round& r : rounds) add_round(stack, r, axes);
  for (const Wall& wall : walls) {
    const Line line = line_of(wall, axes);
    if (line.length < kParallel) end_stack(stack, line);
    else stack.line[stack.lines++] = line;
  }
  const double size = 4 * extent * (1 + std::abs(stack.shear.x) + std::abs(stack.shear.y));
  for (const Point normal : {Point{1, 0}, Point{0, 1}, Point{-1, 0}, Point{0, -1}}) {
    Line line;
    line.normal = normal;
    line.offset = size;
    stack.line[stack.lines++] = line;
  }
  return stack;
}

}  // namespace overlapper::slicing
