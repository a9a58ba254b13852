#include "methods/round/slicing/nodes.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <numbers>
#include <utility>

#include "geometry/lanes.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::slicing {
namespace {

struct Points {
  Row x, y;
};

double sum(const Row& row) { return ((row[0] + row[1]) + (row[2] + row[3])) + ((row[4] + row[5]) + (row[6] + row[7])); }

/// A shorter chord, relative to the radius, has a direction that is mostly the rounding of its ends.
constexpr double kShort = 1e-6;

/// quadric::Segment of each slice.
struct Segments {
  Row area, first_across, second_across, second_along;
};

template <size_t kTerms>
void narrow_segments(const Row& angle, Segments& result) {
  const quadric::SegmentSeries& of = quadric::kSegmentSeries;
  for (int k = 0; k < kRow; ++k) {
    const double square = angle[k] * angle[k], cube = square * angle[k];
    result.area[k] = cube * quadric::series<kTerms>(of.area, square);
    result.first_across[k] = cube * quadric::series<kTerms>(of.first_across, square);
    result.second_across[k] = cube * quadric::series<kTerms>(of.second_across, square);
    result.second_along[k] = cube * quadric::series<kTerms>(of.second_along, square);
  }
}

/// Sets the segments that are not narrow. Sums are in another order than in quadric::segment().
void wide_segments(const Row& angle, const Row& sine, const Row& cosine, Segments& result) {
  for (int k = 0; k < kRow; ++k) {
    const double s = sine[k], c = cosine[k], cube = s * s * s, area = angle[k] - s * c;
    const bool wide = angle[k] >= quadric::kNarrow;
    result.area[k] = wide ? area : result.area[k];
    result.first_across[k] = wide ? 2.0 / 3 * cube - c * area : result.first_across[k];
    result.second_across[k] =
        wide ? (area + 2 * cube * c) / 4 - 4.0 / 3 * c * cube + c * c * area : result.second_across[k];
    result.second_along[k] = wide ? (3 * area - 2 * cube * c) / 12 : result.second_along[k];
  }
}

void find_sides_by_rows(const Stack& stack, const Row& t, const Row& tail, Sides& sides) {
  for (int i = 0; i < stack.quadrics; ++i) {
    const Quadric& q = stack.quadric[i];
    const double low = q.low, high = q.high, stretch = 1 + dot(q.shear, q.shear), along = q.along, slack = q.slack;
    const Point c = q.centre, s = q.shear;
    Row &half = sides.half[i], &upper = sides.upper[i], &lower = sides.lower[i];
    for (int k = 0; k < kRow; ++k) half[k] = std::sqrt(std::max(0.0, (t[k] - low + tail[k]) * (high - t[k] - tail[k])));
    if (q.ball) {
      for (int k = 0; k < kRow; ++k) {
        sides.centre_x[k] = c.x - t[k] * s.x, sides.centre_y[k] = c.y - t[k] * s.y;
        sides.slack[k] = stretch * t[k] * t[k] - 2 * along * t[k] + slack;
      }
      continue;
    }
    for (int k = 0; k < kRow; ++k) {
      const double constant = stretch * t[k] * t[k] - 2 * along * t[k] + slack, middle = c.x - s.x * t[k];
      const double far = middle > 0 ? middle + half[k] : middle - half[k];
      const double near = q.nearer(far, middle, constant, t[k]);
      upper[k] = middle > 0 ? far : near, lower[k] = middle > 0 ? near : far;
    }
  }
}

/// Slices of one outline, a row of them after the other.
class Bundle {
 public:
  Bundle(const Stack& stack, const Outline& outline) : stack_(stack), outline_(outline) {}

  void add(const Row& t, const Row& tail, const Row& counts) {
    t_ = t, counts_ = counts;
    area_ = x_ = y_ = xx_ = yy_ = xy_ = surface_ = cut_ = {};
    find_sides_by_rows(stack_, t_, tail, sides_);
    if (outline_.whole_disc) add_disc();
    else go_round();
    finish();
  }
  const Integrals& integrals() const { return sum_; }
  const Row& areas() const { return area_; }
  const Row& surfaces() const { return surface_; }
  const Row& cuts() const { return cut_; }

