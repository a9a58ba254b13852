#include "methods/round/pieces/planar_part.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <limits>
#include <numbers>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/quadric/segment.h"
#include "methods/round/slicing/slice.h"

namespace overlapper::pieces {
namespace {

using slicing::cross;
using slicing::dot;
using Flat = slicing::Point;

/// The rounding of areas, relative to the border of the part times the size of its places.
constexpr double kRounding = 64 * DBL_EPSILON;

/// Keeps the part of a polygon inside a wall.
void keep_inside(const Wall& wall, WidePolygon& polygon, WidePolygon& spare) {
  spare.clear();
  const auto slack = [&](const WideVector& p) { return wall.slack - overlapper::dot(wall.normal, p); };
  const auto negative = [](DoubleDouble s) { return s.head < 0; };
  for (size_t i = 0; i < polygon.size(); ++i) {
    const WideVector &p = polygon[i], &q = polygon[i + 1 < polygon.size() ? i + 1 : 0];
    const DoubleDouble at_p = slack(p), at_q = slack(q);
    if (!negative(at_p)) spare.push_back(p);
    if (negative(at_p) != negative(at_q) && at_p.head != 0 && at_q.head != 0)
      spare.push_back(p + (at_p / (at_p - at_q)) * (q - p));
  }
  polygon.swap(spare);
}

/// The conic in which a plane cuts a round, mapped to the unit circle. A point of the plane at (x, y) of the circle is
/// at the place width x, height y from the middle, along u and v. A plane along a cylinder's axis has no height: its
/// points are told apart by their places alone.
struct Conic {
  WideVector middle, across;  ///< a point that the circle is about, and the direction of y there
  Vec3 u, v;
  double width = 0, height = 0;
  bool ball = false;
  DoubleDouble radius;  ///< m, of the unit circle

  /// False if the plane misses the ball.
  bool become(const Round& round, const WideVector& point, const WideVector& normal) {
    const Vec3 n = rounded(normal);
    ball = round.ball;
    if (ball) {
      const DoubleDouble away = overlapper::dot(normal, round.centre - point), whole{round.radius};
      const DoubleDouble square = (whole - away) * (whole + away);
      if (!(square.head > 0)) return false;
      u = any_orthogonal(n), v = overlapper::cross(n, u), across = wide(v);
      middle = round.centre - away * normal, radius = sqrt(square), width = height = radius.head;
      return true;
    }
    const Vec3 axis = rounded(round.axis), beside = rounded(overlapper::cross(round.axis, normal));
    u = unit(norm2(beside) > 0 ? beside : any_orthogonal(n)), v = overlapper::cross(n, u);
    const Vec3 e = overlapper::cross(u, axis);
    const double sine = overlapper::dot(v, e);
    across = overlapper::unit(wide(sine < 0 ? -e : e)), middle = round.centre, radius = DoubleDouble{round.radius};
    width = round.radius, height = round.radius / std::abs(sine);
    return true;
  }
  /// The area of the plane per area of the circle.
  double area() const { return width * height; }
  /// Whether the conic is so long that places along it keep more digits.
  bool strip() const { return !(height <= 2 * width); }
};

/// ∫ x xᵀ dA of a flat region.
struct FlatProducts {
  double xx = 0, xy = 0, yy = 0;

  void add(double weight, Flat p) { xx += weight * p.x * p.x, xy += weight * p.x * p.y, yy += weight * p.y * p.y; }
  /// p qᵀ + q pᵀ.
  void add(Flat p, Flat q) { xx += 2 * p.x * q.x, xy += p.x * q.y + p.y * q.x, yy += 2 * p.y * q.y; }
};

/// A point of the plane.
struct OnPlane {
  Flat circle, place;
};

/// A part of the polygon's border inside the conic.
struct Chord {
  OnPlane from, to;
  bool from_corner, to_corner;  ///< an end of the polygon's edge
  size_t edge;
};

class Sectioning {
 public:
  PlanarPart part(const WidePolygon& polygon, const WideVector& normal, const Round& round) {
    if (!conic_.become(round, polygon[0], normal)) return {};
    find_corners(polygon);
    chords_.clear();
    around_ = std::isfinite(conic_.height);
    bool large = false;  // too small a polygon has no middle of a circle
    for (size_t i = 0; i < corners_.size(); ++i) {
      around_ = add_edge(i) && around_;
      const Corner &here = corners_[i], &first = corners_[0];
      large = large || std::hypot((here.x - first.x).head, (here.y - first.y).head) > 1;
    }
    around_ = around_ && large;
    if (chords_.empty() && !around_) return {};
    integrate();
    return in_space(polygon[0], wide(conic_.u), wide(conic_.v));
  }

  /// All of a polygon.
  PlanarPart whole(const WidePolygon& polygon, const WideVector& normal) {
    const WideVector u = wide(any_orthogonal(rounded(normal))), v = overlapper::cross(normal, u);
    chords_.clear(), middle_ = {}, around_ = false;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const auto at = [&](const WideVector& p) {
        const WideVector from = p - polygon[0];
        return OnPlane{{}, {overlapper::dot(u, from).head, overlapper::dot(v, from).head}};
      };
      chords_.push_back({at(polygon[i]), at(polygon[i + 1 < polygon.size() ? i + 1 : 0]), true, true, i});
    }
    corners_.resize(polygon.size());
    integrate();
    return in_space(polygon[0], u, v);
  }

