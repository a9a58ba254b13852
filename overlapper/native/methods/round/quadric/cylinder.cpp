#include "methods/round/quadric/cylinder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/constants.h"
#include "geometry/scratch.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::quadric {
namespace {

constexpr int kMostRoundings = 16;       ///< in a term of a sum
constexpr double kLeaving = 16 * kUnit;  ///< error of the points where edges leave the cylinder, over their reach
constexpr double kNearlyWhole = 1e-5;    ///< rad: a shorter arc may be the rest of a whole turn
constexpr double kUpright = 1e-12;       ///< a normal with a smaller component along the axis has straight arcs
constexpr double kGrazing = 1e-6;        ///< squared sine between the surface and a face that grazes it
constexpr double kBeyond = 1e-12;        ///< margin of a plane that is out of reach, over the reach of numbers
constexpr double kUnbalanced = 1e-9;     ///< largest relative sum of terms that should sum to zero

/// Functions of an arc's half angle x, as in SegmentSeries. All are odd.
struct Arc {
  double segment, across, bulge, bulge_square;
};

/// The functions of an arc's half angle x, from x, its sine and its cosine.
Arc arc(double x, double s, double c) {
  if (std::abs(x) < kNarrow) {
    const double square = x * x, cube = square * x;
    const SegmentSeries& of = kSegmentSeries;
    return {cube * series(of.area, square), cube * series(of.first_across, square), cube * series(of.bulge, square),
            cube * series(of.bulge_square, square)};
  }
  const double segment = x - s * c;
  // ⅔ s first: segment() in segment.h multiplies in another order.
  return {segment, 2.0 / 3 * s * s * s - c * segment, s - x * c, 2 * x * c * c + x - 3 * s * c};
}

/// ∫ a³ dA and ∫ a b² dA over the segment of a unit disc, as in SegmentSeries.
struct ThirdMoments {
  double across, across_along;
};

ThirdMoments third_moments(double x, double s, double c, double along) {
  if (x < kNarrow) {
    const double square = x * x, cube = square * x;
    return {cube * series(kSegmentSeries.third_across, square), cube * series(kSegmentSeries.across_along, square)};
  }
  // Moments about the middle of the disc, then about the middle of the chord.
  const double s2 = s * s, s3 = s2 * s, s5 = s3 * s2;
  const double one = x - s * c, to1 = 2.0 / 3 * s3, to2 = one / 4 + s3 * c / 2, to3 = 2 * (s3 / 3 - s5 / 5);
  return {to3 - c * (3 * to2 - c * (3 * to1 - c * one)), 2.0 / 15 * s5 - c * along};
}

/// The part of an edge inside the cylinder.
struct CylinderChord {
  Vec3 from, to;
  bool from_surface, to_surface;  ///< whether the end is on the cylinder, and not a corner
};

double cross2(Vec3 a, Vec3 b) { return a.x * b.y - a.y * b.x; }
double dot2(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y; }

/// The part of the edge from p to q inside the cylinder; false if there is none.
bool find_chord(Vec3 p, Vec3 q, bool p_inside, bool q_inside, double radius, CylinderChord& chord) {
  chord = {p, q, !p_inside, !q_inside};
  if (p_inside && q_inside) return true;
  const Vec3 e = q - p;
  const double length2 = dot2(e, e), along = dot2(p, e), off = std::abs(cross2(p, e));
  if (!p_inside && !q_inside && !(along < 0 && -along < length2)) return false;
  if (!p_inside && !q_inside && !(off < radius * std::sqrt(length2))) return false;
  const double size = radius * std::sqrt(length2);
  const double root = std::sqrt(std::max(0.0, (size - off) * (size + off)));
  const double middle = length2 > 0 ? -along / length2 : 0, half = length2 > 0 ? root / length2 : 0;
  if (!p_inside) chord.from = p + std::clamp(middle - half, 0.0, 1.0) * e;
  if (!q_inside) chord.to = p + std::clamp(middle + half, 0.0, 1.0) * e;
  return true;
}

/// Sums over the part of a face inside the cylinder.
struct FaceSums : Section {
  double sizes = 0;   ///< m²: the sizes of all products whose sum is the area
  double levers = 0;  ///< m²: twice the areas that the border sweeps over if it moves by its distance from the foot
  Vec3 within;        ///< ∫ (ρ² − r²) x dA, where ρ is the distance from the axis
  double cubes = 0;   ///< ∫ z³ dA
};

/// The polyhedron about the point of the axis at half of its height.
struct AboutAxis {
  const Rings* polyhedron = nullptr;
  double radius = 0, level = 0, height = 0;
  double misplaced = 0;  ///< m: rounding of corners and planes
  std::vector<Vec3> corners;
  std::vector<char> inside;