 private:
  void side(const Line& line, Row& result) const {
    const double offset = line.offset, rate = line.rate;
    if (line.quadric < 0)
      for (int k = 0; k < kRow; ++k) result[k] = offset - rate * t_[k];
    else if (line.upper) result = sides_.upper[line.quadric];
    else
      for (int k = 0; k < kRow; ++k) result[k] = -sides_.lower[line.quadric][k];
  }

  void corner(int first, int second, Points& result) const {
    const LineCorner corner_of(stack_.line[first], stack_.line[second]);
    Row p, q;
    side(stack_.line[first], p), side(stack_.line[second], q);
    for (int k = 0; k < kRow; ++k) {
      const Point at = corner_of(p[k], q[k]);
      result.x[k] = at.x, result.y[k] = at.y;
    }
  }

  /// The points where a line enters the disc and leaves it. If rounding has put the line outside the disc, both points
  /// are the tangent point.
  void crossings(const Line& line, Points& enter, Points& leave) const {
    const Point u = (1 / line.length) * line.normal;
    const double length = line.length;
    Row height;
    side(line, height);
    for (int k = 0; k < kRow; ++k) {
      const double h = height[k] / length, cx = sides_.centre_x[k], cy = sides_.centre_y[k];
      const double middle = u.x * cy - u.y * cx, constant = h * (h - 2 * (u.x * cx + u.y * cy)) + sides_.slack[k];
      const double discriminant = middle * middle - constant, root = std::sqrt(std::max(0.0, discriminant));
      const double far = middle > 0 ? middle + root : middle - root, other = far != 0 ? constant / far : 0;
      const double near = discriminant > 0 ? other : middle;
      const double from = middle > 0 ? near : far, to = middle > 0 ? far : near;
      enter.x[k] = h * u.x - from * u.y, enter.y[k] = h * u.y + from * u.x;
      leave.x[k] = h * u.x - to * u.y, leave.y[k] = h * u.y + to * u.x;
    }
  }

  /// The line of an edge; edges are counted around the outline.
  int line_of(int i) const { return outline_.edge[(i + outline_.edges) % outline_.edges].line; }

  /// The ends of edge i. `last` is the end of the edge before, and `first` the beginning of edge 0.
  void find_ends(int i, const Points& last, Points& first, Points& from, Points& to, Points& unused) const {
    const Outline::Edge& edge = outline_.edge[i];
    if (edge.from_circle || edge.to_circle)
      crossings(stack_.line[edge.line], edge.from_circle ? from : unused, edge.to_circle ? to : unused);
    if (!edge.from_circle) {
      if (i > 0) from = last;
      else corner(line_of(i - 1), edge.line, from);
    }
    if (i == 0) first = from;
    if (!edge.to_circle) {
      if (i == outline_.edges - 1) to = first;
      else corner(edge.line, line_of(i + 1), to);
    }
  }

  void go_round() {
    const int edges = outline_.edges;
    Points buffer[5];
    Points *first = &buffer[0], *from = &buffer[1], *to = &buffer[2], *last = &buffer[3], *unused = &buffer[4];
    for (int i = 0; i < edges; ++i) {
      const Outline::Edge& edge = outline_.edge[i];
      const Line& line = stack_.line[edge.line];
      find_ends(i, *last, *first, *from, *to, *unused);
      if (line.quadric < 0) add_edge(line, *from, *to);
      else add_side(line, *from, *to);
      if (i > 0 && edge.from_circle) {
        add_arc(*last, *from, line_of(i - 1), edge.line);
        add_triangle(*first, *last, *from);
      }
      if (i > 0 && (i < edges - 1 || edge.to_circle)) add_triangle(*first, *from, *to);
      if (i == edges - 1 && edge.to_circle) add_arc(*to, *first, edge.line, line_of(0));
      std::swap(to, last);
    }
  }

  void add_triangle(const Points& a, const Points& b, const Points& c) {
    for (int k = 0; k < kRow; ++k) {
      const double ax = a.x[k], ay = a.y[k], bx = b.x[k], by = b.y[k], cx = c.x[k], cy = c.y[k];
      const double w = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2, third = w * (1.0 / 3),
                   part = w * (1.0 / 12);
      const double sx = ax + bx + cx, sy = ay + by + cy;
      area_[k] += w;
      x_[k] += third * sx;
      y_[k] += third * sy;
      xx_[k] += part * (ax * ax + bx * bx + cx * cx + sx * sx);
      yy_[k] += part * (ay * ay + by * by + cy * cy + sy * sy);
      xy_[k] += part * (ax * ay + bx * by + cx * cy + sx * sy);
    }
  }

