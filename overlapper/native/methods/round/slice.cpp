#include "methods/round/slice.h"

#include <algorithm>
#include <cfloat>
#include <numbers>

#include "methods/round/segment.h"

namespace overlapper::slicing {

Slice::Slice(const Stack& stack_, double t_) : stack(stack_), t(t_) {
  for (int i = 0; i < stack.quadrics; ++i) {
    const Quadric& q = stack.quadric[i];
    const double square = std::max(0.0, q.half_chord2(t));
    half_chord[i] = std::sqrt(square);
    const double constant = q.constant(t);
    if (q.ball) {
      centre = q.centre - t * q.shear;
      slack = constant;
      radius = half_chord[i];
    } else {
      // The nearer of the two roots of y² − 2 middle y + constant: not as a difference.
      const double middle = q.centre.x - q.shear.x * t;
      const double far = middle > 0 ? middle + half_chord[i] : middle - half_chord[i];
      const double near = far != 0 ? constant / far : 0;
      upper[i] = middle > 0 ? far : near;
      lower[i] = middle > 0 ? near : far;
    }
  }
}

Point Slice::corner(int first, int second) const {
  const Point a = stack.line[first].normal, b = stack.line[second].normal;
  const double p = side(first), q = side(second), inverse = 1 / slicing::cross(a, b);
  return {(p * b.y - q * a.y) * inverse, (a.x * q - b.x * p) * inverse};
}

namespace {

/// Where a line crosses the circle, as lengths along the line from its point nearest to the origin.
struct Crossing {
  Point normal, direction;
  double height;        ///< of the line over the origin
  double discriminant;  ///< negative where they do not cross
  double enter = 0, leave = 0;

  Crossing(const Slice& slice, int line) {
    const Line& l = slice.stack.line[line];
    normal = (1 / l.length) * l.normal;
    direction = {-normal.y, normal.x};
    height = slice.side(line) / l.length;
    const double middle = dot(direction, slice.centre);
    const double constant = height * (height - 2 * dot(normal, slice.centre)) + slice.slack;
    discriminant = middle * middle - constant;
    if (!(discriminant > 0)) return;
    const double root = std::sqrt(discriminant);
    const double far = middle > 0 ? middle + root : middle - root;
    const double near = far != 0 ? constant / far : 0;
    enter = middle > 0 ? near : far;
    leave = middle > 0 ? far : near;
  }
  Point at(double s) const { return height * normal + s * direction; }
};

/// A convex polygon as the lines of its edges; corner i lies between edges i and i + 1. Nothing beyond its size is set.
struct Polygon {
  std::array<int, kMostLines + 8> line;
  std::array<double, kMostLines + 8> x, y;
  int size = 0;

