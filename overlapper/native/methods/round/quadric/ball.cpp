#include "methods/round/quadric/ball.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/constants.h"
#include "geometry/wide.h"

namespace overlapper::quadric {
namespace {

constexpr DoubleDouble kWidePi{kPi, 1.2246467991473532e-16};
/// Relative error of a length: 4 roundings for a unit vector, one for a difference, 3 for their product. Relative to
/// the size of the numbers.
constexpr double kPlacing = 8 * kUnit;
constexpr double kOpen = 1e-9;  ///< over the squared radius: a larger error of an area means a wrong turn

/// A sum that is rounded only once.
class SumRoundedOnce {
 public:
  SumRoundedOnce& operator+=(DoubleDouble term) {
    const DoubleDouble sum = two_sum(sum_.head, term.head);
    sum_ = {sum.head, sum_.tail + sum.tail + term.tail};
    return *this;
  }
  SumRoundedOnce& operator+=(double term) { return *this += DoubleDouble{term}; }
  double value() const { return sum_.head + sum_.tail; }

 private:
  DoubleDouble sum_;
};

/// The disc that a face's plane cuts from the ball, with sums over the face's part of the disc, edge by edge. Seen from
/// the middle, this part consists of a triangle for each edge, and of sectors for the remaining angles.
struct Disc {
  double height = 0;     ///< of the plane over the centre
  double square = 0;     ///< of the radius ρ; 0 if the plane does not reach the ball
  bool around = true;    ///< the face contains the middle: no edge lies on this side of the middle
  bool touched = false;  ///< by an edge
  int ends = 0;          ///< number of ends of edges on the sphere
  double whole = 0;      ///< twice the area of the face, from its edges
  SumRoundedOnce angle;  ///< of the edges' parts inside the ball, seen from the middle
  double sizes = 0;      ///< sum of the sizes of these angles
  SumRoundedOnce twice;  ///< twice the area of their triangles
  double second = 0;     ///< four times ∫ |y|² dA over the triangles
  Vec3 first;            ///< ∫ y dA over triangles and sectors
  Vec3 third;            ///< ∫ (|y|² − ρ²) y dA over the same
  Section moments;       ///< with ∫ y yᵀ dA over the same, if it is wanted
  /// If the ball's centre is a corner of the face: directions from there, along the edge that arrives and the edge that
  /// leaves.
  Vec3 comes, goes;
};

/// The part of an edge inside the ball, seen from the middle of a disc. Lengths along the edge are relative to its
/// nearest point to the centre.
struct DiscChord {
  Vec3 out, along;  ///< unit, in the disc's plane: from the face across the edge, and along the edge
  double height;    ///< of the edge's line over the middle, positive if the middle is on the side of the face
  double from, to;

