#include "methods/round/closed_forms/closed_forms.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "methods/round/closed_forms/sides.h"
#include "methods/round/quadric/ball.h"
#include "methods/round/quadric/cylinder.h"
#include "methods/round/quadric/shallow_ball.h"
#include "methods/round/quadric/stretch.h"
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

/// Sums over terms of that size are right to this fraction of it.
constexpr double kSummation = 64 * DBL_EPSILON;

/// Of the radius: parts of a half ball that deep at most are within 75° of where they are seen from.
constexpr double kShallowHalf = 0.2;

/// A shallow part of the half ball x >= 0, about the line where the plane that cuts it meets x = 0, `edge` deep in the
/// ball.
Part shallow_half_ball_below(double r, double sine, double cosine, double cut_radius, double edge) {
  quadric::ShallowBall ball(r, edge);
  // Along the line, then −x, then −y.
  const double width = std::sqrt(edge * (2 * r - edge));
  const Vec3 begin{-width, 0, 0}, end{width, 0, 0}, way{1, 0, 0};
  ball.begin_face({0, 1, 0}, 0, r);
  ball.add_chord(end, begin);
  ball.add_arc(begin, end, way);
  ball.end_face();
  ball.begin_face({0, -sine, -cosine}, 0, cut_radius);
  ball.add_chord(begin, end);
  ball.add_arc(end, begin, -way);
  Part part;
  part.flat_area = ball.end_face();
  part.volume = ball.volume();
  const auto about_centre = [&](Vec3 first, double of) { return Vec3{-first.y, -first.z - of * (r - edge), 0}; };
  part.moment = about_centre(ball.first(), part.volume);
  part.flat_moment = about_centre(ball.face_first(), part.flat_area);
  part.curved_area = ball.curved_area();
  part.scale = ball.error() / kSummation;
  return part;
}

