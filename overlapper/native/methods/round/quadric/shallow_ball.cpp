#include "methods/round/quadric/shallow_ball.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "methods/round/quadric/segment.h"

namespace overlapper::quadric {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kUnit = 0x1p-53;  ///< of rounding
constexpr double kOneWay = 1e-7;   ///< of how far ends are: so near each other, doubles do not say which way they are
constexpr double kNear = 1e-9;     ///< of squares: so near the sphere, doubles do not say which side a corner is on

/// Gauss's sixteen nodes and weights on [-1, 1].
constexpr std::array<double, 8> kNode{0.0950125098376374, 0.2816035507792589, 0.4580167776572274, 0.6178762444026438,
                                      0.7554044083550030, 0.8656312023878318, 0.9445750230732326, 0.9894009349916499};
constexpr std::array<double, 8> kWeight{0.1894506104550685, 0.1826034150449236, 0.1691565193950025, 0.1495959888165767,
                                        0.1246289712555339, 0.0951585116824928, 0.0622535239386479, 0.0271524594117541};

/// y z, z x and x y of two points, of one each.
Vec3 products(Vec3 a, Vec3 b) { return {a.y * b.z, a.z * b.x, a.x * b.y}; }

}  // namespace

// With heights h and areas A of the faces over the apex, its depth d in the ball, of radius r, and the height w that
// the unit sphere has lost, where a normal n of it has the height 1 − w,
//
//   3 V = Σ h A + r² (d S + (r − d) L),   S = ∫ dA = ∮ w dφ,   L = ∫ w dA = ½ ∮ w² dφ,   ∫ w² dA = ⅓ ∮ w³ dφ
//
// over the curved part of the unit sphere and along its border, where φ is the angle around the way to the apex: of a
// part of the sphere, dA is dw dφ (Archimedes). With x² + y² = w (2 − w), dφ is (x dy − y dx) / (w (2 − w)), and all
// that is integrated along an arc is a polynomial of x, y, w and their differentials over 2 − w. The other moments are
//
//   ∫ x wᵏ dA = ∮ wᵏ⁺¹ dy / (k + 1),   ∫ y wᵏ dA = −∮ wᵏ⁺¹ dx / (k + 1),   ∫ xy wᵏ dA = ∮ y wᵏ⁺¹ dy / (k + 1),
//   ∫ (x² wᵏ + (1 − w) wᵏ⁺¹ / (k + 1)) dA = ∮ x wᵏ⁺¹ dy / (k + 1), and so for y.
//
// No term is larger than what is shared, but where the curved part does not hold the direction of the apex: nothing
// cancels.
//
// An arc's points are rational in the tangent of a quarter of its angle, which is cut to be at most that of 22.5°: the
// nearest pole is at 2.4 times that, and Gauss's sixteen nodes are off by 5^-32 of what is integrated.
void ShallowBall::begin_face(Vec3 normal, double height, double disc_radius) {
  normal_ = normal, height_ = height, disc_radius_ = disc_radius;
  const double from_centre = radius_ - depth_, of_centre = height + from_centre * normal.z;
  const double across2 = normal.x * normal.x + normal.y * normal.y;
  disc_ = {of_centre * normal.x, of_centre * normal.y, height * normal.z - from_centre * across2};
  twice_ = twice_sizes_ = segments_ = 0, face_first_ = face_squares_ = face_products_ = {};
}

void ShallowBall::add_chord(Vec3 from, Vec3 to) {
  const Vec3 n = normal_, turn = cross(from, to), foot = height_ * n;
  const double twice = dot(n, turn);
  twice_ += twice, twice_sizes_ += std::abs(n.x * turn.x) + std::abs(n.y * turn.y) + std::abs(n.z * turn.z);
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
  // Of more than a half turn, the chord may be too short to say where its own middle is.
  if (angle > 0.75 * kPi) out = -unit(from - disc_ + (to - disc_)), along = cross(normal_, out);
  for (int k = 0; k < parts; ++k) {
    const double at = (2 * k + 1 - parts) * part, sin_at = std::sin(at), cos_at = std::cos(at);
    const Vec3 here = cos_at * out + sin_at * along, way = cos_at * along - sin_at * out;
    integrate(disc_ + disc_radius_ * c * here, disc_radius_ * s * way, disc_radius_ * here, s / (1 + c));
  }
}