 private:
  struct Corner {
    DoubleDouble x, y;  ///< on the circle
    Flat place;
  };

  void find_corners(const WidePolygon& polygon) {
    corners_.clear();
    const WideVector u = wide(conic_.u);
    const WideVector from_start = conic_.middle - polygon[0];
    const double along = overlapper::dot(wide(conic_.v), from_start).head;
    middle_ = {overlapper::dot(u, from_start).head, conic_.strip() ? 0 : along};
    if (!conic_.strip() && !conic_.ball) {
      // The centre of a cylinder is any point of its axis: the middle of the conic is where the plane meets the axis.
      const double off = overlapper::dot(conic_.across, polygon[0] - conic_.middle).head;
      middle_.y = -off * conic_.height / conic_.radius.head;
    }
    for (const WideVector& p : polygon) {
      const WideVector from = p - conic_.middle;
      Corner corner{overlapper::dot(u, from) / conic_.radius, overlapper::dot(conic_.across, from) / conic_.radius, {}};
      corner.place = {conic_.width * corner.x.head, conic_.height * corner.y.head};
      if (conic_.strip()) corner.place.y = overlapper::dot(wide(conic_.v), p - polygon[0]).head;
      corners_.push_back(corner);
    }
  }

  /// Adds the part of an edge inside the circle. True if the circle's middle is on the inner side of the edge.
  bool add_edge(size_t i) {
    const Corner &p = corners_[i], &q = corners_[i + 1 < corners_.size() ? i + 1 : 0];
    const DoubleDouble x = q.x - p.x, y = q.y - p.y;
    const double length = std::hypot(x.head, y.head);
    const OnPlane from{{p.x.head, p.y.head}, p.place}, to{{q.x.head, q.y.head}, q.place};
    // The ends of a shorter edge are one corner, found twice with different rounding.
    constexpr double kOnePoint = 1e-24;
    if (!(length > kOnePoint * (1 + std::hypot(p.x.head, p.y.head)))) {
      if (std::hypot(from.circle.x, from.circle.y) < 1) chords_.push_back({from, to, true, true, i});
      return true;
    }
    const Flat way{x.head / length, y.head / length};
    const double off = (p.x * y - p.y * x).head / length, square = (1 - off) * (1 + off);
    if (!(square > 0)) return off > 0;
    const double half = std::sqrt(square), start = dot(from.circle, way), end = dot(to.circle, way);
    const double low = std::max(start, -half), high = std::min(end, half);
    if (low < high) {
      const auto at = [&](double along) {
        const Flat circle{off * way.y + along * way.x, along * way.y - off * way.x};
        Flat place{conic_.width * circle.x, conic_.height * circle.y};
        if (conic_.strip()) place.y = from.place.y + (along - start) / length * (to.place.y - from.place.y);
        return OnPlane{circle, place};
      };
      chords_.push_back({start >= low ? from : at(low), end <= high ? to : at(high), start >= low, end <= high, i});
    }
    return off > 0;
  }

  /// Sums over the region between chords and arcs, about the first corner.
  void integrate() {
    area_ = rim_ = border_ = extent_ = 0, first_ = {}, second_ = {};
    if (chords_.empty()) {
      area_ = std::numbers::pi * conic_.area(), rim_ = 2 * std::numbers::pi * conic_.height;
      start_ = {};
      second_.add(area_ / 4, {conic_.width, 0}), second_.add(area_ / 4, {0, conic_.height});
      return;
    }
    start_ = chords_[0].from.place;
    double chords = 0;
    for (const Chord& chord : chords_) chords += length(chord.to.circle - chord.from.circle);
    constexpr double kShort = 1e-3;
    nearly_whole_ = around_ && chords < kShort;
    for (size_t i = 0; i < chords_.size(); ++i) {
      const Chord &chord = chords_[i], &next = chords_[i + 1 < chords_.size() ? i + 1 : 0];
      add_triangle(chord.from.place, chord.to.place);
      rim_ += length(chord.to.place - chord.from.place);
      const bool adjacent = next.edge == (chord.edge + 1 < corners_.size() ? chord.edge + 1 : 0);
      if (chord.to_corner && next.from_corner && adjacent) continue;
      add_triangle(chord.to.place, next.from.place);
      add_segment(chord.to, next.from);
    }
  }

  static double length(Flat a) { return std::hypot(a.x, a.y); }

  void add_triangle(Flat from, Flat to) {
    const Flat p = from - start_, q = to - start_;
    const double area = cross(p, q) / 2;
    area_ += area, first_ = first_ + (area / 3) * (p + q);
    for (const Flat corner : {p, q, p + q}) second_.add(area / 12, corner);
    border_ += length(to - from), extent_ = std::max(extent_, length(to));
  }