/// What is left of the half ball x >= 0 where sine * x + cosine * y <= t; `cosine` >= 0. The plane is `height` = r + t
/// into the ball, and `edge` = r cosine + t into its disc, times the cosine.
Part half_ball_below(double r, double sine, double cosine, double t, double height, double edge) {
  if (t >= r) return half_ball(r);
  if (height <= 0) return {};
  const Vec3 direction{sine, cosine, 0};
  const double rho = std::sqrt((r - t) * height);
  if (edge <= 0 || t >= r * cosine) {
    // The circle of the cut lies on one side of x = 0.
    if (t == 0 && sine < 0) return cap(r, r, direction);
    if (t * sine < 0) return t >= 0 ? half_ball(r) : Part{};
    if (t < 0) return cap(r, height, direction);
    Part rest = half_ball(r);
    const Part removed = cap(r, r - t, -direction);
    rest.volume -= removed.volume;
    rest.moment -= removed.moment;
    rest.flat_area = removed.flat_area;
    rest.flat_moment = removed.flat_moment;
    rest.curved_area -= removed.curved_area;
    return rest;
  }
  if (height <= kShallowHalf * r) return shallow_half_ball_below(r, sine, cosine, rho, edge / cosine);
  // Half the angle of the cut's arc, of the arc on x = 0, and the exterior angle of the spherical part where they meet.
  // All three from the same root, so that what rounding did to it cancels in the sum.
  const double root = std::sqrt((r * cosine - t) * edge);
  const double arc = std::atan2(root, -t * sine), base_arc = std::atan2(root, -t);
  const double exterior = std::atan2(root, -sine * r);
  // The theorem of Gauss and Bonnet.
  const double spherical = r * r * (2 * kPi - 2 * exterior) + 2 * r * t * arc;
  // Segments of discs: area, and second moment about the disc's centre as that of a sector less that of a triangle.
  const double width = root / cosine;
  const auto segment = [width](double radius, double half_angle, double over) {
    const double area = radius * radius * half_angle - over * width;
    const double second =
        radius * radius * radius * radius * half_angle / 2 - over * width * (3 * over * over + width * width) / 6;
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
/// y = −r cos θ every integrand is a trigonometric polynomial. `enter` and `leave` say how far the cut has passed y =
/// -r, times cosine: where it enters the upper end, and where it leaves the lower one.
CylinderPart cylinder_below(double r, double h, double sine, double cosine, double enter, double leave) {
  CylinderPart result{{}, 0, 0};
  Part& part = result.part;
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

/// A plane that cuts a body, in the plane through the axis that is across it, from numbers in double-doubles: in the
/// shallowest of cuts, each has its digits.
struct Cut {
  double sine = 0, cosine = 0;  ///< of its normal, along the axis and across
  double offset = 0;            ///< about the centre
  double upper = 0, lower = 0;  ///< how far into the balls about the ends of the axis it is
  double enter = 0, leave = 0;  ///< as in cylinder_below()
};

Cut cut_of(const Revolved& body, const WideVector& centre, const WideVector& axis, const WidePlane& plane) {
  const DoubleDouble r{body.radius}, h{body.half_length}, t = -signed_distance(plane, centre);
  if (body.round && body.half_length == 0) return {0, 1, t.head, (r + t).head, (r + t).head, 0, 0};
  const DoubleDouble along = dot(axis, plane.normal), sine = abs(along);
  const DoubleDouble cosine = norm(plane.normal - along * axis), beside = t + r * cosine, ahead = sine * h;
  return {sine.head,
          cosine.head,
          t.head,
          (r + t - ahead).head,
          (r + t + ahead).head,
          (beside - ahead).head,
          (beside + ahead).head};
}

Part below(const Revolved& body, const Cut& cut) {
  const double r = body.radius, h = body.half_length, t = cut.offset;
  if (!body.round) {
    CylinderPart cylinder = cylinder_below(r, h, cut.sine, cut.cosine, cut.enter, cut.leave);
    cylinder.part.curved_area += cylinder.lower_end + cylinder.upper_end;
    return cylinder.part;
  }
  if (h == 0) return cap(r, std::clamp(cut.lower, 0.0, 2 * r), {cut.sine, cut.cosine, 0});
  Part part = cylinder_below(r, h, cut.sine, cut.cosine, cut.enter, cut.leave).part;
  part += half_ball_below(r, cut.sine, cut.cosine, t - cut.sine * h, cut.upper, cut.enter).shifted(h);
  part += half_ball_below(r, -cut.sine, cut.cosine, t + cut.sine * h, cut.lower, cut.leave).mirrored().shifted(-h);
  return part;
}

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

/// What the plane leaves of the body, which is number `self` of the pair; the plane belongs to the other. `rounding` is
/// how far it may be off.
std::optional<Measures> cut_by_plane(const Revolved& body, const Cut& cut, Vec3 normal, int self, double rounding,
                                     Vec3 reference, const std::array<Vec3, 2>& positions) {
  const bool ball = body.round && body.half_length == 0;
  const Vec3 axis = ball ? any_orthogonal(normal) : dot(body.axis, normal) < 0 ? -body.axis : body.axis;
  const Vec3 across = normal - dot(normal, axis) * axis;
  const Vec3 sideways = ball ? normal : norm2(across) > 0 ? unit(across) : any_orthogonal(axis);
  const Part part = below(body, cut);
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
    const Vec3 on_other = part.flat_area * normal;
    q.pulls = opposite_pulls(self == 0 ? -on_other : on_other, where, positions);
  }
  return q;
}

/// What dot(direction, x) is at most over the part of a ball about the origin below a plane, for unit vectors; where
/// planes may be off by `rounding`, no less than that. From -r to r the offset leaves something of the ball.
double reach_of_cap(double r, Vec3 normal, double offset, Vec3 direction, double rounding) {
  const double t = offset + rounding, along = dot(direction, normal);
  if (r * along <= t) return r + rounding;
  const double disc = std::sqrt(std::max(0.0, (r - t) * (r + t)));
  return t * along + disc * norm(direction - along * normal) + 2 * rounding;
}

/// An upper bound, no lower than it takes to be `enough`, of dot(direction, x) over the part of `body` below the plane,
/// about its centre: by weak duality, reach(direction − λ normal) + λ offset for any λ >= 0, a convex function of λ.
double reach_below(const Revolved& body, Vec3 normal, double offset, Vec3 direction, double rounding, double enough) {
  if (body.round && body.half_length == 0) return reach_of_cap(body.radius, normal, offset, direction, rounding);
  const auto bound = [&](double lambda) {
    return body.reach(direction - lambda * normal) + lambda * offset + (1 + lambda) * rounding;
  };
  constexpr double kGolden = 0.6180339887498949;
  double low = 0, high = 4;
  while (high < 1e6 && bound(high) < bound(high / 2)) high *= 2;
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double at_left = bound(left), at_right = bound(right);
  for (int i = 0; i < 48 && std::min(at_left, at_right) > enough; ++i) {
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
  double layers = 0;  ///< of rounding that others may cut off
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
  double layers = 0;
  for (const Plane* plane : cutting) {
    if (plane == deepest) continue;
    const double offset = -signed_distance(*plane, body.centre);
    const double deepest_offset = -signed_distance(*deepest, body.centre);
    const double reach = reach_below(body, deepest->normal, deepest_offset, plane->normal, rounding, offset);
    if (reach > offset + 2 * rounding) return std::nullopt;
    if (reach > offset) layers += 4;  // it may cut off a layer of rounding
  }
  return OnlyCut{deepest, layers};
}

/// A plane of a body's, in its own coordinates; nothing where corners of a hull's facet miss it.
std::optional<WidePlane> own_plane(const Shape& shape, int f) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&shape)) {
    const DoubleDouble length = norm(wide(half->given_normal));
    const bool as_given = norm2(half->plane.normal - half->given_normal) == 0;
    // A normal that is unit but for its last bits stands for its direction, and the offset is along that.
    return WidePlane{unit(wide(half->given_normal)),
                     DoubleDouble{as_given ? half->plane.offset : half->given_offset} / length};
  }
  if (const Box* box = std::get_if<Box>(&shape)) {
    const Plane plane = side(*box, f);
    return WidePlane{wide(plane.normal), {plane.offset}};
  }
  const HullData& hull = *std::get<Hull>(shape).data;
  const auto [a, b, c] = hull.facet_corners[f];
  if (a < 0) return std::nullopt;
  const WideVector normal = unit(wide_normal(hull.corners[a], hull.corners[b], hull.corners[c]));
  return WidePlane{normal, dot(normal, wide(hull.corners[a]))};
}

