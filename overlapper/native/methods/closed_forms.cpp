#include "methods/closed_forms.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "methods/quadric/ball.h"
#include "methods/quadric/cylinder.h"
#include "methods/round/stretch.h"
#include "shapes/solid.h"

namespace overlapper {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Part of a body of revolution left by one plane, in the plane through the axis that is orthogonal to the cut: x along
/// the axis, y across it, the third coordinate zero by symmetry.
struct Part {
  double volume = 0;
  Vec3 moment;  ///< ∫ x dV
  double flat_area = 0;
  Vec3 flat_moment;  ///< ∫ x dA over the cut
  double curved_area = 0;
  double scale = 0;  ///< m³: the size of terms that cancelled, for the rounding of the sum

  Part& operator+=(const Part& other) {
    volume += other.volume;
    moment += other.moment;
    flat_area += other.flat_area;
    flat_moment += other.flat_moment;
    curved_area += other.curved_area;
    scale += other.scale;
    return *this;
  }

  /// The same part about another point of the axis.
  Part shifted(double along) const {
    Part result = *this;
    result.moment.x += along * volume;
    result.flat_moment.x += along * flat_area;
    return result;
  }

  Part mirrored() const {
    Part result = *this;
    result.moment.x = -moment.x;
    result.flat_moment.x = -flat_moment.x;
    return result;
  }
};

// -------------------------------------------------------------------------------------------------------------- balls

/// The cap of height h, from 0 to 2 r, of a ball about the origin: where dot(direction, x) <= h - r.
Part cap(double r, double h, Vec3 direction) {
  const double disc = kPi * h * (2 * r - h);
  const double volume = kPi / 3 * h * h * (3 * r - h);
  const double depth = 0.75 * (2 * r - h) * (2 * r - h) / (3 * r - h);
  return {volume, -volume * depth * direction, disc, disc * (h - r) * direction, 2 * kPi * r * h, volume};
}

Part half_ball(double r) {
  const double volume = 2 * kPi / 3 * r * r * r;
  return {volume, {3 * r / 8 * volume, 0, 0}, 0, {}, 2 * kPi * r * r, volume};
}

/// What is left of the half ball x >= 0 where sine * x + cosine * y <= t; `cosine` >= 0.
Part half_ball_below(double r, double sine, double cosine, double t) {
  if (t >= r) return half_ball(r);
  if (t <= -r) return {};
  const Vec3 direction{sine, cosine, 0};
  const double rho = std::sqrt((r - t) * (r + t));
  if (std::abs(t * sine) >= rho * cosine) {
    // The circle of the cut lies on one side of x = 0.
    if (t * sine < 0 || (t == 0 && sine < 0)) return t >= 0 ? half_ball(r) : Part{};
    if (t < 0) return cap(r, r + t, direction);
    Part rest = half_ball(r);
    const Part removed = cap(r, r - t, -direction);
    rest.volume -= removed.volume;
    rest.moment -= removed.moment;
    rest.flat_area = removed.flat_area;
    rest.flat_moment = removed.flat_moment;
    rest.curved_area -= removed.curved_area;
    return rest;
  }
  // Half the angle of the cut's arc, of the arc on x = 0, and the exterior angle of the spherical part where they meet.
  // All three from the same root, so that what rounding did to it cancels in the sum.
  const double root = std::sqrt((r * cosine - t) * (r * cosine + t));
  const double arc = std::atan2(root, -t * sine), base_arc = std::atan2(root, -t);
  const double exterior = std::atan2(root, -sine * r);
  // The theorem of Gauss and Bonnet.
  const double spherical = r * r * (2 * kPi - 2 * exterior) + 2 * r * t * arc;
  // Segments of discs: area, and second moment about the disc's centre as that of a sector less that of a triangle.
  const double width = root / cosine;
  const auto segment = [width](double radius, double half_angle, double height) {
    const double area = radius * radius * half_angle - height * width;
    const double second =
        radius * radius * radius * radius * half_angle / 2 - height * width * (3 * height * height + width * width) / 6;
    return std::pair(area, second);
  };
  const auto [cut, cut_second] = segment(rho, arc, -t * sine / cosine);
  const auto [base, base_second] = segment(r, base_arc, -t / cosine);
  Part part;
  part.volume = (r * spherical + t * cut) / 3;
  // ∫ x dV = ½ ∮ |x|² dA, and the area vectors of a closed surface sum to zero.
  const Vec3 along{1, 0, 0};
  part.moment =
      (r * r * (base * along - cut * direction) + (t * t * cut + cut_second) * direction - base_second * along) / 2;
  part.flat_area = cut;
  part.flat_moment = cut * t * direction + 2.0 / 3.0 * width * width * width * Vec3{cosine, -sine, 0};
  part.curved_area = spherical;
  part.scale = 2 * kPi * r * r * r;
  return part;
}

// ---------------------------------------------------------------------------------------------------------- cylinders

/// Gauss's sixteen nodes and weights on [0, 1], which integrate cos(4θ) over half a turn to rounding.
template <class Integrand>
void integrate(double from, double width, Integrand integrand) {
  constexpr std::array<double, 8> node{0.0950125098376374, 0.2816035507792589, 0.4580167776572274, 0.6178762444026438,
                                       0.7554044083550030, 0.8656312023878318, 0.9445750230732326, 0.9894009349916499};
  constexpr std::array<double, 8> weight{0.1894506104550685, 0.1826034150449236, 0.1691565193950025,
                                         0.1495959888165767, 0.1246289712555339, 0.0951585116824928,
                                         0.0622535239386479, 0.0271524594117541};
  for (int i = 0; i < 8; ++i)
    for (const double side : {-1.0, 1.0}) {
      const double advance = width * (1 + side * node[i]) / 2;
      integrand(from + advance, advance, width * weight[i] / 2);
    }
}

/// The angle θ at which y = −r cos θ has risen from −r by `risen`.
double angle_at(double r, double risen) {
  return std::atan2(std::sqrt(std::max(0.0, risen * (2 * r - risen))), r - risen);
}

/// angle_at(r, risen + more) − angle_at(r, risen), without cancellation.
double angle_between(double r, double risen, double more) {
  const double y = risen - r, end = y + more;
  const double p = std::sqrt(risen * (2 * r - risen));
  const double q = std::sqrt(std::max(0.0, (risen + more) * (2 * r - risen - more)));
  const double sine = y * end > 0 ? more * (y + end) / (end * p + y * q) : (end * p - y * q) / (r * r);
  return std::atan2(sine, (p * q + y * end) / (r * r));
}

struct CylinderPart {
  Part part;
  double lower_end, upper_end;  ///< m²: what is left of the flat ends
};

/// What is left of the cylinder |x| <= h, y² + z² <= r², where sine * x + cosine * y <= t; both >= 0. Slices of
/// constant y are rectangles, 2 √(r² − y²) wide, whose length falls from 2 h to nothing while y crosses the cut; with
/// y = −r cos θ every integrand is a trigonometric polynomial.
CylinderPart cylinder_below(double r, double h, double sine, double cosine, double t) {
  CylinderPart result{{}, 0, 0};
  Part& part = result.part;
  // How far the cut has passed y = -r, times cosine: where it enters the upper end, and where it leaves the lower one.
  const double enter = t - sine * h + cosine * r, leave = t + sine * h + cosine * r;
  if (leave <= 0) return result;
  const double across = 2 * r * cosine;
  const double full = enter >= across ? kPi : enter <= 0 ? 0 : angle_at(r, enter / cosine);
  integrate(0, full, [&](double angle, double, double weight) {
    const double y = -r * std::cos(angle), chord = 2 * r * std::sin(angle) * r * std::sin(angle);
    const double volume = weight * 2 * h * chord;
    part.volume += volume;
    part.moment.y += volume * y;
    part.curved_area += weight * 4 * r * h;
    result.upper_end += weight * chord;
  });
  result.lower_end = result.upper_end;
  if (enter >= across) return result;

  const double start = enter <= 0 ? 0 : enter / cosine;
  const double length = enter <= 0 ? leave / sine : 2 * h;
  const bool open = leave >= across;
  if (sine == 0) {
    // The cut is parallel to the axis: a rectangle.
    part.flat_area = 4 * h * std::sqrt(std::max(0.0, start * (2 * r - start)));
    part.flat_moment.y = part.flat_area * (start - r);
    return result;
  }
  // Where rounding alone has kept the cut from the far side, nothing is left, and the formula for it is 0 / 0.
  const double rest = kPi - full;
  const double width =
      open ? rest : std::min(rest, angle_between(r, start, (enter <= 0 ? leave : 2 * sine * h) / cosine));
  integrate(full, width, [&](double angle, double advance, double weight) {
    const double y = -r * std::cos(angle), chord = 2 * r * std::sin(angle) * r * std::sin(angle);
    const double risen = 2 * r * std::sin(angle - advance / 2) * std::sin(advance / 2);
    const double here = std::max(0.0, length - cosine / sine * risen);
    const double volume = weight * here * chord;
    part.volume += volume;
    part.moment += volume * Vec3{here / 2 - h, y, 0};
    part.curved_area += weight * 2 * r * here;
    result.lower_end += weight * chord;
    const double cut = weight * chord / sine;
    part.flat_area += cut;
    part.flat_moment += cut * Vec3{here - h, y, 0};
  });
  return result;
}

// -------------------------------------------------------------------------------------------------- one plane, one body

/// A ball, a capsule or a cylinder as all of them are seen here.
struct Revolved {
  Vec3 centre, axis;
  double radius, half_length;
  bool round;  ///< ends in half balls

