#include "methods/round/lenses/discs.h"

#include <algorithm>
#include <cfloat>

#include "geometry/constants.h"
#include "geometry/fitted_axes.h"

namespace overlapper::lenses {
namespace {

WideVector scaled_by(const WideVector& a, const WideVector& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
WideVector inverse(const WideVector& v) {
  const DoubleDouble one{1};
  return {one / v.x, one / v.y, one / v.z};
}
DoubleDouble twice(DoubleDouble a) { return {2 * a.head, 2 * a.tail}; }

Mat3 rounded(const WideMatrix& m) { return {rounded(m.row0), rounded(m.row1), rounded(m.row2)}; }

/// The matrix K, from the first body's ball to the second's.
WideMatrix between_balls(const StretchedBall& first, const StretchedBall& second, const WideVector& inverse_second) {
  const WideMatrix &a = first.rotation, &b = second.rotation;
  const auto row = [&](int axis) {
    const auto of_b = [&](const WideVector& v) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; };
    const DoubleDouble scale = of_b(inverse_second);
    if (first.ball || second.ball) {
      // The axes of the ball are those of the ellipsoid.
      const DoubleDouble own = scale * of_b(first.half_axes);
      return WideVector{axis == 0 ? own : DoubleDouble{}, axis == 1 ? own : DoubleDouble{},
                        axis == 2 ? own : DoubleDouble{}};
    }
    const WideVector turned =
        scaled(a.row0, of_b(b.row0)) + scaled(a.row1, of_b(b.row1)) + scaled(a.row2, of_b(b.row2));
    return scaled(scaled_by(turned, first.half_axes), scale);
  };
  return {row(0), row(1), row(2)};
}

/// The direction of a rim. If a face is much nearer to the inner point than a shallow part of the first body is wide,
/// the common part is a sliver along the face and the body's surface. `contact` leads to the first body's centre. Zero
/// if there is no such face.
Vec3 rim(std::span<const slicing::Wall> walls, Vec3 contact, double slack) {
  constexpr double kShallow = 1e-4, kNear = 0.05, kLeastAngle = 1e-3;
  if (!(slack <= kShallow)) return {};
  for (const slicing::Wall& wall : walls) {
    if (wall.owner == slicing::kCut || !(wall.slack.head * wall.slack.head <= kNear * kNear * slack)) continue;
    const Vec3 along = cross(rounded(wall.normal), contact);
    if (norm2(along) > kLeastAngle * kLeastAngle * norm2(contact)) return unit(along);
  }
  return {};
}

/// The direction across the slices. There are two such directions; this is the one that is more across the contact, or
/// more along the part, unless the other one is wanted.
Vec3 across_slices(const Principal& of, Vec3 contact, Vec3 along, bool other) {
  const auto& [low, middle, high] = of.value;
  const double whole = high - low;
  if (!(whole > 4 * DBL_EPSILON * high)) return norm2(contact) > 0 ? any_orthogonal(unit(contact)) : of.axis[0];
  const double sine = std::sqrt((high - middle) / whole), cosine = std::sqrt((middle - low) / whole);
  const Vec3 a = cosine * of.axis[0] + sine * of.axis[2], b = cosine * of.axis[0] - sine * of.axis[2];
  const auto size = [](Vec3 p, Vec3 q) { return std::abs(overlapper::dot(p, q)); };
  if (norm2(along) > 0) return unit((size(a, along) >= size(b, along)) != other ? a : b);
  return unit((size(a, contact) <= size(b, contact)) != other ? a : b);
}

/// Axes of a slice, and their images by K.
struct Axes {
  Vec3 n, x, y;
  WideVector along_n, along_x, along_y;  ///< K n, K x, K y
  DoubleDouble xx, yy, xy;               ///< (K x) · (K x), ...

