#include "methods/round/lenses/region.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "methods/round/lenses/polynomials.h"

namespace overlapper::lenses {
namespace {

/// The crossings of a line with a circle. Counter-clockwise on the circle, the part beyond the line begins at `leave`
/// and ends at `enter`.
struct Crossings {
  bool cross = false;
  Flat leave, enter;

  /// The line is dot(normal, p) = side, with a unit normal.
  Crossings(const Circle& circle, Flat normal, double side) {
    const Flat way{-normal.y, normal.x};
    const double half = -dot(way, circle.centre);
    const double constant = side * (side - 2 * dot(normal, circle.centre)) - circle.slack;
    const double under_root = half * half - constant;
    if (!(under_root > 0)) return;
    cross = true;
    const double root = std::sqrt(under_root);
    const double far = half > 0 ? -half - root : -half + root, near = far != 0 ? constant / far : 0;
    const auto at = [&](double along) { return circle.on(side * normal + along * way); };
    leave = at(std::min(far, near)), enter = at(std::max(far, near));
  }
};

/// Whether a point of the circle is on its arc from one corner to the next.
bool on_arc(Flat from, Flat to, Flat point) { return cross(to - from, point - from) <= 0; }

void add(Region& region, Flat at, int curve) {
  if (region.corners < Region::kMostCorners) region.corner[region.corners++] = {at.x, at.y, curve};
}

/// Whether only rounding is between two points. An arc between them might as well be the whole circle, by its ends.
bool same(Flat a, Flat b) { return norm(a - b) <= 16 * DBL_EPSILON * (norm(a) + norm(b)); }

/// Whether a wall whose one side has both ends of an arc certainly has all of the arc there. Where the circle is
/// farthest towards the other side, it is then not on the arc.
bool clearly_off(const Circle& circle, Flat normal, Flat from, Flat to, bool inner) {
  constexpr double kClearly = 1e-6;
  const Flat farthest = circle.centre + (inner ? circle.radius : -circle.radius) * normal, chord = to - from,
             way = farthest - from;
  const double beside = cross(chord, way);
  return beside > 0 && beside * beside > kClearly * dot(chord, chord) * (circle.radius * circle.radius);
}

/// Cuts off what is beyond a wall.
void clip(Region& region, int wall, Flat normal, double side) {
  std::array<std::optional<Crossings>, 2> crossings;
  const auto with = [&](int circle) -> const Crossings& {
    auto& found = crossings[circle];
    if (!found) found.emplace(region.circle[circle], normal, side);
    return *found;
  };
  if (region.whole) {
    const int whole = *region.whole;
    const Crossings& found = with(whole);
    if (!found.cross) {
      if (side - dot(normal, region.circle[whole].centre) < 0) region.whole.reset();
      return;
    }
    region.whole.reset();
    add(region, found.leave, 2 + wall);
    add(region, found.enter, whole);
    return;
  }
  std::array<Region::Corner, Region::kMostCorners> before;
  const int corners = region.corners;
  std::copy_n(region.corner.begin(), corners, before.begin());
  region.corners = 0;
  for (int i = 0; i < corners; ++i) {
    const Flat from = before[i].at(), to = before[i + 1 < corners ? i + 1 : 0].at();
    const int curve = before[i].curve;
    const double of_from = side - dot(normal, from), of_to = side - dot(normal, to);
    const bool stays = of_from >= 0, ends = of_to >= 0;
    if (curve >= 2) {
      if (stays) add(region, from, curve);
      if (stays == ends) continue;
      const Flat at = from + (of_from / (of_from - of_to)) * (to - from);
      add(region, at, stays ? 2 + wall : curve);
      continue;
    }
    const auto add_arc = [&](Flat begin, Flat end) {
      if (!same(begin, end)) add(region, begin, curve);
    };
    if (stays == ends && clearly_off(region.circle[curve], normal, from, to, stays)) {
      if (stays) add(region, from, curve);
      continue;
    }
    const Crossings& found = with(curve);
    if (stays == ends && !(found.cross && on_arc(from, to, found.leave) && on_arc(from, to, found.enter))) {
      if (stays) add(region, from, curve);
      continue;
    }
    const Flat leave = found.cross ? found.leave : to, enter = found.cross ? found.enter : from;
    if (stays) add_arc(from, leave);
    else add_arc(enter, ends ? to : leave);
    if (stays || !ends) add(region, leave, 2 + wall);
    if (stays && ends) add_arc(enter, to);
  }
  if (region.corners < 2) region.corners = 0;
}

std::array<double, 2> along(Flat normal, const Line& line) {
  return {dot(normal, line.start), dot(normal, line.slope)};
}

Line shifted(const Line& line, double start, double step) { return {line.at(start), step * line.slope}; }
Quadratic shifted(const Quadratic& p, double start, double step) {
  return {at(p, start), step * (p[1] + 2 * start * p[2]), step * step * p[2]};
}

/// Slices by a variable u with t = start + step u. If a wall crosses the slices fast, u is its side, so that places
/// within its short interval are as accurate as elsewhere.
struct Scaled {
  double start = 0, step = 1;
  Flat normal, way;            ///< of the wall: unit
  std::array<double, 2> side;  ///< of u, for the unit normal
  double low, high;            ///< of u
  Line apart;
  std::array<Line, 2> centre;
  std::array<Quadratic, 2> slack;
  Quadratic difference;
  std::array<double, 5> of_chord;