  Point corner(int i) const { return {x[i], y[i]}; }
  void append(int edge, Point p) { line[size] = edge, x[size] = p.x, y[size] = p.y, ++size; }
};

/// Whether two lines of one direction cross at no place but one that rounding has made up: anywhere on the two, or
/// beyond the edge from p to q, although the other line has these on either side.
bool along_one_another(const Slice& slice, int edge, int other, Point p, Point q) {
  const Point a = slice.stack.line[edge].normal, b = slice.stack.line[other].normal;
  const double one = a.x * b.y, two = a.y * b.x, off = std::abs(one - two);
  if (!(off <= 32 * DBL_EPSILON * dot(a, b))) return false;
  if (off <= 32 * DBL_EPSILON * (std::abs(one) + std::abs(two))) return true;
  const double along = dot(slice.corner(edge, other) - p, q - p);
  return !(along >= 0 && along <= dot(q - p, q - p));
}

/// Cuts off what lies beyond the line, with `spare` to work in; false if nothing is left, and then by how much the
/// nearest corner misses it.
bool clip(Polygon& polygon, Polygon& spare, const Slice& slice, int line, double& missed) {
  const Stack& stack = slice.stack;
  const Point normal = stack.line[line].normal;
  const double side = slice.side(line);
  const int size = polygon.size;
  std::array<bool, kMostLines + 8> kept;
  int count = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < size; ++i) {
    const double slack = side - dot(normal, polygon.corner(i));
    most = std::max(most, slack);
    kept[i] = slack >= 0;
    count += kept[i];
  }
  if (count == size) return true;
  missed = most;
  if (count == 0) return false;
  int first = 0;
  while (!kept[first] || kept[first > 0 ? first - 1 : size - 1]) ++first;
  const auto wrapped = [size](int i) { return i < size ? i : i - size; };
  // Of two lines of one direction the nearer is all that counts, whatever rounding says of the other's corners.
  const auto farther = [&](int edge) {
    return slice.side(edge) * stack.line[line].length > side * stack.line[edge].length;
  };
  for (const bool last : {true, false}) {
    const int to = last ? wrapped(first + count) : first, edge = polygon.line[to];
    if (!along_one_another(slice, edge, line, polygon.corner(to > 0 ? to - 1 : size - 1), polygon.corner(to))) continue;
    if (!farther(edge)) return true;
    if (--count == 0) return false;
    if (!last) first = wrapped(first + 1);
  }
  spare.size = 0;
  for (int i = 0; i < count; ++i) {
    const int from = wrapped(first + i);
    spare.append(polygon.line[from], polygon.corner(from));
  }
  const int leaves = polygon.line[wrapped(first + count)], enters = polygon.line[first];
  spare.append(leaves, slice.corner(leaves, line));
  spare.append(line, slice.corner(line, enters));
  std::swap(polygon.size, spare.size);
  std::copy_n(spare.line.begin(), polygon.size, polygon.line.begin());
  std::copy_n(spare.x.begin(), polygon.size, polygon.x.begin());
  std::copy_n(spare.y.begin(), polygon.size, polygon.y.begin());
  return true;
}

/// Of a chord: a corner no farther inside of the circle may lie on it.
constexpr double kBesideCircle = 1e-6;

/// Of the radius: how far the centre is inside of lines that leave the whole disc, but for rounding. That their chords
/// meet no edge is not enough: of a polygon that is nothing but rounding, none does.
constexpr double kBeyondCircle = 0.999;

/// The outline of polygon and disc.
void cut_by_disc(const Polygon& polygon, const Slice& slice, Outline& result) {
  std::array<int, kMostLines + 8> position;
  std::array<double, kMostLines + 8> before, after;  // of the chord, what lies outside of the piece
  int long_edges = 0;
  bool holds_disc = slice.radius > 0;
  for (int i = 0; i < polygon.size; ++i) {
    const int line = polygon.line[i];
    const Crossing crossing(slice, line);
    holds_disc = holds_disc && crossing.height - dot(crossing.normal, slice.centre) >= kBeyondCircle * slice.radius;
    const double from = dot(crossing.direction, polygon.corner(i > 0 ? i - 1 : polygon.size - 1));
    const double to = dot(crossing.direction, polygon.corner(i));
    // Where three lines meet in a point, rounding may turn the edge round that they leave there.
    if (!(from < to)) continue;
    ++long_edges;
    if (!(crossing.discriminant > 0)) continue;
    if (!(std::max(from, crossing.enter) < std::min(to, crossing.leave))) continue;
    const double chord = crossing.leave - crossing.enter;
    before[result.edges] = (from - crossing.enter) / chord, after[result.edges] = (crossing.leave - to) / chord;
    position[result.edges] = long_edges - 1;
    result.edge[result.edges++] = {line, crossing.enter > from, crossing.leave < to};
  }
  result.whole_disc = result.edges == 0 && holds_disc;
  // Both edges at a corner see it inside of the circle, or neither does, and there the outline turns by less than half
  // a turn; unless the polygon is nothing but rounding.
  for (int i = 0; i < result.edges; ++i) {
    const int next = (i + 1) % result.edges;
    const bool adjacent = position[next] == (position[i] + 1) % long_edges && result.edges > 1;
    Outline::Edge &edge = result.edge[i], &other = result.edge[next];
    const bool corner = adjacent && !edge.to_circle && !other.from_circle;
    const Point here = slice.stack.line[edge.line].normal, there = slice.stack.line[other.line].normal;
    if (corner && (slicing::cross(here, there) > 0 || dot(here, there) > 0)) continue;
    if (corner || after[i] > kBesideCircle || before[next] > kBesideCircle) {
      result.edges = 0;
      return;
    }
    edge.to_circle = other.from_circle = true;
  }
}

}  // namespace