WideMatrix rotation_of(const Placed& body) {
  if (unturned(body.orientation)) return {{{1}, {}, {}}, {{}, {1}, {}}, {{}, {}, {1}}};
  return wide_rotation(body.orientation);
}

/// The direction of a capsule's or a cylinder's axis in the world.
WideVector axis_of(const Placed& body) {
  const WideMatrix turn = rotation_of(body);
  return {turn.row0.z, turn.row1.z, turn.row2.z};
}

/// Where a body is in the own coordinates of another.
struct WideSeen {
  WideVector centre, axis;
};
WideSeen seen_from(const Placed& other, const Placed& body) {
  const WideMatrix turn = rotation_of(other);
  WideSeen seen{apply_transposed(turn, wide_difference(body.position, other.position)), {}};
  if (const HullData* hull = polytope_of(other.shape)) seen.centre = seen.centre - wide(hull->origin);
  if (std::holds_alternative<Capsule>(body.shape) || std::holds_alternative<Cylinder>(body.shape)) {
    seen.axis = apply_transposed(turn, axis_of(body));
  }
  return seen;
}

/// The body where at most one of the planes cuts off anything that the others leave.
std::optional<Measures> cut_by_polytope(const Revolved& body, const Placed& placed, const Placed& other,
                                        std::span<const Plane> planes, int self, double rounding, Vec3 reference,
                                        const std::array<Vec3, 2>& positions) {
  const auto found = only_cut(body, planes, rounding);
  if (!found) return std::nullopt;
  const Vec3 normal = found->plane->normal;
  if (const auto plane = own_plane(other.shape, static_cast<int>(found->plane - planes.data()))) {
    const WideSeen seen = seen_from(other, placed);
    const Cut cut = cut_of(body, seen.centre, seen.axis, *plane);
    return cut_by_plane(body, cut, normal, self, found->layers * rounding, reference, positions);
  }
  const Cut cut = cut_of(body, wide(body.centre), wide(body.axis), {wide(normal), {found->plane->offset}});
  return cut_by_plane(body, cut, normal, self, (1 + found->layers) * rounding, reference, positions);
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
  q.volume_error = (1 + cut->layers) * rounding * q.area + 2 * kSummation * q.volume;
  if (!whole) {
    const Vec3 force = turn * on_other, where = centre + turn * scaled(half_axes, offset * normal);
    q.pulls = opposite_pulls(self == 0 ? -force : force, where, positions);
  }
  return q;
}

