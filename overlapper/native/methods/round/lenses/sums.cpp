#include "methods/round/lenses/sums.h"

#include <algorithm>

#include "geometry/constants.h"
#include "methods/round/lenses/region.h"
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

/// A slice, with the data for its parts. Vectors have one component across the slices, then two in the plane.
struct Place {
  const Discs& discs;
  double t, tail;
  Section section;
  Vec3 ahead, aside;  ///< in the plane
  Vec3 foot;

  Place(const Discs& of, double at, double tail_) : discs(of), t(at), tail(tail_), section(lenses::section(of, at)) {
    ahead = {0, section.ahead.x, section.ahead.y}, aside = {0, -section.ahead.y, section.ahead.x};
    foot = {t, t * of.lean.x, t * of.lean.y};
  }
  Vec3 chord() const { return foot + (section.chord * ahead + section.aside * aside); }
  Vec3 world(Vec3 v) const { return v.x * discs.normal + v.y * discs.x + v.z * discs.y; }
};

/// Integrals over a flat set, about a point and along two axes.
struct FlatMoments {
  double area = 0;
  Flat first;
  double xx = 0, yy = 0, xy = 0;

  /// Adds a set that is symmetric to its axis `ahead` through `middle`.
  void add(Flat middle, Flat ahead, double set_area, double along_axis, double second_along, double second_across) {
    const Flat e = ahead, shift = along_axis * e;
    area += set_area;
    first = first + shift + set_area * middle;
    xx += second_along * e.x * e.x + second_across * e.y * e.y + (2 * shift.x + set_area * middle.x) * middle.x;
    yy += second_along * e.y * e.y + second_across * e.x * e.x + (2 * shift.y + set_area * middle.y) * middle.y;
    xy += (second_along - second_across) * e.x * e.y + shift.x * middle.y + shift.y * middle.x +
          set_area * middle.x * middle.y;
  }
  /// Adds a triangle of corners a, b and c, counter-clockwise.
  void add(Flat a, Flat b, Flat c) {
    const double set_area = cross(b - a, c - a) / 2, part = set_area / 12;
    const Flat sum = a + b + c;
    area += set_area;
    first = first + (set_area / 3) * sum;
    xx += part * (a.x * a.x + b.x * b.x + c.x * c.x + sum.x * sum.x);
    yy += part * (a.y * a.y + b.y * b.y + c.y * c.y + sum.y * sum.y);
    xy += part * (a.x * a.y + b.x * b.y + c.x * c.y + sum.x * sum.y);
  }
};

/// Adds a set of the slice. Its flat moments are about `middle`, along the axes e and f.
void add_moments(const FlatMoments& of, Vec3 middle, Vec3 e, Vec3 f, Sums& sums) {
  const Vec3 g = of.first.x * e + of.first.y * f;
  Moments m{of.area, g + of.area * middle, {}, {}};
  m.squares = of.xx * scaled(e, e) + of.yy * scaled(f, f) + 2 * of.xy * scaled(e, f) + 2.0 * scaled(g, middle) +
              of.area * scaled(middle, middle);
  const auto products = [](Vec3 a, Vec3 b) { return Vec3{a.y * b.z, a.z * b.x, a.x * b.y}; };
  m.products = of.xx * products(e, e) + of.yy * products(f, f) + of.xy * (products(e, f) + products(f, e)) +
               products(g, middle) + products(middle, g) + of.area * products(middle, middle);
  sums.moments += m;
}

/// An arc in the slice, with the middle of its chord and unit vectors from there to the arc and along the chord.
struct PlacedArc {
  Arc arc;
  Vec3 chord, ahead, aside;
};

