#include <cmath>

#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/quadric/ball.h"
#include "methods/round/quadric/cylinder.h"

namespace overlapper::closed_forms {
namespace {

/// If a part is more remote than this, slices give more accurate second moments.
constexpr double kRemote = 100;
/// If a corner is this near to the plane of an end, relative to the body's reach, slices measure the pair.
constexpr double kFlush = 1e-9;

/// Sums over the parts of a long body, about its centre, along its axes.
struct LongBodySums {
  Moments moments;
  double error = 0, area = 0;
  int faces = 0;
  Pull on_body{};
  PatchSums* patch = nullptr;  ///< the polyhedron's faces are added to it, if not null
  quadric::SectionView view{};

  void add_faces(const quadric::Rings& part, std::span<const quadric::Section> sections, Vec3 centre) {
    if (!patch) return;
    const quadric::SectionView about = view.about(centre, {});
    for (size_t f = 0; f < sections.size(); ++f)
      if (part.face(f)) about.add(sections[f], part.planes()[f].normal, *patch);
  }
};

/// Adds the common part of an infinite cylinder and a polyhedron that the planes of the ends have cut. False if this
/// part is uncertain.
bool add_middle(const quadric::Rings& part, const Revolved& body, double rounding, LongBodySums& sums) {
  if (part.empty()) return true;
  const auto middle = quadric::measure_cylinder(part, body.radius, rounding);
  if (!middle) return false;
  sums.error = middle->error, sums.faces = middle->faces;
  // The cuts are faces of a cylinder; they are inside a capsule.
  sums.area = body.round ? middle->area : middle->whole_area;
  sums.on_body = body.round ? middle->curved : Pull{-middle->flat.force, -middle->flat.moment};
  sums.moments += *middle;
  sums.add_faces(part, middle->sections, {});
  return true;
}

/// Adds the common part of the half ball about the height `end` and the rest of the polyhedron there. False if this
/// part is uncertain.
bool add_end(quadric::Rings& part, double end, const Revolved& body, LongBodySums& sums) {
  if (!part.cut(end, end < 0)) return false;
  if (part.empty()) return true;
  const quadric::Polyhedron rest = part.polyhedron();
  if (rest.edges.empty()) return false;
  const Vec3 centre{0, 0, end};
  const auto ball = quadric::measure_ball(rest, centre, body.radius, sums.patch != nullptr);
  if (!ball) return true;
  sums.error += ball->error, sums.area += ball->area, sums.faces += ball->faces;
  sums.moments += ball->seen_from(centre);
  sums.on_body.force += -ball->flat, sums.on_body.moment += cross(centre, -ball->flat);
  sums.add_faces(part, ball->sections, centre);
  return true;
}

/// Whether a corner is in the plane of an end, up to rounding. A cut there would leave slivers or duplicate faces.
bool flush(const quadric::Rings& polyhedron, const Revolved& body) {
  const double r = body.radius, h = body.half_length;
  for (const Vec3 corner : polyhedron.corners())
    if (std::abs(std::abs(corner.z) - h) <= kFlush * (r + h)) return true;
  return false;
}

/// Sums over the common part of a polyhedron and a cylinder, or a capsule as a cylinder and two half balls. The
/// polyhedron is in coordinates of the long body. False if a part is uncertain, or there is nothing.
bool add_all(const quadric::Rings& polyhedron, const Revolved& body, double rounding, LongBodySums& sums) {
  thread_local quadric::Rings part;
  if (flush(polyhedron, body)) return false;
  const double h = body.half_length;
  part = polyhedron;
  if (!part.cut(h, true) || !part.cut(-h, false) || !add_middle(part, body, rounding, sums)) return false;
  for (const double end : {h, -h}) {
    if (!body.round) break;
    part = polyhedron;
    if (!add_end(part, end, body, sums)) return false;
  }
  return sums.moments.volume > 0;
}

}  // namespace

std::optional<MeasuresAndInertia> long_body_in_polyhedron(const RoundPair& pair) {
  thread_local quadric::Rings polyhedron;
  const Pose &pose = pair.round_body().pose, &flat = pair.flat_body().pose;
  if (!polyhedron.become(pair.flat_body().shape, relative_pose(pose, flat))) return std::nullopt;
  LongBodySums sums;
  if (!add_all(polyhedron, *pair.revolved[pair.self], pair.rounding, sums)) return std::nullopt;
  Measures q = measures_in_closed_form();
  q.volume = sums.moments.volume, q.area = sums.area, q.facets_touched = sums.faces;
  q.volume_error = sums.error + pair.rounding * q.area;
  if (!std::isfinite(q.volume_error)) return std::nullopt;
  q.centroid = pair.reference + pose * (sums.moments.first / q.volume);
  const Pull turned{pose.rotation * sums.on_body.force, pose.rotation * sums.on_body.moment};
  for (const int i : {0, 1}) {
    const double side = i == pair.self ? 1 : -1;
    q.pulls[i] = about({side * turned.force, side * turned.moment}, pose.translation, pair.positions[i]);
  }
  std::optional<Mat3> inertia;
  if (sums.moments.remoteness() < kRemote)
    inertia = pose.rotation * sums.moments.inertia_about_centroid() * transposed(pose.rotation);
  return MeasuresAndInertia{std::move(q), inertia};
}

bool add_sections_of_long_body(const RoundPair& pair, PatchSums& patch) {
  thread_local quadric::Rings polyhedron;
  const Pose &pose = pair.round_body().pose, &flat = pair.flat_body().pose;
  if (!polyhedron.become(pair.flat_body().shape, relative_pose(pose, flat))) return false;
  PatchSums with = patch;
  LongBodySums sums;
  sums.patch = &with, sums.view = quadric::SectionView(patch, pose.translation, pose.rotation, pair.self == 1);
  if (!add_all(polyhedron, *pair.revolved[pair.self], pair.rounding, sums)) return false;
  if (!(sums.error + pair.rounding * sums.area <= kSureOfSections * sums.moments.volume)) return false;
  patch = with;
  return true;
}

}  // namespace overlapper::closed_forms
