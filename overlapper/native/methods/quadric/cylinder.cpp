#include "methods/quadric/cylinder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace overlapper::quadric {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kUnit = 0x1p-53;        ///< of rounding
constexpr double kPlacing = 16 * kUnit;  ///< of how far numbers reach: where an edge leaves the cylinder
constexpr double kNearlyWhole = 1e-5;    ///< rad: an arc of less may be the rest of a turn
constexpr double kUpright = 1e-12;       ///< of a plane's normal along the axis: its arcs are straight
constexpr double kGrazing = 1e-6;        ///< the square of the sine between a face and the surface
constexpr double kOpen = 1e-9;           ///< of what sums to zero, without a wrong turn

/// Functions of half an arc's angle x that closed forms leave to rounding where it is small.
struct Arc {
  double segment;  ///< x − sin x cos x: the area of a unit disc's segment
  double across;   ///< ⅔ sin³ x − cos x times that: its first moment about the middle of its chord
  double bulge;    ///< sin x − x cos x: ½ ∫ (cos t − cos x) dt from −x to x
  double square;   ///< ∫ (cos t − cos x)² dt
};

struct ArcSeries {
  static constexpr int kTerms = 9;
  std::array<Arc, kTerms> term{};

  constexpr ArcSeries() {
    double factorial = 1, two = 2, three = 3, sign = 1;  // of and to the power of 2 k + 1
    for (int k = 1; k <= kTerms; ++k) {
      factorial *= 2.0 * k * (2.0 * k + 1);
      two *= 4, three *= 9, sign = -sign;
      term[k - 1] = {-sign * two / 2 / factorial, sign * (9 + three - 12 * (2.0 * k + 1)) / (12 * factorial),
                     -sign * 2 * k / factorial, sign * two * (k - 1) / factorial};
    }
  }
};

Arc arc(double x) {
  static constexpr ArcSeries kSeries;
  if (std::abs(x) < 0.4) {
    const double square = x * x, cube = square * x;
    Arc sum{};
    for (int k = ArcSeries::kTerms - 1; k >= 0; --k) {
      const Arc& term = kSeries.term[k];
      sum = {sum.segment * square + term.segment, sum.across * square + term.across, sum.bulge * square + term.bulge,
             sum.square * square + term.square};
    }
    return {cube * sum.segment, cube * sum.across, cube * sum.bulge, cube * sum.square};
  }
  const double s = std::sin(x), c = std::cos(x), segment = x - s * c;
  return {segment, 2.0 / 3 * s * s * s - c * segment, s - x * c, 2 * x * c * c + x - 3 * s * c};
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
  if (!p_inside && !q_inside && !(off < radius * std::sqrt(length2) && along < 0 && -along < length2)) return false;
  const double size = radius * std::sqrt(length2);
  const double root = std::sqrt(std::max(0.0, (size - off) * (size + off)));
  const double middle = length2 > 0 ? -along / length2 : 0, half = length2 > 0 ? root / length2 : 0;
  if (!p_inside) chord.from = p + std::clamp(middle - half, 0.0, 1.0) * e;
  if (!q_inside) chord.to = p + std::clamp(middle + half, 0.0, 1.0) * e;
  return true;
}

/// The part of a face inside the cylinder.
struct Section {
  double area = 0;
  Vec3 first;        ///< ∫ x dA
  double sizes = 0;  ///< m²: of the areas that are summed
};