/// A section, seen across the plane of symmetry: along that, and of its width.
struct Section {
  double area = 0, first = 0, along = 0, across = 0;  ///< ∫ 1, p, p² and z² dA

  /// A strip of that area at p, `half` as wide as that to either side.
  void add(double strip, double p, double half) {
    area += strip, first += strip * p, along += strip * p * p, across += strip * half * half / 3;
  }
};

/// Of the side of a cylinder, as in cylinder_below(): p counts from under the lowest point of its lower end, plus
/// `from`.
void add_side(double r, double h, const Cut& cut, double from, Section& section) {
  const double sine = cut.sine, cosine = cut.cosine, wide = 2 * r * cosine;
  if (cut.leave <= 0 || cut.enter >= wide) return;
  const double start = cut.enter <= 0 ? 0 : cut.enter / cosine;
  if (sine == 0) {
    const double half = std::sqrt(std::max(0.0, start * (2 * r - start))), area = 4 * h * half;
    section.add(area, from + h, half);
    section.along += area * h * h / 3;
    return;
  }
  const double length = cut.enter <= 0 ? cut.leave / sine : 2 * h;
  const double full = cut.enter <= 0 ? 0 : angle_at(r, start), rest = kPi - full;
  const double more = (cut.enter <= 0 ? cut.leave : 2 * sine * h) / cosine;
  const double width = cut.leave >= wide ? rest : std::min(rest, angle_between(r, start, more));
  integrate(full, width, [&](double angle, double advance, double weight) {
    const double half = r * std::sin(angle), up = 2 * r * std::sin(angle / 2) * std::sin(angle / 2);
    const double risen = 2 * r * std::sin(angle - advance / 2) * std::sin(advance / 2);
    const double here = std::max(0.0, length - cosine / sine * risen);
    section.add(weight * 2 * half * half / sine, from + here * cosine - up * sine, half);
  });
}

/// Of a half ball, as in half_ball_below(), which looks along `side`; the ball's own section is about p = `from`.
void add_end(double r, double sine, double cosine, double t, double height, double edge, double side, double from,
             Section& section) {
  if (height <= 0 || t >= r) return;
  const double radius = std::sqrt((r - t) * height);
  double half_angle = kPi;
  if (edge > 0 && t < r * cosine) half_angle = std::atan2(std::sqrt((r * cosine - t) * edge), -t * sine);
  else if (t * sine < 0) return;
  integrate(0, half_angle, [&](double angle, double, double weight) {
    const double half = radius * std::sin(angle);
    section.add(weight * 2 * half * half, from + side * radius * std::cos(angle), half);
  });
}

// ----------------------------------------------------------------------------------------------------------------- lens

/// A ball, or the end of a capsule, where dot(outward, x − centre) >= 0; every side of a ball is one.
struct End {
  Vec3 centre, outward;
};

/// How far the cap dot(normal, x − centre) <= offset of a ball keeps to the outer side of an end, at least.
double clearance(const End& end, Vec3 centre, double radius, Vec3 normal, double offset, double rounding) {
  return dot(end.outward, centre - end.centre) - reach_of_cap(radius, normal, offset, -end.outward, rounding);
}