  Scaled(const Discs& discs, const Cut& cut, double low_, double high_) : low(low_), high(high_) {
    normal = (1 / cut.length) * cut.normal, way = {-normal.y, normal.x};
    side = {cut.offset / cut.length, -cut.rate / cut.length};
    if (std::abs(cut.rate) > cut.length) {
      start = cut.offset / cut.rate, step = -cut.length / cut.rate;
      side = {0, 1};
      constexpr double kFarthest = 16;  // the wall's distance from the foot, where it still meets the unit ball
      const double one = (low - start) / step, other = (high - start) / step;
      low = std::max(-kFarthest, std::min(one, other)), high = std::min(kFarthest, std::max(one, other));
    }
    apart = shifted(discs.apart, start, step);
    centre = {shifted(discs.first_centre(), start, step), shifted(discs.second_centre(), start, step)};
    slack = {shifted(discs.first_slack, start, step), shifted(discs.second_slack, start, step)};
    difference = shifted(discs.difference, start, step);
    of_chord = chord(apart, shifted(discs.centre, start, step), shifted(discs.slack, start, step), difference);
  }
  double t(double u) const { return start + step * u; }
};

/// The values of u where the line of a wall goes through a crossing of both circles: 4 G² = B² C, with C as in chord().
/// G = w A·A − D/2 n·A − X n·A⊥, and B = n·A⊥. A leads from the first centre to the second. D is the difference of the
/// slacks, X is A × the first centre, and w is the wall's side about the foot.
std::array<double, 7> through_crossing(const Scaled& of) {
  const Line& a = of.apart;
  const Line turned{{-a.start.y, a.start.x}, {-a.slope.y, a.slope.x}};
  const auto of_a = along(of.normal, a), of_turned = along(of.normal, turned);
  const Quadratic x = cross(a, of.centre[0]);
  const auto first = product(of.side, dot(a, a)), second = product(of_a, of.difference), third = product(of_turned, x);
  std::array<double, 4> g;
  for (size_t i = 0; i < g.size(); ++i) g[i] = first[i] - second[i] / 2 - third[i];
  const auto square = product(g, g);
  const auto other = product(product(of_turned, of_turned), of.of_chord);
  std::array<double, 7> result;
  for (size_t i = 0; i < result.size(); ++i) result[i] = 4 * square[i] - other[i];
  return result;
}

/// The side of a wall by u, for its unit normal.
std::array<double, 2> side_by(const Scaled& of, const Cut& cut) {
  return {cut.side(of.start) / cut.length, -cut.rate * of.step / cut.length};
}

/// The line in which two walls meet, along u. No value if both are nearly parallel in the slices.
std::optional<Line> meeting(const Scaled& of, const Cut& one, const Cut& other) {
  const Flat a = (1 / one.length) * one.normal, b = (1 / other.length) * other.normal;
  const double both = cross(a, b);
  if (!(std::abs(both) > 1e-9)) return std::nullopt;
  const auto of_a = side_by(of, one), of_b = side_by(of, other);
  const auto at = [&](size_t i) {
    return (1 / both) * Flat{of_a[i] * b.y - of_b[i] * a.y, of_b[i] * a.x - of_a[i] * b.x};
  };
  return Line{at(0), at(1)};
}

/// Collects the values of t that matter: their points are not clearly outside another wall or a disc.
class WallChanges {
 public:
  WallChanges(const Discs& discs, double low, double high, Changes& result)
      : discs_(discs), low_(low), high_(high), near_(1e-3 * (high - low)), result_(result) {}

