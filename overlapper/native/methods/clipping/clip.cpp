#include "methods/clipping/clip.h"

#include <algorithm>

#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "methods/clipping/flush_walls.h"
#include "methods/clipping/sign_table.h"
#include "shapes/canonical_order.h"
#include "shapes/local_measures.h"
#include "shapes/relation.h"

namespace overlapper {
namespace {

struct Workspace : TableClipping {
  std::vector<int> apex;          ///< per facet: one of its vertices, or -1
  std::vector<double> cone;       ///< per facet: six times the volume of the cone from the origin
  std::vector<double> extent;     ///< per vertex: the sum of its coordinates over their size
  std::vector<Vec3> area_vector;  ///< per facet: twice its area vector
  std::vector<WideLanes> wide_planes;
  std::vector<Vec3> by_doubles;  ///< the vertices before they are placed in wider arithmetic
  std::vector<MovedWall> moved;  ///< walls that do not bound the common polytope, as another wall is flush with them
};

Workspace& workspace() {
  thread_local Workspace kept;
  return kept;
}

/// Makes coordinates relative to the middle of the vertices, and returns the middle.
Vec3 centre(std::span<Vec3> vertices) {
  Vec3 middle;
  for (Vec3 v : vertices) middle += v;
  middle = middle / static_cast<double>(vertices.size());
  for (Vec3& v : vertices) v -= middle;
  return middle;
}

/// Two vectors, with their coordinates side by side.
struct TwoVectors {
  TwoLanes x, y, z;
};
inline TwoVectors beside(Vec3 a, Vec3 b) { return {TwoLanes{a.x, b.x}, TwoLanes{a.y, b.y}, TwoLanes{a.z, b.z}}; }
inline TwoVectors operator+(const TwoVectors& a, const TwoVectors& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline TwoVectors operator-(const TwoVectors& a, const TwoVectors& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline TwoVectors operator/(const TwoVectors& a, double s) { return {a.x / s, a.y / s, a.z / s}; }
inline TwoVectors operator*(TwoLanes s, const TwoVectors& a) { return {s * a.x, s * a.y, s * a.z}; }
inline TwoLanes dot(const TwoVectors& a, const TwoVectors& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline TwoVectors cross(const TwoVectors& a, const TwoVectors& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline TwoLanes norm2(const TwoVectors& a) { return dot(a, a); }
inline Vec3 lane(const TwoVectors& a, int k) { return {a.x[k], a.y[k], a.z[k]}; }

/// Calls `use(e, f, two)` for edges two at a time. For an odd number the last call has one edge: `f` equals `e`.
template <class Use>
void for_each_two(std::span<const Edge> edges, Use use) {
  for (size_t i = 0; i < edges.size(); i += 2) {
    const bool two = i + 1 < edges.size();
    use(edges[i], edges[two ? i + 1 : i], two);
  }
}

/// Sums over the common polytope from clipping. Its vertices are relative to a point inside.
class Sums {
 public:
  /// `size` is the extent of the vertices along each axis, or any other unit of length.
  Sums(Workspace& workspace, Vec3 size) : w_(workspace) {
    const Vec3 per_size{1 / size.x, 1 / size.y, 1 / size.z};
    w_.apex.assign(w_.first.facets + w_.second.facets, -1);
    w_.cone.assign(w_.first.facets + w_.second.facets, 0);
    w_.extent.resize(w_.vertices.size());
    std::ranges::transform(w_.vertices, w_.extent.begin(), [&](Vec3 v) { return dot(abs(v), per_size); });
    for (const auto* list : {&w_.edges, &w_.seam})
      for (const Edge& e : *list) w_.apex[e.left] = w_.apex[e.right] = e.from;
    for (const auto* list : {&w_.edges, &w_.seam}) add(*list);
    // Each product of three coordinates is rounded less than eight times. Then follows the sum of the tetrahedra; no
    // tetrahedron is negative.
    const double terms = 2 * static_cast<double>(w_.edges.size() + w_.seam.size());
    rounding_ = 8 * 0x1p-53 * uncancelled_ * size.x * size.y * size.z / 6 + terms * 0x1p-53 * six_volumes_ / 6;
  }

  double volume() const { return six_volumes_ / 6; }
  double volume_rounding() const { return rounding_; }
  Vec3 centroid() const { return moment_ / (4 * six_volumes_); }

  /// The pull on the first body, from the seam.
  Pull pull() const {
    const Vec3* vertices = w_.vertices.data();
    Pull pull{};
    for_each_two(w_.seam, [&](const Edge& e, const Edge& f, bool two) {
      const PullOf<TwoVectors> pulls =
          pull_along_border(beside(vertices[e.from], vertices[f.from]), beside(vertices[e.to], vertices[f.to]));
      const auto add_lane = [&](int k) {
        pull.force += lane(pulls.force, k);
        pull.moment += lane(pulls.moment, k);
      };
      add_lane(0);
      if (two) add_lane(1);
    });
    return {pull.force, pull.moment - cross(centroid(), pull.force)};
  }

 private:
  /// Tetrahedra from the origin over each edge and a corner of either facet; none is negative. The terms of two edges
  /// are computed together and added in order.
  void add(std::span<const Edge> edges) {
    const Vec3* vertices = w_.vertices.data();
    const double* extent = w_.extent.data();
    const int* apex = w_.apex.data();
    double* cone = w_.cone.data();
    Vec3 moment = moment_;
    double six_volumes = six_volumes_, uncancelled = uncancelled_;
    for_each_two(edges, [&](const Edge& e, const Edge& f, bool two) {
      const int left_e = apex[e.left], left_f = apex[f.left], right_e = apex[e.right], right_f = apex[f.right];
      const TwoVectors from = beside(vertices[e.from], vertices[f.from]), to = beside(vertices[e.to], vertices[f.to]);
      const TwoVectors left = beside(vertices[left_e], vertices[left_f]), sum = from + to, area = cross(from, to);
      const TwoVectors right = beside(vertices[right_e], vertices[right_f]);
      const TwoLanes on_left = dot(left, area), on_right = -dot(right, area), on_both = on_left + on_right;
      const TwoLanes products =
          (TwoLanes{extent[left_e], extent[left_f]} + TwoLanes{extent[right_e], extent[right_f]}) *
          TwoLanes{extent[e.from], extent[f.from]} * TwoLanes{extent[e.to], extent[f.to]};
      const TwoVectors moments = on_left * (left + sum) + on_right * (right + sum);
      const auto add_lane = [&](const Edge& edge, int k) {
        cone[edge.left] += on_left[k];
        cone[edge.right] += on_right[k];
        uncancelled += products[k];
        six_volumes += on_both[k];
        moment += lane(moments, k);
      };
      add_lane(e, 0);
      if (two) add_lane(f, 1);
    });
    moment_ = moment, six_volumes_ = six_volumes, uncancelled_ = uncancelled;
  }

  Workspace& w_;
  Vec3 moment_;
  double six_volumes_ = 0;
  double uncancelled_ = 0;  ///< upper bound of six times the volumes, without cancellation of terms
  double rounding_ = 0;
};

/// A wanted patch. The body is the second one, or the first one if swapped.
struct WantedPatch {
  bool swapped;
  std::optional<Vec3> direction;  ///< to see it along
  Patch patch{};

  /// Finds the patch from the seam, which is counter-clockwise around the first body's part.
  void find(const Workspace& w, Vec3 centroid, Vec3 force_on_first) {
    PatchSums sums(centroid, seen_along(swapped ? force_on_first : -force_on_first, direction));
    for (const Edge& e : w.seam) {
      const Vec3 from = w.vertices[e.from], to = w.vertices[e.to];
      swapped ? sums.add_edge(from, to) : sums.add_edge(to, from);
    }
    patch = sums.patch();
  }
};

/// The distance of a common facet's plane from the middle of the common polytope.
struct Slack {
  Vec3 normal;
  double distance;
};

/// Calls `use(facet, slack)` for each facet of the common polytope.
template <class Use>
void for_each_facet(const Workspace& w, Vec3 middle, Use use) {
  for (int f = 0; f < static_cast<int>(w.apex.size()); ++f) {
    if (w.apex[f] < 0) continue;
    const Solid& body = f < w.first.facets ? w.first : w.second;
    const int plane = f < w.first.facets ? f : f - w.first.facets;
    use(f, Slack{body.normal(plane), body.offset[plane] - dot(body.normal(plane), middle)});
  }
}

/// The volume between the polytope and a polytope whose planes are moved out by `moved`, with the growth of the area on
/// the way.
double moved_volume(double area, double moved, double least_slack) {
  return moved * area * growth(moved, least_slack) / 3;
}

/// Orthogonal axes as rows. The first axis is across the facet nearest to the middle, the second across the next
/// nearest facet. Along each axis, the coordinates of a sliver or a needle are then no larger than its thickness.
Mat3 thin_axes(const Workspace& w, Vec3 middle) {
  Slack nearest{{}, kInfinity}, next{{}, kInfinity};
  for_each_facet(w, middle, [&](int, const Slack& s) { nearest = s.distance < nearest.distance ? s : nearest; });
  const Vec3 first = unit(nearest.normal);
  for_each_facet(w, middle, [&](int, const Slack& s) {
    const Vec3 along = s.normal - dot(s.normal, first) * first;
    const double length2 = norm2(along);
    if (length2 < 0x1p-10) return;  // the new direction is more than rounding
    const double distance = s.distance / std::sqrt(length2);
    if (distance < next.distance) next = {along, distance};
  });
  const Vec3 along = unit(next.normal), second = unit(along - dot(along, first) * first);
  return {first, second, cross(first, second)};
}

/// The areas of facets, from their corners alone.
double area_by_corners(Workspace& w) {
  w.area_vector.assign(w.apex.size(), {});
  for (const auto* list : {&w.edges, &w.seam}) {
    for (const Edge& e : *list) {
      const Vec3 area = cross(w.vertices[e.from], w.vertices[e.to] - w.vertices[e.from]);
      w.area_vector[e.left] += area;
      w.area_vector[e.right] -= area;
    }
  }
  double area = 0;
  for (Vec3 twice : w.area_vector) area += std::sqrt(norm2(twice)) / 2;
  return area;
}

/// m³: bound of the volume that the moved walls may cut off from the common polytope. It is the projection to the wall
/// times the way that the polytope reaches beyond. Rounding makes the projection less than twice as large.
double cut_off(Workspace& w) {
  if (w.moved.empty()) return 0;
  area_by_corners(w);
  double volume = 0;
  for (const MovedWall& wall : w.moved) {
    double projection = 0;  // each point of it is covered by two facets, and area vectors are twice as long
    for (Vec3 area : w.area_vector) projection += std::abs(dot(area, wall.normal)) / 4;
    volume += 2 * wall.beyond * projection;
  }
  return volume;
}

/// Measures the common polytope again about `middle`, from corners placed in wider arithmetic. Leaves `common`
/// unchanged if even that is not accurate enough.
void measure_widened(Workspace& w, const Placed& a, const Placed& b, double reach, double least_slack, double cut,
                     Vec3 middle, Measures& measures, Pull& on_first, WantedPatch* wanted) {
  const Mat3 axes = thin_axes(w, middle);
  w.by_doubles.assign(w.vertices.begin(), w.vertices.end());
  std::optional<Sums> sums;
  double area = 0, error = kInfinity;
  for (Approach approach : {Approach::kOnce, Approach::kTwice}) {
    if (approach == Approach::kTwice) std::ranges::copy(w.by_doubles, w.vertices.begin());
    const std::optional<double> corner_rounding = place_in_wide(
        {a, b, w.first.facets, w.apex, w.corners, middle, reach}, axes, w.vertices, w.wide_planes, approach);
    if (!corner_rounding) return;
    Vec3 size;
    for (Vec3 v : w.vertices) size = max(size, abs(v));
    sums.emplace(w, size);
    area = area_by_corners(w);
    // The axes are orthogonal and of length 1 but for a few roundings.
    error = moved_volume(area, *corner_rounding, least_slack) + sums->volume_rounding() +
            16 * 0x1p-53 * sums->volume() + cut;
    if (error <= kEnough * sums->volume()) break;
  }
  if (!(error <= kEnough * sums->volume())) return;
  measures.measured = true;
  measures.way = Way::kWideClipping;
  measures.volume = sums->volume();
  measures.volume_error = error;
  measures.area = area;
  measures.centroid = middle + apply_transposed(axes, sums->centroid());
  const Pull pull = sums->pull();
  on_first = {apply_transposed(axes, pull.force), apply_transposed(axes, pull.moment)};
  if (!wanted) return;
  if (wanted->direction) wanted->direction = axes * *wanted->direction;
  wanted->find(w, sums->centroid(), pull.force);
  wanted->patch = turned(wanted->patch, transposed(axes), middle);
}

/// Measures by sums in doubles, about `middle`. False if a plane is nearer to `middle` than `least_slack`, which
/// becomes the distance of the nearest plane. Up to `cut` of the volume may be cut off.
bool measure(Workspace& w, const Sums& sums, Vec3 middle, double rounding, double cut, double& least_slack,
             Measures& common) {
  common.status = Status::kOverlapping;
  common.way = Way::kClipping;
  common.volume = sums.volume();
  common.centroid = middle + sums.centroid();
  double nearest = kInfinity;
  for_each_facet(w, middle, [&](int f, const Slack& slack) {
    common.area += w.cone[f] / (2 * slack.distance);
    nearest = std::min(nearest, slack.distance);
    ++common.facets_touched;
  });
  if (!(nearest > least_slack)) return false;
  least_slack = nearest;
  common.volume_error = moved_volume(common.area, rounding, least_slack) + sums.volume_rounding() + cut;
  common.measured = common.volume_error <= kEnough * common.volume;
  return true;
}

/// The body with more facets comes first, and its coordinates are used. The order then does not depend on the caller's.
bool comes_first(const Placed& a, const Placed& b) {
  const int facets_a = facets(a.shape), facets_b = facets(b.shape);
  return facets_a != facets_b ? facets_a > facets_b : !comes_before(b, a);
}

/// Clips in the coordinates of `a`, and finds the pull on `a`; false if doubles cannot decide.
bool clip_in_first(const Placed& a, const Placed& b, Measures& common, Pull& on_first, WantedPatch* wanted = nullptr) {
  const auto [pose, reach, flat, doubt, apart] = relation(a, b);
  if (apart) return true;
  Workspace& w = workspace();
  set_solid(w.first, a, 0, nullptr, 4 * reach);
  set_solid(w.second, b, 1, &pose, 4 * reach);
  w.moved.clear();
  Signs signs = w.run(doubt, true);
  if (signs == Signs::kUncertain && move_flush_walls(w.first, w.second, doubt, w.moved)) signs = w.run(doubt, true);
  if (signs != Signs::kCertain) return signs == Signs::kSeparated;
  const Vec3 middle = centre(w.vertices);
  const Sums sums(w, {1, 1, 1});
  double least_slack = 4 * doubt;  // rounding might hide thinner sets
  const double cut = cut_off(w);
  if (!measure(w, sums, middle, rounding(reach) + flat, cut, least_slack, common)) return false;
  if (!common.measured || w.shallow) {
    common.measured = false;
    measure_widened(w, a, b, reach, least_slack, cut, middle, common, on_first, wanted);
    return common.measured || (w.moved.empty() && !w.shallow);
  }
  on_first = sums.pull();
  if (!wanted) return true;
  wanted->find(w, sums.centroid(), on_first.force);
  wanted->patch.centre += middle;
  return true;
}

/// The areas of sides of the common polytope that was clipped last.
SideAreas side_areas(Workspace& w, const Placed& first, const Placed& second) {
  area_by_corners(w);
  SideAreas areas{};
  for (int f = 0; f < static_cast<int>(w.apex.size()); ++f) {
    if (w.apex[f] < 0) continue;
    const bool of_first = f < w.first.facets;
    const Shape& shape = of_first ? first.shape : second.shape;
    if (polytope_of(shape)) continue;
    const int side = of_first ? f : f - w.first.facets;
    const double area = std::sqrt(norm2(w.area_vector[f])) / 2;
    Vec3& sum = areas[of_first ? 0 : 1];
    (side < 2 ? sum.x : side < 4 ? sum.y : sum.z) += area;
  }
  return areas;
}

/// The bodies from the smallest to the largest. The order then does not depend on the caller's.
std::vector<int> from_small_to_large(std::span<const Placed> bodies) {
  std::vector<int> order = canonical_order(bodies);
  const auto size = [&](int i) { return bounded(bodies[i].shape) ? radius(bodies[i].shape) : kInfinity; };
  std::stable_sort(order.begin(), order.end(), [&](int i, int j) { return size(i) < size(j); });
  return order;
}

Ball ball_around(const Solid& solid, double rounding) {
  Ball ball{};
  for (int i = 0; i < solid.vertices; ++i) ball.centre += solid.vertex(i);
  ball.centre = ball.centre / static_cast<double>(solid.vertices);
  for (int i = 0; i < solid.vertices; ++i)
    ball.radius = std::max(ball.radius, std::sqrt(norm2(solid.vertex(i) - ball.centre)) + solid.doubt[i]);
  ball.radius += rounding;
  return ball;
}

/// Clips the first body by the other bodies in turn, in its own coordinates.
Signs clip_in_turn(Workspace& w, std::span<const Placed> bodies, std::span<const int> order, double reach,
                   double doubt) {
  const Placed& first = bodies[order[0]];
  set_solid(w.first, first, order[0], nullptr, 4 * reach);
  for (int i : order.subspan(1)) {
    const Pose pose = relative_pose(first.pose, bodies[i].pose);
    if (!set_part(w.second, bodies[i], i, pose, ball_around(w.first, doubt), 4 * reach)) return Signs::kSeparated;
    if (w.second.facets == 0) continue;
    if (const Signs signs = w.run(doubt); signs != Signs::kCertain) return signs;
    w.take_common(4 * reach);
  }
  return Signs::kCertain;
}

/// The pulls of the common polytope on its bodies, with moments about the centroid: like a seam, along all borders
/// between two bodies.
void add_pulls(const Workspace& w, const Pose& pose, Vec3 centroid, std::vector<Pull>& pulls) {
  for (const Edge& e : w.edges) {
    const int left = w.owner(e.left), right = w.owner(e.right);
    if (left == right) continue;
    const Pull of_edge = pull_along_border(w.vertices[e.from] - centroid, w.vertices[e.to] - centroid);
    const Vec3 force = pose.rotation * of_edge.force, moment = pose.rotation * of_edge.moment;
    pulls[left].force += force, pulls[right].force -= force;
    pulls[left].moment += moment, pulls[right].moment -= moment;
  }
}

}  // namespace

std::optional<Measures> clip(const Placed& a, const Placed& b, std::optional<SideAreas>* sides,
                             std::optional<Patch>* patch) {
  WantedPatch wanted{!comes_first(a, b), {}};
  const bool swapped = wanted.swapped;
  const Placed &first = swapped ? b : a, &second = swapped ? a : b;
  std::optional<Measures> common(std::in_place);
  Pull on_first{};
  if (clip_in_first(first, second, *common, on_first, patch ? &wanted : nullptr)) {
    say_in_world(*common, on_first, a, b, swapped);
    if (patch && common->measured) *patch = turned(wanted.patch, first.pose.rotation, first.pose.translation);
  } else {
    common.reset();
  }
  if (sides && common && common->measured) {
    *sides = side_areas(workspace(), swapped ? b : a, swapped ? a : b);
    if (swapped) std::swap((**sides)[0], (**sides)[1]);
  }
  return common;
}

std::optional<Patch> clipped_patch(const Placed& a, const Placed& b, std::optional<Vec3> direction) {
  WantedPatch wanted{!comes_first(a, b), {}};
  const Placed &first = wanted.swapped ? b : a, &second = wanted.swapped ? a : b;
  if (direction) wanted.direction = apply_transposed(first.pose.rotation, *direction);
  Measures common;
  Pull on_first{};
  if (!clip_in_first(first, second, common, on_first, &wanted) || !common.measured) return std::nullopt;
  return turned(wanted.patch, first.pose.rotation, first.pose.translation);
}

std::optional<Measures> clip(std::span<const Placed> bodies) {
  const std::vector<int> order = from_small_to_large(bodies);
  const Placed& first = bodies[order[0]];
  double far = 0, flat = 0;
  for (const Placed& body : bodies) {
    const double between = norm(body.pose.translation - first.pose.translation);
    far = std::max(far, reach(body, between + radius(body.shape)));
    flat = std::max(flat, flatness(body.shape));
  }
  const double doubt = doubt_of_signs(far, flat);
  Workspace& w = workspace();
  const Signs signs = clip_in_turn(w, bodies, order, far, doubt);
  if (signs == Signs::kSeparated) return Measures{};
  if (signs == Signs::kUncertain) return std::nullopt;
  w.show_first();
  const Vec3 middle = centre(w.vertices);
  const Sums sums(w, {1, 1, 1});
  // Each cut moves the rest of an edge off its planes by at most three half-ulps.
  const double rounded = rounding(far) + 3 * 0x1p-53 * far * static_cast<double>(bodies.size()) + flat;
  double least_slack = 4 * doubt;
  std::optional<Measures> common(std::in_place);
  if (!measure(w, sums, middle, rounded, 0, least_slack, *common) || !common->measured) return std::nullopt;
  common->pulls_of_group.resize(bodies.size());
  add_pulls(w, first.pose, common->centroid - middle, common->pulls_of_group);
  const Vec3 centroid = first.pose.rotation * common->centroid;
  common->centroid = centroid + first.pose.translation;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Vec3 lever = centroid + (first.pose.translation - bodies[i].position);
    common->pulls_of_group[i] = about(common->pulls_of_group[i], lever, {});
  }
  return common;
}

}  // namespace overlapper
