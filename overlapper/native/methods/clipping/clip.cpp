#include "methods/clipping/clip.h"

#include <algorithm>

#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "geometry/wide_lanes.h"
#include "methods/clipping/flush_walls.h"
#include "methods/clipping/sign_table.h"
#include "shapes/canonical_order.h"
#include "shapes/local_measures.h"
#include "shapes/relation.h"

namespace overlapper {
namespace {

struct Row {
  Quad lanes;
};

struct Workspace : TableClipping {
  std::vector<int> apex;         ///< per facet: one of its vertices, or -1
  std::vector<double> cone;      ///< per facet: six times the volume of the cone from the origin
  std::vector<double> distance;  ///< per facet in the common polytope: of its plane from the middle
  std::vector<Row> row;          ///< per vertex: its coordinates, and the sum of their sizes over those of the whole
  std::vector<Row> area_vector;  ///< per facet: twice its area vector
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
inline TwoVectors operator-(const TwoVectors& a, const TwoVectors& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline TwoVectors operator/(const TwoVectors& a, double s) { return {a.x / s, a.y / s, a.z / s}; }
inline TwoVectors operator*(TwoLanes s, const TwoVectors& a) { return {s * a.x, s * a.y, s * a.z}; }
inline TwoLanes dot(const TwoVectors& a, const TwoVectors& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline TwoVectors cross(const TwoVectors& a, const TwoVectors& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline TwoLanes norm2(const TwoVectors& a) { return dot(a, a); }
inline Vec3 lane(const TwoVectors& a, int k) { return {a.x[k], a.y[k], a.z[k]}; }

/// Four vertices, with their coordinates side by side.
template <bool wider>
struct FourRows {
  FourRows(const Row& a, const Row& b, const Row& c, const Row& d)
      : x(a.lanes), y(b.lanes), z(c.lanes), extent(d.lanes) {
    transpose<wider>(x, y, z, extent);
  }
  Quad x, y, z, extent;
};

/// Calls `use(e, f, two)` for edges two at a time. For an odd number the last call has one edge: `f` equals `e`.
template <class Use>
void for_each_two(std::span<const Edge> edges, Use use) {
  for (size_t i = 0; i < edges.size(); i += 2) {
    const bool two = i + 1 < edges.size();
    use(edges[i], edges[two ? i + 1 : i], two);
  }
}

/// The sums over tetrahedra from the origin over each edge and a corner of either facet; none is negative.
struct ConeSums {
  Quad moment_and_volume{};  ///< 24 times the first moment, and six times the volume
  double uncancelled = 0;    ///< upper bound of six times the volumes, without cancellation of terms

  /// Adds tetrahedra. The terms of four edges are computed together and added in order.
  template <bool wider>
  void add(std::span<const Edge> edges, const Row* row, const int* apex, double* cone) {
    for (size_t i = 0; i < edges.size(); i += 4) {
      const size_t rest = edges.size() - i;
      const Edge &e = edges[i], &f = edges[rest > 1 ? i + 1 : i], &g = edges[rest > 2 ? i + 2 : i],
                 &h = edges[rest > 3 ? i + 3 : i];
      const FourRows<wider> from(row[e.from], row[f.from], row[g.from], row[h.from]),
          to(row[e.to], row[f.to], row[g.to], row[h.to]),
          left(row[apex[e.left]], row[apex[f.left]], row[apex[g.left]], row[apex[h.left]]),
          right(row[apex[e.right]], row[apex[f.right]], row[apex[g.right]], row[apex[h.right]]);
      const Quad sum_x = from.x + to.x, sum_y = from.y + to.y, sum_z = from.z + to.z;
      const Quad area_x = from.y * to.z - from.z * to.y, area_y = from.z * to.x - from.x * to.z,
                 area_z = from.x * to.y - from.y * to.x;
      const Quad on_left = left.x * area_x + left.y * area_y + left.z * area_z,
                 on_right = -(right.x * area_x + right.y * area_y + right.z * area_z),
                 products = (left.extent + right.extent) * from.extent * to.extent;
      Quad x = on_left * (left.x + sum_x) + on_right * (right.x + sum_x),
           y = on_left * (left.y + sum_y) + on_right * (right.y + sum_y),
           z = on_left * (left.z + sum_z) + on_right * (right.z + sum_z), on_both = on_left + on_right;
      transpose<wider>(x, y, z, on_both);
      const auto add_lane = [&](const Edge& edge, int k, const Quad& terms) {
        cone[edge.left] += on_left[k];
        cone[edge.right] += on_right[k];
        uncancelled += products[k];
        moment_and_volume += terms;
      };
      add_lane(e, 0, x);
      if (rest > 1) add_lane(f, 1, y);
      if (rest > 2) add_lane(g, 2, z);
      if (rest > 3) add_lane(h, 3, on_both);
    }
  }
};

/// Finds the cones of facets, and their sums. Sizes of vertices count in units of 1 / per_size.
template <bool wider>
void add_cones(Workspace& w, Vec3 per_size, ConeSums& sums) {
  const size_t vertices = w.vertices.size();
  w.row.resize(vertices);
  Row* const row = w.row.data();
  for (size_t i = 0; i < vertices; ++i) {
    const Vec3 v = w.vertices[i];
    row[i].lanes = Quad{v.x, v.y, v.z, dot(abs(v), per_size)};
  }
  const size_t facets = w.first.facets + w.second.facets;
  w.apex.assign(facets, -1);
  w.cone.assign(facets, 0);
  int* const apex = w.apex.data();
  for (const auto* list : {&w.edges, &w.seam})
    for (const Edge& e : *list) apex[e.left] = apex[e.right] = e.from;
  ConeSums found;
  for (const auto* list : {&w.edges, &w.seam}) found.add<wider>(*list, row, apex, w.cone.data());
  sums = found;
}

#ifdef OVERLAPPER_WIDER
OVERLAPPER_WIDER void add_cones_wider(Workspace& w, Vec3 per_size, ConeSums& sums) {
  add_cones<true>(w, per_size, sums);
}
auto* const add_cones_fastest = is_wider() ? add_cones_wider : add_cones<kFused>;
#else
auto* const add_cones_fastest = add_cones<kFused>;
#endif

/// Sums over the common polytope from clipping. Its vertices are relative to a point inside.
class Sums {
 public:
  /// `size` is the extent of the vertices along each axis, or any other unit of length.
  Sums(Workspace& workspace, Vec3 size) : w_(workspace) {
    const Vec3 per_size{1 / size.x, 1 / size.y, 1 / size.z};
    ConeSums sums;
    add_cones_fastest(w_, per_size, sums);
    const Quad& found = sums.moment_and_volume;
    moment_ = {found[0], found[1], found[2]}, six_volumes_ = found[3];
    // Each product of three coordinates is rounded less than eight times. Then follows the sum of the tetrahedra; no
    // tetrahedron is negative.
    const double terms = 2 * static_cast<double>(w_.edges.size() + w_.seam.size());
    rounding_ = 8 * 0x1p-53 * sums.uncancelled * size.x * size.y * size.z / 6 + terms * 0x1p-53 * six_volumes_ / 6;
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
  Workspace& w_;
  Vec3 moment_;
  double six_volumes_ = 0;
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

/// Calls `use(facet, body, plane)` for each facet of the common polytope.
template <class Use>
void for_each_facet(const Workspace& w, Use use) {
  const int* apex = w.apex.data();
  int f = 0;
  for (const Solid* body : {&w.first, &w.second})
    for (int plane = 0; plane < body->facets; ++plane, ++f)
      if (apex[f] >= 0) use(f, *body, plane);
}

/// The volume between the polytope and a polytope whose planes are moved out by `moved`, with the growth of the area on
/// the way.
double moved_volume(double area, double moved, double least_slack) {
  return moved * area * growth(moved, least_slack) / 3;
}

/// Orthogonal axes as rows. The first axis is across the facet nearest to the middle, the second across the next
/// nearest facet. Along each axis, the coordinates of a sliver or a needle are then no larger than its thickness.
Mat3 thin_axes(const Workspace& w) {
  const double* distances = w.distance.data();
  Vec3 nearest_normal, next;
  double nearest = kInfinity, next_distance = kInfinity;
  for_each_facet(w, [&](int f, const Solid& body, int plane) {
    if (distances[f] < nearest) nearest = distances[f], nearest_normal = body.normal(plane);
  });
  const Vec3 first = unit(nearest_normal);
  for_each_facet(w, [&](int f, const Solid& body, int plane) {
    const Vec3 normal = body.normal(plane), along = normal - dot(normal, first) * first;
    const double length2 = norm2(along);
    if (length2 < 0x1p-10) return;  // the new direction is more than rounding
    const double distance = distances[f] / std::sqrt(length2);
    if (distance < next_distance) next_distance = distance, next = along;
  });
  const Vec3 along = unit(next), second = unit(along - dot(along, first) * first);
  return {first, second, cross(first, second)};
}

/// Twice the area vectors of facets, from their corners alone.
void find_area_vectors(Workspace& w) {
  w.area_vector.assign(w.apex.size(), Row{});
  Row* const sums = w.area_vector.data();
  const auto add = [&](const Edge& e, const Quad& area) {
    sums[e.left].lanes += area;
    sums[e.right].lanes -= area;
  };
  const Vec3* vertices = w.vertices.data();
  for (const auto* list : {&w.edges, &w.seam}) {
    for (const Edge& e : *list) {
      const Vec3 area = cross(vertices[e.from], vertices[e.to] - vertices[e.from]);
      add(e, Quad{area.x, area.y, area.z, 0});
    }
  }
}

#ifdef OVERLAPPER_WIDER
OVERLAPPER_WIDER void find_area_vectors_wider(Workspace& w) { find_area_vectors(w); }
auto* const find_area_vectors_fastest = is_wider() ? find_area_vectors_wider : find_area_vectors;
#else
auto* const find_area_vectors_fastest = find_area_vectors;
#endif

Vec3 area_vector(const Workspace& w, int facet) {
  const Quad& area = w.area_vector[facet].lanes;
  return {area[0], area[1], area[2]};
}

/// The areas of facets, from their corners alone.
double area_by_corners(Workspace& w) {
  find_area_vectors_fastest(w);
  double area = 0;
  for (int f = 0; f < static_cast<int>(w.apex.size()); ++f) area += std::sqrt(norm2(area_vector(w, f))) / 2;
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
    for (int f = 0; f < static_cast<int>(w.apex.size()); ++f)
      projection += std::abs(dot(area_vector(w, f), wall.normal)) / 4;
    volume += 2 * wall.beyond * projection;
  }
  return volume;
}

/// Measures the common polytope again about `middle`, from corners placed in wider arithmetic. Leaves `common`
/// unchanged if even that is not accurate enough.
void measure_widened(Workspace& w, const Placed& a, const Placed& b, double reach, double least_slack, double cut,
                     Vec3 middle, Measures& measures, Pull& on_first, WantedPatch* wanted) {
  const Mat3 axes = thin_axes(w);
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
  w.distance.resize(w.apex.size());
  double* const distances = w.distance.data();
  const double* cones = w.cone.data();
  double nearest = kInfinity, area = 0;
  int facets = 0;
  for_each_facet(w, [&](int f, const Solid& body, int plane) {
    const double distance = body.offset[plane] - dot(body.normal(plane), middle);
    distances[f] = distance;
    area += cones[f] / (2 * distance);
    nearest = std::min(nearest, distance);
    ++facets;
  });
  common.area = area, common.facets_touched = facets;
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
    const double area = std::sqrt(norm2(area_vector(w, f))) / 2;
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