  void add_area(int owner, double area) {
    sum_.area += area;
    if (owner == 0) sum_.first_area += area;
  }

  /// Adds an edge of the slices in a plane.
  void add_edge(const Line& line, const Points& from, const Points& to) {
    const Point d = (1 / line.length) * Point{-line.normal.y, line.normal.x};
    const double inverse = 1 / line.length, offset = std::abs(line.offset), rate = std::abs(line.rate);
    const double nx = std::abs(line.normal.x), ny = std::abs(line.normal.y);
    // In the orthogonal axes l, m, n.
    const Point s = stack_.shear;
    const Vec3 normal{line.normal.x, line.normal.y, line.rate - dot(s, line.normal)};
    const double owned = line.owner == kCut ? 0 : stack_.stretch ? stack_.area(normal) : 1;
    Row weight, x, y, up, size, blur;
    for (int k = 0; k < kRow; ++k) {
      const double px = from.x[k], py = from.y[k], qx = to.x[k], qy = to.y[k], t = t_[k];
      const double w = ((qx - px) * d.x + (qy - py) * d.y) * inverse, counts = w * counts_[k];
      surface_[k] += owned * w;
      weight[k] = counts;
      x[k] = counts * (0.5 * (px + qx)), y[k] = counts * (0.5 * (py + qy));
      up[k] = t * counts, size[k] = std::abs(t) * counts;
      // Rounding may move the crossings of nearly parallel lines past each other. Terms have sizes all the same.
      blur[k] = std::abs(counts) * (offset + rate * std::abs(t) + nx * std::max(std::abs(px), std::abs(qx)) +
                                    ny * std::max(std::abs(py), std::abs(qy)));
    }
    if (stack_.cuts && line.owner == kCut)
      for (int k = 0; k < kRow; ++k)
        cut_[k] += ((to.x[k] - from.x[k]) * d.x + (to.y[k] - from.y[k]) * d.y) * inverse * std::sqrt(norm2(normal));
    const double all = sum(weight), mx = sum(x), my = sum(y), mt = sum(up);
    const Vec3 place{mx + s.x * mt, my + s.y * mt, mt};
    sum_.correction += line.offset_tail * all - line.rate_tail * mt - line.normal_tail.x * mx - line.normal_tail.y * my;
    sum_.blur += sum(blur);
    sum_.pull[line.owner] += all * normal;
    sum_.moment[line.owner] += stack_.moment(place, normal);
    sum_.across += mt * normal.z;
    sum_.terms += sum(size) * (rate + std::abs(s.x) * nx + std::abs(s.y) * ny);
    const double border = all * std::sqrt(norm2(normal));
    sum_.border += border;
    if (line.owner == kCut) sum_.cut_border += border;
    add_area(line.owner, owned * all);
    if (stack_.view && stack_.view->sees(line.owner)) {
      const double facing = dot(normal, stack_.view->normal);
      for (int k = 0; k < kRow; ++k) weight[k] *= facing;
      see(from, to, weight);
    }
  }