Outline outline(const Slice& slice) {
  const Stack& stack = slice.stack;
  Outline result;
  Polygon polygon, spare;
  // The last four lines form a square around everything.
  const int square = stack.lines - 4;
  for (int i = 0; i < 4; ++i) polygon.append(square + i, slice.corner(square + i, square + (i + 1) % 4));
  for (int i = 0; i < stack.lines - 4; ++i) {
    if (clip(polygon, spare, slice, i, result.missed)) continue;
    result.failed = i;
    return result;
  }
  if (stack.ball >= 0) {
    cut_by_disc(polygon, slice, result);
    result.failed = stack.lines;
    if (result.empty()) {
      // How far the disc misses the polygon, roughly: it is enough to compare slices.
      double worst = 0;
      for (int i = 0; i < polygon.size; ++i) {
        const Crossing crossing(slice, polygon.line[i]);
        worst = std::min(worst, crossing.height - dot(crossing.normal, slice.centre) + slice.radius);
      }
      result.missed = worst;
    }
    return result;
  }
  result.edges = polygon.size;
  for (int i = 0; i < polygon.size; ++i) result.edge[i] = {polygon.line[i], false, false};
  return result;
}

void Integrals::add(double weight, const Integrals& other) {
  volume += weight * other.volume;
  first += weight * other.first;
  squares += weight * other.squares;
  products += weight * other.products;
  area += weight * other.area;
  for (int i = 0; i < 3; ++i) {
    pull[i] += weight * other.pull[i];
    moment[i] += weight * other.moment[i];
  }
  across += weight * other.across;
  terms += weight * other.terms;
  border += weight * other.border;
  correction += weight * other.correction;
  blur += weight * other.blur;
}

namespace {

/// Area and moments of a plane region.
struct Region2 {
  double area = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;

  void add_triangle(Point a, Point b, Point c) {
    const double w = slicing::cross(b - a, c - a) / 2;
    const Point s = a + b + c;
    area += w;
    x += w / 3 * s.x;
    y += w / 3 * s.y;
    xx += w / 12 * (a.x * a.x + b.x * b.x + c.x * c.x + s.x * s.x);
    yy += w / 12 * (a.y * a.y + b.y * b.y + c.y * c.y + s.y * s.y);
    xy += w / 12 * (a.x * a.y + b.x * b.y + c.x * c.y + s.x * s.y);
  }

  /// The segment of a disc beyond the chord about `middle` whose outward unit normal is `across`.
  void add_segment(const Segment& unit, double radius, Point middle, Point across) {
    const double r2 = radius * radius, w = unit.area * r2, f = unit.first_across * r2 * radius;
    const double a = unit.second_across * r2 * r2, b = unit.second_along * r2 * r2;
    area += w;
    x += w * middle.x + f * across.x;
    y += w * middle.y + f * across.y;
    xx += w * middle.x * middle.x + 2 * f * middle.x * across.x + a * across.x * across.x + b * across.y * across.y;
    yy += w * middle.y * middle.y + 2 * f * middle.y * across.y + a * across.y * across.y + b * across.x * across.x;
    xy += w * middle.x * middle.y + f * (middle.x * across.y + middle.y * across.x) + (a - b) * across.x * across.y;
  }