  void run() {
    for (int i = 0; i < discs_.cuts; ++i) {
      const Cut& cut = discs_.cut[i];
      const Scaled of(discs_, cut, low_, high_);
      if (!(of.low < of.high)) continue;
      for (const int k : {0, 1}) add_touching(of, i, k);
      add_crossings(of);
      for (int j = 0; j < discs_.cuts; ++j) {
        const Cut& other = discs_.cut[j];
        // Edges are found by the variable of the faster wall.
        const double faster = std::abs(cut.rate) * other.length - std::abs(other.rate) * cut.length;
        if (faster > 0 || (faster == 0 && j < i))
          if (const auto line = meeting(of, cut, other)) add_edge(of, i, j, *line);
      }
    }
  }

 private:
  void add_touching(const Scaled& of, int i, int k) {
    const auto aside = along(of.way, of.centre[k]);
    const auto square = product(of.side, of.side), a = product(aside, aside),
               b = product(of.side, along(of.normal, of.centre[k]));
    Quadratic touching;
    for (size_t j = 0; j < touching.size(); ++j) touching[j] = a[j] - square[j] + 2 * b[j] + of.slack[k][j];
    const Roots found = roots<2>(touching, of.low, of.high);
    for (int j = 0; j < found.count; ++j) {
      const double u = found.t[j];
      add(of.t(u), (of.side[0] + of.side[1] * u) * of.normal + dot(of.way, of.centre[k].at(u)) * of.way, i, i);
    }
  }
  void add_crossings(const Scaled& of) {
    const Roots found = roots<6>(through_crossing(of), of.low, of.high);
    for (int j = 0; j < found.count; ++j) result_.add(of.t(found.t[j]));
  }
  /// Where an edge of two walls meets a circle, or a third wall.
  void add_edge(const Scaled& of, int i, int j, const Line& edge) {
    const Quadratic size = dot(edge, edge);
    for (const int k : {0, 1}) {
      const Quadratic to_centre = dot(edge, of.centre[k]);
      Quadratic on;
      for (size_t m = 0; m < on.size(); ++m) on[m] = size[m] - 2 * to_centre[m] - of.slack[k][m];
      const Roots found = roots<2>(on, of.low, of.high);
      for (int m = 0; m < found.count; ++m) add(of.t(found.t[m]), edge.at(found.t[m]), i, j);
    }
    for (int k = 0; k < discs_.cuts; ++k) {
      if (k == i || k == j) continue;
      const Cut& third = discs_.cut[k];
      const auto height = along((1 / third.length) * third.normal, edge), side = side_by(of, third);
      const double u = (side[0] - height[0]) / (height[1] - side[1]);
      if (u > of.low && u < of.high) add(of.t(u), edge.at(u), i, j);
    }
  }
  void add(double t, Flat point, int i, int j) {
    for (int k = 0; k < discs_.cuts; ++k) {
      const Cut& cut = discs_.cut[k];
      if (k != i && k != j && dot(cut.normal, point) - cut.side(t) > near_ * cut.length) return;
    }
    const double square = dot(point, point);
    for (const int k : {0, 1})
      if (square - 2 * dot(point, centre_[k].at(t)) - at(*slack_[k], t) > near_ * (high_ - low_ + near_)) return;
    result_.add(t);
  }

