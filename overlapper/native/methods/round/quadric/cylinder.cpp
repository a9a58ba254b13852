#include "methods/round/quadric/cylinder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "geometry/scratch.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::quadric {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kUnit = 0x1p-53;        ///< of rounding
constexpr double kPlacing = 16 * kUnit;  ///< of how far numbers reach: where an edge leaves the cylinder
constexpr double kNearlyWhole = 1e-5;    ///< rad: an arc of less may be the rest of a turn
constexpr double kUpright = 1e-12;       ///< of a plane's normal along the axis: its arcs are straight
constexpr double kGrazing = 1e-6;        ///< the square of the sine between a face and the surface
constexpr double kBeyond = 1e-12;        ///< of how far numbers reach: a plane is out of reach
constexpr double kOpen = 1e-9;           ///< of what sums to zero, without a wrong turn

/// Functions of an arc's half angle x, as in SegmentSeries. All are odd.
struct Arc {
  double segment, across, bulge, bulge_square;
};

/// Of an arc's half angle, the sine and the cosine of that.
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
  // About the middle of the disc, then about the chord's.
  const double s2 = s * s, s3 = s2 * s, s5 = s3 * s2;
  const double one = x - s * c, to1 = 2.0 / 3 * s3, to2 = one / 4 + s3 * c / 2, to3 = 2 * (s3 / 3 - s5 / 5);
  return {to3 - c * (3 * to2 - c * (3 * to1 - c * one)), 2.0 / 15 * s5 - c * along};
}

/// The part of an edge inside the cylinder.
struct Chord {
  Vec3 from, to;
  bool from_surface, to_surface;  ///< whether that is where it enters or leaves, and not a corner
};

double cross2(Vec3 a, Vec3 b) { return a.x * b.y - a.y * b.x; }
double dot2(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y; }