  void become(const Rings& rings, double cylinder_radius, double rounding) {
    polyhedron = &rings, radius = cylinder_radius, misplaced = rounding;
    corners.assign(rings.corners().begin(), rings.corners().end());
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (size_t f = 0; f < rings.planes().size(); ++f)
      for (const int i : rings.ring(f)) low = std::min(low, corners[i].z), high = std::max(high, corners[i].z);
    level = low + (high - low) / 2, height = high - low;
    inside.resize(corners.size());
    for (size_t i = 0; i < corners.size(); ++i) {
      corners[i].z -= level;
      inside[i] = dot2(corners[i], corners[i]) < radius * radius;
    }
  }
};

/// Sums over all faces and arcs.
struct CylinderSums {
  CylinderPart part;
  int terms = 0;
  double cones = 0, sizes = 0, all_area = 0;
  double levers = 0;               ///< m²: those of all faces
  double upward = 0;               ///< m²: area of faces that look up, seen along the axis
  double far2 = 0;                 ///< m²: largest squared distance of a cut edge's corner from the origin
  double turned = 0;               ///< rad: sum over the arcs
  double rims = 0;                 ///< m: bound of the length of all arcs
  double levels = 0, squares = 0;  ///< ∫ z dθ and ∫ z² dθ along the arcs
  Vec3 height_moments;             ///< Σ h ∫ x dA
  double radial = 0;               ///< Σ ∫ (ρ² − r²) (n_x x + n_y y) dA
  /// Σ n_x ∫ (ρ² − r²) x dA, Σ n_y ∫ (ρ² − r²) y dA and Σ n_z ∫ z³ dA.
  Vec3 lengthwise;
  /// Σ n_y ∫ (ρ² − r²) z dA, Σ n_x ∫ (ρ² − r²) z dA, and half of Σ n_x ∫ (ρ² − r²) y dA + Σ n_y ∫ (ρ² − r²) x dA.
  Vec3 across;