/// Adds the area vectors of an arc of the first body's surface.
void add_force(const Place& place, const PlacedArc& of, double segment_area, Sums& sums) {
  const double level = place.t - place.discs.first_level;
  const Arc& a = of.arc;
  const Vec3 normal{1, 0, 0}, force = 2 * a.radius * a.sine * of.ahead + 2 * a.half_angle * level * normal;
  sums.force += force;
  sums.moved = sums.moved +
               (outer(of.chord, force) + outer(segment_area * of.ahead, of.ahead) +
                outer(segment_area * of.aside, of.aside) + outer(2 * a.radius * level * bulge(a) * of.ahead, normal));
}

/// Adds the area of an arc of the first body's surface.
void add_first_area(const Place& place, const PlacedArc& of, const Wanted& wanted, Sums& sums) {
  const Discs& d = place.discs;
  const Vec3 e = place.world(of.ahead), f = place.world(of.aside);
  sums.first_area +=
      wanted.first->arc((place.t - d.first_level) * d.normal, of.arc.radius * e, of.arc.radius * f, of.arc.half_angle);
}

/// Adds the area of an arc of the second body's surface.
void add_second_area(const Place& place, const PlacedArc& of, const Wanted& wanted, Sums& sums) {
  const Discs& d = place.discs;
  if (d.second_area > 0) {
    sums.second_area += 2 * of.arc.half_angle * d.second_area;
    return;
  }
  const Vec3 e = place.world(of.ahead), f = place.world(of.aside);
  const Flat centre = d.second_centre().at(place.t);
  const Vec3 level = d.second_ball * place.world(place.foot + Vec3{0, centre.x, centre.y}) - d.second_middle;
  sums.second_area += d.second_rise * wanted.second->arc(level, of.arc.radius * (d.second_ball * e),
                                                         of.arc.radius * (d.second_ball * f), of.arc.half_angle);
}