/// The same points whichever way round the edge is asked for.
bool find_chord(Vec3 p, Vec3 q, bool p_inside, bool q_inside, double radius, Chord& chord) {
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

/// What is summed over a face's part inside.
struct Sum : Section {
  double sizes = 0;  ///< m²: of the areas that are summed
  /// ∫ (ρ² − r²) x dA, of the distance ρ from the axis, and ∫ z³ dA.
  Vec3 within;
  double cubes = 0;
};

class Measuring {
 public:
  std::optional<CylinderPart> measure(const Rings& polyhedron, double radius) {
    polyhedron_ = &polyhedron, radius_ = radius, part_ = {};
    radial_ = 0, lengthwise_ = across_ = {}, sections_.assign(polyhedron.planes().size(), {});
    terms_ = 0, cones_ = sizes_ = all_area_ = upward_ = far2_ = turned_ = levels_ = squares_ = 0, height_moments_ = {};
    return measure();
  }

 private:
  std::optional<CylinderPart> measure() {
    const auto given = polyhedron_->corners();
    corners_.assign(given.begin(), given.end());
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (size_t f = 0; f < polyhedron_->planes().size(); ++f)
      for (const int i : polyhedron_->ring(f)) low = std::min(low, given[i].z), high = std::max(high, given[i].z);
    level_ = low + (high - low) / 2, height_ = high - low;
    inside_.resize(corners_.size());
    for (size_t i = 0; i < corners_.size(); ++i) {
      corners_[i].z -= level_;
      inside_[i] = dot2(corners_[i], corners_[i]) < radius_ * radius_;
    }
    for (size_t f = 0; f < polyhedron_->planes().size(); ++f)
      if (!add_face(f)) return std::nullopt;
    return sum();
  }

  bool add_face(size_t f) {
    Plane plane = polyhedron_->planes()[f];
    plane.offset -= plane.normal.z * level_;
    const Vec3 n = plane.normal;
    // Of the cylinder between the heights, nothing reaches a plane that is farther away.
    const double reach = radius_ * std::sqrt(dot2(n, n)) + std::abs(n.z) * height_ / 2;
    if (plane.offset > reach + kBeyond * (reach + radius_ + std::abs(level_))) return true;
    Sum section;
    find_chords(polyhedron_->ring(f));
    if (chords_.empty()) {
      if (!around(polyhedron_->ring(f), n)) return true;
      add_ellipse(plane, section);
    } else {
      const Vec3 apex = chords_[0].from;
      double border = 0;
      for (const Chord& chord : chords_) border += std::sqrt(dot2(chord.to - chord.from, chord.to - chord.from));
      for (size_t k = 0; k < chords_.size(); ++k) {
        const Chord &chord = chords_[k], &next = chords_[k + 1 < chords_.size() ? k + 1 : 0];
        add_triangle(n, apex, chord.from, chord.to, section);
        if (!chord.to_surface && !next.from_surface) continue;
        if (!add_arc(n, chord.to, next.from, border, section)) return false;
        add_triangle(n, apex, chord.to, next.from, section);
      }
    }
    const double area = section.area;
    ++part_.faces, ++terms_;
    cones_ += plane.offset * area;
    sizes_ += std::abs(plane.offset) * section.sizes;
    all_area_ += area;
    upward_ += std::max(0.0, area * n.z);
    height_moments_ += plane.offset * section.first;
    radial_ += n.x * section.within.x + n.y * section.within.y;
    lengthwise_ += scaled(n, {section.within.x, section.within.y, section.cubes});
    across_ +=
        Vec3{n.y * section.within.z, n.x * section.within.z, (n.x * section.within.y + n.y * section.within.x) / 2};
    sections_[f] = section;
    const Pull pull{area * n, cross(section.first, n)};
    part_.curved.force += -pull.force, part_.curved.moment += -pull.moment;
    if (!polyhedron_->face(f)) return true;
    part_.flat.force += pull.force, part_.flat.moment += pull.moment;
    part_.area += area;
    return true;
  }

  void find_chords(std::span<const int> ring) {
    chords_.clear();
    for (size_t k = 0; k < ring.size(); ++k) {
      const int i = ring[k], j = ring[k + 1 < ring.size() ? k + 1 : 0];
      const auto [low, high] = std::minmax(i, j);
      Chord chord;
      if (!find_chord(corners_[low], corners_[high], inside_[low], inside_[high], radius_, chord)) continue;
      if (i < j) chords_.push_back(chord);
      else chords_.push_back({chord.to, chord.from, chord.to_surface, chord.from_surface});
      far2_ = std::max({far2_, norm2(corners_[i]), norm2(corners_[j])});
    }
    terms_ += 2 * static_cast<int>(chords_.size());
  }

  /// Whether a face that has no edge inside reaches all around: one steeper would be higher than the polyhedron.
  bool around(std::span<const int> ring, Vec3 n) const {
    if (!(std::abs(n.z) * height_ > radius_ * std::hypot(n.x, n.y))) return false;
    double twice = 0;  // its area as seen along the axis
    for (size_t k = 0; k < ring.size(); ++k) {
      const double turn = cross2(corners_[ring[k]], corners_[ring[k + 1 < ring.size() ? k + 1 : 0]]) * n.z;
      if (turn < 0) return false;
      twice += turn;
    }
    // What is nothing but rounding may seem to lie around anything.
    return twice >= 6 * std::abs(n.z) * radius_ * radius_;
  }

  void add_ellipse(const Plane& plane, Sum& section) {
    const Vec3 n = plane.normal;
    const double turn = n.z > 0 ? 2 * kPi : -2 * kPi, z = plane.offset / n.z;
    const double wave2 = radius_ * radius_ * dot2(n, n) / (n.z * n.z);
    section.area = section.sizes = kPi * radius_ * radius_ / std::abs(n.z);
    // The middle of the ellipse is on the axis.
    section.first = section.area * Vec3{0, 0, z};
    turned_ += turn, levels_ += turn * z, squares_ += turn * (z * z + wave2 / 2);
    sizes_ += radius_ * radius_ * std::abs(turn * z);
    const double quarter = radius_ * radius_ / 4;
    const Vec3 slope{-n.x / n.z, -n.y / n.z, 0};
    const double rise2 = quarter * dot2(slope, slope);
    section.squares = section.area * Vec3{quarter, quarter, z * z + rise2};
    section.products = section.area * quarter * Vec3{slope.y, slope.x, 0};
    // Over a disc, the mean of (ρ² − r²) is −r² / 2, and that of (ρ² − r²) x² is −r⁴ / 12.
    section.within = section.area * Vec3{0, 0, -2 * quarter * z};
    section.cubes = section.area * z * (z * z + 3 * rise2);
  }

  void add_triangle(Vec3 n, Vec3 a, Vec3 b, Vec3 c, Sum& section) const {
    const double area = dot(n, cross(b - a, c - a)) / 2;
    if (area == 0) return;
    section.area += area, section.sizes += std::abs(area);
    const Vec3 sum = a + b + c;
    section.first += area / 3 * sum;
    // A rule for polynomials of the third degree.
    const auto at = [&](double weight, Vec3 p) {
      const double w = weight * area, inner = w * (dot2(p, p) - radius_ * radius_);
      section.within += inner * p;
      section.cubes += w * p.z * p.z * p.z;
      add_second(w, p, section);
    };
    at(-27.0 / 48, sum / 3);
    for (const Vec3 corner : {a, b, c}) at(25.0 / 48, 0.2 * sum + 0.4 * corner);
  }

  static void add_second(double weight, Vec3 p, Section& section) {
    section.squares += weight * scaled(p, p);
    section.products += weight * Vec3{p.y * p.z, p.z * p.x, p.x * p.y};
  }

  /// An arc of a face's border, counter-clockwise seen along the axis from where its normal leads, and the segment
  /// between it and its chord. False if that may be nothing as well as a whole turn, or if the face lies along the
  /// surface, where its area is as uncertain as the root of where it lies.
  bool add_arc(Vec3 n, Vec3 p, Vec3 q, double border, Sum& section) {
    for (const Vec3 end : {p, q}) {
      const double sine = dot2(n, end) / radius_;
      if (!(1 - sine * sine > kGrazing)) return false;
    }
    double angle = std::atan2(cross2(p, q), dot2(p, q));
    const bool upright = std::abs(n.z) < kUpright;
    if (std::abs(angle) < kNearlyWhole) {
      // What has a border longer than the arc's chord is not between the two.
      if (!(border > 100 * kNearlyWhole * radius_)) {
        if (chords_.size() != 1) return false;
        const double side = cross2(chords_[0].from, chords_[0].to) * n.z;
        if (std::abs(side) > 0.5 * radius_ * border * std::abs(n.z) && side > 0) angle += n.z > 0 ? 2 * kPi : -2 * kPi;
      }
    } else if (!upright && (n.z > 0) != (angle > 0)) {
      angle += n.z > 0 ? 2 * kPi : -2 * kPi;
    }
    const double x = angle / 2, mean = p.z + (q.z - p.z) / 2, rise = q.z - p.z;
    const double s = std::sin(x), c = std::cos(x);
    const Arc of = arc(x, s, c);
    ++terms_;
    turned_ += angle;
    sizes_ += radius_ * radius_ * std::abs(mean * angle);
    levels_ += mean * angle;
    squares_ += mean * mean * angle;
    if (upright) {
      squares_ += rise * rise * x / 6;
      return true;
    }
    // From the axis to the arc's middle.
    const Vec3 sum{p.x + q.x, p.y + q.y, 0}, way{q.y - p.y, p.x - q.x, 0};
    Vec3 w;
    if (dot2(sum, sum) > dot2(way, way)) w = (std::abs(angle) < kPi ? 1 : -1) / std::sqrt(dot2(sum, sum)) * sum;
    else w = (angle > 0 ? 1 : -1) / std::sqrt(dot2(way, way)) * way;
    const double steep = radius_ / n.z, fall = steep * dot2(n, w);
    levels_ -= 2 * fall * of.bulge;
    sizes_ += radius_ * radius_ * std::abs(2 * fall * of.bulge);
    squares_ += -4 * mean * fall * of.bulge + fall * fall * of.bulge_square;
    const double slope = steep * (n.y * w.x - n.x * w.y);
    if (std::abs(x) < 1e-4) squares_ += rise * rise * x / 6;
    else if (std::abs(x) < 1.5) squares_ += rise * rise / 4 * of.segment / (s * s);
    else squares_ += slope * slope * of.segment;
    // The segment, seen along the axis and as large as it is.
    const double seen = radius_ * radius_ * std::abs(of.segment), area = seen / std::abs(n.z);
    const double beyond = radius_ * radius_ * radius_ * std::abs(of.across) / std::abs(n.z);
    section.area += area, section.sizes += area;
    const Vec3 middle{(p.x + q.x) / 2, (p.y + q.y) / 2, mean};
    const Vec3 out{w.x, w.y, -dot2(n, w) / n.z};
    section.first += area * middle + beyond * out;
    add_segment(middle, radius_ * out, {-radius_ * w.y, radius_ * w.x, -slope}, of, std::abs(x), std::abs(s), c,
                radius_ * radius_ / std::abs(n.z), section);
    return true;
  }

  /// The segment of a unit disc of which that is half the angle, as it lies in the face, `scale` times as large: about
  /// the middle of its chord, across that towards the arc, and along it.
  void add_segment(Vec3 middle, Vec3 across, Vec3 along, const Arc& of, double half, double s, double c, double scale,
                   Sum& section) const {
    const double one = scale * std::abs(of.segment), a = scale * std::abs(of.across);
    const Segment two = segment(half, s, c);
    const ThirdMoments three = third_moments(half, s, c, two.second_along);
    const double aa = scale * two.second_across, bb = scale * two.second_along;
    const double aaa = scale * three.across, abb = scale * three.across_along;
    const auto product = [&](double p, double q, double p_across, double q_across, double p_along, double q_along) {
      return one * p * q + a * (p * q_across + q * p_across) + aa * p_across * q_across + bb * p_along * q_along;
    };
    section.squares += one * scaled(middle, middle) + 2 * a * scaled(middle, across) + aa * scaled(across, across) +
                       bb * scaled(along, along);
    section.products += {product(middle.y, middle.z, across.y, across.z, along.y, along.z),
                         product(middle.z, middle.x, across.z, across.x, along.z, along.x),
                         product(middle.x, middle.y, across.x, across.y, along.x, along.y)};
    // ρ² − r² is r² (a² + 2 a cos x + b² − sin² x).
    const double at_middle = aa + 2 * c * a + bb - s * s * one, at_across = aaa + 2 * c * aa + abb - s * s * a;
    section.within += radius_ * radius_ * (at_middle * middle + at_across * across);
    const double m = middle.z, u = across.z, v = along.z;
    section.cubes +=
        m * m * (m * one + 3 * u * a) + 3 * m * (u * u * aa + v * v * bb) + u * (u * u * aaa + 3 * v * v * abb);
  }

  std::optional<CylinderPart> sum() {
    const double r = radius_, curved = r * levels_;
    // Once around the cylinder and back, and faces that look up and down, unless a turn is wrong.
    if (!(std::abs(turned_) <= kOpen)) return std::nullopt;
    if (!(std::abs(part_.curved.force.z) <= kOpen * all_area_)) return std::nullopt;
    // Seen along the axis, faces that look up share nothing, but where two are one but for rounding.
    if (!(upward_ <= (1 + kOpen) * kPi * r * r)) return std::nullopt;
    part_.volume = (cones_ + r * curved) / 3;
    if (!(part_.volume <= (1 + kOpen) * kPi * r * r * height_)) return std::nullopt;
    part_.area += curved, part_.whole_area = all_area_ + curved;
    const double reach = std::sqrt(far2_) + r;
    part_.error = kUnit * (16 + terms_) * sizes_ / 3 + kPlacing * reach * (all_area_ + std::abs(curved));
    const Vec3 of_curved{r * part_.curved.force.x, r * part_.curved.force.y, r * squares_ / 2};
    part_.first = 0.25 * (height_moments_ + r * of_curved);
    const double v = part_.volume, both = radial_ / 4 + r * r * v / 2, rest = (r * r * v - both) / 2;
    part_.squares = {lengthwise_.x / 2 + rest, lengthwise_.y / 2 + rest, lengthwise_.z / 3};
    part_.products = 0.5 * across_;
    // About the origin again.
    const Vec3 up{0, 0, level_};
    const auto lift = [&](double size, Vec3& first, Vec3& squares, Vec3& products) {
      squares.z += level_ * (2 * first.z + level_ * size);
      products += level_ * Vec3{first.y, first.x, 0};
      first += size * up;
    };
    lift(part_.volume, part_.first, part_.squares, part_.products);
    for (Section& section : sections_) lift(section.area, section.first, section.squares, section.products);
    part_.sections = sections_;
    for (Pull* pull : {&part_.curved, &part_.flat}) pull->moment += cross(up, pull->force);
    return part_;
  }

  const Rings* polyhedron_ = nullptr;
  double radius_ = 0, level_ = 0, height_ = 0;
  std::vector<Vec3> corners_;  ///< about the point of the axis that is as high as the polyhedron's middle
  std::vector<char> inside_;
  std::vector<Chord> chords_;
  CylinderPart part_;
  int terms_ = 0;
  double cones_ = 0, sizes_ = 0, all_area_ = 0;
  double upward_ = 0;                ///< m²: of faces that look up, as seen along the axis
  double far2_ = 0;                  ///< m²: of how far corners of edges that are cut are from the origin
  double turned_ = 0;                ///< rad
  double levels_ = 0, squares_ = 0;  ///< ∫ z dθ and ∫ z² dθ along the arcs
  Vec3 height_moments_;              ///< Σ h ∫ x dA
  std::vector<Section> sections_;
  double radial_ = 0;         ///< Σ ∫ (ρ² − r²) (n_x x + n_y y) dA
  Vec3 lengthwise_, across_;  ///< Σ of n_x and n_y times that ∫ of x and y, n_z ∫ z³ dA; of those of two coordinates
};

}  // namespace