  void add_segment(const OnPlane& from, const OnPlane& to) {
    const Flat way = to.circle - from.circle;
    const double chord = length(way);
    if (!std::isfinite(conic_.height)) {
      rim_ += length(to.place - from.place) / std::max(std::abs(from.circle.x), DBL_MIN);
      return;
    }
    // The two ends are one point but for rounding, with no arc between, or with nearly all of the circle.
    constexpr double kOnePoint = 1e-12;
    if (!(chord > 0) || (chord < kOnePoint && !nearly_whole_)) return;
    const Flat out{way.y / chord, -way.x / chord}, mid = 0.5 * (from.circle + to.circle);
    const double sine = chord / 2, cosine = dot(mid, out), half_angle = std::atan2(sine, cosine);
    const quadric::Segment segment = quadric::segment(half_angle, sine, cosine);
    const double area = conic_.area() * segment.area;
    const Flat ahead{conic_.width * out.x, conic_.height * out.y};
    const Flat middle = 0.5 * (from.place + to.place) - start_, first = (conic_.area() * segment.first_across) * ahead;
    area_ += area, first_ = first_ + (area * middle + first);
    second_.add(area, middle), second_.add(middle, first);
    second_.add(conic_.area() * segment.second_across, ahead);
    second_.add(conic_.area() * segment.second_along, (1 / chord) * (to.place - from.place));
    rim_ += 2 * half_angle * conic_.height;
  }

  PlanarPart in_space(const WideVector& origin, const WideVector& u, const WideVector& v) const {
    PlanarPart found;
    found.area = std::max(0.0, area_), found.rim = rim_;
    found.error = kRounding * (border_ * extent_ + found.area);
    const Flat at = start_ + middle_;
    const Vec3 start = rounded(origin + (DoubleDouble{at.x} * u + DoubleDouble{at.y} * v));
    const Vec3 along = rounded(u), across = rounded(v), first = first_.x * along + first_.y * across;
    found.first = found.area * start + first;
    const auto [xx, xy, yy] = second_;
    found.second = outer(start, found.area * start + first) + outer(first, start) +
                   outer(along, xx * along + xy * across) + outer(across, xy * along + yy * across);
    return found;
  }

  Conic conic_;
  std::vector<Corner> corners_;
  std::vector<Chord> chords_;
  bool around_ = false;        ///< the middle of the circle is inside the polygon
  bool nearly_whole_ = false;  ///< the polygon cuts nearly nothing from the circle
  Flat middle_;                ///< the origin of places, seen from the polygon's first corner
  Flat start_, first_;
  FlatProducts second_;
  double area_ = 0, rim_ = 0, border_ = 0, extent_ = 0;
};

struct Work {
  Sectioning sectioning;
  WidePolygon part, spare;
};

}  // namespace

void add_planar_part(const WidePolygon& polygon, const WideVector& normal, const Pieces& body, PlanarPart& sum) {
  const Scratch<Work> work;
  auto& [sectioning, part, spare] = *work;
  for (int i = 0; i < static_cast<int>(body.pieces.size()); ++i) {
    cancellation_point();
    part = polygon;
    for (const Wall& wall : body.of(i)) {
      if (part.size() < 3) break;
      keep_inside(wall, part, spare);
    }
    if (part.size() < 3) continue;
    const int round = body.pieces[i].round;
    sum.add(round < 0 ? sectioning.whole(part, normal) : sectioning.part(part, normal, body.rounds[round]));
  }
}

bool face_within(std::span<const Wall> walls, size_t i, const WideVector& middle, double radius, WidePolygon& face) {
  const Scratch<WidePolygon> spare;
  const Wall& wall = walls[i];
  const WideVector foot = middle - (overlapper::dot(wall.normal, middle) - wall.slack) * wall.normal;
  const Vec3 u = any_orthogonal(rounded(wall.normal)), v = overlapper::cross(rounded(wall.normal), u);
  face.clear();
  for (const auto [x, y] : {Flat{1, 1}, Flat{-1, 1}, Flat{-1, -1}, Flat{1, -1}})
    face.push_back(foot + wide(2 * radius * (x * u + y * v)));
  for (size_t j = 0; j < walls.size() && face.size() >= 3; ++j) {
    if (j == i) continue;
    const bool same = walls[j].normal == wall.normal && walls[j].slack == wall.slack;
    if (same && j < i) face.clear();
    if (!same) keep_inside(walls[j], face, *spare);
  }
  return face.size() >= 3;
}

Mat3 moved_by_walls(const Round& ball, std::span<const Wall> walls, size_t count) {
  const Scratch<Work> work;
  auto& [sectioning, part, spare] = *work;
  Mat3 sum{{}, {}, {}};
  for (size_t i = 0; i < count; ++i) {
    cancellation_point();
    const Wall& wall = walls[i];
    if (!face_within(walls, i, ball.centre, ball.radius, part)) continue;
    const Vec3 normal = rounded(wall.normal), first = sectioning.part(part, wall.normal, ball).first;
    sum = sum + outer(first, normal);
  }
  return sum;
}

}  // namespace overlapper::pieces