  /// With x along the contact, surfaces that are nearly parallel there have small components along y. These small
  /// components are found in double-double, so the angles between surfaces have all digits.
  Axes(Vec3 normal, Vec3 contact, const WideMatrix& k) : n(normal), x(along(normal, contact)), y(cross(normal, x)) {
    along_n = k * wide(n), along_x = k * wide(x), along_y = k * wide(y);
    xx = overlapper::dot(along_x, along_x), yy = overlapper::dot(along_y, along_y);
    xy = overlapper::dot(along_x, along_y);
  }
  static Vec3 along(Vec3 normal, Vec3 contact) {
    const auto across = [&](Vec3 v) { return v - overlapper::dot(v, normal) * normal; };
    const Vec3 found = across(contact);
    constexpr double kLeast = 1e-3;
    if (!(norm2(found) > kLeast * kLeast * norm2(contact))) return any_orthogonal(normal);
    return unit(across(unit(found)));  // the first difference cancels digits
  }
  double oval() const {
    const double mean = (xx.head + yy.head) / 2;
    return std::max(std::abs((xx - yy).head) / 2, std::abs(xy.head)) / mean;
  }
};

/// Axes whose slices are discs up to the rounding of doubles. Newton's method tilts them until the form of the second
/// body is the same in all directions of the plane.
Axes settled_axes(Vec3 normal, Vec3 contact, const WideMatrix& k) {
  Axes axes(normal, contact, k);
  constexpr int kMostSteps = 3;
  for (int step = 0; step < kMostSteps && axes.oval() > 2 * DBL_EPSILON; ++step) {
    const double x = overlapper::dot(axes.along_x, axes.along_n).head,
                 y = overlapper::dot(axes.along_y, axes.along_n).head;
    const double size = x * x + y * y, half = (axes.xx - axes.yy).head / 2, both = axes.xy.head;
    if (!(size > 0)) break;
    const double tilt_x = (half * x + both * y) / size, tilt_y = (both * x - half * y) / size;
    if (!(tilt_x * tilt_x + tilt_y * tilt_y < 0x1p-20)) break;
    const Axes next(unit(axes.n + tilt_x * axes.x + tilt_y * axes.y), contact, k);
    if (!(next.oval() < axes.oval())) break;
    axes = next;
  }
  return axes;
}

/// The values of t where a radius vanishes. `square` is concave.
std::array<double, 2> ends_of(const Quadratic& square) {
  const double half = square[1] / 2, bend = -square[2], under_root = half * half + bend * square[0];
  if (!(under_root > 0)) return {kInfinity, -kInfinity};
  const double root = std::sqrt(under_root);
  if (half > 0) return {-square[0] / (half + root), (half + root) / bend};
  return {(half - root) / bend, square[0] / (root - half)};
}

/// Up to this sine of the angle between a wall and the slices, the wall ends them.
constexpr double kParallel = 0x1p-46;

void add_wall(const slicing::Wall& wall, const Axes& axes, Flat lean, Discs& result) {
  const DoubleDouble x = overlapper::dot(wall.normal, wide(axes.x)), y = overlapper::dot(wall.normal, wide(axes.y)),
                     n = overlapper::dot(wall.normal, wide(axes.n));
  const DoubleDouble rate = n + (DoubleDouble{lean.x} * x + DoubleDouble{lean.y} * y);
  Cut cut{{x.head, y.head}, std::hypot(x.head, y.head),  wall.slack.head, rate.head,
          n.head,           wall.owner != slicing::kCut, wall.slack.tail, rate.tail};
  if (cut.length > kParallel) {
    result.cut[result.cuts++] = cut;
    return;
  }
  cut.rate = n.head;
  std::optional<Cut>& end = result.end[n.head > 0];
  if (!end || (cut.offset / n.head - end->offset / end->rate) * n.head < 0) end = cut;
}

}  // namespace

std::array<double, 4> Discs::ends() const {
  const auto a = ends_of(first_square);
  const auto b = cylinder ? std::array{-kInfinity, kInfinity} : ends_of(second_square);
  return {a[0], a[1], b[0], b[1]};
}

Mat3 Discs::moved_along_axes(const Mat3& moved) const {
  const Mat3 axes = transposed({normal, x, y});
  return axes * moved * transposed(axes);
}

Vec3 Discs::moment(const Mat3& moved, const quadric::Stretch& stretch) const {
  const Mat3 w = moved_along_axes(moved);
  const Vec3 h = stretch.half_axes, c = stretch.cofactors;
  return {h.y * c.z * w.row1.z - h.z * c.y * w.row2.y, h.z * c.x * w.row2.x - h.x * c.z * w.row0.z,
          h.x * c.y * w.row0.y - h.y * c.x * w.row1.x};
}

std::array<double, 2> Discs::range() const {
  const auto [a_low, a_high, b_low, b_high] = ends();
  std::array<double, 2> found{std::max(a_low, b_low), std::min(a_high, b_high)};
  if (end[0]) found[0] = std::max(found[0], end[0]->offset / end[0]->rate);
  if (end[1]) found[1] = std::min(found[1], end[1]->offset / end[1]->rate);
  return found;
}

/// If the middle value is above the geometric mean of the others, the largest value is nearer to it than the smallest
/// value. Rounding is relative to the largest value, so it matters less then.
bool better_first(const StretchedBall& first, const StretchedBall& second) {
  const Vec3 a = rounded(first.half_axes), b = rounded(second.half_axes);
  if (first.ball || second.ball) {
    std::array<double, 3> values{a.x / b.x, a.y / b.y, a.z / b.z};
    std::ranges::sort(values);
    return values[1] * values[1] >= values[0] * values[2];
  }
  const Mat3 p = transposed(rounded(first.rotation)), q = transposed(rounded(second.rotation));
  double of_second = 0, of_first = 0;
  int i = 0;
  for (const Vec3 along_a : {p.row0, p.row1, p.row2}) {
    int j = 0;
    for (const Vec3 along_b : {q.row0, q.row1, q.row2}) {
      const double cosine = overlapper::dot(along_a, along_b), ratio = cosine * a[i] / b[j],
                   back = cosine * b[j] / a[i];
      of_second += ratio * ratio, of_first += back * back;
      ++j;
    }
    ++i;
  }
  const double scale = std::cbrt(a.x / b.x * (a.y / b.y) * (a.z / b.z));
  return of_first * scale * scale >= of_second / (scale * scale);
}

std::optional<Discs> discs(const StretchedBall& first, const StretchedBall& second) {
  const WideVector inverse_second = inverse(second.half_axes);
  // A ball has any axes; those of the other body make K diagonal.
  const WideMatrix &rotation = first.ball ? second.rotation : first.rotation,
                   &rotation_of_second = second.ball ? first.rotation : second.rotation;
  const WideVector k_centre = scaled_by(inverse_second, apply_transposed(rotation_of_second, second.centre));
  if (!(overlapper::dot(k_centre, k_centre).head < 1)) return std::nullopt;
  const WideVector c = scaled_by(inverse(first.half_axes), apply_transposed(rotation, first.centre));
  std::optional<Discs> result = discs(c, SecondBall{between_balls(first, second, inverse_second), k_centre}, {});
  if (result) result->first_rotation = rotation;
  return result;
}

std::optional<Discs> discs(const WideVector& c, const SecondBall& second, std::span<const slicing::Wall> walls,
                           bool other, Vec3 leading) {
  const WideMatrix& k = second.k;
  const WideVector& k_centre = second.middle;
  const DoubleDouble one{1}, slack_first = one - overlapper::dot(c, c),
                             slack_second = one - overlapper::dot(k_centre, k_centre);
  if (!(slack_first.head > 0) || walls.size() > kMostCuts) return std::nullopt;
  const Mat3 plain = rounded(k);
  const Vec3 contact = rounded(c);
  if (norm2(leading) == 0) leading = rim(walls, contact, slack_first.head);
  const Axes axes = settled_axes(across_slices(principal(plain), contact, leading, other), contact, k);

  Discs result;
  result.normal = axes.n, result.x = axes.x, result.y = axes.y;
  result.oval = axes.oval();
  result.second_ball = plain, result.second_middle = rounded(k_centre);
  const DoubleDouble value = (axes.xx + axes.yy) / DoubleDouble{2}, round = one / value;
  const DoubleDouble c_n = overlapper::dot(c, wide(axes.n)), c_x = overlapper::dot(c, wide(axes.x)),
                     c_y = overlapper::dot(c, wide(axes.y));
  // About -c_n, in the plane where the first body's surface is across c. A small slack keeps the foot near.
  const double steep = c_x.head * c_x.head + c_y.head * c_y.head + slack_first.head;
  Flat lean{-c_n.head * c_x.head / steep, -c_n.head * c_y.head / steep};
  const DoubleDouble p_x = round * overlapper::dot(axes.along_n, axes.along_x),
                     p_y = round * overlapper::dot(axes.along_n, axes.along_y);
  const auto of_second = [&](const WideVector& v) { return round * overlapper::dot(k_centre, v); };
  const DoubleDouble g_n = of_second(axes.along_n), g_x = of_second(axes.along_x), g_y = of_second(axes.along_y);
  // The centres: of the first (c_x, c_y) − t lean, of the second (g_x, g_y) − t (m_x, m_y).
  const DoubleDouble e_x = g_x - c_x, e_y = g_y - c_y;
  const Flat start{c_x.head, c_y.head}, between{e_x.head, e_y.head};
  const double apart2 = dot(between, between);
  const double share = apart2 > 0 ? std::clamp(-dot(start, between) / apart2, 0.0, 1.0) : 0;
  // The part inside a thin cylinder leads along its axis. The foot then stays beside it, and slacks stay small.
  if (const double square = dot(start, start); second.cylinder && square > 0) {
    const Flat aside{-start.y, start.x};
    lean = lean - (share * dot(aside, Flat{p_x.head, p_y.head}) / square) * aside;
  }
  constexpr double kLeastAlong = 1e-2;
  if (const double rise = overlapper::dot(leading, axes.n); std::abs(rise) > kLeastAlong)
    lean = {overlapper::dot(leading, axes.x) / rise, overlapper::dot(leading, axes.y) / rise};
  result.lean = lean, result.first_level = c_n.head;
  const DoubleDouble lean_x{lean.x}, lean_y{lean.y};
  const WideVector along = axes.along_n + (lean_x * axes.along_x + lean_y * axes.along_y);
  const DoubleDouble m_x = round * overlapper::dot(along, axes.along_x),
                     m_y = round * overlapper::dot(along, axes.along_y);
  using Slack = std::array<DoubleDouble, 3>;
  const Slack of_first{slack_first, twice(c_n + lean_x * c_x + lean_y * c_y),
                       -(one + lean_x * lean_x + lean_y * lean_y)};
  const Slack of_other{round * slack_second, twice(g_n + lean_x * g_x + lean_y * g_y),
                       -(round * overlapper::dot(along, along))};
  result.apart = {between, {(lean_x - m_x).head, (lean_y - m_y).head}};
  const DoubleDouble part{share}, rest = one - part;
  result.share = share;
  result.centre = {{(c_x + part * e_x).head, (c_y + part * e_y).head},
                   {-(rest * lean_x + part * m_x).head, -(rest * lean_y + part * m_y).head}};
  for (int i = 0; i < 3; ++i) {
    result.slack[i] = (rest * of_first[i] + part * of_other[i]).head;
    result.difference[i] = (of_first[i] - of_other[i]).head;
    result.first_slack[i] = of_first[i].head, result.second_slack[i] = of_other[i].head;
  }
  result.first_square = {(slack_first + c_x * c_x + c_y * c_y).head, 2 * c_n.head, -1};
  // A section that is not quite a disc is replaced by a disc of equal area. The square of the radius is a difference.
  // It may be small relative to its change by the section's shape.
  const DoubleDouble whole = value / (axes.xx * axes.yy - axes.xy * axes.xy);
  const auto dot_in_section = [&](DoubleDouble a_x, DoubleDouble a_y, DoubleDouble b_x, DoubleDouble b_y) {
    return whole * (axes.yy * a_x * b_x + axes.xx * a_y * b_y - axes.xy * (a_x * b_y + a_y * b_x));
  };
  result.second_square = {
      (of_other[0] + dot_in_section(g_x, g_y, g_x, g_y)).head, 2 * (g_n - dot_in_section(g_x, g_y, p_x, p_y)).head,
      (dot_in_section(p_x, p_y, p_x, p_y) - round * overlapper::dot(axes.along_n, axes.along_n)).head};
  result.second_rise = std::sqrt(-result.second_square[2] * value.head);
  result.cylinder = second.cylinder;
  if (second.cylinder) result.second_square = {round.head, 0, 0}, result.second_rise = 0;
  for (const slicing::Wall& wall : walls) add_wall(wall, axes, lean, result);
  return result;
}

}  // namespace overlapper::lenses