// With heights h and areas A of the faces, and the area C of the curved part, all about a point of the axis,
//
//   3 V = Σ h A + r C,   C = r ∮ z dθ,   4 ∫ x dV = Σ h ∫ x dA + r ∫ x dA over the curved part,
//
// where ∫ n dA is −Σ A n over the curved part, r times its components ∫ x dA and ∫ y dA, and ∫ z dA is ½ r ∮ z² dθ. A
// face's part inside is a polygon of the edges' parts and of the chords of arcs, in space, and segments of an ellipse
// beyond these: of steep faces, segments are slender, and their terms series of no cancellation.
//
// The fields (ρ² − r²) x e, for a coordinate x and a unit vector e orthogonal to the axis, vanish on the curved part,
// and z³ along the axis is along it: by them, second moments are integrals over the faces alone,
//
//   4 ∫ ρ² dV = 2 r² V + Σ ∫ (ρ² − r²) (n_x x + n_y y) dA,   2 ∫ x² dV = r² V − ∫ ρ² dV + Σ n_x ∫ (ρ² − r²) x dA,
//   3 ∫ z² dV = Σ n_z ∫ z³ dA,   2 ∫ x y dV = Σ n_x ∫ (ρ² − r²) y dA.
//
// Edges are cut at the same points whichever face asks, so that the surface closes whatever rounding has done to these;
// a corner that it takes for inside, or an edge that grazes the cylinder, changes it by as much as these are off. Which
// way round an arc goes is sure but where its ends nearly meet. All arcs together turn back as far as they turn, and
// faces look up as much as down; by a wrong turn, neither would be so.
//
// The error. Every term has sixteen roundings or fewer, and every sum on the way one more. Points are off by kPlacing
// of how far their numbers reach: by that, times the area, is the volume between the surface as computed and as it
// should be.
std::optional<CylinderPart> measure_cylinder(const Rings& polyhedron, double radius) {
  const Scratch<Measuring> measuring;
  return measuring->measure(polyhedron, radius);
}

}  // namespace overlapper::quadric