class Measuring {
 public:
  std::optional<CylinderPart> measure(const Rings& polyhedron, double radius) {
    polyhedron_ = &polyhedron, radius_ = radius, part_ = {};
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
    Section section;
    find_chords(polyhedron_->ring(f));
    if (chords_.empty()) {
      if (!around(polyhedron_->ring(f), n)) return true;
      add_ellipse(plane, section);
    } else {
      const Vec3 apex = chords_[0].from;
      double border = 0;
      for (const Chord& chord : chords_) border += std::hypot(chord.to.x - chord.from.x, chord.to.y - chord.from.y);
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
    bool turns = false;  // what is but a point does not
    for (size_t k = 0; k < ring.size(); ++k) {
      const double turn = cross2(corners_[ring[k]], corners_[ring[k + 1 < ring.size() ? k + 1 : 0]]) * n.z;
      if (turn < 0) return false;
      turns = turns || turn > 0;
    }
    return turns;
  }

  void add_ellipse(const Plane& plane, Section& section) {
    const Vec3 n = plane.normal;
    const double turn = n.z > 0 ? 2 * kPi : -2 * kPi, z = plane.offset / n.z;
    const double wave2 = radius_ * radius_ * dot2(n, n) / (n.z * n.z);
    section.area = section.sizes = kPi * radius_ * radius_ / std::abs(n.z);
    // The middle of the ellipse is on the axis.
    section.first = section.area * Vec3{0, 0, z};
    turned_ += turn, levels_ += turn * z, squares_ += turn * (z * z + wave2 / 2);
    sizes_ += radius_ * radius_ * std::abs(turn * z);
  }

  static void add_triangle(Vec3 n, Vec3 a, Vec3 b, Vec3 c, Section& section) {
    const double area = dot(n, cross(b - a, c - a)) / 2;
    section.area += area, section.sizes += std::abs(area);
    section.first += area / 3 * (a + b + c);
  }

  /// An arc of a face's border, counter-clockwise seen along the axis from where its normal leads, and the segment
  /// between it and its chord. False if that may be nothing as well as a whole turn, or if the face lies along the
  /// surface, where its area is as uncertain as the root of where it lies.
  bool add_arc(Vec3 n, Vec3 p, Vec3 q, double border, Section& section) {
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
    const Arc of = arc(x);
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
    if (dot2(sum, sum) > dot2(way, way)) w = (std::abs(angle) < kPi ? 1 : -1) / std::hypot(sum.x, sum.y) * sum;
    else w = (angle > 0 ? 1 : -1) / std::hypot(way.x, way.y) * way;
    const double steep = radius_ / n.z, fall = steep * dot2(n, w);
    levels_ -= 2 * fall * of.bulge;
    sizes_ += radius_ * radius_ * std::abs(2 * fall * of.bulge);
    squares_ += -4 * mean * fall * of.bulge + fall * fall * of.square;
    const double s = std::sin(x), slope = steep * (n.y * w.x - n.x * w.y);
    if (std::abs(x) < 1e-4) squares_ += rise * rise * x / 6;
    else if (std::abs(x) < 1.5) squares_ += rise * rise / 4 * of.segment / (s * s);
    else squares_ += slope * slope * of.segment;
    // The segment, seen along the axis and as large as it is.
    const double seen = radius_ * radius_ * std::abs(of.segment), area = seen / std::abs(n.z);
    const double beyond = radius_ * radius_ * radius_ * std::abs(of.across) / std::abs(n.z);
    section.area += area, section.sizes += area;
    const Vec3 middle{(p.x + q.x) / 2, (p.y + q.y) / 2, mean};
    section.first += area * middle + beyond * Vec3{w.x, w.y, -dot2(n, w) / n.z};
    return true;
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
    // About the origin again.
    const Vec3 up{0, 0, level_};
    part_.first += part_.volume * up;
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
// Edges are cut at the same points whichever face asks, so that the surface closes whatever rounding has done to these;
// a corner that it takes for inside, or an edge that grazes the cylinder, changes it by as much as these are off. Which
// way round an arc goes is sure but where its ends nearly meet. All arcs together turn back as far as they turn, and
// faces look up as much as down; by a wrong turn, neither would be so.
//
// The error. Every term has sixteen roundings or fewer, and every sum on the way one more. Points are off by kPlacing
// of how far their numbers reach: by that, times the area, is the volume between the surface as computed and as it
// should be.
std::optional<CylinderPart> measure_cylinder(const Rings& polyhedron, double radius) {
  thread_local Measuring measuring;
  return measuring.measure(polyhedron, radius);
}

}  // namespace overlapper::quadric