  /// Adds an edge of the slices in the side of a cylinder.
  void add_side(const Line& line, const Points& from, const Points& to) {
    const Quadric& q = stack_.quadric[line.quadric];
    const Point n = line.normal, s = stack_.shear;
    const double stretch = 1 + dot(q.shear, q.shear), along = std::abs(2 * q.along), slack = std::abs(q.slack);
    const double level = q.level, radius = q.radius, nx = std::abs(n.x), ny = std::abs(n.y);
    const Row &half = sides_.half[line.quadric], &upper = sides_.upper[line.quadric],
              &lower = sides_.lower[line.quadric];
    const Row& here = line.upper ? upper : lower;
    Row weight, x, y, up, x_up, y_up, t_up, along_t, size, area, blur;
    for (int k = 0; k < kRow; ++k) {
      const double px = from.x[k], py = from.y[k], qx = to.x[k], qy = to.y[k], t = t_[k], h = half[k];
      const double w = (qy - py) * n.x - (qx - px) * n.y, counts = w * counts_[k];
      const double far = std::max(std::abs(upper[k]), std::abs(lower[k]));
      const double terms = stretch * t * t + along * std::abs(t) + slack, inverse = h > 0 ? 1 / h : 0;
      const double mx = 0.5 * (px + qx) + s.x * t, my = 0.5 * (py + qy) + s.y * t, z = counts * (t - level) * inverse;
      surface_[k] += w * radius * inverse;
      weight[k] = counts;
      x[k] = counts * mx, y[k] = counts * my, along_t[k] = counts * t;
      up[k] = z, x_up[k] = z * mx, y_up[k] = z * my, t_up[k] = z * t;
      area[k] = counts * radius * inverse;
      size[k] = std::abs(t) * (std::abs(t) + std::abs(level)) * counts * inverse;
      blur[k] =
          std::abs(counts) * (std::abs(here[k]) + (far > 0 ? terms / far : 0) +
                              nx * std::max(std::abs(px), std::abs(qx)) + ny * std::max(std::abs(py), std::abs(qy)));
    }
    const double all = sum(weight), mt = sum(along_t), of_side = sum(area);
    sum_.blur += sum(blur);
    sum_.pull[line.owner] += Vec3{all * n.x, all * n.y, sum(up)};
    sum_.moment[line.owner] += Vec3{sum(y_up) - mt * n.y, mt * n.x - sum(x_up), sum(x) * n.y - sum(y) * n.x};
    sum_.across += sum(t_up);
    sum_.terms += sum(size);
    // A cylinder's normal has length radius / half chord, as its area has.
    sum_.border += of_side;
    add_area(line.owner, of_side);
    if (stack_.view && stack_.view->sees(line.owner)) {
      const Vec3 facing = stack_.view->normal;
      for (int k = 0; k < kRow; ++k) weight[k] = weight[k] * (n.x * facing.x + n.y * facing.y) + up[k] * facing.z;
      see(from, to, weight);
    }
  }

  /// Adds edges to the view, with their visible lengths.
  void see(const Points& from, const Points& to, const Row& length) {
    const View& view = *stack_.view;
    for (int k = 0; k < kRow; ++k) {
      const double t = t_[k], w = length[k], u0 = view.u0 + view.u.z * t, v0 = view.v0 + view.v.z * t;
      const double u = u0 + view.u.x * from.x[k] + view.u.y * from.y[k],
                   v = v0 + view.v.x * from.x[k] + view.v.y * from.y[k];
      const double p = u0 + view.u.x * to.x[k] + view.u.y * to.y[k], q = v0 + view.v.x * to.x[k] + view.v.y * to.y[k];
      sum_.seen[0] += w, sum_.seen[1] += w / 2 * (u + p), sum_.seen[2] += w / 2 * (v + q);
      sum_.seen[3] += w / 3 * (u * u + u * p + p * p), sum_.seen[5] += w / 3 * (v * v + v * q + q * q);
      sum_.seen[4] += w / 6 * (2 * u * v + u * q + p * v + 2 * p * q);
    }
  }

  /// The chord of the arc from p to q in each slice, and half the angle of the arc.
  struct Chords {
    Row length, distance;  ///< the distance of the centre from the chord, negative if the arc is less than half a turn
    Row x, y;              ///< the unit vector across the chord, to the arc
    Row angle, sine, cosine;
  };

