#include <algorithm>
#include <cfloat>

#include "methods/round/closed_forms/closed_forms.h"
#include "methods/round/closed_forms/only_cut.h"
#include "methods/round/closed_forms/own_polyhedron.h"
#include "methods/round/closed_forms/revolved_part.h"
#include "methods/round/quadric/shallow_ball.h"
#include "methods/round/quadric/stretch.h"

namespace overlapper::closed_forms {
namespace {

/// The error of a point or a plane that doubles map, relative to the size of its terms.
constexpr double kMapping = 8 * DBL_EPSILON;
/// The rounding of the volume of a cap and of its image.
constexpr double kImage = 16 * DBL_EPSILON;

WideVector times(Vec3 by, const WideVector& v) {
  return {DoubleDouble{by.x} * v.x, DoubleDouble{by.y} * v.y, DoubleDouble{by.z} * v.z};
}
WideVector over(const WideVector& v, Vec3 by) {
  return {v.x / DoubleDouble{by.x}, v.y / DoubleDouble{by.y}, v.z / DoubleDouble{by.z}};
}
Vec3 over(Vec3 v, Vec3 by) { return {v.x / by.x, v.y / by.y, v.z / by.z}; }

WideMatrix transposed(const WideMatrix& m) {
  return {{m.row0.x, m.row1.x, m.row2.x}, {m.row0.y, m.row1.y, m.row2.y}, {m.row0.z, m.row1.z, m.row2.z}};
}

/// The flat body of a pair where the ellipsoid is the unit ball about the origin, along the ellipsoid's axes.
class SeenFlat final : public quadric::WidePlaces {
 public:
  explicit SeenFlat(const RoundPair& pair)
      : flat_(pair.flat_body()), half_axes_(stretched(pair.round_body().shape)->half_axes), own_(flat_.shape) {
    const Placed& ellipsoid = pair.round_body();
    const WideMatrix of_flat = wide_turn(flat_), axes = transposed(wide_turn(ellipsoid));
    turn_ = {apply_transposed(of_flat, axes.row0), apply_transposed(of_flat, axes.row1),
             apply_transposed(of_flat, axes.row2)};
    centre_ = apply_transposed(of_flat, wide_difference(ellipsoid.position, flat_.position));
    if (const HullData* hull = polytope_of(flat_.shape)) centre_ = centre_ - wide(hull->origin);
    plain_turn_ = {rounded(turn_.row0), rounded(turn_.row1), rounded(turn_.row2)}, plain_centre_ = rounded(centre_);
    append_planes(flat_.shape, planes_);
    double reach2 = 0;
    for (Plane& plane : planes_) plane = into_ball(plane);
    for (const Vec3 corner : (*own_).corners) {
      corners_.push_back(over(plain_turn_ * (corner - plain_centre_), half_axes_));
      reach2 = std::max(reach2, norm2(corner));
    }
    misplaced_ =
        kMapping * (std::sqrt(reach2) + norm(plain_centre_)) / std::min({half_axes_.x, half_axes_.y, half_axes_.z});
  }

  WideVector corner(int i) const override { return into_ball(wide((*own_).corners[i]) - centre_); }
  WideVector between(int from, int to) const override {
    return into_ball(wide_difference((*own_).corners[to], (*own_).corners[from]));
  }
  std::optional<quadric::PlaneAbout> plane(int f) const override {
    const auto own = unit_facet(flat_.shape, f);
    if (!own) return std::nullopt;
    const WideVector normal = times(half_axes_, turn_ * own->normal);
    const DoubleDouble length = norm(normal);
    return quadric::PlaneAbout{normal / length, -signed_distance(*own, centre_) / length};
  }

  quadric::Polyhedron polyhedron() const { return {corners_, planes_, (*own_).edges, planes_.size(), misplaced_}; }
  double misplaced() const { return misplaced_; }  ///< error of a corner or a plane of the polyhedron

