#include "methods/round/lenses/sums.h"

#include <algorithm>

#include "geometry/constants.h"
#include "methods/round/quadric/gauss.h"
#include "methods/round/quadric/segment.h"

namespace overlapper::lenses {
namespace {

/// An arc of a circle: half the angle that it takes, with sine and cosine, and the circle's radius.
struct Arc {
  double half_angle, sine, cosine, radius;
};
Arc arc(double half_chord, double to_chord) {
  const double radius = std::sqrt(half_chord * half_chord + to_chord * to_chord);
  return {std::atan2(half_chord, to_chord), half_chord / radius, to_chord / radius, radius};
}
Arc whole_circle(double radius) { return {kPi, 0, -1, radius}; }
constexpr Arc kNone{0, 0, 1, 0};

/// Area and moments of a segment about the middle of its chord.
quadric::Segment segment(const Arc& a) {
  quadric::Segment s = quadric::segment(a.half_angle, a.sine, a.cosine);
  const double square = a.radius * a.radius;
  s.area *= square, s.first_across *= square * a.radius;
  s.second_across *= square * square, s.second_along *= square * square;
  return s;
}

/// sin x − x cos x
double bulge(const Arc& a) {
  const double x = a.half_angle;
  if (x >= quadric::kNarrow) return a.sine - x * a.cosine;
  return x * x * x * quadric::series(quadric::kSegmentSeries.bulge, x * x);
}

Mat3 outer(Vec3 a, Vec3 b) { return {a.x * b, a.y * b, a.z * b}; }
Mat3 operator+(const Mat3& a, const Mat3& b) { return {a.row0 + b.row0, a.row1 + b.row1, a.row2 + b.row2}; }

/// A slice, with the data for its parts. Vectors have one component across the slices, then two in the plane.
struct Place {
  const Discs& discs;
  double t;
  Section section;
  Vec3 ahead, aside;  ///< in the plane
  Vec3 foot;

