#include "methods/round/quadric/shallow_ball.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/constants.h"
#include "methods/round/quadric/gauss.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::quadric {
namespace {

/// Two ends: their distance over the sum of their distances from the apex. Below this, doubles give no direction.
constexpr double kOneWay = 1e-7;
/// Squared distance from the sphere, relative to the squared radius. Below this, doubles do not decide on which side of
/// the sphere a corner is.
constexpr double kNear = 1e-9;

/// y z, z x and x y, with one factor from each point.
Vec3 products(Vec3 a, Vec3 b) { return {a.y * b.z, a.z * b.x, a.x * b.y}; }

}  // namespace

// The faces have heights h over the apex and areas A. The apex has the depth d in the ball of radius r. A normal n of
// the unit sphere has the height 1 − w: w is the height that it loses from the top.
//
//   3 V = Σ h A + r² (d S + (r − d) L),   S = ∫ dA = ∮ w dφ,   L = ∫ w dA = ½ ∮ w² dφ,   ∫ w² dA = ⅓ ∮ w³ dφ
//
// All integrals are over the curved part of the unit sphere, or along its border. φ is the angle around the direction
// of the apex. On a sphere, dA is dw dφ (Archimedes). With x² + y² = w (2 − w), dφ is (x dy − y dx) / (w (2 − w)).
// Every integrand along an arc is therefore a polynomial of x, y, w and their differentials, over 2 − w. The other
// moments are
//
//   ∫ x wᵏ dA = ∮ wᵏ⁺¹ dy / (k + 1),   ∫ y wᵏ dA = −∮ wᵏ⁺¹ dx / (k + 1),   ∫ xy wᵏ dA = ∮ y wᵏ⁺¹ dy / (k + 1),
//   ∫ (x² wᵏ + (1 − w) wᵏ⁺¹ / (k + 1)) dA = ∮ x wᵏ⁺¹ dy / (k + 1), and so for y.
//
// If the curved part contains the direction of the apex, no term is larger than the common set, and nothing cancels.
//
// The points of an arc are rational functions of the tangent of a quarter of its angle. Arcs are cut so that this
// tangent is at most that of 22.5°. The nearest pole is at 2.4 times this tangent. The relative error of Gauss's
// sixteen nodes is therefore 5^-32.
void ShallowBall::begin_face(Vec3 normal, double height, double disc_radius) {
  normal_ = normal, height_ = height, disc_radius_ = disc_radius;
  const double from_centre = radius_ - depth_, of_centre = height + from_centre * normal.z;
  const double across2 = normal.x * normal.x + normal.y * normal.y;
  disc_ = {of_centre * normal.x, of_centre * normal.y, height * normal.z - from_centre * across2};
  twice_ = twice_sizes_ = segments_ = 0, face_first_ = face_squares_ = face_products_ = {};
}

void ShallowBall::add_chord(Vec3 from, Vec3 to) {
  const Vec3 n = normal_, foot = height_ * n;
  const double twice = dot(n, cross(from, to));
  twice_ += twice, twice_sizes_ += dot(abs(n), sizes_of_cross(from, to));
  const Vec3 sum = from + to + foot;
  face_first_ += twice / 6 * sum;
  if (height_ == 0) return;
  const double share = twice / 24;
  for (const Vec3 corner : {from, to, foot, sum}) {
    face_squares_ += share * scaled(corner, corner);
    face_products_ += share * products(corner, corner);
  }
}