  void add_disc(double radius, Point centre) {
    const double w = std::numbers::pi * radius * radius;
    area += w;
    x += w * centre.x;
    y += w * centre.y;
    xx += w * (centre.x * centre.x + radius * radius / 4);
    yy += w * (centre.y * centre.y + radius * radius / 4);
    xy += w * centre.x * centre.y;
  }
};

/// The part of a slice's boundary on a line.
void add_edge(const Slice& slice, int number, Point from, Point to, Integrals& sum) {
  const Stack& stack = slice.stack;
  const Line& line = stack.line[number];
  const Point middle = 0.5 * (from + to);
  const double length = norm(to - from), t = slice.t;
  const double weight = length / line.length;
  sum.correction += weight * (line.offset_tail - line.rate_tail * t - dot(line.normal_tail, middle));
  double terms = std::abs(line.offset) + std::abs(line.rate * t);
  if (line.quadric >= 0) {
    const double far = std::max(std::abs(slice.upper[line.quadric]), std::abs(slice.lower[line.quadric]));
    terms = std::abs(slice.side(number)) + (far > 0 ? stack.quadric[line.quadric].terms(t) / far : 0);
  }
  sum.blur += weight * (terms + std::abs(line.normal.x) * std::max(std::abs(from.x), std::abs(to.x)) +
                        std::abs(line.normal.y) * std::max(std::abs(from.y), std::abs(to.y)));
  // In the orthogonal axes l, m, n.
  const Vec3 place{middle.x + stack.shear.x * t, middle.y + stack.shear.y * t, t};
  Vec3 pull;
  if (line.quadric < 0) {
    pull = weight * Vec3{line.normal.x, line.normal.y, line.rate - dot(stack.shear, line.normal)};
    sum.terms += std::abs(t * weight) * (std::abs(line.rate) + std::abs(stack.shear.x * line.normal.x) +
                                         std::abs(stack.shear.y * line.normal.y));
    if (line.owner != kCut) sum.area += weight;
  } else {
    const Quadric& q = stack.quadric[line.quadric];
    const double half = slice.half_chord[line.quadric];
    pull = length * Vec3{line.normal.x, line.normal.y, half > 0 ? (t - q.level) / half : 0};
    sum.area += half > 0 ? length * q.radius / half : 0;
    sum.terms += half > 0 ? std::abs(t) * length * (std::abs(t) + std::abs(q.level)) / half : 0;
  }
  sum.pull[line.owner] += pull;
  sum.moment[line.owner] += cross(place, pull);
  sum.across += t * pull.z;
  sum.border += norm(pull);
}

/// The arc from p to q, counter-clockwise: the segment beyond its chord, and the strip of the sphere.
void add_arc(const Slice& slice, Point p, Point q, bool major_if_closed, Region2& region, Integrals& sum) {
  const Stack& stack = slice.stack;
  const Quadric& ball = stack.quadric[stack.ball];
  const Point chord = q - p, middle = 0.5 * (p + q);
  const double length = norm(chord);
  if (!(length > 0)) return;
  const Point across{chord.y / length, -chord.x / length};
  double distance = dot(across, middle - slice.centre);  // of the chord beyond the centre
  // Of a chord that rounding may have turned round, what is known of the two lines that it lies between tells the side.
  if (length < 1e-6 * slice.radius) distance = major_if_closed ? -std::abs(distance) : std::abs(distance);
  const double half_angle = std::atan2(length / 2, distance);
  region.add_segment(segment(half_angle), slice.radius, middle, across);
  sum.area += 2 * half_angle * ball.radius;
  const double level = slice.t - ball.level;
  const Vec3 pull{across.x * length, across.y * length, level * 2 * half_angle};
  const Vec3 centre{ball.centre.x, ball.centre.y, ball.level};
  sum.pull[ball.owner] += pull;
  sum.moment[ball.owner] += cross(centre, pull);
  sum.across += slice.t * pull.z;
  sum.terms += std::abs(slice.t) * (std::abs(slice.t) + std::abs(ball.level)) * 2 * half_angle;
  sum.border += 2 * half_angle * ball.radius;
  sum.blur += half_angle * (ball.terms(slice.t) + length * length);
}

void finish(const Region2& r, double t, Integrals& sum) {
  sum.volume = r.area;
  sum.first = {r.x, r.y, r.area * t};
  sum.squares = {r.xx, r.yy, r.area * t * t};
  sum.products = {r.y * t, r.x * t, r.xy};
}

Region2 integrate(const Slice& slice, const Outline& outline, Integrals& sum) {
  Region2 region;
  if (outline.whole_disc) {
    const Quadric& ball = slice.stack.quadric[slice.stack.ball];
    region.add_disc(slice.radius, slice.centre);
    sum.area += 2 * std::numbers::pi * ball.radius;
    const Vec3 pull{0, 0, 2 * std::numbers::pi * (slice.t - ball.level)};
    sum.pull[ball.owner] += pull;
    sum.moment[ball.owner] += cross(Vec3{ball.centre.x, ball.centre.y, ball.level}, pull);
    sum.across += slice.t * pull.z;
    sum.terms += std::abs(slice.t) * (std::abs(slice.t) + std::abs(ball.level)) * 2 * std::numbers::pi;
    sum.border += sum.area;
    sum.blur += 2 * std::numbers::pi * slice.radius * slice.radius;
    return region;
  }
  Point start, last;
  Point first_corner{};
  const int edges = outline.edges;
  for (int i = 0; i < edges; ++i) {
    const Outline::Edge& edge = outline.edge[i];
    const int before = outline.edge[(i + edges - 1) % edges].line, after = outline.edge[(i + 1) % edges].line;
    Point from, to;
    if (edge.from_circle || edge.to_circle) {
      const Crossing crossing(slice, edge.line);
      if (!(crossing.discriminant > 0)) {
        // The line has left the disc by rounding, at its tangent point.
        const Point foot = crossing.at(dot(crossing.direction, slice.centre));
        from = edge.from_circle ? foot : slice.corner(before, edge.line);
        to = edge.to_circle ? foot : slice.corner(edge.line, after);
      } else {
        from = edge.from_circle ? crossing.at(crossing.enter) : slice.corner(before, edge.line);
        to = edge.to_circle ? crossing.at(crossing.leave) : slice.corner(edge.line, after);
      }
    } else {
      from = i > 0 ? last : slice.corner(before, edge.line);
      to = slice.corner(edge.line, after);
    }
    add_edge(slice, edge.line, from, to, sum);
    if (i == 0) start = from, first_corner = from;
    const auto beyond = [&](int line) {
      const Line& l = slice.stack.line[line];
      return slice.side(line) - dot(l.normal, slice.centre) > 0.9 * slice.radius * l.length;
    };
    if (i > 0 && edge.from_circle) {
      add_arc(slice, last, from, beyond(before) && beyond(edge.line), region, sum);
      region.add_triangle(first_corner, last, from);
    }
    if (i > 0) region.add_triangle(first_corner, from, to);
    last = to;
    if (i == edges - 1 && edge.to_circle)
      add_arc(slice, to, start, beyond(edge.line) && beyond(outline.edge[0].line), region, sum);
  }
  return region;
}

}  // namespace