  /// `before` and `after` are the lines that end at p and begin at q.
  void find_chords(const Points& p, const Points& q, int before, int after, Chords& chords) const {
    auto& [length, distance, ax, ay, angle, sine, cosine] = chords;
    const Row& radius = sides_.half[stack_.ball];
    // If two lines leave nearly all of the disc, the arc between them is nearly all of the circle or nearly empty.
    // It is nearly all only if the lines are one line, or turn back.
    const bool back = slicing::cross(stack_.line[before].normal, stack_.line[after].normal) <= 0;
    Row one, two;
    beyond(stack_.line[before], one), beyond(stack_.line[after], two);
    double shortest = 0;
    for (int k = 0; k < kRow; ++k) {
      const double cx = q.x[k] - p.x[k], cy = q.y[k] - p.y[k], l = std::sqrt(cx * cx + cy * cy);
      const double inverse = l > 0 ? 1 / l : 0, x = cy * inverse, y = -cx * inverse;
      const double beside =
          x * (0.5 * (p.x[k] + q.x[k]) - sides_.centre_x[k]) + y * (0.5 * (p.y[k] + q.y[k]) - sides_.centre_y[k]);
      // Rounding may have reversed a short chord. The two lines beside the chord then decide the side.
      const double sure = back && one[k] > 0 && two[k] > 0 ? -std::abs(beside) : std::abs(beside);
      const double d = l < kShort * radius[k] ? sure : beside, h = 0.5 * l;
      const double whole = std::max(std::sqrt(h * h + d * d), DBL_MIN);
      length[k] = l, distance[k] = d, ax[k] = x, ay[k] = y;
      sine[k] = h / whole, cosine[k] = d / whole;
      angle[k] = half_turn_angle(h / whole, d / whole);
    }
    for (int k = 0; k < kRow; ++k) shortest = std::min(shortest, length[k] - kShort * radius[k]);
    // If a chord is only rounding, the direction across it is the direction from the centre. One of its coordinates,
    // the one with less rounding, then tells its length.
    for (int k = 0; shortest < 0 && k < kRow; ++k) {
      if (!(length[k] < kShort * radius[k])) continue;
      const Point away =
          Point{0.5 * (p.x[k] + q.x[k]) - sides_.centre_x[k], 0.5 * (p.y[k] + q.y[k]) - sides_.centre_y[k]};
      const double far = std::copysign(norm(away), distance[k]);
      if (far == 0) continue;
      const double x = away.x / far, y = away.y / far;
      const double of_x = std::max(std::abs(p.x[k]), std::abs(q.x[k])) * std::abs(x),
                   of_y = std::max(std::abs(p.y[k]), std::abs(q.y[k])) * std::abs(y);
      const double l = std::abs(of_y < of_x ? (q.y[k] - p.y[k]) / x : (q.x[k] - p.x[k]) / y);
      ax[k] = x, ay[k] = y;
      if (!(l < 2 * length[k])) continue;
      const double h = 0.5 * l, d = distance[k], whole = std::max(std::sqrt(h * h + d * d), DBL_MIN);
      length[k] = l, sine[k] = h / whole, cosine[k] = d / whole;
      angle[k] = half_turn_angle(h / whole, d / whole);
    }
  }

  static Segments segments_of(const Chords& chords) {
    const Row& angle = chords.angle;
    double least = 4, most = 0;
    for (int k = 0; k < kRow; ++k) least = std::min(least, angle[k]), most = std::max(most, angle[k]);
    Segments segments{};
    if (least < quadric::kNarrow) {
      if (most < 0.1) narrow_segments<8>(angle, segments);
      else narrow_segments<quadric::SegmentSeries::kTerms>(angle, segments);
    }
    if (most >= quadric::kNarrow) wide_segments(angle, chords.sine, chords.cosine, segments);
    return segments;
  }

  /// Adds the distance of a corner along a line, as far as it is across the arc: rounding moves the corner off the arc.
  void add_off_arc(const Line& line, const Points& corner, Row& off) const {
    const double nx = line.normal.x / line.length, ny = line.normal.y / line.length;
    const Row& radius = sides_.half[stack_.ball];
    for (int k = 0; k < kRow; ++k) {
      const double x = corner.x[k], y = corner.y[k];
      const double facing = nx * (y - sides_.centre_y[k]) - ny * (x - sides_.centre_x[k]);
      off[k] += radius[k] > 0 ? std::abs(facing * (nx * y - ny * x)) / radius[k] : 0;
    }
  }