  double distance2(double t) const { return height * height + t * t; }
};

/// Subtracts the first and third moments of a sector from a disc. `out` is minus the integral of the unit vectors over
/// the angle of the sector.
void add_sector(Vec3 out, Disc& disc) {
  const double cube = disc.square * std::sqrt(disc.square);
  disc.first += cube / 3 * out;
  disc.third -= 2.0 / 15 * disc.square * cube * out;
}

/// Adds ∫ y yᵀ dA for the end of a sector in the direction of y, without the mean over the angle. For unit vectors u
/// and w = n × u, d(u wᵀ + w uᵀ) / dθ is 2 (1 − n nᵀ) − 4 u uᵀ.
void add_end_of_sector(Vec3 y, Vec3 n, double side, Disc& disc) {
  disc.moments.add_second(side * disc.square * disc.square / 16 / norm2(y), y, cross(n, y));
}

void add_second_moments(const DiscChord& chord, Disc& disc) {
  const Vec3 foot = chord.height * chord.out, n = cross(chord.out, chord.along);
  const Vec3 from = foot + chord.from * chord.along, to = foot + chord.to * chord.along;
  const double share = chord.height * (chord.to - chord.from) / 24;
  disc.moments.add_second(share, from, from);
  disc.moments.add_second(share, from, to);
  disc.moments.add_second(share, to, to);
  if (!(norm2(from) > 0 && norm2(to) > 0)) return;
  add_end_of_sector(from, n, -1, disc), add_end_of_sector(to, n, 1, disc);
}

/// Returns the size of the angle.
double add(const DiscChord& chord, Disc& disc) {
  const auto [out, along, h, from, to] = chord;
  const double length = to - from, h2 = h * h, cubes = length * (from * from + from * to + to * to);
  const double angle = std::atan2(length * h, h2 + from * to);
  disc.touched = true;
  disc.angle += angle, disc.sizes += std::abs(angle);
  disc.twice += h * length;
  disc.second += h * (h2 * length + cubes / 3);
  disc.first += h * length / 6 * (2 * h * out + (from + to) * along);
  const double part = h2 / 5 - disc.square / 3;
  const double squares = length * (from + to), fourths = squares * (from * from + to * to);
  disc.third += h2 * (part * length + cubes / 15) * out + h * (part * squares / 2 + fourths / 20) * along;
  // A chord seen from one of its own ends has no angle.
  if (chord.distance2(from) > 0 && chord.distance2(to) > 0) {
    const double begin = 1 / std::sqrt(chord.distance2(from)), end = 1 / std::sqrt(chord.distance2(to));
    add_sector((from * begin - to * end) * out + h * (end - begin) * along, disc);
  }
  return std::abs(angle);
}

/// The angle by which the border of the curved part turns on the edge between two planes, at `t` along the edge from
/// its nearest point to the centre. The turn is negative, or more than half a turn, if t is negative.
double turn_at(double t, double radius, double cosine, double sine, double heights) {
  const double x = cosine * t * t - heights, turn = std::atan2(radius * sine * t, x);
  return turn < 0 && x < 0 ? turn + 2 * kPi : turn;
}

/// A ball and a polyhedron, with all decisions that the sums share.
struct BallAndPolyhedron {
  const Polyhedron& polyhedron;
  Vec3 centre;
  double r, r2 = r * r, r3 = r * r2;
  std::vector<Disc>& discs;   ///< per plane
  std::vector<char>& inside;  ///< per corner
  bool second_moments;        ///< of sections are wanted

  /// False if a plane leaves nothing of the ball.
  bool set_discs() {
    discs.assign(polyhedron.planes.size(), {});
    for (size_t f = 0; f < discs.size(); ++f) {
      const double h = -signed_distance(polyhedron.planes[f], centre);
      if (h <= -r) return false;
      discs[f].height = h, discs[f].square = std::max(0.0, (r - h) * (r + h));
    }
    return true;
  }
  /// Returns how many corners are inside.
  int set_inside() {
    inside.resize(polyhedron.corners.size());
    for (size_t i = 0; i < inside.size(); ++i) inside[i] = norm2(polyhedron.corners[i] - centre) < r2;
    return static_cast<int>(std::ranges::count(inside, char{1}));
  }
};

/// Sums over edges and faces.
struct BallSums {
  BallPart part;
  int characteristic;            ///< of the curved part (Euler)
  SumRoundedOnce curved, cones;  ///< the area of the curved part, over r²; Σ h A
  double sizes = 0, cone_sizes = 0;
  double flats = 0;     ///< m², of all faces
  double pressure = 0;  ///< Σ h ∫ (|x|² − r²) dA
};

/// An edge, projected along itself: both planes and the line where they meet. The height of one plane and the height of
/// the line give the height of the other plane.
struct SeenEdge {
  Vec3 n, m, along, out;
  double length, cosine, sine;
  double fold = 0;              ///< rad: the turn inwards of planes that rounding has put in a wrong order
  bool from_middle, to_middle;  ///< the ball's centre is that end
  double height, other;         ///< of the line, over the middles of the left and the right disc
  double first, last;           ///< of the ends, along the line from its point nearest to the centre

  bool through() const { return from_middle || to_middle; }

