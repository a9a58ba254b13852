#include "methods/round/seam/part.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "geometry/cancellation.h"
#include "geometry/wide_pose.h"
#include "methods/round/pieces/enclosing_polytope.h"

namespace overlapper::seam {
namespace {

/// Rounding of a place on the seam, relative to its distance from the inner point.
constexpr double kRounding = 1e-12;
/// Below this sine, the angle between two surfaces is rounding.
constexpr double kLeastSine = 3e-8;

bool goes_up(Vec3 v) { return v.x != 0 ? v.x > 0 : v.y != 0 ? v.y > 0 : v.z > 0; }

}  // namespace

Quadric quadric_of(const slicing::Round& round) {
  const WideVector centre = round.ball ? round.centre : slicing::foot(round);
  Quadric q;
  q.radius = round.radius;
  q.b = q.centre = rounded(centre);
  q.slack = (norm(centre) - DoubleDouble{round.radius}).head * (norm(centre) + DoubleDouble{round.radius}).head;
  q.ball = round.ball, q.cylinder = !round.ball;
  if (round.ball) {
    const double r = round.radius;
    q.stretch = {{r, 0, 0}, {0, r, 0}, {0, 0, r}};
    return q;
  }
  q.axis = rounded(round.axis);
  const Vec3 u = any_orthogonal(q.axis);
  q.k = {u, cross(q.axis, u), {}};
  return q;
}

Quadric quadric_of(const Placed& ellipsoid, Vec3 half_axes, Vec3 inside) {
  const WideMatrix turn = wide_rotation(ellipsoid.orientation);
  const double least = std::min({half_axes.x, half_axes.y, half_axes.z});
  const WideVector own = apply_transposed(turn, wide_difference(ellipsoid.position, inside));
  const auto over = [&](DoubleDouble x, double h) { return DoubleDouble{least} * x / DoubleDouble{h}; };
  const WideVector centre{over(own.x, half_axes.x), over(own.y, half_axes.y), over(own.z, half_axes.z)};
  const Mat3 back = transposed(ellipsoid.pose.rotation);
  Quadric q;
  q.k = {least / half_axes.x * back.row0, least / half_axes.y * back.row1, least / half_axes.z * back.row2};
  q.b = apply_transposed(q.k, rounded(centre));
  q.slack = (norm(centre) - DoubleDouble{least}).head * (norm(centre) + DoubleDouble{least}).head;
  q.centre = ellipsoid.position - inside;
  q.stretch = transposed(Mat3{half_axes.x * back.row0, half_axes.y * back.row1, half_axes.z * back.row2});
  return q;
}

bool Part::holds(Vec3 x, Sides sides) {
  const double rounding = kRounding * norm(x);
  const auto side_of = [&](int owner) {
    for (const int side : sides)
      if (side != kRound && faces_[side].owner == owner) return side;
    return kRound;
  };
  for (int i = 0; i < static_cast<int>(faces_.size()); ++i) {
    const Face& face = faces_[i];
    if (i == sides[0] || i == sides[1]) continue;
    const double room = face.slack - dot(face.normal, x);
    if (room > rounding) continue;
    if (room < -rounding) return false;
    // A point on a cut belongs to one of the two pieces, and a point on two faces of a body to one of them.
    if (face.owner == slicing::kCut ? !goes_up(face.normal) : i < side_of(face.owner)) return false;
  }
  if (const Quadric* other = beside(sides); other && other->value(x) > rounding * norm(other->gradient(x)))
    return false;
  for (const auto& pair : flush_)
    if (std::abs(faces_[pair[0]].slack - dot(faces_[pair[0]].normal, x)) <= misplaced + rounding) touching_ = true;
  return true;
}

const Quadric* Part::beside(Sides sides) const {
  if (sides[0] == kRound && sides[1] == kRound) return nullptr;
  if (sides[0] != kRound && sides[1] != kRound) return nullptr;
  const int face = sides[0] == kRound ? sides[1] : sides[0];
  return round[rim_of_ >= 0 ? 1 - rim_of_ : faces_[face].owner];
}

void Part::add_rims(int body, size_t first, size_t last, std::vector<SeamPoint>& points) {
  const Quadric* own = round[body];
  if (!own || !own->cylinder) return;
  constexpr double kAcross = 0.5;  // cuts contain the axis or are orthogonal to it
  rim_of_ = body;
  for (size_t i = first; i < last; ++i)
    if (faces_[i].owner == slicing::kCut && std::abs(dot(faces_[i].normal, own->axis)) > kAcross)
      add_section(*this, static_cast<int>(i), *own, points);
  rim_of_ = -1;
}

void Part::add(std::vector<SeamPoint>& points) {
  faces_.clear(), flush_.clear();
  for (const slicing::Wall& wall : walls) faces_.push_back({rounded(wall.normal), wall.slack.head, wall.owner});
  const int size = static_cast<int>(faces_.size());
  const double near = misplaced + 16 * DBL_EPSILON * extent;
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j) {
      const Face &a = faces_[i], &b = faces_[j];
      if (a.owner != 0 || b.owner != 1 || !(dot(a.normal, b.normal) > 0)) continue;
      if (std::abs(a.slack - b.slack) + extent * norm(cross(a.normal, b.normal)) <= near) flush_.push_back({i, j});
    }
  const size_t before = points.size();
  for (int i = 0; i < size; ++i) {
    cancellation_point();
    if (faces_[i].owner == slicing::kCut) continue;
    if (const Quadric* other = round[1 - faces_[i].owner]) add_section(*this, i, *other, points);
    for (int j = 0; j < size; ++j)
      if (faces_[i].owner == 0 && faces_[j].owner == 1) add_ridge(i, j, points);
  }
  if (round[0] && round[1]) {
    const Quadric &a = *round[0], &b = *round[1];
    const bool parallel = a.cylinder && b.cylinder && norm(cross(a.axis, b.axis)) <= 1e-11;
    if (coincide(a, b)) touching_ = touching_ || anything();
    else if ((a.ball && b.ball) || parallel) add_radical(*this, points);
    else if (a.cylinder || b.cylinder)
      add_on_cylinder(*this, a.cylinder && !(b.cylinder && b.radius < a.radius) ? 0 : 1, points);
    else add_followed(*this, points);
  }
  for (size_t i = before; i < points.size(); ++i) {
    const auto& [n, m] = points[i].outward;
    if (points[i].weight > 0 && !(norm(cross(n, m)) > kLeastSine * norm(n) * norm(m))) touching_ = true;
  }
}