 private:
  WideVector into_ball(const WideVector& own) const { return over(turn_ * own, half_axes_); }
  Plane into_ball(const Plane& own) const {
    const Vec3 normal = scaled(half_axes_, plain_turn_ * own.normal);
    const double length = norm(normal);
    return {normal / length, -signed_distance(own, plain_centre_) / length};
  }

  const Placed& flat_;
  Vec3 half_axes_;
  OwnPolyhedron own_;
  WideMatrix turn_;    ///< from the flat body's own axes to the ellipsoid's
  WideVector centre_;  ///< of the ellipsoid, in the flat body's own coordinates
  Mat3 plain_turn_;
  Vec3 plain_centre_;
  std::vector<Vec3> corners_;
  std::vector<Plane> planes_;
  double misplaced_;
};

/// The image of a part of the unit ball about a point of the ball.
struct Image {
  Vec3 about;
  double volume;
  Vec3 first;            ///< ∫ x dV about the point
  Vec3 force, moment;    ///< of the faces, in the ellipsoid's axes, about the image of the point
  double flat_area = 0;  ///< m², of the faces in the world
  int faces = 0;
  double area = 0;  ///< of the part of the ball
};

/// `error`: error of the volume of the ball's part. `rounding` bounds the error of planes in the world.
Measures measures_of(const Image& image, double error, const RoundPair& pair, const quadric::Stretch& stretch,
                     double rounding) {
  const Placed& body = pair.round_body();
  const auto placed = [&](Vec3 of_ball) {
    return body.pose.translation + body.pose.rotation * scaled(stretch.half_axes, of_ball);
  };
  Measures q = measures_in_closed_form();
  // This is an upper bound, until the area is measured.
  q.area_known = false, q.area = max_component(stretch.cofactors) * image.area;
  q.facets_touched = image.faces;
  q.volume = stretch.volume * image.volume;
  q.volume_error = stretch.volume * error + rounding * image.flat_area + kImage * q.volume;
  q.centroid = pair.reference + placed(image.about + image.first / image.volume);
  const Pull on_flat{body.pose.rotation * image.force, body.pose.rotation * image.moment};
  for (const int i : {0, 1}) {
    const double side = i == pair.self ? -1 : 1;
    q.pulls[i] = about({side * on_flat.force, side * on_flat.moment}, placed(image.about), pair.positions[i]);
  }
  return q;
}

/// Adds the faces of a part, whose sections are about the image's point.
void add_faces(const SeenFlat& seen, const quadric::BallPart& part, const quadric::Stretch& stretch, Image& image) {
  const auto planes = seen.polyhedron().planes;
  for (size_t f = 0; f < part.sections.size(); ++f) {
    const quadric::Section& section = part.sections[f];
    if (section.area == 0) continue;
    const Vec3 normal = stretch.normal(planes[f].normal);
    image.force += section.area * normal;
    image.moment += cross(scaled(stretch.half_axes, section.first), normal);
    image.flat_area += section.area * norm(normal);
  }
  image.faces = part.faces, image.area = part.area;
}

Mat3 inertia_of(const Moments& moments, const RoundPair& pair, const quadric::Stretch& stretch) {
  const Mat3& turn = pair.round_body().pose.rotation;
  return turn * stretch.moments(moments).inertia_about_centroid() * overlapper::transposed(turn);
}

std::optional<MeasuresAndInertia> shallow(const SeenFlat& seen, const RoundPair& pair,
                                          const quadric::Stretch& stretch) {
  const auto part = quadric::measure_shallow_ball(seen.polyhedron(), seen, {}, 1);
  if (!part || !(part->volume > 0)) return std::nullopt;
  Image image{part->apex, part->volume, part->about_apex.first, {}, {}};
  add_faces(seen, *part, stretch, image);
  return MeasuresAndInertia{measures_of(image, part->error, pair, stretch, 0),
                            inertia_of(part->about_apex, pair, stretch)};
}

std::optional<MeasuresAndInertia> deep(const SeenFlat& seen, const RoundPair& pair, const quadric::Stretch& stretch) {
  const auto part = quadric::measure_ball(seen.polyhedron(), {}, 1);
  if (!part || !(part->volume > 0) || !std::isfinite(part->error)) return std::nullopt;
  Image image{{}, part->volume, part->first, {}, {}};
  add_faces(seen, *part, stretch, image);
  const double error = part->error + seen.misplaced() * part->area;
  return MeasuresAndInertia{measures_of(image, error, pair, stretch, pair.rounding), inertia_of(*part, pair, stretch)};
}

/// A cap of the unit ball, or all of it.
std::optional<MeasuresAndInertia> cut_once(const SeenFlat& seen, const RoundPair& pair,
                                           const quadric::Stretch& stretch) {
  const auto planes = seen.polyhedron().planes;
  const double shortest = std::min({stretch.half_axes.x, stretch.half_axes.y, stretch.half_axes.z});
  const auto cut = only_cut({{}, {0, 0, 1}, 1, 0, true}, planes, pair.rounding / shortest);
  if (!cut) return std::nullopt;
  const auto wide_plane = seen.plane(static_cast<int>(cut->plane - planes.data()));
  const Vec3 normal = cut->plane->normal;
  const DoubleDouble offset = wide_plane ? wide_plane->offset : DoubleDouble{cut->plane->offset};
  const double height = std::min(2.0, (DoubleDouble{1} + offset).head);
  if (!(height > 0)) return std::nullopt;
  const RevolvedPart part = cap(1, height, normal);
  Image image{offset.head * normal, part.volume, part.moment - part.volume * offset.head * normal, {}, {}};
  image.area = part.flat_area + part.curved_area;
  if (height < 2) {
    image.faces = 1;
    image.force = part.flat_area * stretch.normal(normal);
    image.flat_area = norm(image.force);
  } else {
    image.about = image.first = {};
  }
  const double layers = cut->layers + (wide_plane ? 0 : 1);
  return MeasuresAndInertia{measures_of(image, 0, pair, stretch, layers * pair.rounding), {}};
}

}  // namespace

bool add_sections_of_ellipsoid(const RoundPair& pair, PatchSums& patch) {
  const SeenFlat seen(pair);
  const quadric::Polyhedron polyhedron = seen.polyhedron();
  if (polyhedron.edges.empty()) return false;
  const auto part = quadric::measure_ball(polyhedron, {}, 1, true);
  if (!part || !(part->error + seen.misplaced() * part->area <= kSureOfSections * part->volume)) return false;
  const Pose& pose = pair.round_body().pose;
  const quadric::Stretch stretch(stretched(pair.round_body().shape)->half_axes);
  quadric::SectionView view(patch, pose.translation, pose.rotation, pair.self == 1);
  view.u = scaled(stretch.half_axes, view.u), view.v = scaled(stretch.half_axes, view.v);
  view.normal = stretch.normal(view.normal);
  for (size_t f = 0; f < part->sections.size(); ++f) view.add(part->sections[f], polyhedron.planes[f].normal, patch);
  return true;
}

/// If at most one plane reaches the ball, a cap has fewer terms.
std::optional<MeasuresAndInertia> ellipsoid_in_flat(const RoundPair& pair) {
  const SeenFlat seen(pair);
  const quadric::Stretch stretch(stretched(pair.round_body().shape)->half_axes);
  const quadric::Polyhedron polyhedron = seen.polyhedron();
  const double reach = 1 + seen.misplaced();
  const auto reaches = [&](const Plane& plane) { return plane.offset < reach; };
  const bool several = !polyhedron.edges.empty() && std::ranges::count_if(polyhedron.planes, reaches) > 1;
  std::optional<MeasuresAndInertia> found;
  if (several && pair.outside) found = shallow(seen, pair, stretch);
  if (!found && !(several && !pair.outside)) found = cut_once(seen, pair, stretch);
  if (!found && several) found = deep(seen, pair, stretch);
  if (!found && several && !pair.outside) found = cut_once(seen, pair, stretch);
  return found;
}

}  // namespace overlapper::closed_forms