  const Discs& discs_;
  const double low_, high_, near_;
  Changes& result_;
  const std::array<Line, 2> centre_{discs_.first_centre(), discs_.second_centre()};
  const std::array<const Quadratic*, 2> slack_{&discs_.first_slack, &discs_.second_slack};
};

}  // namespace

Circle::Circle(Flat centre_, double slack_, double radius_)
    : centre(centre_), slack(slack_), radius(radius_), away_(std::sqrt(dot(centre_, centre_))) {
  if (away_ > 0) ahead_ = (-1 / away_) * centre;
}

Flat Circle::on(Flat near) const {
  const double along = dot(ahead_, near), y = cross(ahead_, near);
  const double square = radius * radius - y * y;
  // Elsewhere, the circle runs across the line, and the place along the line has all the digits that y has.
  if (!(square > y * y)) return near;
  const double root = std::sqrt(square);
  const double x = along + away_ > 0 ? (slack - y * y) / (away_ + root) : -root - away_;
  return x * ahead_ + y * Flat{-ahead_.y, ahead_.x};
}

namespace {

/// The lens about the middle of its chord. Both centres are then on the x axis.
void become_lens(const Section& section, Region& result) {
  const double half = section.half_chord, square = half * half;
  result.ahead = section.ahead;
  result.origin = section.chord * result.ahead + section.aside * result.aside();
  const auto radius = [&](double to_chord) { return std::sqrt(square + to_chord * to_chord); };
  result.circle = {Circle({-section.to_first, 0}, square, radius(section.to_first)),
                   Circle({section.to_second, 0}, square, radius(section.to_second))};
  add(result, {0, -half}, 0);
  add(result, {0, half}, 1);
}

/// The lens, or a whole disc, about the foot.
void become_about_foot(const Discs& discs, const Section& section, double t, Region& result) {
  const bool second = section.outline == Outline::kSecond;
  const Flat centre = (second ? discs.second_centre() : discs.first_centre()).at(t);
  const double away = std::sqrt(dot(centre, centre));
  result.about_foot = true;
  result.ahead = away > 0 ? (-1 / away) * centre : Flat{1, 0};
  const auto circle = [&](const Line& line, const Quadratic& slack, const Quadratic& square) {
    const Flat at_t = line.at(t);
    return Circle({dot(result.ahead, at_t), cross(result.ahead, at_t)}, at(slack, t),
                  std::sqrt(std::max(0.0, at(square, t))));
  };
  result.circle = {circle(discs.first_centre(), discs.first_slack, discs.first_square),
                   circle(discs.second_centre(), discs.second_slack, discs.second_square)};
  if (section.outline != Outline::kLens) {
    result.whole = second;
    return;
  }
  const Flat between = discs.apart.at(t);
  const double apart = std::sqrt(dot(between, between));
  const Flat normal = (-1 / apart) * Flat{dot(result.ahead, between), cross(result.ahead, between)};
  const Crossings found(result.circle[0], normal, -at(discs.difference, t) / (2 * apart));
  if (!found.cross) return;
  // The first circle's arc is on the other side of the line, from where the circle enters to where it leaves.
  add(result, found.enter, 0);
  add(result, found.leave, 1);
}

/// Whether a wall cuts a thin part from the lens beside the foot. The lens itself is then not thin.
bool cuts_thin_part(const Discs& discs, const Section& section, double t, double tail) {
  constexpr double kThin = 0.1;
  const auto rise = [&](double to_chord) {
    const double square = section.half_chord * section.half_chord;
    return square / (std::sqrt(square + to_chord * to_chord) + std::abs(to_chord));
  };
  const double thin = kThin * (rise(section.to_first) + rise(section.to_second));
  for (int i = 0; i < discs.cuts; ++i)
    if (std::abs(discs.cut[i].side(t, tail)) < thin * discs.cut[i].length) return true;
  return false;
}

}  // namespace

Region region(const Discs& discs, const Section& section, double t, double tail) {
  Region result;
  if (section.outline == Outline::kNothing) return result;
  if (section.outline == Outline::kLens && !cuts_thin_part(discs, section, t, tail)) become_lens(section, result);
  else become_about_foot(discs, section, t, result);
  const Flat aside = result.aside();
  for (int i = 0; i < discs.cuts && !result.empty(); ++i) {
    const Cut& cut = discs.cut[i];
    const Flat normal{dot(cut.normal, result.ahead) / cut.length, dot(cut.normal, aside) / cut.length};
    clip(result, i, normal, (cut.side(t, tail) - dot(cut.normal, result.origin)) / cut.length);
  }
  return result;
}

void add_changes_by_walls(const Discs& discs, double low, double high, Changes& result) {
  WallChanges(discs, low, high, result).run();
}

}  // namespace overlapper::lenses