  /// Adds the part of a face inside. `n` and `offset` are those of its plane.
  void add_face(Vec3 n, double offset, const FaceSums& face, bool is_cut) {
    const double area = face.area;
    ++part.faces, ++terms;
    cones += offset * area;
    sizes += std::abs(offset) * face.sizes;
    all_area += area, levers += face.levers;
    upward += std::max(0.0, area * n.z);
    height_moments += offset * face.first;
    radial += n.x * face.within.x + n.y * face.within.y;
    lengthwise += scaled(n, {face.within.x, face.within.y, face.cubes});
    across += Vec3{n.y * face.within.z, n.x * face.within.z, (n.x * face.within.y + n.y * face.within.x) / 2};
    const Pull pull{area * n, cross(face.first, n)};
    part.curved.force += -pull.force, part.curved.moment += -pull.moment;
    if (is_cut) return;
    part.flat.force += pull.force, part.flat.moment += pull.moment;
    part.area += area;
  }
};

void find_chords(const AboutAxis& at, std::span<const int> ring, std::vector<CylinderChord>& chords,
                 CylinderSums& sums) {
  chords.clear();
  for (size_t k = 0; k < ring.size(); ++k) {
    const int i = ring[k], j = ring[k + 1 < ring.size() ? k + 1 : 0];
    const auto [low, high] = std::minmax(i, j);
    CylinderChord chord;
    if (!find_chord(at.corners[low], at.corners[high], at.inside[low], at.inside[high], at.radius, chord)) continue;
    if (i < j) chords.push_back(chord);
    else chords.push_back({chord.to, chord.from, chord.to_surface, chord.from_surface});
    sums.far2 = std::max({sums.far2, norm2(at.corners[i]), norm2(at.corners[j])});
  }
  sums.terms += 2 * static_cast<int>(chords.size());
}

/// Whether a face without an edge inside reaches all around. A steeper face would be higher than the polyhedron.
bool around(const AboutAxis& at, std::span<const int> ring, Vec3 n) {
  if (!(std::abs(n.z) * at.height > at.radius * std::hypot(n.x, n.y))) return false;
  double twice = 0;  // twice its area, seen along the axis
  for (size_t k = 0; k < ring.size(); ++k) {
    const double turn = cross2(at.corners[ring[k]], at.corners[ring[k + 1 < ring.size() ? k + 1 : 0]]) * n.z;
    if (turn < 0) return false;
    twice += turn;
  }
  // A face that is only rounding may seem to surround any point.
  return twice >= 6 * std::abs(n.z) * at.radius * at.radius;
}

FaceSums add_ellipse(Vec3 n, double offset, double radius, CylinderSums& sums) {
  FaceSums face;
  const double turn = n.z > 0 ? 2 * kPi : -2 * kPi, z = offset / n.z;
  const double wave2 = radius * radius * dot2(n, n) / (n.z * n.z);
  face.area = face.sizes = kPi * radius * radius / std::abs(n.z);
  // The middle of the ellipse is on the axis.
  face.first = face.area * Vec3{0, 0, z};
  sums.turned += turn, sums.levels += turn * z, sums.squares += turn * (z * z + wave2 / 2);
  sums.sizes += radius * radius * std::abs(turn * z);
  const double quarter = radius * radius / 4;
  const Vec3 slope{-n.x / n.z, -n.y / n.z, 0};
  const double rise2 = quarter * dot2(slope, slope);
  face.squares = face.area * Vec3{quarter, quarter, z * z + rise2};
  face.products = face.area * quarter * Vec3{slope.y, slope.x, 0};
  // Over a disc, the mean of (ρ² − r²) is −r² / 2, and that of (ρ² − r²) x² is −r⁴ / 12.
  face.within = face.area * Vec3{0, 0, -2 * quarter * z};
  face.cubes = face.area * z * (z * z + 3 * rise2);
  return face;
}

void add_triangle(Vec3 n, Vec3 a, Vec3 b, Vec3 c, double radius, FaceSums& face) {
  const Vec3 e = b - a, f = c - a;
  const double area = dot(n, cross(e, f)) / 2;
  face.sizes += dot(abs(n), sizes_of_cross(e, f)) / 2;
  if (area == 0) return;
  face.area += area;
  const Vec3 sum = a + b + c;
  face.first += area / 3 * sum;
  // A rule for polynomials of the third degree.
  const auto at = [&](double weight, Vec3 p) {
    const double w = weight * area, inner = w * (dot2(p, p) - radius * radius);
    face.within += inner * p;
    face.cubes += w * p.z * p.z * p.z;
    face.squares += w * scaled(p, p);
    face.products += w * Vec3{p.y * p.z, p.z * p.x, p.x * p.y};
  };
  at(-27.0 / 48, sum / 3);
  for (const Vec3 corner : {a, b, c}) at(25.0 / 48, 0.2 * sum + 0.4 * corner);
}

/// Whether a face is nearly tangent to the surface at `end`. The error of its area is then the root of the error of its
/// place.
bool grazes(Vec3 n, Vec3 end, double radius) {
  const double sine = dot2(n, end) / radius;
  return !(1 - sine * sine > kGrazing);
}

/// The angle of an arc from p to q of a face's border. Seen from the side of the face's normal, arcs run
/// counter-clockwise. No value if the angle may be either 0 or a whole turn. `border` is the length of the face's
/// chords.
std::optional<double> arc_angle(Vec3 n, Vec3 p, Vec3 q, std::span<const CylinderChord> chords, double border,
                                double radius) {
  const double angle = std::atan2(cross2(p, q), dot2(p, q)), turn = n.z > 0 ? 2 * kPi : -2 * kPi;
  if (!(std::abs(angle) < kNearlyWhole)) {
    const bool upright = std::abs(n.z) < kUpright;
    return !upright && (n.z > 0) != (angle > 0) ? angle + turn : angle;
  }
  // If the rest of the border is longer than the arc's chord, the face is more than the part between arc and chord.
  if (border > 100 * kNearlyWhole * radius) return angle;
  if (chords.size() != 1) return std::nullopt;
  const double side = cross2(chords[0].from, chords[0].to) * n.z;
  return std::abs(side) > 0.5 * radius * border * std::abs(n.z) && side > 0 ? angle + turn : angle;
}

/// The unit vector from the axis towards the middle of an arc.
Vec3 way_to_middle(Vec3 p, Vec3 q, double angle) {
  const Vec3 sum{p.x + q.x, p.y + q.y, 0}, way{q.y - p.y, p.x - q.x, 0};
  if (dot2(sum, sum) > dot2(way, way)) return (std::abs(angle) < kPi ? 1 : -1) / std::sqrt(dot2(sum, sum)) * sum;
  return (angle > 0 ? 1 : -1) / std::sqrt(dot2(way, way)) * way;
}

/// Adds the moments of a segment of half angle `half` in a face: that of a unit disc, `scale` times as large. `middle`
/// is the middle of its chord. `across` leads from there towards the arc, and `along` along the chord.
void add_segment(Vec3 middle, Vec3 across, Vec3 along, const Arc& of, double half, double s, double c, double scale,
                 double radius, FaceSums& face) {
  const double one = scale * std::abs(of.segment), a = scale * std::abs(of.across);
  const Segment two = segment(half, s, c);
  const ThirdMoments three = third_moments(half, s, c, two.second_along);
  const double aa = scale * two.second_across, bb = scale * two.second_along;
  const double aaa = scale * three.across, abb = scale * three.across_along;
  const auto product = [&](double p, double q, double p_across, double q_across, double p_along, double q_along) {
    return one * p * q + a * (p * q_across + q * p_across) + aa * p_across * q_across + bb * p_along * q_along;
  };
  face.squares += one * scaled(middle, middle) + 2 * a * scaled(middle, across) + aa * scaled(across, across) +
                  bb * scaled(along, along);
  face.products += {product(middle.y, middle.z, across.y, across.z, along.y, along.z),
                    product(middle.z, middle.x, across.z, across.x, along.z, along.x),
                    product(middle.x, middle.y, across.x, across.y, along.x, along.y)};
  // ρ² − r² is r² (a² + 2 a cos x + b² − sin² x).
  const double at_middle = aa + 2 * c * a + bb - s * s * one, at_across = aaa + 2 * c * aa + abb - s * s * a;
  face.within += radius * radius * (at_middle * middle + at_across * across);
  const double m = middle.z, u = across.z, v = along.z;
  face.cubes += m * m * (m * one + 3 * u * a) + 3 * m * (u * u * aa + v * v * bb) + u * (u * u * aaa + 3 * v * v * abb);
}

/// Adds an arc of a face's border, and the segment between it and its chord.
void add_arc(Vec3 n, Vec3 p, Vec3 q, double angle, double radius, CylinderSums& sums, FaceSums& face) {
  const double x = angle / 2, mean = p.z + (q.z - p.z) / 2, rise = q.z - p.z;
  const double s = std::sin(x), c = std::cos(x);
  const Arc of = arc(x, s, c);
  ++sums.terms;
  sums.turned += angle, sums.rims += radius * std::abs(angle) + std::abs(rise);
  sums.sizes += radius * radius * std::abs(mean * angle);
  sums.levels += mean * angle;
  sums.squares += mean * mean * angle;
  if (std::abs(n.z) < kUpright) {
    sums.squares += rise * rise * x / 6;
    return;
  }
  const Vec3 w = way_to_middle(p, q, angle);
  const double steep = radius / n.z, fall = steep * dot2(n, w);
  sums.levels -= 2 * fall * of.bulge;
  sums.sizes += radius * radius * std::abs(2 * fall * of.bulge);
  sums.squares += -4 * mean * fall * of.bulge + fall * fall * of.bulge_square;
  const double slope = steep * (n.y * w.x - n.x * w.y);
  if (std::abs(x) < 1e-4) sums.squares += rise * rise * x / 6;
  else if (std::abs(x) < 1.5) sums.squares += rise * rise / 4 * of.segment / (s * s);
  else sums.squares += slope * slope * of.segment;
  // The area of the segment, seen along the axis and in the face.
  const double seen = radius * radius * std::abs(of.segment), area = seen / std::abs(n.z);
  const double beyond = radius * radius * radius * std::abs(of.across) / std::abs(n.z);
  face.area += area, face.sizes += area;
  const Vec3 middle{(p.x + q.x) / 2, (p.y + q.y) / 2, mean};
  const Vec3 out{w.x, w.y, -dot2(n, w) / n.z};
  face.first += area * middle + beyond * out;
  add_segment(middle, radius * out, {-radius * w.y, radius * w.x, -slope}, of, std::abs(x), std::abs(s), c,
              radius * radius / std::abs(n.z), radius, face);
}

/// The part of a face inside, which chords and the arcs between them bound; no value if an arc leaves it open.
std::optional<FaceSums> add_polygon(Vec3 n, std::span<const CylinderChord> chords, double radius, CylinderSums& sums) {
  FaceSums face;
  const Vec3 apex = chords[0].from;
  double border = 0;
  for (const CylinderChord& chord : chords) border += std::sqrt(dot2(chord.to - chord.from, chord.to - chord.from));
  const Vec3 beside = cross(apex, n);
  const auto lever = [&](Vec3 from, Vec3 to) { return std::abs(dot(beside, to - from)); };
  for (size_t k = 0; k < chords.size(); ++k) {
    const CylinderChord &chord = chords[k], &next = chords[k + 1 < chords.size() ? k + 1 : 0];
    add_triangle(n, apex, chord.from, chord.to, radius, face);
    face.levers += lever(chord.from, chord.to);
    if (!chord.to_surface && !next.from_surface) continue;
    if (grazes(n, chord.to, radius) || grazes(n, next.from, radius)) return std::nullopt;
    const auto angle = arc_angle(n, chord.to, next.from, chords, border, radius);
    if (!angle) return std::nullopt;
    add_arc(n, chord.to, next.from, *angle, radius, sums, face);
    add_triangle(n, apex, chord.to, next.from, radius, face);
    face.levers += lever(chord.to, next.from);
  }
  return face;
}

/// Adds the part of a face inside, and sets `section`. False if that part is left open.
bool add_face(const AboutAxis& at, size_t f, std::vector<CylinderChord>& chords, CylinderSums& sums, Section& section) {
  const Vec3 n = at.polyhedron->planes()[f].normal;
  const double offset = at.polyhedron->planes()[f].offset - n.z * at.level;
  // The cylinder between the heights does not reach a plane farther away.
  const double reach = at.radius * std::sqrt(dot2(n, n)) + std::abs(n.z) * at.height / 2;
  if (offset > reach + kBeyond * (reach + at.radius + std::abs(at.level)) + 2 * at.misplaced) return true;
  const auto ring = at.polyhedron->ring(f);
  find_chords(at, ring, chords, sums);
  if (chords.empty() && !around(at, ring, n)) return true;
  const auto face =
      chords.empty() ? std::optional(add_ellipse(n, offset, at.radius, sums)) : add_polygon(n, chords, at.radius, sums);
  if (!face) return false;
  sums.add_face(n, offset, *face, !at.polyhedron->face(f));
  section = *face;
  return true;
}

/// Whether the sums are those of a closed surface: its arcs turn forward as much as back, and its faces look up as much
/// as down. Seen along the axis, faces that look up cover at most the disc once, but for rounding.
bool closes(const CylinderSums& sums, double radius) {
  return std::abs(sums.turned) <= kUnbalanced && std::abs(sums.part.curved.force.z) <= kUnbalanced * sums.all_area &&
         sums.upward <= (1 + kUnbalanced) * kPi * radius * radius;
}

/// Changes moments about a point to moments about the point `level` lower.
void lift(double level, double size, Vec3& first, Vec3& squares, Vec3& products) {
  squares.z += level * (2 * first.z + level * size);
  products += level * Vec3{first.y, first.x, 0};
  first += size * Vec3{0, 0, level};
}

/// Adds the curved part. False if the volume is larger than that of the cylinder between the heights.
bool finish(const AboutAxis& at, CylinderSums& sums) {
  const double r = at.radius, curved = r * sums.levels;
  CylinderPart& part = sums.part;
  part.volume = (sums.cones + r * curved) / 3;
  if (!(part.volume <= (1 + kUnbalanced) * kPi * r * r * at.height)) return false;
  part.area += curved, part.whole_area = sums.all_area + curved;
  const double reach = std::sqrt(sums.far2) + r;
  part.error = kUnit * (kMostRoundings + sums.terms) * sums.sizes / 3 +
               kLeaving * reach * (sums.all_area + std::abs(curved) + reach * sums.rims / 3) +
               (kLeaving * reach + at.misplaced) * sums.levers / 3;
  const Vec3 of_curved{r * part.curved.force.x, r * part.curved.force.y, r * sums.squares / 2};
  part.first = 0.25 * (sums.height_moments + r * of_curved);
  const double v = part.volume, both = sums.radial / 4 + r * r * v / 2, rest = (r * r * v - both) / 2;
  part.squares = {sums.lengthwise.x / 2 + rest, sums.lengthwise.y / 2 + rest, sums.lengthwise.z / 3};
  part.products = 0.5 * sums.across;
  // Moments about the origin again.
  lift(at.level, part.volume, part.first, part.squares, part.products);
  for (Pull* pull : {&part.curved, &part.flat}) pull->moment += cross(Vec3{0, 0, at.level}, pull->force);
  return true;
}

struct CylinderScratch {
  AboutAxis about;
  std::vector<CylinderChord> chords;
  std::vector<Section> sections;
};

}  // namespace