void ShallowBall::add_arc(Vec3 from, Vec3 to, Vec3 back) {
  const double half = norm(to - from) / 2;
  Vec3 along = back, out = cross(back, normal_);
  const Vec3 middle = from + 0.5 * (to - from);
  const double to_chord = dot(out, middle - disc_);  // from the middle of the disc
  const double angle = std::atan2(half, to_chord);
  const double sine = half / disc_radius_, cosine = to_chord / disc_radius_;
  add_chord(from, to);
  const Segment part_of = segment(angle, sine, cosine);
  const double square = disc_radius_ * disc_radius_, area = square * part_of.area;
  const double first = square * part_of.first_across;
  const Vec3 outwards = disc_radius_ * out, onwards = disc_radius_ * along;
  segments_ += area;
  face_first_ += area * middle + first * outwards;
  if (height_ != 0) {
    const double of_across = square * part_of.second_across, of_along = square * part_of.second_along;
    face_squares_ += area * scaled(middle, middle) + 2 * first * scaled(middle, outwards) +
                     of_across * scaled(outwards, outwards) + of_along * scaled(onwards, onwards);
    face_products_ += area * products(middle, middle) +
                      first * (products(middle, outwards) + products(outwards, middle)) +
                      of_across * products(outwards, outwards) + of_along * products(onwards, onwards);
  }
  const double tight = kPi / 4;
  if (angle <= tight) return integrate(middle, half * along, disc_radius_ * out, half / (disc_radius_ + to_chord));
  const int parts = static_cast<int>(std::ceil(angle / tight));
  const double part = angle / parts, s = std::sin(part), c = std::cos(part);
  // If an arc is longer than half a turn, its chord may be too short to give the direction of its middle.
  if (angle > 0.75 * kPi) out = -unit(from - disc_ + (to - disc_)), along = cross(normal_, out);
  for (int k = 0; k < parts; ++k) {
    const double at = (2 * k + 1 - parts) * part, sin_at = std::sin(at), cos_at = std::cos(at);
    const Vec3 here = cos_at * out + sin_at * along, way = cos_at * along - sin_at * out;
    integrate(disc_ + disc_radius_ * c * here, disc_radius_ * s * way, disc_radius_ * here, s / (1 + c));
  }
}

/// Adds the integrals along an arc of a circle, from middle − along to middle + along. `out` is the radius towards the
/// arc, and `quarter` is the tangent of a quarter of its angle.
void ShallowBall::integrate(Vec3 middle, Vec3 along, Vec3 out, double quarter) {
  const double scale = 1 / radius_, q2 = quarter * quarter;
  const double mx = scale * middle.x, my = scale * middle.y;
  // A point of the arc is middle + a along + b out, with a = (2 τ / (1 + τ²)) / (2 q / (1 + q²)) and
  // b = 2 (q² − τ²) / ((1 + τ²) (1 + q²)).
  const double widen = scale * (1 + q2), ax = widen * along.x, ay = widen * along.y;
  const double rise = 2 * scale * q2 / (1 + q2), bx = rise * out.x, by = rise * out.y;
  const double size = rise * std::sqrt(norm2(out));
  for (int i = 0; i < 8; ++i)
    for (const double node : {-kGaussNode[i], kGaussNode[i]}) {
      const double t2 = q2 * node * node, c = 1 / (1 + t2);
      const double go = node * c, bulge = (1 - node * node) * c;
      // The rates have the opposite sign: a face is on the left of its border, and the curved part is on the right.
      const double go_rate = -kGaussWeight[i] * (1 - t2) * c * c,
                   bulge_rate = 2 * kGaussWeight[i] * (1 + q2) * node * c * c;
      const double x = mx + ax * go + bx * bulge, y = my + ay * go + by * bulge;
      const double dx = ax * go_rate + bx * bulge_rate, dy = ay * go_rate + by * bulge_rate;
      const double square = x * x + y * y, w = square / (1 + std::sqrt(std::max(0.0, 1 - square)));
      const double turn = x * dy - y * dx, of_area = turn / (2 - w);
      const double w2 = w * w;
      lost_[0] += of_area, lost_[1] += w * of_area / 2, lost_[2] += w2 * of_area / 3, lost_[3] += w2 * w * of_area / 4;
      const Vec3 across{dy, -dx, 0}, second{x * dy, -y * dx, y * dy};
      across_[0] += w * across, across_[1] += w2 / 2 * across, across_[2] += w2 * w / 3 * across;
      border_[0] += w * second, border_[1] += w2 / 2 * second;
      const double x_size = std::abs(mx) + std::abs(ax * go) + size * bulge;
      const double y_size = std::abs(my) + std::abs(ay * go) + size * bulge;
      const double sizes = (x_size * (std::abs(ay * go_rate) + size * std::abs(bulge_rate)) +
                            y_size * (std::abs(ax * go_rate) + size * std::abs(bulge_rate)));
      area_sizes_ += sizes, lost_sizes_ += w * sizes;
    }
}

