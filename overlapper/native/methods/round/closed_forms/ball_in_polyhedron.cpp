#include <algorithm>
#include <limits>

#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/own_polyhedron.h"
#include "methods/round/quadric/shallow_ball.h"

namespace overlapper::closed_forms {
namespace {

/// Measures of part of a ball. Its curved surface belongs to the round body, and its faces belong to the polyhedron.
/// `moments` are the second moments of the part about any point. Planes may be off by `rounding`.
MeasuresAndInertia measures_of(const quadric::BallPart& part, const Moments& moments, const RoundPair& pair,
                               Vec3 centre, double rounding) {
  const Mat3& rotation = pair.flat_body().pose.rotation;
  Measures q = measures_in_closed_form();
  q.facets_touched = part.faces;
  q.volume = part.volume, q.area = part.area;
  q.volume_error = part.error + rounding * part.area;
  q.centroid = pair.reference + (centre + rotation * (part.first / part.volume));
  // The forces on the ball act towards its centre.
  q.pulls = pulls_of_flat(pair, rotation * part.flat, centre);
  return {std::move(q), rotation * moments.inertia_about_centroid() * transposed(rotation)};
}

/// A polyhedron with exact numbers of its own, about a centre in its own coordinates.
class ExactAbout final : public quadric::WidePlaces {
 public:
  ExactAbout(const quadric::Polyhedron& polyhedron, const Shape& shape, const WideVector& centre)
      : polyhedron_(polyhedron), shape_(shape), centre_(centre) {}

  WideVector corner(int i) const override { return wide(polyhedron_.corners[i]) - centre_; }
  WideVector between(int from, int to) const override {
    return wide_difference(polyhedron_.corners[to], polyhedron_.corners[from]);
  }
  std::optional<quadric::PlaneAbout> plane(int f) const override {
    const auto own = unit_facet(shape_, f);
    if (!own) return std::nullopt;
    return quadric::PlaneAbout{own->normal, -signed_distance(*own, centre_)};
  }

 private:
  const quadric::Polyhedron& polyhedron_;
  const Shape& shape_;
  const WideVector& centre_;
};

/// The common part of a polyhedron and a ball in a shallow contact. The ball's centre is in the polyhedron's own
/// coordinates.
std::optional<quadric::ShallowPart> shallow_part(const OwnPolyhedron& polyhedron, const Placed& other,
                                                 const WideVector& centre, double radius) {
  auto part =
      quadric::measure_shallow_ball(*polyhedron, ExactAbout(*polyhedron, other.shape, centre), rounded(centre), radius);
  if (part && !(part->volume > 0)) part.reset();
  return part;
}

/// Maps a point of the pair's coordinates to the flat body's own coordinates.
Vec3 in_flat(const RoundPair& pair, Vec3 point) {
  const Pose& pose = pair.flat_body().pose;
  return apply_transposed(pose.rotation, point - pose.translation);
}

/// 1 or -1 for the end of a capsule that is nearer to a polyhedron, measured by the farthest plane. 0 if neither end is
/// nearer than the radius. Centre and axis are in the polyhedron's coordinates.
double nearer_end(const quadric::Polyhedron& polyhedron, const Revolved& capsule, Vec3 centre, Vec3 axis) {
  double side = 0, nearest = capsule.radius;
  for (const double each : {1.0, -1.0}) {
    const Vec3 end = centre + each * capsule.half_length * axis;
    double over = -std::numeric_limits<double>::infinity();
    for (const Plane& plane : polyhedron.planes) over = std::max(over, signed_distance(plane, end));
    if (over < nearest) nearest = over, side = each;
  }
  return side;
}

}  // namespace

std::optional<MeasuresAndInertia> shallow_ball_in_polyhedron(const RoundPair& pair) {
  const Revolved& ball = *pair.revolved[pair.self];
  const OwnPolyhedron polyhedron(pair.flat_body().shape);
  if ((*polyhedron).edges.empty()) return std::nullopt;
  const auto part = shallow_part(polyhedron, pair.flat_body(), seen_from(pair.flat_body(), ball).centre, ball.radius);
  if (!part) return std::nullopt;
  return measures_of(*part, part->about_apex, pair, ball.centre, 0);
}

/// If at most one plane reaches the ball, a cap has fewer terms.
std::optional<MeasuresAndInertia> ball_in_polyhedron(const RoundPair& pair) {
  const Revolved& ball = *pair.revolved[pair.self];
  const OwnPolyhedron polyhedron(pair.flat_body().shape);
  if ((*polyhedron).edges.empty()) return std::nullopt;
  const Vec3 centre = in_flat(pair, ball.centre);
  const auto reaches = [&](const Plane& plane) {
    return -signed_distance(plane, centre) < ball.radius + pair.rounding;
  };
  if (std::ranges::count_if((*polyhedron).planes, reaches) < 2) return std::nullopt;
  const auto part = quadric::measure_ball(*polyhedron, centre, ball.radius);
  if (!part || !(part->volume > 0)) return std::nullopt;
  auto found = measures_of(*part, *part, pair, ball.centre, pair.rounding);
  if (!std::isfinite(found.measures.volume_error)) return std::nullopt;
  return found;
}

bool add_sections_of_ball(const RoundPair& pair, PatchSums& patch) {
  const Revolved& ball = *pair.revolved[pair.self];
  const OwnPolyhedron polyhedron(pair.flat_body().shape);
  if ((*polyhedron).edges.empty()) return false;
  const auto part = quadric::measure_ball(*polyhedron, in_flat(pair, ball.centre), ball.radius, true);
  if (!part || !(part->error + pair.rounding * part->area <= kSureOfSections * part->volume)) return false;
  const quadric::SectionView view(patch, ball.centre, pair.flat_body().pose.rotation, pair.self == 1);
  for (size_t f = 0; f < part->sections.size(); ++f) view.add(part->sections[f], (*polyhedron).planes[f].normal, patch);
  return true;
}

std::optional<MeasuresAndInertia> shallow_end_in_polyhedron(const RoundPair& pair) {
  const Revolved& capsule = *pair.revolved[pair.self];
  const Placed& flat = pair.flat_body();
  const OwnPolyhedron polyhedron(flat.shape);
  if ((*polyhedron).edges.empty()) return std::nullopt;
  const Vec3 centre = in_flat(pair, capsule.centre), axis = apply_transposed(flat.pose.rotation, capsule.axis);
  const double side = nearer_end(*polyhedron, capsule, centre, axis), r = capsule.radius;
  if (side == 0) return std::nullopt;
  const WideAxis seen = seen_from(flat, capsule);
  const auto part = shallow_part(polyhedron, flat, seen.centre + side * capsule.half_length * seen.axis, r);
  if (!part) return std::nullopt;
  // The whole part is farther than `distance` in the direction of the apex. The error of the apex in doubles is kApex.
  constexpr double kApex = 1e-7;
  const double distance = norm(part->apex);
  if (!(reach_of_cap(r, part->apex / -distance, -distance, -side * axis, kApex * r) < 0)) return std::nullopt;
  return measures_of(*part, part->about_apex, pair, capsule.centre + side * capsule.half_length * capsule.axis, 0);
}

}  // namespace overlapper::closed_forms
