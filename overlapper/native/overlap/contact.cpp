#include "overlap/contact.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "distance/gjk.h"
#include "distance/penetration.h"
#include "distance/wide_gap.h"
#include "distance/wide_parting.h"
#include "geometry/rounding.h"
#include "geometry/thresholds.h"
#include "shapes/canonical_order.h"

namespace overlapper {
namespace {

/// The shortest way out along one of the normals or of those of the planes between which the deepest ball lies.
Penetration parting(const Arrangement& at, std::vector<Vec3> normals, const WideBall* ball) {
  const std::vector<WideBody> bodies = at.wide_bodies();
  if (ball)
    for (const auto& [plane, owner] : ball->cuts)
      if (owner >= 0) normals.push_back(owner == 0 ? -rounded(plane.normal) : rounded(plane.normal));
  Penetration least{std::numeric_limits<double>::infinity(), {}};
  for (Vec3 normal : normals) {
    const double depth = wide_depth(bodies[0], bodies[1], wide(normal));
    if (depth < least.depth) least = {depth, normal};
  }
  return least;
}

double up(double x) { return std::nextafter(x, std::numeric_limits<double>::infinity()); }

bool rim(const Placed& body) { return std::holds_alternative<Cylinder>(body.shape); }

/// True if doubles leave more of the depth in doubt than kClear.
bool in_doubt(double depth, const Placed& a, const Placed& b) {
  const double between = radius(a.shape) + radius(b.shape) + norm(a.pose.translation - b.pose.translation);
  return rounding(reach(a, reach(b, between))) > kClear * depth;
}

Penetration parting(const Placed& a, const Placed& b, Vec3 reference, Vec3 hint) {
  const WideParting way = wide_parting(WideBody(a, wide(reference)), WideBody(b, wide(reference)), hint);
  return {way.depth, way.normal};
}

Distance wide_distance(const Arrangement& at, double reach) {
  const std::vector<WideBody> bodies = at.wide_bodies();
  const WideGap gap = wide_gap(bodies[0], bodies[1], wide_rounding(reach));
  return {gap.distance, gap.certified, gap.normal, rounded(gap.witness_a), rounded(gap.witness_b)};
}

/// A plane half-way between the supports along the normal; a half-space reaches to its witness point.
Plane half_way(const Placed& a, const Placed& b, Vec3 normal, const Distance& d, Vec3 reference) {
  const double level_a = dot(normal, bounded(a.shape) ? a.support(-normal) : d.witness_a);
  const double level_b = dot(normal, bounded(b.shape) ? b.support(normal) : d.witness_b);
  const double level = level_a / 2 + level_b / 2;
  return {normal, level + dot(normal, reference)};
}

/// The opposite without negative zeros.
Vec3 reversed(Vec3 v) { return Vec3{} - v; }

}  // namespace

Penetration penetration_in_order(const Placed& a, const Placed& b) {
  const bool swapped = comes_before(b, a);
  const Placed &first = swapped ? b : a, &second = swapped ? a : b;
  const Vec3 reference = first.pose.translation;
  Penetration p = penetration(first.seen_from(reference), second.seen_from(reference));
  if (in_doubt(p.depth, first, second)) p = parting(first, second, reference, p.normal);
  if (swapped) p.normal = reversed(p.normal);
  return p;
}

Contact contact_of(const Arrangement& at, Status status, bool as_in_paper, const WideBall* wide_ball) {
  const Placed &a = at.relative[0], &b = at.relative[1];
  const auto reach = [&] { return std::max(magnitude(a), magnitude(b)); };
  Contact contact;
  if (status == Status::kOverlapping) {
    Penetration p = penetration(a, b);
    if (rim(a) || rim(b)) {
      if (wide_ball || p.depth <= doubt(reach())) p = parting(at, {p.normal}, wide_ball);
    } else if (wide_ball || in_doubt(p.depth, a, b)) {
      p = parting(a, b, at.reference, p.normal);
    }
    contact.depth = p.depth;
    contact.normal = p.normal;
  } else {
    Distance d = distance(a, b);
    const double size = reach();
    if (rounding(size) > kClear * d.gap && (bounded(a.shape) || bounded(b.shape))) d = wide_distance(at, size);
    contact.normal = d.normal;
    // Where the bodies touch, which method "paper" may call apart, the line between the witness points may be all
    // rounding; the way out is not.
    if ((status == Status::kTouching || as_in_paper) && !(d.gap > 0))
      contact.normal = parting(at, {penetration(a, b).normal}, wide_ball).normal;
    contact.distance = status == Status::kSeparated ? std::max(0.0, d.distance) : 0;
    contact.witness_a = d.witness_a + at.reference;
    contact.witness_b = d.witness_b + at.reference;
    contact.separating = half_way(a, b, contact.normal, d, at.reference);
  }
  if (at.order[0] == 1) {
    contact.normal = reversed(contact.normal);
    contact.separating = {contact.normal, -contact.separating.offset};
    std::swap(contact.witness_a, contact.witness_b);
  }
  return contact;
}

namespace {

/// Greatest of how far a number may be off that is known to lie between two others.
double off(double stated, double lower, double upper) {
  const double most = std::max(stated - lower, upper - stated);
  return most > 0 ? up(most) : 0;
}

/// m: no farther a point is outside of a body.
double outside(const Placed& body, Vec3 point) {
  const WideBody wide_body(body, wide(point));
  const WideBody at_point({Sphere{0}, point, {}, {{}, point}}, wide(point));
  const double lost = 0x1p-94 * wide_body.reach();
  return std::max(0.0, wide_gap(at_point, wide_body, lost).distance) + lost;
}

}  // namespace

ContactErrors errors_of(const Contact& contact, const Placed& a, const Placed& b, Status status) {
  const Vec3 reference = a.pose.translation;
  const WideParting way = wide_parting(WideBody(a, wide(reference)), WideBody(b, wide(reference)), contact.normal);
  ContactErrors errors;
  errors.depth = off(contact.depth, std::max(0.0, way.lower), std::max(0.0, way.upper));
  errors.distance = off(contact.distance, std::max(0.0, -way.upper), std::max(0.0, -way.lower));
  if (status == Status::kOverlapping) return errors;
  const double between = norm(rounded(wide_difference(contact.witness_a, contact.witness_b)));
  errors.witnesses = up(std::max(outside(a, contact.witness_a), outside(b, contact.witness_b)) +
                        std::max(0.0, between * (1 + 0x1p-50) - std::max(0.0, -way.upper)));
  return errors;
}

}  // namespace overlapper