  /// Adds the arcs from p to q, counter-clockwise: the segments beyond their chords, and the zone of the sphere.
  void add_arc(const Points& p, const Points& q, int before, int after) {
    const Quadric& ball = stack_.quadric[stack_.ball];
    const double level = ball.level, stretch = 1 + dot(ball.shear, ball.shear), along = std::abs(2 * ball.along);
    const double slack = std::abs(ball.slack), of_ball = stack_.stretch ? 0 : ball.radius;
    const Row& radius = sides_.half[stack_.ball];
    Chords chords;
    find_chords(p, q, before, after, chords);
    const Row &length = chords.length, &ax = chords.x, &ay = chords.y, &angle = chords.angle;
    const Segments segments = segments_of(chords);
    Row off_arc{};
    add_off_arc(stack_.line[before], p, off_arc), add_off_arc(stack_.line[after], q, off_arc);
    Row strip, blur, px, py, up, t_up, size;
    for (int k = 0; k < kRow; ++k) {
      const double r = radius[k], r2 = r * r, w = segments.area[k] * r2, f = segments.first_across[k] * r2 * r;
      const double a = segments.second_across[k] * r2 * r2, b = segments.second_along[k] * r2 * r2, x = ax[k],
                   y = ay[k];
      const double mx = 0.5 * (p.x[k] + q.x[k]), my = 0.5 * (p.y[k] + q.y[k]), t = t_[k];
      area_[k] += w;
      x_[k] += w * mx + f * x;
      y_[k] += w * my + f * y;
      xx_[k] += w * mx * mx + 2 * f * mx * x + a * x * x + b * y * y;
      yy_[k] += w * my * my + 2 * f * my * y + a * y * y + b * x * x;
      xy_[k] += w * mx * my + f * (mx * y + my * x) + (a - b) * x * y;
      const double turned = counts_[k] * 2 * angle[k];
      surface_[k] += 2 * angle[k] * of_ball;
      const double z = (t - level) * turned;
      strip[k] = turned;
      px[k] = counts_[k] * length[k] * x, py[k] = counts_[k] * length[k] * y;
      up[k] = z, t_up[k] = t * z, size[k] = std::abs(t) * (std::abs(t) + std::abs(level)) * turned;
      blur[k] = 0.5 * turned * (stretch * t * t + along * std::abs(t) + slack + length[k] * length[k] + off_arc[k] * r);
    }
    sum_.blur += sum(blur);
    const double all = sum(strip), surface = stack_.stretch ? stretched_zone(ax, ay, angle) : all * ball.radius;
    add_zone(ball, {sum(px), sum(py), sum(up)}, all, sum(t_up), sum(size), surface);
  }

  /// The surface of an ellipsoid along arcs that extend by `angle` to either side of (x, y).
  double stretched_zone(const Row& x, const Row& y, const Row& angle) {
    const Row& radius = sides_.half[stack_.ball];
    double surface = 0;
    for (int k = 0; k < kRow; ++k) {
      if (counts_[k] == 0) continue;
      const Vec3 level = (t_[k] - stack_.quadric[stack_.ball].level) * stack_.n;
      const Vec3 across = radius[k] * (x[k] * stack_.l + y[k] * stack_.m),
                 along = radius[k] * (x[k] * stack_.m - y[k] * stack_.l);
      const double strip = stack_.areas ? stack_.stretch->arc(level, across, along, angle[k])
                                        : stack_.stretch->most_of_arc(level, across, along, angle[k]);
      surface_[k] += strip, surface += counts_[k] * strip;
    }
    return surface;
  }

  /// Positive if a line leaves nearly all of the disc.
  void beyond(const Line& line, Row& result) const {
    const Point n = line.normal;
    const double length = line.length;
    const Row& radius = sides_.half[stack_.ball];
    Row sides;
    side(line, sides);
    for (int k = 0; k < kRow; ++k)
      result[k] = sides[k] - (n.x * sides_.centre_x[k] + n.y * sides_.centre_y[k]) - 0.9 * radius[k] * length;
  }

  void add_disc() {
    const Quadric& ball = stack_.quadric[stack_.ball];
    const double pi = std::numbers::pi;
    double up = 0, all = 0, t_up = 0, size = 0;
    for (int k = 0; k < kRow; ++k) {
      const double r2 = sides_.half[stack_.ball][k] * sides_.half[stack_.ball][k], w = pi * r2, x = sides_.centre_x[k],
                   y = sides_.centre_y[k];
      const double t = t_[k], turned = 2 * pi * counts_[k], z = turned * (t - ball.level);
      area_[k] = w, x_[k] = w * x, y_[k] = w * y;
      xx_[k] = w * (x * x + r2 / 4), yy_[k] = w * (y * y + r2 / 4), xy_[k] = w * x * y;
      surface_[k] = stack_.stretch ? 0 : 2 * pi * ball.radius;
      up += z, all += turned, t_up += t * z;
      size += std::abs(t) * (std::abs(t) + std::abs(ball.level)) * turned;
      sum_.blur += turned * r2;
    }
    double surface = all * ball.radius;
    if (stack_.stretch) {
      Row one, none, whole;
      one.fill(1), none.fill(0), whole.fill(pi);
      surface = stretched_zone(one, none, whole);
    }
    add_zone(ball, {0, 0, up}, all, t_up, size, surface);
  }