/// Adds the line in which two faces cross. Gauss's two nodes are exact for products of two linear functions. The end of
/// a cylinder has more nodes, for functions that are not polynomials.
void Part::add_ridge(int of_first, int of_second, std::vector<SeamPoint>& points) {
  const WideVector n = walls[of_first].normal, m = walls[of_second].normal, wide_across = cross(n, m);
  const Vec3 across = rounded(wide_across);
  if (!(norm(across) > 4 * DBL_EPSILON)) return;
  const Vec3 along = unit(across);
  const WideVector start =
      (walls[of_first].slack * cross(m, wide_across) + walls[of_second].slack * cross(wide_across, n)) /
      dot(wide_across, wide_across);
  const Vec3 origin = rounded(start);
  double low = -2 * extent, high = 2 * extent;
  for (const Face& face : faces_) {
    const double rate = dot(face.normal, along), room = face.slack - dot(face.normal, origin);
    if (!(std::abs(rate) > 8 * DBL_EPSILON)) continue;
    (rate > 0 ? high : low) = rate > 0 ? std::min(high, room / rate) : std::max(low, room / rate);
  }
  for (const Quadric* q : round) {
    if (!q) continue;
    const Vec3 k_along = q->k * along;
    const double square = norm2(k_along), middle = dot(q->gradient(origin), along), constant = q->value(origin);
    if (!(square > 1e-30)) {
      if (constant > 0) return;
      continue;
    }
    const double discriminant = middle * middle - square * constant;
    if (!(discriminant > 0)) return;
    const double far = -(middle + std::copysign(std::sqrt(discriminant), middle));
    const double one = far / square, two = far != 0 ? constant / far : 0;
    low = std::max(low, std::min(one, two)), high = std::min(high, std::max(one, two));
  }
  if (!(low < high) || !holds(origin + (low / 2 + high / 2) * along, {of_first, of_second})) return;
  const auto at = [&](double far) {
    return SeamPoint{origin + far * along, {faces_[of_first].normal, faces_[of_second].normal}, 1 / norm(across)};
  };
  if (round[0] || round[1]) {
    Quadrature(at, points).add(low, high);
    return;
  }
  const double node = std::sqrt(1.0 / 12), length = high - low;
  for (const double share : {0.5 - node, 0.5 + node}) {
    points.push_back(at(low + share * length));
    points.back().weight *= length / 2;
  }
}

bool Part::coincide(const Quadric& a, const Quadric& b) const {
  // Places are within `extent`, and values grow by the gradient.
  const double near = misplaced + 16 * DBL_EPSILON * extent;
  if (a.cylinder != b.cylinder) return false;
  if (a.cylinder) {
    if (!(extent * norm(cross(a.axis, b.axis)) <= near)) return false;
    return norm(a.centre - b.centre) <= near && std::abs(a.radius - b.radius) <= near;
  }
  if (!(norm(a.centre - b.centre) <= near)) return false;
  if (a.ball && b.ball) return std::abs(a.radius - b.radius) <= near;
  // The axes of both may be numbered in other orders.
  const Mat3 one = transposed(a.k) * a.k, two = transposed(b.k) * b.k;
  const double size = std::max({norm(one.row0), norm(one.row1), norm(one.row2)});
  const Mat3 off = one - two;
  return a.radius == b.radius && norm(off.row0) + norm(off.row1) + norm(off.row2) <= 16 * DBL_EPSILON * size &&
         std::abs(a.slack - b.slack) <= near * (norm(a.b) + near);
}

/// Whether walls leave anything of the part.
bool Part::anything() const {
  pieces::EnclosingPolytope rest;
  rest.become({{-extent, -extent, -extent}, {extent, extent, extent}});
  const double thin = misplaced + 16 * DBL_EPSILON * extent;
  return std::ranges::all_of(
      faces_, [&](const Face& face) { return rest.cut({face.normal, face.slack - thin, pieces::kNoWall}); });
}

}  // namespace overlapper::seam