  SeenEdge(const Edge& edge, const BallAndPolyhedron& at, double left_height) {
    const Vec3 corner = at.polyhedron.corners[edge.from], between = at.polyhedron.corners[edge.to] - corner;
    n = at.polyhedron.planes[edge.left].normal, m = at.polyhedron.planes[edge.right].normal;
    length = std::sqrt(norm2(between));
    const Vec3 p = corner - at.centre;
    along = between / length, out = cross(along, n);
    // No zero may be negative: its angle would be on the other side.
    cosine = dot(n, m), sine = std::max(0.0, dot(out, m));
    if (sine == 0) fold = std::atan2(std::max(0.0, -dot(out, m)), cosine);
    from_middle = p == Vec3{}, to_middle = at.polyhedron.corners[edge.to] == at.centre;
    height = through() ? 0 : dot(out, p) + 0.0;
    other = through() ? 0 : sine * left_height - cosine * height + 0.0;
    first = to_middle ? -length : dot(p, along), last = to_middle ? 0 : first + length;
  }
};

/// Adds the contribution of an edge to the sums of the whole faces.
void add_border(const SeenEdge& edge, Disc& left, Disc& right) {
  if (edge.from_middle) left.goes = right.comes = edge.along;
  if (edge.to_middle) left.comes = right.goes = -edge.along;
  left.whole += edge.height * edge.length, right.whole += edge.other * edge.length;
  if (edge.height < 0) left.around = false;
  if (edge.other < 0) right.around = false;
}

/// Adds the error of an edge's part inside. `beside` is the size of the sectors of its two chords. Heights are those of
/// the planes.
void add_error(const SeenEdge& edge, const DiscChord& left, const DiscChord& right, bool from_inside, bool to_inside,
               double beside, double left_height, double right_height, double r3, double misplaced_corners,
               double& error) {
  const double far = std::abs(edge.first) + std::abs(edge.height) + std::abs(left_height);
  const double misplaced = kPlacing * far + misplaced_corners;
  const double tilt_left = std::abs(dot(edge.along, edge.n)), tilt_right = std::abs(dot(edge.along, edge.m));
  const auto seen = [&](double t) {
    return edge.through() && t == 0 ? 0 : 1 / std::sqrt(left.distance2(t)) + 1 / std::sqrt(right.distance2(t));
  };
  // How fast the angle between both ends changes if the corners move along the edge.
  const auto turning = [&](const DiscChord& chord) {
    const auto at = [&](double t, bool inside) {
      return inside && chord.height != 0 ? chord.height / chord.distance2(t) : 0;
    };
    return std::abs(at(chord.to, to_inside) - at(chord.from, from_inside));
  };
  const int ends = !from_inside + !to_inside;
  error += misplaced * beside;
  if (from_inside) error += misplaced * r3 / 2 * seen(left.from);
  if (to_inside) error += (misplaced + kPlacing * edge.length) * r3 / 2 * seen(left.to);
  error += ends * r3 * (tilt_left + tilt_right + edge.fold + kPlacing);
  error += r3 / 2 *
           (tilt_left * std::abs(left_height) * turning(left) + tilt_right * std::abs(right_height) * turning(right));
}

/// An edge between two corners at one place, where more than three faces meet.
void add_short_edge(const Edge& edge, const BallAndPolyhedron& at, BallSums& sums) {
  if (!at.inside[edge.from]) return;
  for (Disc* disc : {&at.discs[edge.left], &at.discs[edge.right]})
    disc->touched = true, disc->around = disc->around && at.polyhedron.corners[edge.from] != at.centre;
  ++sums.characteristic;
}

/// The ends of an edge's part inside, along the edge. No value if there is no such part. If rounding puts an end beyond
/// a corner, as on edges nearly tangent to the sphere, the corner is the end.
std::optional<std::array<double, 2>> range_inside(const SeenEdge& edge, bool from_inside, bool to_inside,
                                                  const Disc& left, const Disc& right) {
  const double half = std::sqrt(std::max(0.0, left.square - edge.height * edge.height));
  const double first = edge.first, last = edge.last;
  if (!from_inside && !to_inside && !(half > 0 && right.square > 0 && first < 0 && last > 0)) return std::nullopt;
  return std::array{from_inside ? first : std::clamp(-half, first, to_inside ? last : 0),
                    to_inside ? last : std::clamp(half, from_inside ? first : 0, last)};
}

void add_edge(const Edge& edge, const BallAndPolyhedron& at, BallSums& sums) {
  if (norm2(at.polyhedron.corners[edge.to] - at.polyhedron.corners[edge.from]) == 0)
    return add_short_edge(edge, at, sums);
  Disc &left = at.discs[edge.left], &right = at.discs[edge.right];
  const bool from_inside = at.inside[edge.from], to_inside = at.inside[edge.to];
  const SeenEdge seen(edge, at, left.height);
  add_border(seen, left, right);
  const auto range = range_inside(seen, from_inside, to_inside, left, right);
  if (!range) return;
  const auto [from, to] = *range;
  const auto turn = [&](double t) { return turn_at(t, at.r, seen.cosine, seen.sine, seen.height * seen.other); };
  const int ends = !from_inside + !to_inside;
  left.ends += ends, right.ends += ends;
  const double at_from = from_inside ? 0 : turn(-from);
  const double at_to = to_inside ? 0 : ends == 2 && -from == to ? at_from : turn(to);
  sums.curved += -at_from, sums.curved += -at_to;
  sums.sizes += at_from + at_to;
  const DiscChord of_left{seen.out, seen.along, seen.height, from, to};
  const DiscChord of_right{seen.sine * seen.n - seen.cosine * seen.out, seen.along, seen.other, from, to};
  const double beside = left.square * add(of_left, left) + right.square * add(of_right, right);
  if (at.second_moments) add_second_moments(of_left, left), add_second_moments(of_right, right);
  ++sums.characteristic;
  add_error(seen, of_left, of_right, from_inside, to_inside, beside, left.height, right.height, at.r3,
            at.polyhedron.misplaced, sums.part.error);
}

/// A face that has a corner at the ball's centre.
void add_corner_at_centre(Vec3 n, Disc& disc) {
  if (disc.goes == Vec3{}) return;
  const double angle = std::atan2(dot(n, cross(disc.comes, disc.goes)), dot(disc.comes, disc.goes));
  disc.around = false;
  disc.angle += angle, disc.sizes += std::abs(angle);
  add_sector(cross(disc.comes - disc.goes, n), disc);
  add_end_of_sector(disc.comes, n, -1, disc), add_end_of_sector(disc.goes, n, 1, disc);
}

/// Adds the part of a face inside the ball, and returns it.
Section add_face(const Disc& disc, Vec3 n, bool is_cut, double r, BallSums& sums) {
  BallPart& part = sums.part;
  // A face as small as rounding may seem to surround any point.
  const bool wide_enough = disc.touched || disc.whole >= 6 * disc.square;
  const bool whole_turn = disc.around && disc.square > 0 && wide_enough;
  if (!whole_turn && !disc.touched) return {};
  ++part.faces;
  // If no edge ends on the sphere, edges are the whole border. Their turn then differs from a whole turn only by
  // rounding.
  const double h = disc.height, turn = whole_turn ? 2 * kPi : 0, rest = turn - disc.angle.value();
  const double arcs = disc.touched && disc.ends == 0 ? 0 : rest;
  if (!(arcs > -kOpen && arcs < 2 * kPi + kOpen)) part.error = kInfinity;
  const double twice = disc.twice.value(), face = (disc.square * arcs + twice) / 2;
  --sums.characteristic;
  sums.curved += arcs * h / r;
  sums.cones += h * face;
  sums.sizes += (turn + disc.sizes) * std::abs(h) / r;
  sums.cone_sizes += std::abs(h) * (disc.square * (turn + disc.sizes) + std::abs(twice)) / 2;
  sums.flats += face;
  if (!is_cut) part.area += face;
  part.flat += face * n;
  const double on_face = (disc.second - disc.square * disc.square * arcs) / 4 - disc.square * twice / 2;
  part.first += on_face / 2 * n;
  sums.pressure += h * on_face;
  const Vec3 w = h * on_face * n + disc.third;
  part.squares += scaled(n, w);
  part.products += 0.5 * Vec3{n.y * w.z + n.z * w.y, n.z * w.x + n.x * w.z, n.x * w.y + n.y * w.x};
  Section section = disc.moments;
  section.area = face, section.first = face * h * n + disc.first;
  const double mean = disc.square * disc.square * arcs / 8;
  section.squares += mean * Vec3{1, 1, 1};
  section.add_second((face * h * h - mean) / 2, n, n);
  section.add_second(h, n, disc.first);
  return section;
}

/// Adds the curved part to the sums over the faces.
void finish(const std::vector<Disc>& discs, double r, BallSums& sums) {
  BallPart& part = sums.part;
  const double r2 = r * r, r3 = r * r2;
  sums.curved += DoubleDouble{sums.characteristic * 2.0} * kWidePi;
  const double area = r2 * sums.curved.value();
  // If no face reaches the ball, no plane does either, unless the polyhedron is as small as rounding.
  const bool reached = std::ranges::any_of(discs, [](const Disc& disc) { return disc.square > 0; });
  if (part.faces == 0 && reached) part.error = kInfinity;
  // The rest of the sphere, beyond the faces, is larger than the faces. The area of the curved part is larger than the
  // length of its area vector. A wrong turn would violate one of these two inequalities.
  const double slack = kOpen * r2;
  if (!(area + sums.flats <= 4 * kPi * r2 + slack && norm(part.flat) <= area + slack)) part.error = kInfinity;
  part.area += area;
  part.volume = (sums.cones.value() + r * area) / 3;
  part.error += kUnit * 10 * (sums.cone_sizes + r3 * sums.sizes + r * std::abs(area)) / 3;
  const double all = (3 * r2 * part.volume + sums.pressure) / 5, each = r2 * part.volume - all;
  part.squares = 0.5 * (part.squares + Vec3{each, each, each});
  part.products = 0.5 * part.products;
}

}  // namespace

// The faces have heights h and areas A, and the curved part has the area C. All are about the centre:
//
//   3 V = Σ h A + r C,   2 ∫ x dV = Σ n ∫ (|x|² − r²) dA over the faces,   ∫ n dA = −Σ A n over the curved part.
//   2 ∫ x xᵀ dV + ∫ |x|² dV = r² V + Σ n ∫ (|x|² − r²) xᵀ dA.
//
// The theorem of Gauss and Bonnet gives C / r². It is 2π times the Euler characteristic of the curved part, minus the
// turns of its border at corners and along arcs. The turn along an arc of angle φ is −h φ / r. The characteristic is 2,
// that of a sphere, minus that of the union of the faces' parts. The latter is the number of these parts, minus the
// number of edges inside, plus the number of corners inside.
//
// All sums share the same decisions. Whether a corner is inside, which part of an edge is inside, and on which side of
// an edge a disc's middle lies are each decided once. If rounding makes a decision wrong, it is right for a ball or a
// plane that is moved by the rounding. Tangent planes and tangent edges are therefore no special cases.
//
// If the ball's centre is itself a corner, the sums treat the corner as if it were a little farther along the edge that
// leaves it. The middles of its faces' discs are then outside.
//
// Error. Every term has at most ten roundings. Sums of many terms are rounded once, because the turns of a fine
// polyhedron cancel in all but their last digits. The other errors come from the edges:
//
// - Rounding misplaces an edge by kPlacing times the size of its numbers, plus the misplacement of these numbers. Seen
//   along the edge, the two planes and their line still meet. The edge contributes to the volume a signed part of the
//   ball, between its planes and two radii of its discs. The error of this part is at most the misplacement times the
//   area that the edge cuts off from the discs. This area is part of a sector of each disc.
// - If the edge ends in a corner inside, the direction from a disc's middle to the corner has an error: the
//   misplacement of the corner over its distance. It changes a sector, and the part of the ball above the sector. If
//   the corner is in the middle of the disc, the error has no bound, because each edge gives another direction.
// - Misplaced corners tilt the edge against a plane. Corners then move along the edge by the tilt times the height of
//   the plane over the centre, and ends on the sphere do not. Seen from the disc's middle, the angle between both ends
//   changes. The measured tilt counts.
// - Planes that meet near one line may follow each other in a wrong order. The polyhedron then has a fold inwards. Its
//   faces there are as narrow as rounding, but the border of the curved part turns back by the angle of the fold. No
//   edge of a convex polyhedron turns back, so this turn is left out, and counts as an error.
std::optional<BallPart> measure_ball(const Polyhedron& polyhedron, Vec3 centre, double radius, bool second_moments) {
  thread_local std::vector<Disc> discs;
  thread_local std::vector<char> inside;
  thread_local std::vector<Section> sections;
  BallAndPolyhedron at{.polyhedron = polyhedron,
                       .centre = centre,
                       .r = radius,
                       .discs = discs,
                       .inside = inside,
                       .second_moments = second_moments};
  if (!at.set_discs()) return std::nullopt;
  BallSums sums{{}, 2 - at.set_inside(), {}, {}};
  for (const Edge& edge : polyhedron.edges) add_edge(edge, at, sums);
  sections.clear();
  for (size_t f = 0; f < discs.size(); ++f) {
    const Vec3 n = polyhedron.planes[f].normal;
    add_corner_at_centre(n, discs[f]);
    sections.push_back(add_face(discs[f], n, f >= polyhedron.faces, radius, sums));
  }
  const bool holds_centre = std::ranges::none_of(discs, [](const Disc& disc) { return disc.height < 0; });
  if (sums.part.faces == 0 && !holds_centre) return BallPart{};
  finish(discs, radius, sums);
  sums.part.sections = sections;
  return sums.part;
}

}  // namespace overlapper::quadric