  /// Adds a zone of the ball's surface. Its forces act along lines through the ball's centre.
  void add_zone(const Quadric& ball, Vec3 pull, double turned, double t_up, double size, double surface) {
    add_area(ball.owner, surface);
    sum_.border += turned * ball.radius;
    sum_.pull[ball.owner] += pull;
    sum_.moment[ball.owner] += cross(Vec3{ball.centre.x, ball.centre.y, ball.level}, pull);
    sum_.across += t_up;
    sum_.terms += size;
  }

  void finish() {
    Row a, x, y, z, xx, yy, zz, yz, zx, xy;
    for (int k = 0; k < kRow; ++k) {
      const double t = t_[k], w = counts_[k];
      a[k] = w * area_[k], x[k] = w * x_[k], y[k] = w * y_[k], z[k] = a[k] * t;
      xx[k] = w * xx_[k], yy[k] = w * yy_[k], xy[k] = w * xy_[k];
      zz[k] = z[k] * t, yz[k] = y[k] * t, zx[k] = x[k] * t;
    }
    sum_.volume += sum(a);
    sum_.first += Vec3{sum(x), sum(y), sum(z)};
    sum_.squares += Vec3{sum(xx), sum(yy), sum(zz)};
    sum_.products += Vec3{sum(yz), sum(zx), sum(xy)};
  }

  /// atan2(sine, cosine) for a sine that is not negative: the rational approximation of Cephes for half the angle,
  /// without branches.
  static double half_turn_angle(double sine, double cosine) {
    const double tangent = sine / (1 + std::abs(cosine));
    const bool large = tangent > 0.66;
    const double u = large ? (tangent - 1) / (tangent + 1) : tangent, z = u * u;
    const double p =
        (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z - 7.500855792314704667340e1) * z -
         1.228866684490136173410e2) *
            z -
        6.485021904942025371773e1;
    const double q =
        ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z + 4.328810604912902668951e2) * z +
         4.853903996359136964868e2) *
            z +
        1.945506571482613964425e2;
    const double small = u + u * (z * p / q), half = large ? std::numbers::pi / 4 + small : small;
    return cosine < 0 ? std::numbers::pi - 2 * half : 2 * half;
  }

  const Stack& stack_;
  const Outline& outline_;
  Row t_, counts_;
  Sides sides_;
  Row area_, x_, y_, xx_, yy_, xy_, surface_, cut_;  ///< per slice
  Integrals sum_;
};

Integrals measure_by_rows(const Stack& stack, const Outline& outline, const Nodes& nodes, Slices& slices) {
  Bundle bundle(stack, outline);
  for (int first = 0; first < nodes.size; first += kRow) {
    Row t, tail, counts;
    for (int k = 0; k < kRow; ++k) {
      const int node = std::min(first + k, nodes.size - 1);
      t[k] = nodes.t[node], tail[k] = nodes.tail[node], counts[k] = first + k < nodes.size ? nodes.weight[node] : 0;
    }
    bundle.add(t, tail, counts);
    for (int k = 0; k < kRow && first + k < nodes.size; ++k)
      slices.volume[first + k] = bundle.areas()[k], slices.area[first + k] = bundle.surfaces()[k],
                            slices.cut[first + k] = bundle.cuts()[k];
  }
  return bundle.integrals();
}

#ifdef OVERLAPPER_WIDER
OVERLAPPER_WIDER void find_sides_by_wider_rows(const Stack& stack, const Row& t, const Row& tail, Sides& sides) {
  find_sides_by_rows(stack, t, tail, sides);
}
OVERLAPPER_WIDER Integrals measure_by_wider_rows(const Stack& stack, const Outline& outline, const Nodes& nodes,
                                                 Slices& slices) {
  return measure_by_rows(stack, outline, nodes, slices);
}
const bool kWider = is_wider();
#else
constexpr bool kWider = false;
constexpr auto find_sides_by_wider_rows = find_sides_by_rows;
constexpr auto measure_by_wider_rows = measure_by_rows;
#endif

}  // namespace

void find_sides(const Stack& stack, const Row& t, const Row& tail, Sides& sides) {
  (kWider ? find_sides_by_wider_rows : find_sides_by_rows)(stack, t, tail, sides);
}

Integrals measure(const Stack& stack, const Outline& outline, const Nodes& nodes, Slices& slices) {
  return (kWider ? measure_by_wider_rows : measure_by_rows)(stack, outline, nodes, slices);
}