/// Adds the patch's integrals along an arc of the first body's surface, by Gauss's nodes in each half.
void add_patch(const Place& place, const PlacedArc& of, const View& view, Sums& sums) {
  const Arc& a = of.arc;
  const double level = place.t - place.discs.first_level;
  const Vec3 e = place.world(of.ahead), f = place.world(of.aside), n = place.discs.normal;
  const Vec3 from = place.world(of.chord);
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

/// Adds the wanted sums of an arc of the first body's surface.
void add_first(const Place& place, const PlacedArc& of, double segment_area, const Wanted& wanted, Sums& sums) {
  add_force(place, of, segment_area, sums);
  if (wanted.view) add_patch(place, of, *wanted.view, sums);
  if (wanted.first) add_first_area(place, of, wanted, sums);
  if (wanted.closing) sums.border += 2 * of.arc.half_angle;
}

/// Adds the wanted sums of an arc of the second body's surface.
void add_second(const Place& place, const PlacedArc& of, const Wanted& wanted, Sums& sums) {
  if (wanted.first) add_second_area(place, of, wanted, sums);
  if (!wanted.closing) return;
  const Discs& d = place.discs;
  const Flat moves = d.lean + d.second_centre().slope;
  const double grows = d.second_square[1] / 2 + d.second_square[2] * place.t;
  const double chord = 2 * of.arc.radius * of.arc.sine, angle = 2 * of.arc.half_angle;
  const double back = angle * grows + chord * (of.ahead.y * moves.x + of.ahead.z * moves.y);
  sums.second_force += Vec3{-back, 0, 0} + chord * of.ahead;
  const double square = of.arc.radius * of.arc.radius;
  sums.border += angle * std::sqrt(square + grows * grows + square * dot(moves, moves));
}

/// Coordinates along other axes of the plane, by sizes: `ahead` is the first of these axes.
Flat turned(Flat ahead, Flat sizes) {
  const double x = std::abs(ahead.x), y = std::abs(ahead.y);
  return {x * sizes.x + y * sizes.y, y * sizes.x + x * sizes.y};
}

/// The terms of a lens's slacks, and of its centres along the line of centres and aside, whose rounding moves its arcs.
/// The half chord is a root of slack + aside² + chord (2 along − chord). Here `along` and `aside` are the mean centre
/// in the slice's own axes. The chord is half the difference of the slacks, over the distance of the centres. Rounding
/// of that distance stretches or twists these axes. Places are at most `reach` from the middle of the chord.
///
/// The mean disc divides both the difference of the slacks and the distance of the centres. A disc that is much smaller
/// than the other has a small part of both, and little of their rounding.
struct Terms {
  std::array<double, 2> slack, centre, aside;  ///< of the first disc and of the second
  double square;                               ///< of the distance of places from the foot
};
Terms terms_of_lens(const Place& place, Flat reach) {
  const Discs& d = place.discs;
  const Section& s = place.section;
  const double t = place.t, chord = std::abs(s.chord), aside = std::abs(s.aside);
  const Flat away = Flat{chord, aside} + reach, middle = d.centre.at(t),
             centres = turned(s.ahead, sizes_at(d.centre, t)), between = turned(s.ahead, sizes_at(d.apart, t));
  const double apart = norm(d.apart.at(t)), stretch = between.x / apart, twist = between.y / apart;
  const double along = std::abs(dot(s.ahead, middle)), lever = along + chord, difference = size_at(d.difference, t);
  const double square = dot(away, away);
  const double slack = size_at(d.slack, t) + difference * lever / apart + square + d.misplaced +
                       2 * aside * (centres.y + along * twist) +
                       2 * chord * (centres.x + aside * twist + lever * stretch);
  const double centre = centres.x + aside * twist + chord * (1 + stretch);
  Terms terms{{}, {}, {}, square};
  for (const int k : {0, 1}) {
    const double share = k == 0 ? d.share : 1 - d.share;
    terms.slack[k] = slack + share * difference, terms.centre[k] = centre + share * between.x;
    terms.aside[k] = centres.y + along * twist + share * between.y;
  }
  return terms;
}

/// The movement of a lens's arcs by rounding, as slacks of both discs, in units of the last bit.
void add_blur_of_lens(const Place& place, const Arc& first, const Arc& second, Flat reach, Sums& sums) {
  const Terms terms = terms_of_lens(place, reach);
  // A misplaced centre along the line of centres changes its segment.
  sums.blur = first.half_angle * terms.slack[0] + second.half_angle * terms.slack[1] +
              2 * (terms.centre[0] * first.radius * bulge(first) + terms.centre[1] * second.radius * bulge(second));
  sums.oval = second.half_angle * terms.square;
  sums.terms = std::ranges::max(terms.slack);
}

/// The same for a whole disc.
void add_blur_of_disc(const Place& place, double half_angle, const Quadratic& square, bool is_second, Sums& sums) {
  const double terms = size_at(square, place.t) + place.discs.misplaced;
  sums.blur = half_angle * terms;
  sums.oval = is_second ? half_angle * at(square, place.t) : 0;
  sums.terms = terms;
}

Sums whole_slice(const Place& place, const Wanted& wanted) {
  const Discs& discs = place.discs;
  const Section& s = place.section;
  const double t = place.t;
  Sums sums;
  Arc first = kNone, second = kNone;
  Vec3 middle = place.chord();
  double of_first = 0;
  FlatMoments flat;
  if (s.outline == Outline::kLens) {
    first = arc(s.half_chord, s.to_first), second = arc(s.half_chord, s.to_second);
    const quadric::Segment a = segment(first), b = segment(second);
    of_first = a.area;
    flat = {a.area + b.area,
            {a.first_across - b.first_across, 0},
            a.second_across + b.second_across,
            a.second_along + b.second_along,
            0};
    const double rise = std::max(first.radius - s.to_first, second.radius - s.to_second);
    add_blur_of_lens(place, first, second, {rise, s.half_chord + rise}, sums);
  } else {
    const bool is_first = s.outline == Outline::kFirst;
    const double square = std::max(0.0, at(is_first ? discs.first_square : discs.second_square, t));
    const Flat centre = (is_first ? discs.first_centre() : discs.second_centre()).at(t);
    (is_first ? first : second) = whole_circle(std::sqrt(square));
    middle = place.foot + Vec3{0, centre.x, centre.y};
    const double area = kPi * square;
    if (is_first) of_first = area;
    flat = {area, {}, area * square / 4, area * square / 4, 0};
    add_blur_of_disc(place, kPi, is_first ? discs.first_square : discs.second_square, !is_first, sums);
  }
  add_moments(flat, middle, place.ahead, place.aside, sums);
  // The chord of a whole circle is a point, opposite to `ahead`.
  const bool lens = s.outline == Outline::kLens;
  if (first.half_angle > 0) {
    const PlacedArc of{first, lens ? middle : middle - first.radius * place.ahead, place.ahead, place.aside};
    add_first(place, of, of_first, wanted, sums);
  }
  if (second.half_angle > 0) {
    const double side = lens ? -1 : 1;
    const PlacedArc of{second, lens ? middle : middle - second.radius * place.ahead, side * place.ahead, place.aside};
    add_second(place, of, wanted, sums);
  }
  return sums;
}

/// A curve of a region: half the angle of its arcs, or its length, and how far it reaches along the region's axes.
struct Side {
  double size = 0;
  Flat reach;

  void add(double more, Flat from, Flat to, double rise) {
    size += more;
    reach.x = std::max({reach.x, std::abs(from.x) + rise, std::abs(to.x) + rise});
    reach.y = std::max({reach.y, std::abs(from.y) + rise, std::abs(to.y) + rise});
  }
};
using Sides = std::array<Side, 2 + kMostCuts>;

/// The blur of a region that walls cut: that of its arcs, and that of the walls.
void add_blur_of_region(const Place& place, const Region& of, const Sides& sides, Sums& sums) {
  const Discs& d = place.discs;
  const Section& s = place.section;
  Flat from_foot{};
  if (of.about_foot) {
    const std::array<const Quadratic*, 2> slack{&d.first_slack, &d.second_slack};
    const std::array<Line, 2> centre{d.first_centre(), d.second_centre()};
    for (const int k : {0, 1}) {
      const auto& [half_angle, reach] = sides[k];
      if (!(half_angle > 0)) continue;
      const double square = dot(reach, reach);
      const double terms = size_at(*slack[k], place.t) +
                           2 * dot(turned(of.ahead, sizes_at(centre[k], place.t)), reach) + square + d.misplaced;
      sums.blur += half_angle * terms, sums.terms = std::max(sums.terms, terms);
      if (k == 1) sums.oval = half_angle * square;
    }
  } else {
    Flat reach{};
    for (const Side& side : sides) reach = {std::max(reach.x, side.reach.x), std::max(reach.y, side.reach.y)};
    const Terms terms = terms_of_lens(place, reach);
    const std::array<double, 2> rise{of.circle[0].radius - s.to_first, of.circle[1].radius - s.to_second};
    for (const int k : {0, 1})
      sums.blur +=
          sides[k].size * (terms.slack[k] + 2 * (terms.centre[k] * rise[k] + terms.aside[k] * sides[k].reach.y));
    sums.oval = sides[1].size * terms.square;
    sums.terms = std::ranges::max(terms.slack);
    from_foot = {std::abs(s.chord), std::abs(s.aside)};
  }
  for (int i = 0; i < d.cuts; ++i) {
    const auto& [length, reach] = sides[2 + i];
    if (!(length > 0)) continue;
    const Cut& cut = d.cut[i];
    const Flat normal = turned(of.ahead, {std::abs(cut.normal.x), std::abs(cut.normal.y)});
    // Points of the wall are as far from the foot as its side there.
    const double terms = (d.misplaced + 2 * dot(normal, reach + from_foot)) / cut.length;
    sums.blur += length * terms;
    sums.terms = std::max(sums.terms, terms);
  }
}

/// Adds the strip of a wall along a line of the slice.
void add_wall(const Place& place, const Cut& cut, double length, const Wanted& wanted, Sums& sums) {
  const double part = length / cut.length;
  const Vec3 normal{cut.across, cut.normal.x, cut.normal.y};
  (cut.face ? sums.second_force : sums.cut_force) += part * normal, sums.border += part;
  if (!wanted.first || !cut.face) return;
  sums.second_area += part * wanted.first->area(place.world(normal));
}

Sums cut_slice(const Place& place, const Wanted& wanted) {
  const Region of = region(place.discs, place.section, place.t, place.tail);
  Sums sums;
  if (of.empty()) return sums;
  if (of.whole || (of.corners == 2 && of.corner[0].curve == 0 && of.corner[1].curve == 1))
    return whole_slice(place, wanted);
  const Vec3 e{0, of.ahead.x, of.ahead.y}, f{0, of.aside().x, of.aside().y};
  const Vec3 origin = place.foot + Vec3{0, of.origin.x, of.origin.y};
  FlatMoments flat;
  Sides sides{};
  for (int i = 0; i < of.corners; ++i) {
    const int curve = of.corner[i].curve;
    const Flat from = of.corner[i].at(), to = of.next(i), way = to - from;
    if (i > 0 && i + 1 < of.corners) flat.add(of.corner[0].at(), from, to);
    const double whole = std::sqrt(dot(way, way));
    if (!(whole > 0)) continue;
    if (curve >= 2) {
      sides[curve].add(whole, from, to, 0);
      add_wall(place, place.discs.cut[curve - 2], whole, wanted, sums);
      continue;
    }
    const Circle& circle = of.circle[curve];
    const Flat along = (1 / whole) * way, out{along.y, -along.x}, middle = 0.5 * (from + to);
    const Arc a = arc(whole / 2, dot(middle - circle.centre, out));
    const quadric::Segment s = segment(a);
    flat.add(middle, out, s.area, s.first_across, s.second_across, s.second_along);
    sides[curve].add(a.half_angle, from, to, a.radius * (1 - a.cosine));
    const PlacedArc placed{a, origin + (middle.x * e + middle.y * f), out.x * e + out.y * f, along.x * e + along.y * f};
    if (curve == 0) add_first(place, placed, s.area, wanted, sums);
    else add_second(place, placed, wanted, sums);
  }
  add_moments(flat, origin, e, f, sums);
  add_blur_of_region(place, of, sides, sums);
  return sums;
}

}  // namespace