  /// The offset of the supporting plane along `direction`, about the centre.
  double reach(Vec3 direction) const {
    const double along = dot(axis, direction);
    return half_length * std::abs(along) + radius * norm(round ? direction : direction - along * axis);
  }
};

std::optional<Revolved> revolved(const Placed& body) {
  const Vec3 axis = body.pose.rotation * Vec3{0, 0, 1};
  if (const Sphere* s = std::get_if<Sphere>(&body.shape))
    return Revolved{body.pose.translation, axis, s->radius, 0, true};
  if (const Ellipsoid* e = std::get_if<Ellipsoid>(&body.shape); e && e->ball())
    return Revolved{body.pose.translation, axis, e->half_axes.x, 0, true};
  if (const Capsule* c = std::get_if<Capsule>(&body.shape))
    return Revolved{body.pose.translation, axis, c->radius, c->length / 2, true};
  if (const Cylinder* c = std::get_if<Cylinder>(&body.shape))
    return Revolved{body.pose.translation, axis, c->radius, c->length / 2, false};
  return std::nullopt;
}

Part below(const Revolved& body, double sine, double cosine, double t) {
  const double r = body.radius, h = body.half_length;
  if (!body.round) {
    CylinderPart cylinder = cylinder_below(r, h, sine, cosine, t);
    cylinder.part.curved_area += cylinder.lower_end + cylinder.upper_end;
    return cylinder.part;
  }
  if (h == 0) return t >= r ? cap(r, 2 * r, {1, 0, 0}) : t > -r ? cap(r, r + t, {sine, cosine, 0}) : Part{};
  Part part = cylinder_below(r, h, sine, cosine, t).part;
  part += half_ball_below(r, sine, cosine, t - sine * h).shifted(h);
  part += half_ball_below(r, -sine, cosine, t + sine * h).mirrored().shifted(-h);
  return part;
}

/// Sums over terms of that size are right to this fraction of it.
constexpr double kSummation = 64 * DBL_EPSILON;

Measures by_formula() {
  Measures m;
  m.status = Status::kOverlapping;
  m.way = Way::kClosedForm;
  m.measured = true;
  return m;
}

/// Of a pull and of its opposite, both of which act at `where`, each about the position of its body.
std::array<Pull, 2> opposite_pulls(Vec3 force_on_first, Vec3 where, const std::array<Vec3, 2>& positions) {
  return {about({force_on_first, {}}, where, positions[0]), about({-force_on_first, {}}, where, positions[1])};
}

/// What the plane leaves of the body, which is number `self` of the pair; the plane belongs to the other. `rounding` as
/// in closed_form().
std::optional<Measures> cut_by_plane(const Revolved& body, const Plane& plane, int self, double rounding,
                                     Vec3 reference, const std::array<Vec3, 2>& positions) {
  double sine = dot(body.axis, plane.normal);
  const Vec3 axis = sine < 0 ? -body.axis : body.axis;
  sine = std::abs(sine);
  const Vec3 across = plane.normal - sine * axis;
  const double cosine = norm(across);
  const Vec3 sideways = cosine > 0 ? across / cosine : any_orthogonal(axis);
  const Part part = below(body, sine, cosine, -signed_distance(plane, body.centre));
  if (!(part.volume > 0)) return std::nullopt;
  const auto placed = [&](Vec3 p) { return body.centre + (p.x * axis + p.y * sideways); };
  Measures q = by_formula();
  q.facets_touched = part.flat_area > 0 ? 1 : 0;
  q.volume = part.volume;
  q.area = part.flat_area + part.curved_area;
  q.centroid = reference + placed(part.moment / part.volume);
  q.volume_error = rounding * q.area + kSummation * part.scale + kSummation * part.volume;
  if (part.flat_area > 0) {
    const Vec3 where = placed(part.flat_moment / part.flat_area);
    // The area vectors of a closed surface sum to zero, and so do their moments.
    const Vec3 on_other = part.flat_area * plane.normal;
    q.pulls = opposite_pulls(self == 0 ? -on_other : on_other, where, positions);
  }
  return q;
}

/// An upper bound, as low as it takes, of dot(direction, x) over the part of `body` below the plane, about its centre:
/// by weak duality, reach(direction − λ normal) + λ offset for any λ >= 0, a convex function of λ.
double reach_below(const Revolved& body, Vec3 normal, double offset, Vec3 direction, double rounding) {
  const auto bound = [&](double lambda) {
    return body.reach(direction - lambda * normal) + lambda * offset + (1 + lambda) * rounding;
  };
  constexpr double kGolden = 0.6180339887498949;
  double low = 0, high = 4;
  while (high < 1e6 && bound(high) < bound(high / 2)) high *= 2;
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double at_left = bound(left), at_right = bound(right);
  for (int i = 0; i < 48; ++i) {
    if (at_left < at_right) {
      high = right, right = left, at_right = at_left;
      left = high - kGolden * (high - low), at_left = bound(left);
    } else {
      low = left, left = right, at_left = at_right;
      right = low + kGolden * (high - low), at_right = bound(right);
    }
  }
  return std::min({bound(0), at_left, at_right});
}

/// The only one of some planes that cuts off anything which the others leave of a body.
struct OnlyCut {
  const Plane* plane = nullptr;
  double layers = 1;  ///< of rounding that others may cut off
};

/// Nothing where there are two such planes.
std::optional<OnlyCut> only_cut(const Revolved& body, std::span<const Plane> planes, double rounding) {
  const Plane* deepest = nullptr;
  double most = -kInfinity;
  std::vector<const Plane*> cutting;
  for (const Plane& plane : planes) {
    const double beyond = body.reach(plane.normal) + signed_distance(plane, body.centre);
    if (beyond > most) most = beyond, deepest = &plane;
    if (beyond > 0) cutting.push_back(&plane);
  }
  double layers = 1;
  for (const Plane* plane : cutting) {
    if (plane == deepest) continue;
    const double offset = -signed_distance(*plane, body.centre);
    const double deepest_offset = -signed_distance(*deepest, body.centre);
    const double reach = reach_below(body, deepest->normal, deepest_offset, plane->normal, rounding);
    if (reach > offset + 2 * rounding) return std::nullopt;
    if (reach > offset) layers += 4;  // it may cut off a layer of rounding
  }
  return OnlyCut{deepest, layers};
}

/// The body where at most one of the planes cuts off anything that the others leave.
std::optional<Measures> cut_by_polytope(const Revolved& body, std::span<const Plane> planes, int self, double rounding,
                                        Vec3 reference, const std::array<Vec3, 2>& positions) {
  const auto cut = only_cut(body, planes, rounding);
  if (!cut) return std::nullopt;
  return cut_by_plane(body, *cut->plane, self, cut->layers * rounding, reference, positions);
}

/// An ellipsoid likewise: a cap of the unit ball that it is made of, stretched.
std::optional<Measures> cut_by_polytope(const Placed& body, std::span<const Plane> planes, int self, double rounding,
                                        Vec3 reference, const std::array<Vec3, 2>& positions) {
  const slicing::Stretch stretch(stretched(body.shape)->half_axes);
  const Vec3 half_axes = stretch.half_axes, centre = body.pose.translation;
  const Mat3& turn = body.pose.rotation;
  std::vector<Plane> seen;
  for (const Plane& plane : planes) {
    const Vec3 normal = scaled(half_axes, apply_transposed(turn, plane.normal));
    const double length = norm(normal);
    seen.push_back({normal / length, -signed_distance(plane, centre) / length});
  }
  const Revolved ball{{}, {0, 0, 1}, 1, 0, true};
  const double shortest = std::min({half_axes.x, half_axes.y, half_axes.z});
  const auto cut = only_cut(ball, seen, rounding / shortest);
  if (!cut) return std::nullopt;
  const auto& [normal, offset] = *cut->plane;
  const double height = std::min(2.0, 1 + offset);
  if (!(height > 0)) return std::nullopt;
  const Part part = cap(1, height, normal);
  const bool whole = height == 2;
  const slicing::Stretch::Cap curved = stretch.cap(normal, height);
  const Vec3 on_other = whole ? Vec3{} : stretch.normal(part.flat_area * normal);
  Measures q = by_formula();
  q.facets_touched = whole ? 0 : 1;
  q.volume = stretch.volume * part.volume;
  q.area = curved.area + norm(on_other);
  q.area_error = curved.error + stretch.open() * q.area;
  q.centroid = reference + (centre + turn * scaled(half_axes, part.moment / part.volume));
  q.volume_error = cut->layers * rounding * q.area + 2 * kSummation * q.volume;
  if (!whole) {
    const Vec3 force = turn * on_other, where = centre + turn * scaled(half_axes, offset * normal);
    q.pulls = opposite_pulls(self == 0 ? -force : force, where, positions);
  }
  return q;
}

// ----------------------------------------------------------------------------------------------------------------- lens

/// A ball, or the end of a capsule, where dot(outward, x − centre) >= 0; every side of a ball is one.
struct End {
  Vec3 centre, outward;
};

/// How far the cap dot(normal, x − centre) <= offset of a ball keeps to the outer side of an end, at least.
double clearance(const End& end, Vec3 centre, double radius, Vec3 normal, double offset, double rounding) {
  const Revolved ball{centre, {0, 0, 1}, radius, 0, true};
  return dot(end.outward, centre - end.centre) - reach_below(ball, normal, offset, -end.outward, rounding);
}

/// The lens of two balls: cap of a towards b, cap of b towards a.
std::optional<Measures> lens(Vec3 a, double ra, Vec3 b, double rb, double rounding, Vec3 reference,
                             std::span<const End> ends, const std::array<Vec3, 2>& positions) {
  const double distance = norm(b - a), depth = ra + rb - distance;
  if (!(depth > 0)) return std::nullopt;
  const Vec3 towards = distance > 0 ? (b - a) / distance : Vec3{1, 0, 0};
  double height_a = 0, height_b = 0;
  if (distance <= std::abs(ra - rb)) {
    (ra <= rb ? height_a : height_b) = 2 * std::min(ra, rb);
  } else {
    // The smaller by the formula, the other as the rest: a circle misplaced by rounding then moves no volume.
    height_a = depth * (rb - ra + distance) / (2 * distance);
    height_b = depth * (ra - rb + distance) / (2 * distance);
    (height_a <= height_b ? height_b : height_a) = depth - std::min(height_a, height_b);
  }
  for (const End& end : ends) {
    const double by_a = height_a > 0 ? clearance(end, a, ra, -towards, height_a - ra, rounding) : kInfinity;
    const double by_b = height_b > 0 ? clearance(end, b, rb, towards, height_b - rb, rounding) : kInfinity;
    if (std::min(by_a, by_b) <= 0) return std::nullopt;
  }
  const Part cap_a = cap(ra, height_a, -towards), cap_b = cap(rb, height_b, towards);
  Measures q = by_formula();
  q.volume = cap_a.volume + cap_b.volume;
  q.area = cap_a.curved_area + cap_b.curved_area;
  // About the point where the line of centres passes through the circle.
  const Vec3 moment = cap_a.moment + (ra - height_a) * cap_a.volume * -towards + cap_b.moment +
                      (rb - height_b) * cap_b.volume * towards;
  const Vec3 circle = height_a > 0 ? a + (ra - height_a) * towards : b - (rb - height_b) * towards;
  q.centroid = reference + (circle + moment / q.volume);
  q.volume_error = rounding * q.area + kSummation * q.volume;
  const double disc = std::max(cap_a.flat_area, cap_b.flat_area);
  if (disc > 0) q.pulls = opposite_pulls(disc * towards, circle, positions);
  return q;
}

/// Where every point of the common set lies beyond the ends of both bodies, the ends are all that matters: the set is
/// connected, and around the lens there is nothing else of them.
std::optional<Measures> lens_of_ends(const Revolved& a, const Revolved& b, double rounding, Vec3 reference,
                                     const std::array<Vec3, 2>& positions) {
  const double sign_a = dot(a.axis, b.centre - a.centre) < 0 ? -1 : 1;
  const double sign_b = dot(b.axis, a.centre - b.centre) < 0 ? -1 : 1;
  std::vector<End> ends;
  Vec3 centre_a = a.centre, centre_b = b.centre;
  if (a.half_length > 0) {
    centre_a += sign_a * a.half_length * a.axis;
    ends.push_back({centre_a, sign_a * a.axis});
  }
  if (b.half_length > 0) {
    centre_b += sign_b * b.half_length * b.axis;
    ends.push_back({centre_b, sign_b * b.axis});
  }
  return lens(centre_a, a.radius, centre_b, b.radius, rounding, reference, ends, positions);
}

// --------------------------------------------------------------------------------------------------------- polyhedra

/// The corners, planes and edges of a box or a hull, in coordinates of its own.
class OwnPolyhedron {
 public:
  explicit OwnPolyhedron(const Shape& shape) {
    if (const Box* box = std::get_if<Box>(&shape)) {
      for (int i = 0; i < 8; ++i) corners_[i] = corner(*box, i);
      for (int f = 0; f < 6; ++f) planes_[f] = side(*box, f);
      polyhedron_ = {corners_, planes_, edges(shape), 6};
    } else if (const Hull* hull = std::get_if<Hull>(&shape)) {
      polyhedron_ = {hull->data->vertices, hull->data->planes, edges(shape), hull->data->planes.size()};
    }
  }
  /// Without edges if there is none.
  const quadric::Polyhedron& operator*() const { return polyhedron_; }

