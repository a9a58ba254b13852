#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "geometry/moments.h"
#include "methods/round/quadric/stretch.h"
#include "methods/round/slicing/wall.h"

namespace overlapper::slicing {

/// A point of a slice.
struct Point {
  double x = 0, y = 0;
};
inline Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
inline Point operator*(double s, Point a) { return {s * a.x, s * a.y}; }
inline double dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
inline double norm(Point a) { return std::sqrt(dot(a, a)); }
inline double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }

/// How many lines may bound a slice; bodies with more planes than that where no cut leaves fewer have another way.
inline constexpr int kMostLines = 72;

/// A quadric in coordinates (x, y, t) about a point of the common set, X = x l + y m + t T, where T · n = 1, so that
/// slices are t apart, and T may be oblique: a ball, or a cylinder whose axis lies in the slices. Seen along
/// that axis, a cylinder is a disc with the one coordinate `across` · (x, y).
struct Quadric {
  bool ball = false;
  int owner = 0;
  double radius = 0;
  Point across;                          ///< of a cylinder: the unit vector orthogonal to the axis
  Point shear;                           ///< what T has along l and m; of a cylinder in x alone, along `across`
  Point centre;                          ///< of a ball at t = 0; of a cylinder in x alone, along `across`
  double along = 0;                      ///< dot(T, centre), in the plane orthogonal to the axis
  double slack = 0;                      ///< |centre|² − radius²: not positive where the origin is inside
  double low = 0, high = 0;              ///< the values of t between which there are slices
  double level = 0;                      ///< that of its centre
  static constexpr double kPole = 1e-6;  ///< of the terms, the square of a side that is as well known by a difference

  double half_chord2(double t) const { return (t - low) * (high - t); }
  /// The part of value() that does not depend on x and y, and the size of its terms.
  double constant(double t) const { return (1 + dot(shear, shear)) * t * t - 2 * along * t + slack; }
  double terms(double t) const { return (1 + dot(shear, shear)) * t * t + std::abs(2 * along * t) + std::abs(slack); }
  /// The root of y² − 2 middle y + constant that is nearer to zero, from the other root. It is no difference, except
  /// near an end of the quadric, where it is smaller than the rounding of the constant.
  double nearer(double far, double middle, double constant, double t) const {
    return far * far > kPole * terms(t) ? constant / far : 2 * middle - far;
  }
  /// The value of |X − centre|² − radius² at a point of the slice's coordinates.
  double value(Point p, double t) const {
    const Point q = ball ? p : Point{dot(across, p), 0};
    return dot(q, q) - 2 * dot(q, centre) + 2 * dot(shear, q) * t + constant(t);
  }
};

/// A line of the slices: dot(normal, x) <= side(t). Of a plane, side(t) = offset − rate t.
struct Line {
  Point normal;
  double length = 1;  ///< of the normal
  double offset = 0, rate = 0;
  int quadric = -1;   ///< the cylinder that it is a side of
  bool upper = true;  ///< along `across` of that, or against it
  int owner = kCut;   ///< the body
  Vec3 face;          ///< the plane's unit normal in the world
  Point normal_tail;  ///< what rounding to doubles has taken from the plane
  double offset_tail = 0, rate_tail = 0;
};

/// The points where two lines cross, from their sides: the foot of the nearer line, and as far along that as the other
/// says. So the point lies on both but for the rounding of their sides, however nearly parallel the two are, and
/// however much farther one of them is.
struct LineCorner {
  struct Base {
    Point foot, way;
    double share, inverse;
  };
  std::array<Base, 2> base;
  std::array<double, 2> length;

  LineCorner(const Line& first, const Line& second) : length{first.length, second.length} {
    const Point a = first.normal, b = second.normal;
    const double both = dot(a, b), inverse = 1 / cross(a, b);
    base[0] = about(a, first.length, both, inverse), base[1] = about(b, second.length, both, -inverse);
  }
  Point operator()(double first_side, double second_side) const {
    const bool second = std::abs(second_side) * length[0] < std::abs(first_side) * length[1];
    const Base& nearer = base[second];
    const double side = second ? second_side : first_side, other = second ? first_side : second_side;
    const double along = (other - nearer.share * side) * nearer.inverse;
    return {side * nearer.foot.x + along * nearer.way.x, side * nearer.foot.y + along * nearer.way.y};
  }

 private:
  static Base about(Point normal, double length, double both, double inverse) {
    const double square = length * length;
    return {(1 / square) * normal, {-normal.y, normal.x}, both / square, inverse};
  }
};