double ShallowBall::end_face() {
  const double area = twice_ / 2 + segments_;
  cones_ += height_ * area;
  cone_sizes_ += std::abs(height_) * (twice_sizes_ / 2 + segments_);
  cone_firsts_ += height_ * face_first_;
  cone_squares_ += height_ * face_squares_, cone_products_ += height_ * face_products_;
  return area;
}

double ShallowBall::volume() const {
  return (cones_ + radius_ * radius_ * (depth_ * lost_[0] + (radius_ - depth_) * lost_[1])) / 3;
}

/// Terms have about twenty roundings. Their coordinates have a few.
double ShallowBall::error() const {
  constexpr double kRoundings = 64;
  return kRoundings * kUnit * (cone_sizes_ + radius_ * radius_ * (depth_ * area_sizes_ + radius_ * lost_sizes_)) / 3;
}

Vec3 ShallowBall::first() const {
  const double r = radius_, d = depth_, from_centre = r - d;
  const Vec3 across = r * r * r * (d * across_[0] + from_centre * across_[1]);
  const double up = r * r * (d * d * (lost_[0] - lost_[1]) - r * from_centre * lost_[2]);
  return 0.25 * (cone_firsts_ + Vec3{across.x, across.y, up});
}

Moments ShallowBall::moments() const {
  const double r = radius_, d = depth_, from_centre = r - d, r2 = r * r;
  const Vec3 both = d * border_[0] + from_centre * border_[1];
  const double rest = d * (lost_[1] - lost_[2]) + from_centre / 2 * (lost_[2] - lost_[3]);
  const Vec3 rising = r * r2 * (d * d * (across_[0] - across_[1]) - r * from_centre * across_[2]);
  const double up = r2 * (d * d * (d * lost_[0] - (r + d) * lost_[1]) +
                          r * (d * (2 * d - r) * lost_[2] + r * from_centre * lost_[3]));
  const Vec3 squares = cone_squares_ + Vec3{r2 * r2 * (both.x - rest), r2 * r2 * (both.y - rest), up};
  const Vec3 mixed = cone_products_ + Vec3{rising.y, rising.x, r2 * r2 * both.z};
  return {volume(), first(), 0.2 * squares, 0.2 * mixed};
}

namespace {

/// The part of an edge inside the ball.
struct ShallowChord {
  int left, right;
  WideVector from, to;          ///< from the apex
  WideVector along;             ///< unit
  bool from_sphere, to_sphere;  ///< whether the end is on the sphere, and not a corner
};

/// The same chord in the axes at the apex.
struct SeenChord {
  Vec3 from, to, along;
};

/// An end of a chord on the sphere, for the arcs of a face.
struct ArcEnd {
  Vec3 at;
  int chord;
};

/// The face with the highest plane over the ball's centre, and the height of the plane.
struct HighestFace {
  int face = 0;
  double over = -kInfinity;
};

/// No value if a plane leaves nothing of the ball, or if all planes have its centre inside.
std::optional<HighestFace> highest_face(const Polyhedron& polyhedron, Vec3 centre, double radius) {
  HighestFace highest;
  for (int f = 0; f < static_cast<int>(polyhedron.planes.size()); ++f) {
    const double over = signed_distance(polyhedron.planes[f], centre);
    if (over >= radius) return std::nullopt;
    if (over > highest.over) highest = {f, over};
  }
  return highest.over > 0 ? std::optional(highest) : std::nullopt;
}

/// The polyhedron's nearest point to the centre, in doubles. Any point near it is good enough.
struct NearestPoint {
  bool above = true;  ///< the point is in the highest face
  int edge = -1;      ///< otherwise it is on this edge
  int corner = -1;    ///< the end of the edge at which the point is, or -1
  double least2 = kInfinity;
};

/// No value if an edge has no length. `reached` gets the edges that may reach the ball.
std::optional<NearestPoint> nearest_point(const Polyhedron& polyhedron, Vec3 centre, double radius, int highest,
                                          std::vector<int>& reached) {
  NearestPoint nearest;
  const double reach2 = radius * radius * (1 + kNear);
  const Vec3 n = polyhedron.planes[highest].normal;
  reached.clear();
  for (int e = 0; e < static_cast<int>(polyhedron.edges.size()); ++e) {
    const Edge& edge = polyhedron.edges[e];
    const Vec3 from = polyhedron.corners[edge.from] - centre;
    const Vec3 between = polyhedron.corners[edge.to] - centre - from;
    const double length2 = norm2(between), at = std::clamp(-dot(from, between) / length2, 0.0, 1.0);
    if (!(length2 > 0)) return std::nullopt;
    const double distance2 = norm2(from + at * between);
    if (distance2 <= reach2) reached.push_back(e);
    if (distance2 < nearest.least2)
      nearest.least2 = distance2, nearest.edge = e, nearest.corner = at == 0 ? edge.from : at == 1 ? edge.to : -1;
    if (edge.left == highest && dot(cross(between, n), from) < 0) nearest.above = false;
    if (edge.right == highest && dot(cross(between, n), from) > 0) nearest.above = false;
  }
  return nearest;
}

/// A polyhedron about the centre of a ball, in double-doubles.
struct WidePolyhedron {
  const Polyhedron& polyhedron;
  const WidePlaces& places;
  Vec3 c;  ///< the centre in doubles
  double radius;