 private:
  std::array<Vec3, 8> corners_;
  std::array<Plane, 6> planes_;
  quadric::Polyhedron polyhedron_;
};

/// Where one plane at most reaches a ball, a cap has fewer terms.
std::optional<MeasuresAndInertia> ball_and_polyhedron(const Revolved& ball, const Placed& other, int self,
                                                      double rounding, Vec3 reference,
                                                      const std::array<Vec3, 2>& positions) {
  const OwnPolyhedron polyhedron(other.shape);
  if ((*polyhedron).edges.empty()) return std::nullopt;
  const Vec3 centre = apply_transposed(other.pose.rotation, ball.centre - other.pose.translation);
  const auto reaches = [&](const Plane& plane) { return -signed_distance(plane, centre) < ball.radius + rounding; };
  if (std::ranges::count_if((*polyhedron).planes, reaches) < 2) return std::nullopt;
  const auto part = quadric::measure_ball(*polyhedron, centre, ball.radius);
  if (!part || !(part->volume > 0)) return std::nullopt;
  Measures q = by_formula();
  q.facets_touched = part->faces;
  q.volume = part->volume, q.area = part->area;
  q.volume_error = part->error + rounding * part->area;
  if (!std::isfinite(q.volume_error)) return std::nullopt;
  const auto turned = [&](Vec3 v) { return other.pose.rotation * v; };
  q.centroid = reference + (ball.centre + turned(part->first / part->volume));
  // The forces on the ball act towards its centre.
  const Vec3 on_other = turned(part->flat);
  q.pulls = opposite_pulls(self == 0 ? -on_other : on_other, ball.centre, positions);
  const Mat3 rotation = other.pose.rotation;
  const Mat3 inertia = part->inertia_about_centroid();
  return MeasuresAndInertia{std::move(q), rotation * inertia * transposed(rotation)};
}

/// From parts more remote than that, slices know second moments better.
constexpr double kRemote = 100;
/// Of how far a body reaches: nearer to a corner, the planes of its ends are left to slices.
constexpr double kFlush = 1e-9;

/// A cylinder, or a capsule as a cylinder and two half balls. They are faces of the cylinder where the planes of its
/// ends cut the polyhedron, and none of the capsule.
std::optional<MeasuresAndInertia> long_body_and_polyhedron(const Revolved& body, const Placed& placed,
                                                           const Placed& other, int self, double rounding,
                                                           Vec3 reference, const std::array<Vec3, 2>& positions) {
  thread_local quadric::Rings polyhedron, part;
  if (!polyhedron.become(other.shape, relative_pose(placed.pose, other.pose))) return std::nullopt;
  const double r = body.radius, h = body.half_length;
  // Cuts through corners would leave slivers that are nothing but rounding, or faces twice.
  for (const Vec3 corner : polyhedron.corners())
    if (std::abs(std::abs(corner.z) - h) <= kFlush * (r + h)) return std::nullopt;
  part = polyhedron;
  if (!part.cut(h, true) || !part.cut(-h, false)) return std::nullopt;
  Measures q = by_formula();
  Moments moments;  // about its centre, along its axes
  Pull on_body{};   // likewise
  if (!part.empty()) {
    const auto middle = quadric::measure_cylinder(part, r);
    if (!middle) return std::nullopt;
    q.volume_error = middle->error, q.area = middle->area, q.facets_touched = middle->faces;
    moments += *middle;
    on_body = body.round ? middle->curved : Pull{-middle->flat.force, -middle->flat.moment};
    if (!body.round) q.area = middle->whole_area;
  }
  for (const double end : {h, -h}) {
    if (!body.round) break;
    part = polyhedron;
    if (!part.cut(end, end < 0)) return std::nullopt;
    if (part.empty()) continue;
    const quadric::Polyhedron rest = part.polyhedron();
    if (rest.edges.empty()) return std::nullopt;
    const Vec3 centre{0, 0, end};
    const auto ball = quadric::measure_ball(rest, centre, r);
    if (!ball) continue;
    q.volume_error += ball->error, q.area += ball->area, q.facets_touched += ball->faces;
    moments += ball->seen_from(centre);
    on_body.force += -ball->flat, on_body.moment += cross(centre, -ball->flat);
  }
  q.volume = moments.volume;
  if (!(q.volume > 0)) return std::nullopt;
  q.volume_error += rounding * q.area;
  if (!std::isfinite(q.volume_error)) return std::nullopt;
  q.centroid = reference + placed.pose * (moments.first / q.volume);
  const Pull turned{placed.pose.rotation * on_body.force, placed.pose.rotation * on_body.moment};
  for (const int i : {0, 1}) {
    const double side = i == self ? 1 : -1;
    q.pulls[i] = about({side * turned.force, side * turned.moment}, placed.pose.translation, positions[i]);
  }
  std::optional<Mat3> inertia;
  if (moments.remoteness() < kRemote)
    inertia = placed.pose.rotation * moments.inertia_about_centroid() * transposed(placed.pose.rotation);
  return MeasuresAndInertia{std::move(q), inertia};
}

std::optional<MeasuresAndInertia> without_inertia(const std::optional<Measures>& measures) {
  return measures ? std::optional(MeasuresAndInertia{*measures, {}}) : std::nullopt;
}

}  // namespace