Integrals measure(const Slice& slice, const Outline& outline) {
  Integrals sum;
  const Region2 region = integrate(slice, outline, sum);
  finish(region, slice.t, sum);
  return sum;
}

void add_face(const Line& plane, const Slice& slice, const Outline& outline, Integrals& sum) {
  Integrals of_border;
  const Region2 region = integrate(slice, outline, of_border);
  // The plane is parallel but for less than 1e-11: what it is tilted counts to first order.
  const Point tilt = plane.normal + plane.normal_tail;
  sum.correction += (plane.offset_tail * region.area - plane.rate_tail * slice.t * region.area - tilt.x * region.x -
                     tilt.y * region.y) /
                    std::abs(plane.rate);
  sum.blur += region.area * (std::abs(plane.offset) + std::abs(plane.rate * slice.t)) / std::abs(plane.rate);
  if (plane.owner != kCut) sum.area += region.area;
  const double side = plane.rate > 0 ? 1 : -1;
  sum.pull[plane.owner] += Vec3{0, 0, side * region.area};
  sum.across += slice.t * side * region.area;
  sum.terms += std::abs(slice.t) * region.area;
  sum.border += region.area;
  sum.moment[plane.owner] += cross(Vec3{region.x + slice.stack.shear.x * slice.t * region.area,
                                        region.y + slice.stack.shear.y * slice.t * region.area, slice.t * region.area},
                                   {0, 0, side});
}

}  // namespace overlapper::slicing