  WideVector corner(int i) const { return places.corner(i); }
  WideVector along(const Edge& edge) const { return unit(places.between(edge.from, edge.to)); }
  bool inside(int i) const {
    const double r2 = radius * radius, distance2 = norm2(polyhedron.corners[i] - c);
    if (std::abs(distance2 - r2) <= kNear * r2) return norm(corner(i)) < DoubleDouble{radius};
    return distance2 < r2;
  }
};

/// The point of a line that is nearest to the origin.
WideVector foot_on(const WideVector& from, const WideVector& along) { return from - dot(from, along) * along; }

/// The apex, relative to the centre of the ball. No value if the corners of the highest face miss its plane.
std::optional<WideVector> apex_of(const WidePolyhedron& at, const NearestPoint& nearest, int highest) {
  if (nearest.above) {
    const auto top = at.places.plane(highest);
    return top ? std::optional(top->offset * top->normal) : std::nullopt;
  }
  if (nearest.corner >= 0) return at.corner(nearest.corner);
  const Edge& edge = at.polyhedron.edges[nearest.edge];
  return foot_on(at.corner(edge.from), at.along(edge));
}

/// The part of an edge inside the ball, about the apex. No value if there is none.
std::optional<ShallowChord> chord_of(const Edge& edge, bool from_inside, bool to_inside, const WidePolyhedron& at,
                                     const WideVector& apex) {
  ShallowChord chord{edge.left,    edge.right, at.corner(edge.from), at.corner(edge.to), at.along(edge),
                     !from_inside, !to_inside};
  if (chord.from_sphere || chord.to_sphere) {
    const WideVector foot = foot_on(chord.from, chord.along);
    const DoubleDouble wide_radius{at.radius}, off = norm(foot);
    const DoubleDouble half2 = (wide_radius - off) * (wide_radius + off);
    const auto crosses = [&] {
      return half2.head > 0 && dot(chord.from, chord.along).head < 0 && dot(chord.to, chord.along).head > 0;
    };
    if (chord.from_sphere && chord.to_sphere && !crosses()) return std::nullopt;
    const WideVector half = sqrt(half2) * chord.along;
    if (chord.from_sphere) chord.from = foot - half;
    if (chord.to_sphere) chord.to = foot + half;
  }
  chord.from = chord.from - apex, chord.to = chord.to - apex;
  return chord;
}

/// Decides once for each corner whether it is inside, for all of its edges.
void find_chords(const WidePolyhedron& at, std::span<const int> reached, const WideVector& apex,
                 std::vector<ShallowChord>& chords) {
  thread_local std::vector<signed char> known;
  known.assign(at.polyhedron.corners.size(), -1);
  const auto inside = [&](int i) {
    if (known[i] < 0) known[i] = at.inside(i);
    return known[i] == 1;
  };
  chords.clear();
  for (const int e : reached) {
    const Edge& edge = at.polyhedron.edges[e];
    const bool from_inside = inside(edge.from), to_inside = inside(edge.to);
    if (const auto chord = chord_of(edge, from_inside, to_inside, at, apex)) chords.push_back(*chord);
  }
}

/// Axes at the apex. The first axis points to the farthest end of a chord, so the width of a slender part has all
/// digits.
struct ApexAxes {
  WideVector ahead, aside, up;