void Sums::add(double weight, const Sums& other, const Wanted& wanted) {
  const Moments& m = other.moments;
  moments += Moments{weight * m.volume, weight * m.first, weight * m.squares, weight * m.products};
  force += weight * other.force;
  moved.row0 += weight * other.moved.row0, moved.row1 += weight * other.moved.row1,
      moved.row2 += weight * other.moved.row2;
  blur += weight * other.blur, oval += weight * other.oval, terms = std::max(terms, other.terms);
  if (wanted.first) first_area += weight * other.first_area, second_area += weight * other.second_area;
  if (wanted.closing) {
    border += weight * other.border;
    second_force += weight * other.second_force;
  }
  cut_force += weight * other.cut_force;
  if (wanted.view)
    for (size_t i = 0; i < patch.size(); ++i) patch[i] += weight * other.patch[i];
}

Sums slice(const Discs& discs, double t, const Wanted& wanted, double tail) {
  const Place place(discs, t, tail);
  if (place.section.outline == Outline::kNothing) return {};
  return discs.cuts > 0 ? cut_slice(place, wanted) : whole_slice(place, wanted);
}

void add_end(const Discs& discs, const Cut& end, double area, const Wanted& wanted, Sums& sums) {
  const double side = end.across > 0 ? 1 : -1;
  (end.face ? sums.second_force : sums.cut_force) += Vec3{side * area, 0, 0}, sums.border += area;
  if (!wanted.first || !end.face) return;
  sums.second_area += area * wanted.first->area(discs.normal);
}

}  // namespace overlapper::lenses