// Volume and centroid. Faces have heights h and areas A, and the curved part has the area C. All are about a point of
// the axis:
//
//   3 V = Σ h A + r C,   C = r ∮ z dθ,   4 ∫ x dV = Σ h ∫ x dA + r ∫ x dA over the curved part.
//
// Over the curved part, ∫ n dA = −Σ A n. The integrals ∫ x dA and ∫ y dA are r times its components, and
// ∫ z dA = ½ r ∮ z² dθ. The part of a face inside is a polygon of parts of edges and of chords of arcs, and segments of
// an ellipse beyond these chords. The segments of steep faces are slender; series without cancellation give their
// terms.
//
// Second moments. For a coordinate x and a unit vector e orthogonal to the axis, the field (ρ² − r²) x e vanishes on
// the curved part. The field z³ along the axis is tangent to the curved part. With these fields, second moments are
// integrals over the faces alone:
//
//   4 ∫ ρ² dV = 2 r² V + Σ ∫ (ρ² − r²) (n_x x + n_y y) dA,   2 ∫ x² dV = r² V − ∫ ρ² dV + Σ n_x ∫ (ρ² − r²) x dA,
//   3 ∫ z² dV = Σ n_z ∫ z³ dA,   2 ∫ x y dV = Σ n_x ∫ (ρ² − r²) y dA.
//
// Closing. Both faces at an edge get the same points where the edge is cut. The surface therefore closes, whatever the
// rounding of these points. If rounding moves a corner inside, or makes an edge graze the cylinder, the surface changes
// by no more than the rounding. The direction of an arc is certain unless its ends nearly meet. All arcs together turn
// forth as much as back, and faces look up as much as down. An arc in the wrong direction would violate both.
//
// Error. Every term has at most kMostRoundings roundings, and every sum adds one. Points are off by kLeaving times the
// reach of their numbers. The volume between the computed surface and the true one is at most that, times the area.
// Points off the plane of a face also tilt its area vector, and h A leaves out the component in the plane. For an edge
// e, the point p where the triangles of the face meet, and points off by δ, this component is at most δ |e|, and its
// product with p is at most δ |n · (e × p)|. It is large for a face that is far from the foot of its height. A
// point off the cylinder also leaves a gap along its arc, between the face and the curved part. The gap is at most as
// wide as the point is off, and counts with a third of the reach as its height.
std::optional<CylinderPart> measure_cylinder(const Rings& polyhedron, double radius, double misplaced) {
  const Scratch<CylinderScratch> scratch;
  auto& [at, chords, sections] = *scratch;
  at.become(polyhedron, radius, misplaced);
  sections.assign(polyhedron.planes().size(), {});
  CylinderSums sums;
  for (size_t f = 0; f < sections.size(); ++f)
    if (!add_face(at, f, chords, sums, sections[f])) return std::nullopt;
  if (!closes(sums, radius) || !finish(at, sums)) return std::nullopt;
  for (Section& section : sections) lift(at.level, section.area, section.first, section.squares, section.products);
  sums.part.sections = sections;
  return sums.part;
}

}  // namespace overlapper::quadric