  Vec3 seen(const WideVector& v) const { return {rounded(dot(v, ahead)), rounded(dot(v, aside)), rounded(dot(v, up))}; }
};

std::optional<ApexAxes> axes_at(const WideVector& up, std::span<const ShallowChord> chords) {
  Vec3 farthest_at;
  double farthest2 = 0;
  for (const ShallowChord& chord : chords)
    for (const WideVector* end : {&chord.from, &chord.to}) {
      const Vec3 at = rounded(*end);
      if (const double far2 = norm2(at); far2 > farthest2) farthest2 = far2, farthest_at = at;
    }
  if (!(farthest2 > 0)) return std::nullopt;
  const WideVector across = wide(farthest_at) - dot(wide(farthest_at), up) * up;
  if (!(norm2(rounded(across)) > 0)) return std::nullopt;
  const WideVector ahead = unit(across);
  return ApexAxes{ahead, cross(up, ahead), up};
}

/// The border of a face: the chords of its edges, and arcs between the ends where they leave and enter the sphere.
struct FaceBorder {
  int face;
  Vec3 n;
  std::span<const ShallowChord> chords;
  std::span<const SeenChord> seen;
  std::vector<ArcEnd>&leaves, &enters;

  void add_chords(ShallowBall& ball) {
    leaves.clear(), enters.clear();
    for (int k = 0; k < static_cast<int>(chords.size()); ++k) {
      const auto& [from, to, along] = seen[k];
      if (chords[k].left == face) add_chord(ball, k, from, to, chords[k].from_sphere, chords[k].to_sphere);
      if (chords[k].right == face) add_chord(ball, k, to, from, chords[k].to_sphere, chords[k].from_sphere);
    }
  }

  /// The next end at which an edge enters, counter-clockwise.
  const ArcEnd& next(const ArcEnd& leave, Vec3 middle) const {
    const ArcEnd* next = &enters[0];
    double first = kInfinity;
    for (const ArcEnd& enter : enters) {
      if (enters.size() == 1) break;
      const Vec3 u = leave.at - middle, v = enter.at - middle;
      double turn = std::atan2(dot(n, cross(u, v)), dot(u, v));
      if (turn < 0) turn += 2 * kPi;
      if (turn < first) first = turn, next = &enter;
    }
    return *next;
  }

  /// The unit vector from the begin of an arc to its end. No value if doubles leave the direction of the arc uncertain.
  std::optional<Vec3> back(const ArcEnd& leave, const ArcEnd& enter) const {
    if (enter.chord == leave.chord) {
      const Vec3 along = seen[leave.chord].along;
      return chords[leave.chord].left == face ? -along : along;
    }
    const Vec3 between = enter.at - leave.at;
    const double length = std::sqrt(norm2(between));
    if (!(length > kOneWay * (norm(leave.at) + norm(enter.at)))) return std::nullopt;
    return between / length;
  }

  /// False if doubles leave the direction of an arc uncertain.
  bool add_arcs(ShallowBall& ball) const {
    if (leaves.size() != enters.size()) return false;
    for (const ArcEnd& leave : leaves) {
      const ArcEnd& enter = next(leave, ball.disc());
      const auto way = back(leave, enter);
      if (!way) return false;
      ball.add_arc(leave.at, enter.at, *way);
    }
    return true;
  }