std::optional<MeasuresAndInertia> closed_form(const Placed& a, const Placed& b, double rounding, Vec3 reference) {
  const std::optional<Revolved> smooth_a = revolved(a), smooth_b = revolved(b);
  const std::array<Vec3, 2> positions{a.position - reference, b.position - reference};
  if (smooth_a && smooth_b) {
    if (!smooth_a->round || !smooth_b->round) return std::nullopt;
    return without_inertia(lens_of_ends(*smooth_a, *smooth_b, rounding, reference, positions));
  }
  const bool first = smooth_a || stretched(a.shape);
  if (!first && !smooth_b && !stretched(b.shape)) return std::nullopt;
  const Placed &body = first ? a : b, &other = first ? b : a;
  if (smooth(other.shape)) return std::nullopt;
  const int self = first ? 0 : 1;
  const std::optional<Revolved>& revolved_body = first ? smooth_a : smooth_b;
  std::optional<MeasuresAndInertia> several;
  const auto error = [](const Measures& m) { return m.volume_error / m.volume; };
  if (revolved_body && revolved_body->round && revolved_body->half_length == 0)
    several = ball_and_polyhedron(*revolved_body, other, self, rounding, reference, positions);
  else if (revolved_body)
    several = long_body_and_polyhedron(*revolved_body, body, other, self, rounding, reference, positions);
  if (several && error(several->measures) <= kEnough) return several;
  std::vector<Plane> planes;
  append_planes(other.shape, planes);
  for (Plane& plane : planes) plane = other.pose * plane;
  if (!revolved_body) return without_inertia(cut_by_polytope(body, planes, self, rounding, reference, positions));
  const auto cut = cut_by_polytope(*revolved_body, planes, self, rounding, reference, positions);
  if (several && !(cut && error(*cut) <= error(several->measures))) return several;
  return without_inertia(cut);
}

}  // namespace overlapper