/// An arc from middle − along to middle + along, of a circle whose radius towards the arc is `out`, and the tangent of
/// a quarter of its angle.
void ShallowBall::integrate(Vec3 middle, Vec3 along, Vec3 out, double quarter) {
  const double scale = 1 / radius_, q2 = quarter * quarter;
  const double mx = scale * middle.x, my = scale * middle.y;
  // Along the chord, the sine is 2 τ / (1 + τ²) over 2 q / (1 + q²) of half of it; across, 2 (q² − τ²) / ... of `out`.
  const double widen = scale * (1 + q2), ax = widen * along.x, ay = widen * along.y;
  const double rise = 2 * scale * q2 / (1 + q2), bx = rise * out.x, by = rise * out.y;
  const double size = rise * std::sqrt(norm2(out));
  for (int i = 0; i < 8; ++i)
    for (const double node : {-kNode[i], kNode[i]}) {
      const double t2 = q2 * node * node, c = 1 / (1 + t2);
      const double go = node * c, bulge = (1 - node * node) * c;
      // Backwards: what is to the left of a face's border is to the right of the curved part's.
      const double go_rate = -kWeight[i] * (1 - t2) * c * c, bulge_rate = 2 * kWeight[i] * (1 + q2) * node * c * c;
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

/// Terms have a score of roundings, of coordinates that are right to a few.
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
struct Chord {
  int left, right;
  WideVector from, to;          ///< from the ball's centre
  WideVector along;             ///< unit
  bool from_sphere, to_sphere;  ///< whether that is where it enters or leaves, and not a corner
};

/// An end of a chord on the sphere, as the arcs of a face see it.
struct End {
  Vec3 at;
  int chord;
};

}  // namespace

std::optional<ShallowPart> measure_shallow_ball(const Polyhedron& polyhedron,
                                                const std::function<std::optional<WidePlane>(int)>& plane,
                                                const WideVector& centre, double radius) {
  const Vec3 c = rounded(centre);
  const double r2 = radius * radius;
  int highest = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (int f = 0; f < static_cast<int>(polyhedron.planes.size()); ++f) {
    const double over = signed_distance(polyhedron.planes[f], c);
    if (over >= radius) return std::nullopt;
    if (over > most) most = over, highest = f;
  }
  if (!(most > 0)) return std::nullopt;

  // The polyhedron's point that is nearest to the centre, as doubles see it: any near it would do.
  thread_local std::vector<int> reached;
  reached.clear();
  bool above = true;  // the face that is highest
  int nearest = -1, nearest_end = -1;
  double least = std::numeric_limits<double>::infinity();
  const double reach2 = r2 * (1 + kNear);
  for (int e = 0; e < static_cast<int>(polyhedron.edges.size()); ++e) {
    const Edge& edge = polyhedron.edges[e];
    const Vec3 from = polyhedron.corners[edge.from] - c, between = polyhedron.corners[edge.to] - c - from;
    const double length2 = norm2(between), at = std::clamp(-dot(from, between) / length2, 0.0, 1.0);
    if (!(length2 > 0)) return std::nullopt;
    const double distance2 = norm2(from + at * between);
    if (distance2 <= reach2) reached.push_back(e);
    if (distance2 < least) least = distance2, nearest = e, nearest_end = at == 0 ? edge.from : at == 1 ? edge.to : -1;
    const Vec3 n = polyhedron.planes[highest].normal;
    if (edge.left == highest && dot(cross(between, n), from) < 0) above = false;
    if (edge.right == highest && dot(cross(between, n), from) > 0) above = false;
  }
  if (reached.empty()) return std::nullopt;
  const double distance = above ? most : std::sqrt(least);
  if (!(distance < radius && distance >= (1 - kShallow) * radius)) return std::nullopt;

  const auto corner = [&](int i) { return wide(polyhedron.corners[i]) - centre; };
  const auto foot_on = [&](const Edge& edge, WideVector& along, WideVector& from) {
    along = unit(wide_difference(polyhedron.corners[edge.to], polyhedron.corners[edge.from]));
    from = corner(edge.from);
    return from - dot(from, along) * along;
  };
  WideVector apex, along, from;
  if (above) {
    const auto top = plane(highest);
    if (!top) return std::nullopt;
    apex = -signed_distance(*top, centre) * top->normal;
  } else {
    apex = nearest_end >= 0 ? corner(nearest_end) : foot_on(polyhedron.edges[nearest], along, from);
  }
  const DoubleDouble from_centre = norm(apex), wide_radius{radius};
  const double depth = rounded(wide_radius - from_centre);
  if (!(depth > 0)) return std::nullopt;
  const WideVector up = apex / from_centre;

  // Which corners are inside is decided once for all their edges.
  thread_local std::vector<signed char> inside;
  inside.assign(polyhedron.corners.size(), -1);
  const auto is_inside = [&](int i) {
    if (inside[i] >= 0) return inside[i] == 1;
    const double distance2 = norm2(polyhedron.corners[i] - c);
    bool in = distance2 < r2;
    if (std::abs(distance2 - r2) <= kNear * r2) in = norm(corner(i)) < wide_radius;
    inside[i] = in;
    return in;
  };
  thread_local std::vector<Chord> chords;
  chords.clear();
  Vec3 farthest_at;
  double farthest2 = 0;
  for (const int e : reached) {
    const Edge& edge = polyhedron.edges[e];
    Chord chord{edge.left, edge.right, {}, {}, {}, !is_inside(edge.from), !is_inside(edge.to)};
    const WideVector foot = foot_on(edge, chord.along, chord.from);
    chord.to = corner(edge.to);
    if (chord.from_sphere || chord.to_sphere) {
      const DoubleDouble off = norm(foot), half2 = (wide_radius - off) * (wide_radius + off);
      if (chord.from_sphere && chord.to_sphere) {
        const bool crosses =
            half2.head > 0 && dot(chord.from, chord.along).head < 0 && dot(chord.to, chord.along).head > 0;
        if (!crosses) continue;
      }
      const WideVector half = sqrt(half2) * chord.along;
      if (chord.from_sphere) chord.from = foot - half;
      if (chord.to_sphere) chord.to = foot + half;
    }
    for (WideVector* end : {&chord.from, &chord.to}) {
      *end = *end - apex;
      const Vec3 at = rounded(*end);
      if (const double far2 = norm2(at); far2 > farthest2) farthest2 = far2, farthest_at = at;
    }
    chords.push_back(chord);
  }
  if (chords.empty() || !(farthest2 > 0)) return std::nullopt;

  // Axes, the first towards the farthest end: slender parts have the digits of their widths.
  const WideVector across = wide(farthest_at) - dot(wide(farthest_at), up) * up;
  if (!(norm2(rounded(across)) > 0)) return std::nullopt;
  const WideVector ahead = unit(across), aside = cross(up, ahead);
  const auto seen = [&](const WideVector& v) {
    return Vec3{rounded(dot(v, ahead)), rounded(dot(v, aside)), rounded(dot(v, up))};
  };
  thread_local std::vector<std::array<Vec3, 3>> seen_chords;
  seen_chords.clear();
  for (const Chord& chord : chords) seen_chords.push_back({seen(chord.from), seen(chord.to), seen(chord.along)});

  ShallowBall ball(radius, depth);
  ShallowPart part;
  part.apex = rounded(apex);
  const double apex_distance = rounded(from_centre);
  const Vec3 plain_up = rounded(up);
  thread_local std::vector<End> leaves, enters;
  for (int f = 0; f < static_cast<int>(polyhedron.planes.size()); ++f) {
    leaves.clear(), enters.clear();
    const auto begins = [&](const Chord& chord) { return chord.left == f || chord.right == f; };
    if (std::ranges::none_of(chords, begins)) {
      // A face that no edge parts is whole, or nothing: it is nothing if the middle of its disc is above the apex.
      const Plane& whole = polyhedron.planes[f];
      const double height = -signed_distance(whole, c);
      if (height < radius && height * dot(whole.normal, plain_up) >= (1 - kNear) * apex_distance) return std::nullopt;
      continue;
    }
    const auto of_face = plane(f);
    if (!of_face) return std::nullopt;
    const DoubleDouble of_centre = -signed_distance(*of_face, centre);
    const DoubleDouble square = (wide_radius - of_centre) * (wide_radius + of_centre);
    if (!(square.head > 0)) return std::nullopt;
    const double disc_radius = std::sqrt(square.head);
    const Vec3 n = seen(of_face->normal);
    ball.begin_face(n, rounded(of_centre - dot(of_face->normal, apex)), disc_radius);
    for (int k = 0; k < static_cast<int>(chords.size()); ++k) {
      const auto& [chord_from, chord_to, chord_along] = seen_chords[k];
      if (chords[k].left == f) {
        ball.add_chord(chord_from, chord_to);
        if (chords[k].to_sphere) leaves.push_back({chord_to, k});
        if (chords[k].from_sphere) enters.push_back({chord_from, k});
      }
      if (chords[k].right == f) {
        ball.add_chord(chord_to, chord_from);
        if (chords[k].from_sphere) leaves.push_back({chord_from, k});
        if (chords[k].to_sphere) enters.push_back({chord_to, k});
      }
    }
    if (leaves.size() != enters.size()) return std::nullopt;
    for (const End& leave : leaves) {
      // The next of the ends where edges enter, counter-clockwise.
      const End* next = &enters[0];
      if (enters.size() > 1) {
        const Vec3 middle = ball.disc();
        double first = std::numeric_limits<double>::infinity();
        for (const End& enter : enters) {
          const Vec3 u = leave.at - middle, v = enter.at - middle;
          double turn = std::atan2(dot(n, cross(u, v)), dot(u, v));
          if (turn < 0) turn += 2 * kPi;
          if (turn < first) first = turn, next = &enter;
        }
      }
      const Vec3 between = next->at - leave.at;
      const double length = std::sqrt(norm2(between));
      Vec3 back;
      if (next->chord == leave.chord) {
        const bool is_left = chords[leave.chord].left == f;
        back = is_left ? -seen_chords[leave.chord][2] : seen_chords[leave.chord][2];
      } else {
        if (!(length > kOneWay * (norm(leave.at) + norm(next->at)))) return std::nullopt;
        back = between / length;
      }
      ball.add_arc(leave.at, next->at, back);
    }
    const double area = ball.end_face();
    ++part.faces;
    part.area += area;
    part.flat += area * rounded(of_face->normal);
  }
  part.area += ball.curved_area();
  part.volume = ball.volume(), part.error = ball.error();
  part.about_apex = ball.moments().along({rounded(ahead), rounded(aside), plain_up});
  part.first = part.about_apex.first + part.volume * part.apex;
  return part;
}

}  // namespace overlapper::quadric