 private:
  void add_chord(ShallowBall& ball, int k, Vec3 from, Vec3 to, bool from_sphere, bool to_sphere) {
    ball.add_chord(from, to);
    if (to_sphere) leaves.push_back({to, k});
    if (from_sphere) enters.push_back({from, k});
  }
};

/// If no edge cuts the disc of a face, the face is the whole disc or empty. It is empty if the disc's middle is above
/// the apex.
bool is_whole(const Plane& face, Vec3 centre, double radius, Vec3 up, double apex_distance) {
  const double height = -signed_distance(face, centre);
  return height < radius && height * dot(face.normal, up) >= (1 - kNear) * apex_distance;
}

/// Adds a face whose disc is cut by edges. False if a decision is uncertain.
bool add_face(int f, const WidePolyhedron& at, const WideVector& apex, const ApexAxes& axes,
              std::span<const ShallowChord> chords, std::span<const SeenChord> seen, ShallowBall& ball,
              ShallowPart& part, Section& section) {
  thread_local std::vector<ArcEnd> leaves, enters;
  const auto of_face = at.places.plane(f);
  if (!of_face) return false;
  const DoubleDouble wide_radius{at.radius}, of_centre = of_face->offset;
  const DoubleDouble square = (wide_radius - of_centre) * (wide_radius + of_centre);
  if (!(square.head > 0)) return false;
  const Vec3 n = axes.seen(of_face->normal);
  ball.begin_face(n, rounded(of_centre - dot(of_face->normal, apex)), std::sqrt(square.head));
  FaceBorder border{f, n, chords, seen, leaves, enters};
  border.add_chords(ball);
  if (!border.add_arcs(ball)) return false;
  const double area = ball.end_face();
  ++part.faces;
  part.area += area;
  part.flat += area * rounded(of_face->normal);
  const Vec3 first = ball.face_first();
  section.area = area;
  section.first = first.x * rounded(axes.ahead) + first.y * rounded(axes.aside) + first.z * rounded(axes.up);
  return true;
}

/// All faces and the curved part. The apex has the given `distance` from the centre.
std::optional<ShallowPart> measure_from(const WideVector& apex, const WidePolyhedron& at,
                                        std::span<const int> reached) {
  thread_local std::vector<ShallowChord> chords;
  thread_local std::vector<SeenChord> seen;
  thread_local std::vector<Section> sections;
  sections.assign(at.polyhedron.planes.size(), {});
  const DoubleDouble from_centre = norm(apex);
  const double depth = rounded(DoubleDouble{at.radius} - from_centre);
  if (!(depth > 0)) return std::nullopt;
  find_chords(at, reached, apex, chords);
  const auto axes = axes_at(apex / from_centre, chords);
  if (!axes) return std::nullopt;
  seen.clear();
  for (const ShallowChord& chord : chords)
    seen.push_back({axes->seen(chord.from), axes->seen(chord.to), axes->seen(chord.along)});
  const Vec3 up = rounded(axes->up);
  ShallowBall ball(at.radius, depth);
  ShallowPart part;
  part.apex = rounded(apex);
  for (int f = 0; f < static_cast<int>(at.polyhedron.planes.size()); ++f) {
    const auto parts = [&](const ShallowChord& chord) { return chord.left == f || chord.right == f; };
    if (std::ranges::any_of(chords, parts)) {
      if (!add_face(f, at, apex, *axes, chords, seen, ball, part, sections[f])) return std::nullopt;
    } else if (is_whole(at.polyhedron.planes[f], at.c, at.radius, up, rounded(from_centre))) {
      return std::nullopt;
    }
  }
  part.area += ball.curved_area();
  part.volume = ball.volume(), part.error = ball.error();
  part.about_apex = ball.moments().along({rounded(axes->ahead), rounded(axes->aside), up});
  part.first = part.about_apex.first + part.volume * part.apex;
  part.sections = sections;
  return part;
}

}  // namespace

std::optional<ShallowPart> measure_shallow_ball(const Polyhedron& polyhedron, const WidePlaces& places, Vec3 centre,
                                                double radius) {
  thread_local std::vector<int> reached;
  const WidePolyhedron at{polyhedron, places, centre, radius};
  const auto highest = highest_face(polyhedron, at.c, radius);
  if (!highest) return std::nullopt;
  const auto nearest = nearest_point(polyhedron, at.c, radius, highest->face, reached);
  if (!nearest || reached.empty()) return std::nullopt;
  const double distance = nearest->above ? highest->over : std::sqrt(nearest->least2);
  if (!(distance < radius && distance >= (1 - kShallow) * radius)) return std::nullopt;
  const auto apex = apex_of(at, *nearest, highest->face);
  return apex ? measure_from(*apex, at, reached) : std::nullopt;
}

}  // namespace overlapper::quadric