/// A surface seen along a direction, in coordinates u and v across it.
struct View {
  int owner = 0;      ///< of the surface
  bool rest = false;  ///< instead of it, all other surfaces are seen, from behind: these have no arcs, if it has
  double u0 = 0, v0 = 0;
  Vec3 u, v;    ///< what u and v grow by along x, y and t
  Vec3 normal;  ///< against the direction, along l, m and n

  bool sees(int of_owner) const { return (of_owner == owner) != rest; }
};

/// The common set of a polytope, at most two cylinders and at most one ball, as a stack of slices.
struct Stack {
  std::array<Line, kMostLines + 8> line;
  int lines = 0;
  std::array<Quadric, 2> quadric;
  int quadrics = 0;
  int ball = -1;                              ///< which of the quadrics is one
  double low = 0, high = 0;                   ///< slices lie between, if there are any
  std::optional<Line> low_plane, high_plane;  ///< planes parallel to the slices, if such end the stack
  Vec3 l, m, n, t;                            ///< the axes, in the world
  Point shear;                                ///< what t has along l and m
  std::optional<View> view;                   ///< if anything is looked at
  const quadric::Stretch* stretch = nullptr;  ///< of an ellipsoid: what makes the ball and all else out of the world

  /// The stretched area of a plane's part whose area vector, along l, m and n, is `normal`.
  double area(Vec3 normal) const { return stretch->area(normal.x * l + normal.y * m + normal.z * n); }
  /// place × normal, all along l, m and n; in the world, if that is stretched.
  Vec3 moment(Vec3 place, Vec3 normal) const {
    if (!stretch) return cross(place, normal);
    const auto in_world = [&](Vec3 v) { return v.x * l + v.y * m + v.z * n; };
    const Vec3 found = stretch->moment(in_world(place), in_world(normal));
    return {dot(l, found), dot(m, found), dot(n, found)};
  }
};

/// The lines and the disc of one slice.
struct Slice {
  explicit Slice(const Stack& stack_, double t_);

  const Stack& stack;
  double t;
  std::array<double, 2> half_chord{}, upper{}, lower{};  ///< per quadric; the sides only of cylinders
  Point centre;                                          ///< of the disc
  double slack = 0, radius = 0;                          ///< |centre|² − radius²

  double side(int line) const {
    const Line& l = stack.line[line];
    if (l.quadric < 0) return l.offset - l.rate * t;
    return l.upper ? upper[l.quadric] : -lower[l.quadric];
  }
  Point corner(int first, int second) const {
    return LineCorner(stack.line[first], stack.line[second])(side(first), side(second));
  }
};

/// The border of a slice, counter-clockwise: pieces of lines, and arcs wherever a piece ends on the circle.
struct Outline {
  struct Edge {
    int line;
    bool from_circle, to_circle;
    friend bool operator==(const Edge&, const Edge&) = default;
  };
  std::array<Edge, kMostLines + 8> edge;
  int edges = 0;
  bool whole_disc = false;
  Outline() = default;
  Outline(const Outline& other) { *this = other; }
  Outline& operator=(const Outline& other) {
    if (this != &other) std::copy_n(other.edge.begin(), other.edges, edge.begin());
    edges = other.edges, whole_disc = other.whole_disc;
    return *this;
  }

  bool empty() const { return edges == 0 && !whole_disc; }
  friend bool operator==(const Outline& a, const Outline& b) {
    return a.edges == b.edges && a.whole_disc == b.whole_disc &&
           std::equal(a.edge.begin(), a.edge.begin() + a.edges, b.edge.begin());
  }
};
Outline outline(const Slice& slice);

/// Whether a slice surely has that outline, which is found sooner than the outline itself.
bool is_outline(const Slice& slice, const Outline& outline);

/// Integrals over a slice, or over slices, in coordinates x, y and t: the volume's, and those of the surfaces.
struct Integrals : Moments {
  double area = 0;        ///< of what the bodies own of the surface
  double first_area = 0;  ///< of that, the first body's
  /// ∫ N dA and ∫ X × N dA along l, m and n: per body of its surface, and of the cuts through bodies.
  std::array<Vec3, 3> pull{}, moment{};
  double across = 0;             ///< ∫ t N dA along n, over all of the surface: the volume, by other integrals
  double terms = 0;              ///< the size of the terms of that
  double border = 0;             ///< ∫ dA over all of the surface
  double correction = 0;         ///< of the volume: what the tails of planes add to first order
  double blur = 0;               ///< of the volume: the size of terms that lines are the sums of
  std::array<double, 6> seen{};  ///< ∫ 1, u, v, u², uv and v² over what a view shows

  void add(double weight, const Integrals& other);
};
}  // namespace overlapper::slicing