  Place(const Discs& of, double at) : discs(of), t(at), section(lenses::section(of, at)) {
    ahead = {0, section.ahead.x, section.ahead.y}, aside = {0, -section.ahead.y, section.ahead.x};
    foot = {t, t * of.lean.x, t * of.lean.y};
  }
  Vec3 chord() const { return foot + (section.chord * ahead + section.aside * aside); }
  Vec3 world(Vec3 v) const { return v.x * discs.normal + v.y * discs.x + v.z * discs.y; }
};

/// Adds a set with the axis of symmetry `ahead` through the origin, shifted to `middle`.
void add_moments(const Place& place, Vec3 middle, double area, double ahead, double along, double across, Sums& sums) {
  const Vec3 e = place.ahead, f = place.aside;
  const Vec3 first = ahead * e + area * middle, g = ahead * e;
  Moments m{area, first, {}, {}};
  m.squares = along * scaled(e, e) + across * scaled(f, f) + 2.0 * scaled(g, middle) + area * scaled(middle, middle);
  const auto products = [](Vec3 a, Vec3 b) { return Vec3{a.y * b.z, a.z * b.x, a.x * b.y}; };
  m.products = along * products(e, e) + across * products(f, f) + products(g, middle) + products(middle, g) +
               area * products(middle, middle);
  sums.moments = m;
}

/// Adds the area vectors of an arc of the first body's surface about the middle of its chord.
void add_force(const Place& place, Vec3 chord, const Arc& a, double segment_area, Sums& sums) {
  const double level = place.t - place.discs.first_level;
  const Vec3 normal{1, 0, 0};
  sums.force = 2 * a.radius * a.sine * place.ahead + 2 * a.half_angle * level * normal;
  sums.moved = outer(chord, sums.force) + outer(segment_area * place.ahead, place.ahead) +
               outer(segment_area * place.aside, place.aside) +
               outer(2 * a.radius * level * bulge(a) * place.ahead, normal);
}

/// Adds the areas of the arcs on both surfaces.
void add_areas(const Place& place, const Arc& first, const Arc& second, const Wanted& wanted, Sums& sums) {
  const Discs& d = place.discs;
  const Vec3 e = place.world(place.ahead), f = place.world(place.aside);
  if (first.half_angle > 0)
    sums.first_area =
        wanted.first->arc((place.t - d.first_level) * d.normal, first.radius * e, first.radius * f, first.half_angle);
  if (!(second.half_angle > 0)) return;
  const Flat centre = d.second_centre().at(place.t);
  const Vec3 level = d.second_ball * place.world(place.foot + Vec3{0, centre.x, centre.y}) - d.second_middle;
  sums.second_area = d.second_rise * wanted.second->arc(level, -second.radius * (d.second_ball * e),
                                                        second.radius * (d.second_ball * f), second.half_angle);
}

/// Adds the patch's integrals along an arc of the first body's surface, by Gauss's nodes in each half.
void add_patch(const Place& place, Vec3 centre, const Arc& a, const View& view, Sums& sums) {
  const double level = place.t - place.discs.first_level;
  const Vec3 e = place.world(place.ahead), f = place.world(place.aside), n = place.discs.normal;
  const Vec3 from = place.world(centre);
  for (const double half : {-1.0, 1.0})
    for (size_t i = 0; i < 2 * quadric::kGaussNode.size(); ++i) {
      const size_t node = i / 2;
      const double x = (i % 2 == 0 ? 1 : -1) * quadric::kGaussNode[node];
      const double angle = a.half_angle * (half + x) / 2, cosine = std::cos(angle), sine = std::sin(angle);
      // cos − cos of the end, without cancellation.
      const double rise = 2 * std::sin((a.half_angle + angle) / 2) * std::sin((a.half_angle - angle) / 2);
      const Vec3 y = from + a.radius * (rise * e + sine * f);
      const Vec3 outward = a.radius * (cosine * e + sine * f) + level * n;
      const double weight = a.half_angle / 2 * quadric::kGaussWeight[node] * overlapper::dot(view.weight, outward);
      const double u = view.u0 + overlapper::dot(view.u, y), v = view.v0 + overlapper::dot(view.v, y);
      const std::array<double, 6> terms{1, u, v, u * u, u * v, v * v};
      for (size_t k = 0; k < terms.size(); ++k) sums.patch[k] += weight * terms[k];
    }
}

/// The movement of a lens's arcs by rounding, as slacks of both discs, in units of the last bit. The half chord is a
/// root of slack + aside² + chord (2 along − chord). Here `along` and `aside` are the mean centre in the slice's own
/// axes. The chord is half the difference of the slacks, over the distance of the centres. Places are at most `reach`
/// from the foot.
void add_blur_of_lens(const Place& place, const Arc& first, const Arc& second, double reach, Sums& sums) {
  const Discs& d = place.discs;
  const Section& s = place.section;
  const double t = place.t, chord = std::abs(s.chord), aside = std::abs(s.aside), away = chord + aside + reach;
  const Flat between = d.apart.at(t), middle = d.centre.at(t);
  const double apart = std::sqrt(dot(between, between)), along = std::abs(dot(s.ahead, middle));
  const double centres = size_at(d.centre, t), bend = size_at(d.apart, t) / apart;
  const double lever = along + chord;
  const double sizes = size_at(d.slack, t) + size_at(d.difference, t) * (1 + lever / apart);
  const double terms = sizes + away * away + d.misplaced + 2 * aside * (centres + along * bend) +
                       2 * chord * (centres + (aside + lever) * bend);
  // A misplaced centre along the line of centres changes its segment.
  const double to_centres = centres + size_at(d.apart, t) + chord * bend;
  sums.blur = (first.half_angle + second.half_angle) * terms +
              2 * to_centres * (first.radius * bulge(first) + second.radius * bulge(second));
  sums.oval = second.half_angle * away * away;
  sums.terms = terms;
}

/// The same for a whole disc.
void add_blur_of_disc(const Place& place, double half_angle, const Quadratic& square, bool is_second, Sums& sums) {
  const double terms = size_at(square, place.t) + place.discs.misplaced;
  sums.blur = half_angle * terms;
  sums.oval = is_second ? half_angle * at(square, place.t) : 0;
  sums.terms = terms;
}

}  // namespace

void Sums::add(double weight, const Sums& other) {
  const Moments& m = other.moments;
  moments += Moments{weight * m.volume, weight * m.first, weight * m.squares, weight * m.products};
  force += weight * other.force;
  moved.row0 += weight * other.moved.row0, moved.row1 += weight * other.moved.row1,
      moved.row2 += weight * other.moved.row2;
  blur += weight * other.blur, oval += weight * other.oval, terms = std::max(terms, other.terms);
  first_area += weight * other.first_area, second_area += weight * other.second_area;
  for (size_t i = 0; i < patch.size(); ++i) patch[i] += weight * other.patch[i];
}

Sums slice(const Discs& discs, double t, const Wanted& wanted) {
  const Place place(discs, t);
  const Section& s = place.section;
  Sums sums;
  if (s.outline == Outline::kNothing) return sums;
  Arc first = kNone, second = kNone;
  Vec3 middle = place.chord();
  double of_first = 0;
  if (s.outline == Outline::kLens) {
    first = arc(s.half_chord, s.to_first), second = arc(s.half_chord, s.to_second);
    const quadric::Segment a = segment(first), b = segment(second);
    of_first = a.area;
    add_moments(place, middle, a.area + b.area, a.first_across - b.first_across, a.second_across + b.second_across,
                a.second_along + b.second_along, sums);
    const double rise = std::max(first.radius - s.to_first, second.radius - s.to_second);
    add_blur_of_lens(place, first, second, s.half_chord + rise, sums);
  } else {
    const bool is_first = s.outline == Outline::kFirst;
    const double square = std::max(0.0, at(is_first ? discs.first_square : discs.second_square, t));
    const Flat centre = (is_first ? discs.first_centre() : discs.second_centre()).at(t);
    (is_first ? first : second) = whole_circle(std::sqrt(square));
    middle = place.foot + Vec3{0, centre.x, centre.y};
    const double area = kPi * square;
    if (is_first) of_first = area;
    add_moments(place, middle, area, 0, area * square / 4, area * square / 4, sums);
    add_blur_of_disc(place, kPi, is_first ? discs.first_square : discs.second_square, !is_first, sums);
  }
  if (first.half_angle > 0) {
    // The chord of a whole circle is a point, opposite to `ahead`.
    const Vec3 chord = s.outline == Outline::kLens ? middle : middle - first.radius * place.ahead;
    add_force(place, chord, first, of_first, sums);
    if (wanted.view) add_patch(place, chord, first, *wanted.view, sums);
  }
  if (wanted.first) add_areas(place, first, second, wanted, sums);
  return sums;
}

}  // namespace overlapper::lenses
