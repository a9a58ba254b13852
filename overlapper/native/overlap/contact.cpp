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

double sum(Vec3 v) { return v.x + v.y + v.z; }

/// At least radius(), but faster.
double extent(const Shape& shape) {
  return ask(shape, [](const auto& s) { return s.loose_radius(); });
}

/// Rounding error of a depth or distance in doubles, in coordinates about one of the two bodies.
double rounding_between(const Placed& a, const Placed& b) {
  const double between = extent(a.shape) + extent(b.shape) + sum(abs(a.pose.translation - b.pose.translation));
  return rounding(reach(a, reach(b, between)));
}

Penetration parting(const Placed& a, const Placed& b, Vec3 reference, Vec3 hint, bool bounds = true) {
  const WideParting way = wide_parting(a, b, reference, hint, bounds);
  return {way.depth, way.normal};
}

Distance wide_distance(const Arrangement& at) {
  const std::vector<WideBody> bodies = at.wide_bodies();
  const WideGap gap = wide_gap(bodies[0], bodies[1], wide_rounding(bodies[0].reach() + bodies[1].reach()));
  return {gap.distance, gap.certified, gap.normal, rounded(gap.witness_a), rounded(gap.witness_b)};
}

/// The plane half-way between the supports along the normal; a half-space counts up to its witness point.
Plane half_way(const Placed& a, const Placed& b, Vec3 normal, const Distance& d, Vec3 reference) {
  const double level_a = dot(normal, bounded(a.shape) ? a.support(-normal) : d.witness_a);
  const double level_b = dot(normal, bounded(b.shape) ? b.support(normal) : d.witness_b);
  const double level = level_a / 2 + level_b / 2;
  return {normal, level + dot(normal, reference)};
}

/// The opposite without negative zeros.
Vec3 reversed(Vec3 v) { return Vec3{} - v; }

}  // namespace

bool in_doubt(double length, const Placed& a, const Placed& b) { return rounding_between(a, b) > kClear * length; }

bool has_curved_core(const Placed& a, const Placed& b) {
  return (has_curved_core(a.shape) || has_curved_core(b.shape)) && bounded(a.shape) && bounded(b.shape);
}

Penetration penetration_in_order(const Placed& a, const Placed& b) {
  const bool swapped = comes_before(b, a);
  const Placed &first = swapped ? b : a, &second = swapped ? a : b;
  const Vec3 reference = first.pose.translation;
  const Placed seen_first = first.seen_from(reference), seen_second = second.seen_from(reference);
  Penetration p = penetration(seen_first, seen_second);
  if (in_doubt(p.depth, seen_first, seen_second)) p = parting(seen_first, seen_second, reference, p.normal);
  if (swapped) p.normal = reversed(p.normal);
  return p;
}

Contact contact_of(const Arrangement& at, Status status, bool as_in_paper, bool doubtful) {
  const Placed &a = at.relative[0], &b = at.relative[1];
  Contact contact;
  if (status == Status::kOverlapping) {
    const bool curved = has_curved_core(a, b);
    Penetration p = curved ? parting(a, b, at.reference, some_way_out(a, b), false) : penetration(a, b);
    // If the cores nearly touch, the direction and the length of the way out are uncertain by more than rounding.
    const bool open = in_doubt(p.depth, a, b) || p.open > rounding_between(a, b);
    if (!curved && (doubtful || open)) p = parting(a, b, at.reference, p.normal);
    contact.depth = p.depth;
    contact.normal = p.normal;
  } else {
    Distance d = distance(a, b);
    if (in_doubt(d.gap, a, b)) d = wide_distance(at);
    contact.normal = d.normal;
    // If the bodies touch, which method "paper" may report as separated, the line between the witness points may be
    // only rounding. The way out is not.
    if ((status == Status::kTouching || as_in_paper) && !(d.gap > 0))
      contact.normal = parting(a, b, at.reference, penetration(a, b).normal).normal;
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

/// The larger of the two possible errors of a number that lies between two bounds.
double off(double stated, double lower, double upper) {
  const double most = std::max(stated - lower, upper - stated);
  return most > 0 ? up(most) : 0;
}

/// m: upper bound of the distance of a point outside a body from the body.
double outside(const Placed& body, Vec3 point) {
  const WideBody wide_body(body, wide(point));
  const WideBody at_point({Sphere(0), point, {}, {{}, point}}, wide(point));
  const double lost = 0x1p-94 * wide_body.reach();
  return std::max(0.0, wide_gap(at_point, wide_body, lost).most) + lost;
}

}  // namespace

ContactErrors errors_of(const Contact& contact, const Placed& a, const Placed& b, Status status) {
  const Vec3 reference = a.pose.translation;
  WideParting way = wide_parting(a.seen_from(reference), b.seen_from(reference), reference, contact.normal);
  ContactErrors errors;
  if (status != Status::kOverlapping) {
    const double beside = up(std::max(outside(a, contact.witness_a), outside(b, contact.witness_b)));
    const double between = norm(rounded(wide_difference(contact.witness_a, contact.witness_b))) * (1 + 0x1p-50);
    way.lower = std::max(way.lower, -up(between + 2 * beside));
    errors.witnesses = up(beside + std::max(0.0, between - std::max(0.0, -way.upper)));
  }
  errors.depth = off(contact.depth, std::max(0.0, way.lower), std::max(0.0, way.upper));
  errors.distance = off(contact.distance, std::max(0.0, -way.upper), std::max(0.0, -way.lower));
  return errors;
}

}  // namespace overlapper