/// The lens of two balls: cap of a towards b, cap of b towards a. `between` leads from a to b, and ends may be off by
/// the rounding.
std::optional<Measures> lens(Vec3 a, double ra, Vec3 b, double rb, const WideVector& between, double rounding,
                             Vec3 reference, std::span<const End> ends, const std::array<Vec3, 2>& positions) {
  const DoubleDouble distance = norm(between), wider = two_sum(ra, -rb), depth = two_sum(ra, rb) - distance;
  if (!(depth.head > 0)) return std::nullopt;
  const Vec3 towards = distance.head > 0 ? rounded(between / distance) : Vec3{1, 0, 0};
  double height_a = 0, height_b = 0;
  if (!(distance > abs(wider))) {
    (ra <= rb ? height_a : height_b) = 2 * std::min(ra, rb);
  } else {
    // The smaller by the formula, the other as the rest: a circle misplaced by rounding then moves no volume.
    const bool a_higher = wider.head < 0;
    const DoubleDouble less = depth * (distance - abs(wider)) / (DoubleDouble{2} * distance);
    height_a = (a_higher ? depth - less : less).head, height_b = (a_higher ? less : depth - less).head;
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
  q.volume_error = kSummation * q.volume;
  const double disc = std::max(cap_a.flat_area, cap_b.flat_area);
  if (disc > 0) q.pulls = opposite_pulls(disc * towards, circle, positions);
  return q;
}

/// Where every point of the common set lies beyond the ends of both bodies, the ends are all that matters: the set is
/// connected, and around the lens there is nothing else of them.
std::optional<Measures> lens_of_ends(const Revolved& a, const Placed& placed_a, const Revolved& b,
                                     const Placed& placed_b, double rounding, Vec3 reference,
                                     const std::array<Vec3, 2>& positions) {
  std::vector<End> ends;
  WideVector between = wide_difference(placed_b.position, placed_a.position);
  // The end of a body that is nearer to the other, and how far it is from the body's centre.
  const auto end = [&](const Revolved& body, const Placed& placed, Vec3 other, double side) {
    if (body.half_length == 0) return body.centre;
    const bool back = dot(body.axis, other - body.centre) < 0;
    const double along = back ? -body.half_length : body.half_length;
    between = between + side * along * axis_of(placed);
    ends.push_back({body.centre + along * body.axis, back ? -body.axis : body.axis});
    return ends.back().centre;
  };
  const Vec3 centre_a = end(a, placed_a, b.centre, -1), centre_b = end(b, placed_b, a.centre, 1);
  return lens(centre_a, a.radius, centre_b, b.radius, between, rounding, reference, ends, positions);
}

// ---------------------------------------------------------------------------------------------------------------- sides

/// Of what is shared, along `normal` from the first body's axis, a point of which is `foot`, to the second.
Measures of_sides(const SideContact& contact, Vec3 foot, Vec3 normal, double twist, Vec3 reference,
                  const std::array<Vec3, 2>& positions) {
  Measures q = by_formula();
  q.way = Way::kSlicing;
  q.volume = contact.volume, q.area = contact.area;
  q.volume_error = kSummation * q.volume;
  q.centroid = reference + (foot + contact.height * normal);
  q.pulls = opposite_pulls(contact.force * normal, foot, positions);
  q.pulls[0].moment += twist * normal, q.pulls[1].moment += -twist * normal;
  return q;
}

/// Less of a length than that from an end, a contact is not at the side.
constexpr double kEndMargin = 1e-9;

bool shallow_at_sides(double r, double s, DoubleDouble depth) {
  return depth.head > 0 && depth.head <= kShallowSides * std::min(r, s);
}

/// A ball, or the end of a capsule that is nearer, at the side of another capsule or a cylinder, far from the ends of
/// that and from the other side of the plane through the capsule's end.
std::optional<Measures> ball_beside(const Revolved& ball, const Placed& placed_ball, const Revolved& body,
                                    const Placed& placed_body, Vec3 reference, const std::array<Vec3, 2>& positions) {
  const double r = body.radius, s = ball.radius, h = body.half_length;
  const auto along_body = [&](Vec3 point) { return dot(point - body.centre, body.axis); };
  const auto from_axis = [&](Vec3 point) { return norm(point - body.centre - along_body(point) * body.axis); };
  double side = 0;
  Vec3 centre = ball.centre;
  if (ball.half_length > 0) {
    const Vec3 arm = ball.half_length * ball.axis;
    side = from_axis(ball.centre + arm) < from_axis(ball.centre - arm) ? 1 : -1;
    centre += side * arm;
  }
  const double along = along_body(centre);
  if (!(std::abs(along) < h && from_axis(centre) < r + s)) return std::nullopt;
  const WideVector axis = axis_of(placed_body);
  WideVector between = wide_difference(placed_ball.position, placed_body.position);
  if (side != 0) between = between + side * ball.half_length * axis_of(placed_ball);
  const WideVector out = between - dot(between, axis) * axis;
  const DoubleDouble distance = norm(out), depth = two_sum(r, s) - distance;
  if (!shallow_at_sides(r, s, depth)) return std::nullopt;
  const double reach = reach_of_ball(s, depth.head);
  if (!(std::abs(along) + reach < h - kEndMargin * (h + r))) return std::nullopt;
  const Vec3 normal = rounded(out / distance);
  // All that is shared is beyond the cylinder's tangent plane.
  const double margin = kEndMargin * (ball.half_length + s);
  if (side != 0 && !(reach_of_cap(s, normal, depth.head - s, -side * ball.axis, margin) < 0)) return std::nullopt;
  const SideContact contact = ball_at_side(r, s, distance.head, depth.head);
  return of_sides(contact, body.centre + along * body.axis, normal, 0, reference, positions);
}

/// The sides of two capsules or cylinders that cross far from all ends.
std::optional<Measures> sides_of_two(const Revolved& a, const Placed& placed_a, const Revolved& b,
                                     const Placed& placed_b, Vec3 reference, const std::array<Vec3, 2>& positions) {
  const double r = a.radius, s = b.radius;
  // Where the axes are nearest to each other, along each, as far as doubles know.
  const Vec3 plain = b.centre - a.centre, across = cross(a.axis, b.axis);
  const double cosine = dot(a.axis, b.axis), sine2 = norm2(across);
  const double on_a = dot(plain, a.axis), on_b = dot(plain, b.axis);
  if (!(sine2 > 0)) return std::nullopt;
  const double along_a = (on_a - cosine * on_b) / sine2, along_b = (cosine * on_a - on_b) / sine2;
  if (!(std::abs(along_a) < a.half_length && std::abs(along_b) < b.half_length)) return std::nullopt;
  const WideVector between = wide_difference(placed_b.position, placed_a.position);
  const WideVector common = cross(axis_of(placed_a), axis_of(placed_b));
  const DoubleDouble wide_sine = norm(common), signed_distance_of_axes = dot(between, common) / wide_sine;
  const DoubleDouble distance = abs(signed_distance_of_axes), depth = two_sum(r, s) - distance;
  if (!shallow_at_sides(r, s, depth)) return std::nullopt;
  const double sine = wide_sine.head, turn = std::abs(cosine);
  const double reach_a = reach_of_crossing(r, s, depth.head, sine, turn);
  const double reach_b = reach_of_crossing(s, r, depth.head, sine, turn);
  if (!(std::abs(along_a) + reach_a < a.half_length - kEndMargin * (a.half_length + r) / sine2)) return std::nullopt;
  if (!(std::abs(along_b) + reach_b < b.half_length - kEndMargin * (b.half_length + s) / sine2)) return std::nullopt;
  const SideContact contact = sides_crossing(r, s, depth.head, sine);
  const bool turned = signed_distance_of_axes.head < 0;
  const Vec3 normal = rounded(common / wide_sine) * (turned ? -1.0 : 1.0);
  // The volume is inversely as the sine of the angle between the axes, which the first turns towards the second.
  const double twist = (turned ? -1 : 1) * contact.volume * cosine / sine;
  return of_sides(contact, a.centre + along_a * a.axis, normal, twist, reference, positions);
}

std::optional<Measures> sides(const Revolved& a, const Placed& placed_a, const Revolved& b, const Placed& placed_b,
                              Vec3 reference, const std::array<Vec3, 2>& positions) {
  std::optional<Measures> found;
  if (a.half_length > 0 && b.half_length > 0) found = sides_of_two(a, placed_a, b, placed_b, reference, positions);
  if (!found && a.half_length > 0 && b.round) found = ball_beside(b, placed_b, a, placed_a, reference, positions);
  if (found || b.half_length == 0 || !a.round) return found;
  found = ball_beside(a, placed_a, b, placed_b, reference, {positions[1], positions[0]});
  if (found) std::swap(found->pulls[0], found->pulls[1]);
  return found;
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

/// Of part of a ball about that centre, and its moments about any point, which is on the body number `self` of the
/// pair; the rest of its surface is the other's.
MeasuresAndInertia of_ball(const quadric::BallPart& part, const Moments& moments, Vec3 centre, const Placed& other,
                           int self, double rounding, Vec3 reference, const std::array<Vec3, 2>& positions) {
  const Mat3& rotation = other.pose.rotation;
  Measures q = by_formula();
  q.facets_touched = part.faces;
  q.volume = part.volume, q.area = part.area;
  q.volume_error = part.error + rounding * part.area;
  q.centroid = reference + (centre + rotation * (part.first / part.volume));
  // The forces on the ball act towards its centre.
  const Vec3 on_other = rotation * part.flat;
  q.pulls = opposite_pulls(self == 0 ? -on_other : on_other, centre, positions);
  return {std::move(q), rotation * moments.inertia_about_centroid() * transposed(rotation)};
}

/// What a ball about that point, in the polyhedron's own coordinates, shares with it in a shallow contact.
std::optional<quadric::ShallowPart> shallow_part(const OwnPolyhedron& polyhedron, const Placed& other,
                                                 const WideVector& centre, double radius) {
  const auto plane = [&](int f) { return own_plane(other.shape, f); };
  auto part = quadric::measure_shallow_ball(*polyhedron, plane, centre, radius);
  if (part && !(part->volume > 0)) part.reset();
  return part;
}

std::optional<MeasuresAndInertia> shallow_ball_and_polyhedron(const Revolved& ball, const Placed& placed,
                                                              const Placed& other, int self, Vec3 reference,
                                                              const std::array<Vec3, 2>& positions) {
  const OwnPolyhedron polyhedron(other.shape);
  if ((*polyhedron).edges.empty()) return std::nullopt;
  const auto part = shallow_part(polyhedron, other, seen_from(other, placed).centre, ball.radius);
  if (!part) return std::nullopt;
  return of_ball(*part, part->about_apex, ball.centre, other, self, 0, reference, positions);
}

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
  auto found = of_ball(*part, *part, ball.centre, other, self, rounding, reference, positions);
  if (!std::isfinite(found.measures.volume_error)) return std::nullopt;
  return found;
}

/// The end of a capsule in a shallow contact, where it shares nothing else with a polyhedron.
std::optional<MeasuresAndInertia> end_and_polyhedron(const Revolved& capsule, const Placed& placed, const Placed& other,
                                                     int self, Vec3 reference, const std::array<Vec3, 2>& positions) {
  const OwnPolyhedron polyhedron(other.shape);
  if ((*polyhedron).edges.empty()) return std::nullopt;
  const Vec3 centre = apply_transposed(other.pose.rotation, capsule.centre - other.pose.translation);
  const Vec3 axis = apply_transposed(other.pose.rotation, capsule.axis);
  // Of the ends, the one that is nearer, by its distance from the farthest plane.
  double side = 0, nearest = capsule.radius;
  for (const double each : {1.0, -1.0}) {
    const Vec3 end = centre + each * capsule.half_length * axis;
    double over = -kInfinity;
    for (const Plane& plane : (*polyhedron).planes) over = std::max(over, signed_distance(plane, end));
    if (over < nearest) nearest = over, side = each;
  }
  if (side == 0) return std::nullopt;
  const WideSeen seen = seen_from(other, placed);
  const WideVector end = seen.centre + side * capsule.half_length * seen.axis;
  const auto part = shallow_part(polyhedron, other, end, capsule.radius);
  if (!part) return std::nullopt;
  // All of it is farther along the way to the apex than that, but for how well doubles know the apex.
  constexpr double kApex = 1e-7;
  const double distance = norm(part->apex), r = capsule.radius;
  if (!(reach_of_cap(r, part->apex / -distance, -distance, -side * axis, kApex * r) < 0)) return std::nullopt;
  return of_ball(*part, part->about_apex, capsule.centre + side * capsule.half_length * capsule.axis, other, self, 0,
                 reference, positions);
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
    const bool balls = smooth_a->half_length == 0 && smooth_b->half_length == 0;
    auto at_sides = balls ? std::nullopt : sides(*smooth_a, a, *smooth_b, b, reference, positions);
    if (at_sides || !smooth_a->round || !smooth_b->round) return without_inertia(at_sides);
    return without_inertia(lens_of_ends(*smooth_a, a, *smooth_b, b, rounding, reference, positions));
  }
  const bool first = smooth_a || stretched(a.shape);
  if (!first && !smooth_b && !stretched(b.shape)) return std::nullopt;
  const Placed &body = first ? a : b, &other = first ? b : a;
  if (smooth(other.shape)) return std::nullopt;
  const int self = first ? 0 : 1;
  const std::optional<Revolved>& revolved_body = first ? smooth_a : smooth_b;
  std::vector<Plane> planes;
  append_planes(other.shape, planes);
  double over = -kInfinity;  // how far the body's centre is outside
  for (Plane& plane : planes) {
    plane = other.pose * plane;
    over = std::max(over, signed_distance(plane, body.pose.translation));
  }
  if (!revolved_body) return without_inertia(cut_by_polytope(body, planes, self, rounding, reference, positions));
  std::optional<MeasuresAndInertia> best;
  const auto error = [](const MeasuresAndInertia& m) { return m.measures.volume_error / m.measures.volume; };
  const auto enough = [&](std::optional<MeasuresAndInertia> found) {
    if (found && !(best && error(*best) <= error(*found))) best = std::move(found);
    return best && error(*best) <= kEnoughOfRound;
  };
  const Revolved& whole = *revolved_body;
  const bool ball = whole.half_length == 0, outside = over > 0;
  const auto cut_by_one = [&] {
    return without_inertia(cut_by_polytope(whole, body, other, planes, self, rounding, reference, positions));
  };
  if (outside && ball && enough(shallow_ball_and_polyhedron(whole, body, other, self, reference, positions)))
    return best;
  if (outside && !ball && whole.round && enough(end_and_polyhedron(whole, body, other, self, reference, positions)))
    return best;
  // In a shallow contact, one plane is the rule.
  if (outside && enough(cut_by_one())) return best;
  if (enough(ball ? ball_and_polyhedron(whole, other, self, rounding, reference, positions)
                  : long_body_and_polyhedron(whole, body, other, self, rounding, reference, positions)))
    return best;
  if (!outside) enough(cut_by_one());
  return best;
}

