#include "methods/round/slicing/slice.h"

#include <algorithm>
#include <cfloat>
#include <span>

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
      const double middle = q.centre.x - q.shear.x * t;
      const double far = middle > 0 ? middle + half_chord[i] : middle - half_chord[i];
      const double near = q.nearer(far, middle, constant, t);
      upper[i] = middle > 0 ? far : near;
      lower[i] = middle > 0 ? near : far;
    }
  }
}

namespace {

/// The crossings of a line and the circle.
struct Crossing {
  Point normal, direction;
  double height;                ///< distance of the line from the origin, along the normal
  double discriminant;          ///< negative if the line misses the circle
  double enter = 0, leave = 0;  ///< lengths along the line, from its point nearest to the origin

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

/// A convex polygon by the lines of its edges. Corner i lies between edges i and i + 1. Entries beyond `size` are not
/// set.
struct Polygon {
  std::array<int, kMostLines + 8> line;
  std::array<double, kMostLines + 8> x, y;
  int size = 0;

  Point corner(int i) const { return {x[i], y[i]}; }
  void append(int edge, Point p) { line[size] = edge, x[size] = p.x, y[size] = p.y, ++size; }
};

bool of_one_direction(Point a, Point b) {
  const double one = a.x * b.y, two = a.y * b.x;
  return dot(a, b) > 0 && std::abs(one - two) <= 32 * DBL_EPSILON * (std::abs(one) + std::abs(two));
}

/// Whether two lines run in one direction, so that their crossing is only rounding. The crossing may then be anywhere
/// on the lines. It may also lie outside the edge from p to q, although p and q are on different sides of the other
/// line.
bool along_one_another(const Slice& slice, int edge, int other, Point p, Point q) {
  const Point a = slice.stack.line[edge].normal, b = slice.stack.line[other].normal;
  if (!(std::abs(cross(a, b)) <= 32 * DBL_EPSILON * dot(a, b))) return false;
  if (of_one_direction(a, b)) return true;
  const double along = dot(slice.corner(edge, other) - p, q - p);
  return !(along >= 0 && along <= dot(q - p, q - p));
}

/// Handles an edge that is nearer to the line, and parallel to it, than the error of corners far away. The sides alone
/// then tell which of the two is nearer to the origin, and the nearer one stays. True if there is such an edge.
bool replaced(Polygon& polygon, const Slice& slice, int line) {
  const Line& b = slice.stack.line[line];
  const double near = 64 * DBL_EPSILON * slice.stack.line[slice.stack.lines - 1].offset * b.length;
  for (int i = 0; i < polygon.size; ++i) {
    const Line& a = slice.stack.line[polygon.line[i]];
    if (!of_one_direction(a.normal, b.normal)) continue;
    const double farther = slice.side(polygon.line[i]) * (b.length / a.length) - slice.side(line);
    if (!(std::abs(farther) <= near)) continue;
    if (farther <= 0) return true;
    const int before = i > 0 ? i - 1 : polygon.size - 1, after = i + 1 < polygon.size ? i + 1 : 0;
    const Point from = slice.corner(polygon.line[before], line), to = slice.corner(line, polygon.line[after]);
    polygon.line[i] = line;
    polygon.x[before] = from.x, polygon.y[before] = from.y;
    polygon.x[i] = to.x, polygon.y[i] = to.y;
    return true;
  }
  return false;
}

/// The corners of a polygon on the inner side of a line: `count` corners in turn, from `first`.
struct InnerCorners {
  int first = 0, count = 0;