Integrals measure(const Stack& stack, const Outline& outline, double t) {
  Bundle bundle(stack, outline);
  Row row;
  row.fill(t);
  bundle.add(row, {}, {1});
  return bundle.integrals();
}

namespace {

/// The slope of a plane that ends a stack, against the slices.
Point slope(const Line& plane) { return (1 / plane.rate) * (plane.normal + plane.normal_tail); }

/// ∫ (slope · x)² over a face.
double squared(Point slope, const Integrals& face) {
  const Vec3 s = face.squares;
  return std::max(0.0, slope.x * slope.x * s.x + slope.y * slope.y * s.y + 2 * slope.x * slope.y * face.products.z);
}

/// m³: a bound of ∫ max(0, slope · x − gap) over a face.
double beyond_gap(Point slope, double gap, const Integrals& face) {
  const double square = squared(slope, face), all = std::sqrt(std::abs(face.volume) * square);
  return square < 4 * gap * all ? square / (4 * gap) : all;
}

}  // namespace

void add_face(const Line& plane, const Stack& stack, const Outline& outline, double t, Integrals& sum) {
  const Integrals face = measure(stack, outline, t);
  const double area = face.volume;
  // The plane is nearly parallel to the slices. Its tilt counts to first order.
  const Point tilt = plane.normal + plane.normal_tail;
  sum.correction +=
      (plane.offset_tail * area - plane.rate_tail * t * area - tilt.x * face.first.x - tilt.y * face.first.y) /
      std::abs(plane.rate);
  // If the tilts of both ends are u together, they meet where u is more than the thickness h between the ends, and
  // u − h is at most u² / 4h. For tilts v and w, u² is at most 2 (v² + w²).
  sum.uneven += squared(slope(plane), face) / (2 * (stack.high - stack.low));
  for (const Line& other : stack.farther)
    if ((other.rate > 0) == (plane.rate > 0))
      sum.uneven += beyond_gap(slope(other) - slope(plane), std::abs(other.offset / other.rate - t), face);
  sum.blur += std::abs(area) * (std::abs(plane.offset) + std::abs(plane.rate * t)) / std::abs(plane.rate);
  const double owned = plane.owner == kCut ? 0 : stack.stretch ? stack.area({0, 0, area}) : area;
  sum.area += owned;
  if (plane.owner == 0) sum.first_area += owned;
  const double side = plane.rate > 0 ? 1 : -1;
  if (stack.view && stack.view->sees(plane.owner)) {
    const View& view = *stack.view;
    const double facing = side * view.normal.z, u = view.u0 + view.u.z * t, v = view.v0 + view.v.z * t;
    // u and v are linear in x and y.
    const auto first = [&](Vec3 by) { return by.x * face.first.x + by.y * face.first.y; };
    const auto second = [&](Vec3 a, Vec3 b) {
      return a.x * b.x * face.squares.x + a.y * b.y * face.squares.y + (a.x * b.y + a.y * b.x) * face.products.z;
    };
    sum.seen[0] += facing * area;
    sum.seen[1] += facing * (u * area + first(view.u)), sum.seen[2] += facing * (v * area + first(view.v));
    sum.seen[3] += facing * (u * u * area + 2 * u * first(view.u) + second(view.u, view.u));
    sum.seen[4] += facing * (u * v * area + u * first(view.v) + v * first(view.u) + second(view.u, view.v));
    sum.seen[5] += facing * (v * v * area + 2 * v * first(view.v) + second(view.v, view.v));
  }
  sum.pull[plane.owner] += Vec3{0, 0, side * area};
  sum.across += t * side * area;
  sum.terms += std::abs(t) * area;
  sum.border += area;
  if (plane.owner == kCut) sum.cut_border += area;
  sum.moment[plane.owner] += stack.moment(
      Vec3{face.first.x + stack.shear.x * t * area, face.first.y + stack.shear.y * t * area, t * area}, {0, 0, side});
}

double beyond_ends(const Stack& stack) {
  if (!stack.low_plane || !stack.high_plane) return 0;
  const double t = stack.low + (stack.high - stack.low) / 2;
  const Outline middle = outline(Slice(stack, t));
  if (middle.empty()) return 0;
  return beyond_gap(slope(*stack.high_plane) - slope(*stack.low_plane), std::max(0.0, stack.low - stack.high),
                    measure(stack, middle, t));
}

}  // namespace overlapper::slicing