std::optional<Patch> section_patch(const Placed& a, const Placed& b, Vec3 centroid, Vec3 area) {
  const bool first = std::holds_alternative<HalfSpace>(b.shape);
  const Placed &placed = first ? a : b, &other = first ? b : a;
  const std::optional<Revolved> body = revolved(placed);
  if (!body || !std::holds_alternative<HalfSpace>(other.shape)) return std::nullopt;
  const Vec3 normal = (other.pose * std::get<HalfSpace>(other.shape).plane).normal;
  const WideSeen seen = seen_from(other, placed);
  const Cut cut = cut_of(*body, seen.centre, seen.axis, *own_plane(other.shape, 0));
  const double r = body->radius, h = body->half_length, sine = cut.sine, cosine = cut.cosine;
  const bool ball = body->round && h == 0;
  const Vec3 axis = ball ? any_orthogonal(normal) : dot(body->axis, normal) < 0 ? -body->axis : body->axis;
  const Vec3 beside = normal - dot(normal, axis) * axis;
  const Vec3 sideways = ball ? normal : norm2(beside) > 0 ? unit(beside) : any_orthogonal(axis);
  // Under the centre of the lower end's ball, or under the lowest point of the lower end.
  const double under = cut.offset + sine * h;
  const Vec3 foot = body->centre - h * axis + (body->round ? under * normal : cut.leave * normal - r * sideways);
  Section section;
  if (ball) {
    add_end(r, 0, 1, cut.offset, cut.lower, 0, 1, 0, section);
  } else {
    add_side(r, h, cut, body->round ? r * sine : 0, section);
    if (body->round) {
      add_end(r, sine, cosine, cut.offset - sine * h, cut.upper, cut.enter, 1, 2 * h * cosine, section);
      add_end(r, -sine, cosine, under, cut.lower, cut.leave, -1, 0, section);
    }
  }
  PatchSums sums(centroid, area);
  const Vec3 along = cosine * axis - sine * sideways, across = cross(normal, along);
  const auto [one, p, pp, zz] = section;
  const double u0 = dot(foot - centroid, sums.u()), pu = dot(along, sums.u()), zu = dot(across, sums.u());
  const double v0 = dot(foot - centroid, sums.v()), pv = dot(along, sums.v()), zv = dot(across, sums.v());
  sums.add(one, one * u0 + p * pu, one * v0 + p * pv, (one * u0 + 2 * p * pu) * u0 + pp * pu * pu + zz * zu * zu,
           (one * u0 + p * pu) * v0 + p * pv * u0 + pp * pu * pv + zz * zu * zv,
           (one * v0 + 2 * p * pv) * v0 + pp * pv * pv + zz * zv * zv);
  return sums.patch();
}

}  // namespace overlapper