  InnerCorners(const Polygon& polygon, Point normal, double side) {
    const int size = polygon.size;
    std::array<bool, kMostLines + 8> inner;
    for (int i = 0; i < size; ++i) {
      inner[i] = side - dot(normal, polygon.corner(i)) >= 0;
      count += inner[i];
    }
    if (count == size || count == 0) return;
    while (!inner[first] || inner[first > 0 ? first - 1 : size - 1]) ++first;
  }
};

/// Cuts off the part beyond the line; false if nothing is left. `spare` is memory, which is exchanged with the polygon.
bool clip(Polygon*& now, Polygon*& spare_one, const Slice& slice, int line) {
  if (replaced(*now, slice, line)) return true;
  const Polygon& polygon = *now;
  Polygon& spare = *spare_one;
  const Stack& stack = slice.stack;
  const double side = slice.side(line);
  const int size = polygon.size;
  auto [first, count] = InnerCorners(polygon, stack.line[line].normal, side);
  if (count == size) return true;
  if (count == 0) return false;
  const auto wrapped = [size](int i) { return i < size ? i : i - size; };
  // If two lines run in one direction, only the nearer line counts. Rounding may misplace the corners of the other
  // line.
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
  std::swap(now, spare_one);
  return true;
}

/// A corner inside the circle may lie on the circle if the chord ends within this fraction of its length.
constexpr double kBesideCircle = 1e-6;

/// If lines leave the whole disc, the distance of its centre inside them is at least this fraction of the radius.
/// Chords that meet no edge are not enough: in a polygon that is only rounding, none does.
constexpr double kBeyondCircle = 0.999;

/// Joins edges that do not share a corner by arcs. A corner must be inside the circle for both of its edges or for
/// neither. At a corner the outline turns by less than half a turn. Otherwise the polygon is only rounding, and the
/// outline becomes empty. `position` has the numbers of edges among the `long_edges` of the polygon. `before` and
/// `after` are the fractions of an edge's chord outside the edge.
void close_with_arcs(const Slice& slice, std::span<const int> position, int long_edges, std::span<const double> before,
                     std::span<const double> after, Outline& result) {
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

/// The outline of the common part of the polygon and the disc.
void cut_by_disc(const Polygon& polygon, const Slice& slice, Outline& result) {
  std::array<int, kMostLines + 8> position;
  std::array<double, kMostLines + 8> before, after;  // fractions of the chord outside the edge
  int long_edges = 0;
  bool holds_disc = slice.radius > 0;
  for (int i = 0; i < polygon.size; ++i) {
    const int line = polygon.line[i];
    const Crossing crossing(slice, line);
    holds_disc = holds_disc && crossing.height - dot(crossing.normal, slice.centre) >= kBeyondCircle * slice.radius;
    const double from = dot(crossing.direction, polygon.corner(i > 0 ? i - 1 : polygon.size - 1));
    const double to = dot(crossing.direction, polygon.corner(i));
    // If three lines meet in a point, rounding may reverse the edge between them.
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
  close_with_arcs(slice, std::span(position).first(result.edges), long_edges, before, after, result);
}

/// Whether two neighbouring lines have opposite directions and meet beyond the square around everything. Only rounding
/// is then between them.
bool is_flat(const Polygon& polygon, const Slice& slice) {
  constexpr double kParallel = 1e-12;
  const Stack& stack = slice.stack;
  const double far = 2 * stack.line[stack.lines - 1].offset;
  for (int i = 0; i < polygon.size; ++i) {
    const int first = polygon.line[i], next = polygon.line[i + 1 < polygon.size ? i + 1 : 0];
    const Line &a = stack.line[first], &b = stack.line[next];
    if (std::abs(slicing::cross(a.normal, b.normal)) >= kParallel * a.length * b.length) continue;
    const Point corner = slice.corner(first, next);
    if (dot(a.normal, b.normal) < 0 && !(std::max(std::abs(corner.x), std::abs(corner.y)) <= far)) return true;
  }
  return false;
}

}  // namespace

Outline outline(const Slice& slice) {
  const Stack& stack = slice.stack;
  Outline result;
  Polygon one, other, *polygon = &one, *spare = &other;
  // The last four lines form a square around everything.
  const int square = stack.lines - 4;
  for (int i = 0; i < 4; ++i) polygon->append(square + i, slice.corner(square + i, square + (i + 1) % 4));
  for (int i = 0; i < square; ++i)
    if (!clip(polygon, spare, slice, i)) return result;
  if (is_flat(*polygon, slice)) return result;
  if (stack.ball >= 0) {
    cut_by_disc(*polygon, slice, result);
    return result;
  }
  result.edges = polygon->size;
  for (int i = 0; i < polygon->size; ++i) result.edge[i] = {polygon->line[i], false, false};
  return result;
}

namespace {

/// The lines of a slice without the square around everything, and their sides.
struct LineSides {
  const Slice& slice;
  int lines;
  std::array<double, kMostLines + 8> side;

  explicit LineSides(const Slice& slice_) : slice(slice_), lines(slice_.stack.lines - 4) {
    for (int i = 0; i < lines; ++i) side[i] = slice.side(i);
  }
  double slack(int i, Point p) const { return side[i] - dot(slice.stack.line[i].normal, p); }

  bool hold_disc() const {
    for (int i = 0; i < lines; ++i)
      if (!(slack(i, slice.centre) > slice.radius * slice.stack.line[i].length)) return false;
    return slice.radius > 0;
  }
  /// Whether a point is inside all lines but two.
  bool hold(Point p, int but, int and_but) const {
    for (int i = 0; i < lines; ++i)
      if (!(slack(i, p) > 0) && i != but && i != and_but) return false;
    return true;
  }
  /// Whether the arc of the circle from p to q is inside all lines. p is on the line `before`, and q on the line
  /// `after`. For every other line that cuts the circle, the circle's farthest point along its normal must not be on
  /// the arc.
  bool hold_arc(Point p, Point q, int before, int after) const {
    const Point chord = q - p;
    if (!(dot(chord, chord) > 1e-12 * slice.radius * slice.radius)) return false;
    for (int i = 0; i < lines; ++i) {
      const Line& line = slice.stack.line[i];
      if (i == before || i == after || slack(i, slice.centre) > slice.radius * line.length) continue;
      const Point farthest = slice.centre + (slice.radius / line.length) * line.normal;
      if (!(slicing::cross(chord, farthest - p) > 0)) return false;
    }
    return true;
  }
  bool hold_ends(const Outline::Edge& edge, Point from, Point to, int after) const {
    if (edge.from_circle && !hold(from, edge.line, edge.line)) return false;
    if (!hold(to, edge.line, edge.to_circle ? edge.line : after)) return false;
    if (slice.stack.ball < 0 || edge.to_circle) return true;
    const Point beside = to - slice.centre;
    return dot(beside, beside) < slice.radius * slice.radius;
  }
};

/// The ends of edge i of an outline. `first` is where edge 0 begins, and `last` is where edge i - 1 ends. False if the
/// edge has no ends, or if it is reversed.
bool find_ends(const Slice& slice, const Outline& outline, int i, Point first, Point last, Point& from, Point& to) {
  const int edges = outline.edges;
  const Outline::Edge& edge = outline.edge[i];
  from = last;
  if (edge.from_circle || edge.to_circle) {
    const Crossing crossing(slice, edge.line);
    if (!(crossing.discriminant > 0)) return false;
    if (edge.from_circle) from = crossing.at(crossing.enter);
    if (edge.to_circle) to = crossing.at(crossing.leave);
  }
  if (!edge.from_circle && i == 0) from = slice.corner(outline.edge[edges - 1].line, edge.line);
  if (!edge.to_circle) {
    if (edges == 1) return false;
    to = i + 1 < edges ? slice.corner(edge.line, outline.edge[i + 1].line) : first;
  }
  const Point normal = slice.stack.line[edge.line].normal, way = to - from;
  return normal.x * way.y - normal.y * way.x > 0;
}

}  // namespace

bool is_outline(const Slice& slice, const Outline& outline) {
  const LineSides sides(slice);
  if (outline.whole_disc) return sides.hold_disc();
  const int edges = outline.edges;
  Point first, last;
  for (int i = 0; i < edges; ++i) {
    const Outline::Edge& edge = outline.edge[i];
    const int before = outline.edge[i > 0 ? i - 1 : edges - 1].line;
    const int after = outline.edge[i + 1 < edges ? i + 1 : 0].line;
    Point from, to;
    if (edge.line >= sides.lines || !find_ends(slice, outline, i, first, last, from, to)) return false;
    if (i == 0) first = from;
    if (!sides.hold_ends(edge, from, to, after)) return false;
    if (i > 0 && edge.from_circle && !sides.hold_arc(last, from, before, edge.line)) return false;
    if (i + 1 == edges && edge.to_circle && !sides.hold_arc(to, first, edge.line, outline.edge[0].line)) return false;
    last = to;
  }
  return edges > 0;
}

void Integrals::add(double weight, const Integrals& other) {
  volume += weight * other.volume;
  first += weight * other.first;
  squares += weight * other.squares;
  products += weight * other.products;
  area += weight * other.area;
  first_area += weight * other.first_area;
  for (int i = 0; i < 3; ++i) {
    pull[i] += weight * other.pull[i];
    moment[i] += weight * other.moment[i];
  }
  across += weight * other.across;
  terms += weight * other.terms;
  border += weight * other.border, cut_border += weight * other.cut_border;
  correction += weight * other.correction;
  uneven += weight * other.uneven;
  blur += weight * other.blur;
  for (int i = 0; i < 6; ++i) seen[i] += weight * other.seen[i];
}

}  // namespace overlapper::slicing
