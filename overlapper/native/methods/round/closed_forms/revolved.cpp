#include "methods/round/closed_forms/revolved.h"

#include <algorithm>

namespace overlapper::closed_forms {

std::optional<Revolved> revolved(const Placed& body) {
  const Vec3 axis = body.pose.rotation * Vec3{0, 0, 1};
  if (const Sphere* s = std::get_if<Sphere>(&body.shape))
    return Revolved{body.pose.translation, axis, s->radius, 0, true, &body};
  if (const Ellipsoid* e = std::get_if<Ellipsoid>(&body.shape); e && e->ball())
    return Revolved{body.pose.translation, axis, e->half_axes.x, 0, true, &body};
  if (const Capsule* c = std::get_if<Capsule>(&body.shape))
    return Revolved{body.pose.translation, axis, c->radius, c->length / 2, true, &body};
  if (const Cylinder* c = std::get_if<Cylinder>(&body.shape))
    return Revolved{body.pose.translation, axis, c->radius, c->length / 2, false, &body};
  return std::nullopt;
}

double reach_of_cap(double r, Vec3 normal, double offset, Vec3 direction, double rounding) {
  const double t = offset + rounding, along = dot(direction, normal);
  if (r * along <= t) return r + rounding;
  const double disc = std::sqrt(std::max(0.0, (r - t) * (r + t)));
  return t * along + disc * norm(direction - along * normal) + 2 * rounding;
}

std::optional<WidePlane> own_plane(const Shape& shape, int f) {
  if (const HalfSpace* half = std::get_if<HalfSpace>(&shape)) {
    const DoubleDouble length = norm(wide(half->given_normal));
    const bool as_given = norm2(half->plane.normal - half->given_normal) == 0;
    // A normal of nearly unit length stands for its direction, and the offset counts along that direction.
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

namespace {

WideMatrix rotation_of(const Placed& body) {
  if (unturned(body.orientation)) return {{{1}, {}, {}}, {{}, {1}, {}}, {{}, {}, {1}}};
  return wide_rotation(body.orientation);
}

}  // namespace

WideVector axis_of(const Placed& body) {
  const WideMatrix turn = rotation_of(body);
  return {turn.row0.z, turn.row1.z, turn.row2.z};
}

WideAxis seen_from(const Placed& other, const Revolved& body) {
  const WideMatrix turn = rotation_of(other);
  WideAxis seen{apply_transposed(turn, wide_difference(body.placed->position, other.position)), {}};
  if (const HullData* hull = polytope_of(other.shape)) seen.centre = seen.centre - wide(hull->origin);
  if (body.half_length > 0) seen.axis = apply_transposed(turn, axis_of(*body.placed));
  return seen;
}

}  // namespace overlapper::closed_forms
