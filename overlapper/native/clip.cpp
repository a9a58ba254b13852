#include "clip.h"

#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "canonical_order.h"
#include "minkowski.h"
#include "trace.h"
#include "wide_corners.h"

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The relative error of a volume beyond which it is worth computing in another way.
constexpr double kEnough = 1e-12;

/// Two doubles that are added, multiplied and compared at once.
using Pair = double __attribute__((vector_size(16)));

inline Pair load(const double* p) {
  Pair v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline void store(double* p, Pair v) { std::memcpy(p, &v, sizeof v); }
inline Pair both(double x) { return Pair{x, x}; }
inline Pair larger(Pair a, Pair b) { return a > b ? a : b; }
inline Pair smaller(Pair a, Pair b) { return a < b ? a : b; }
inline double larger(Pair a) { return a[0] > a[1] ? a[0] : a[1]; }

constexpr std::array<Edge, 12> box_edges() {
  std::array<Edge, 12> edges{};
  int n = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    for (int si = 0; si < 2; ++si) {
      for (int sj = 0; sj < 2; ++sj) {
        const int low = si << i | sj << j, facet_i = 2 * i + si, facet_j = 2 * j + sj;
        edges[n++] = {low, low | 1 << k, si == sj ? facet_i : facet_j, si == sj ? facet_j : facet_i};
      }
    }
  }
  return edges;
}
/// By the numbers of corner() and side().
constexpr std::array<Edge, 12> kBoxEdges = box_edges();

/// A body in the coordinates of the first one, as columns.
struct Solid {
  int vertices = 0, facets = 0;
  int stride = 0;                          ///< facets rounded up; the rest are planes that hold everything inside
  std::vector<double> x, y, z;             ///< of vertices
  std::vector<double> nx, ny, nz, offset;  ///< of planes
  std::span<const Edge> edges;

  Vec3 vertex(int i) const { return {x[i], y[i], z[i]}; }
  Vec3 normal(int f) const { return {nx[f], ny[f], nz[f]}; }

  void resize(int vertex_count, int facet_count, double beyond) {
    vertices = vertex_count, facets = facet_count, stride = (facet_count + 3) / 4 * 4;
    for (std::vector<double>* column : {&x, &y, &z}) column->resize(vertices);
    for (std::vector<double>* column : {&nx, &ny, &nz, &offset}) column->resize(stride);
    for (int f = facets; f < stride; ++f) set_plane(f, {}, beyond);
  }
  void set_vertex(int i, Vec3 v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
  void set_plane(int f, Vec3 normal, double height) {
    nx[f] = normal.x, ny[f] = normal.y, nz[f] = normal.z, offset[f] = height;
  }
};

enum class Signs { kCertain, kUncertain, kSeparated };

/// Signed distances of the vertices of one body from the planes of the other.
struct SignTable {
  int stride = 0;
  std::vector<double> rows;         ///< by vertex
  std::vector<double> nearest;      ///< per plane: the least of all vertices
  std::vector<std::int8_t> inside;  ///< per vertex

  double* row(int vertex) { return rows.data() + static_cast<ptrdiff_t>(vertex) * stride; }

  Signs fill(const Solid& of, const Solid& by, double rounding) {
    stride = by.stride;
    rows.resize(static_cast<size_t>(of.vertices) * stride);
    inside.resize(of.vertices);
    nearest.assign(stride, kInfinity);
    bool uncertain = false;
    for (int i = 0; i < of.vertices; ++i) {
      const Pair x = both(of.x[i]), y = both(of.y[i]), z = both(of.z[i]);
      double* signs = row(i);
      Pair farthest = both(-kInfinity);
      for (int j = 0; j < stride; j += 2) {
        const Pair s = load(&by.nx[j]) * x + load(&by.ny[j]) * y + load(&by.nz[j]) * z - load(&by.offset[j]);
        store(signs + j, s);
        farthest = larger(farthest, s);
        store(&nearest[j], smaller(load(&nearest[j]), s));
      }
      const double s = larger(farthest);
      inside[i] = s < 0;
      uncertain |= std::abs(s) <= rounding;
    }
    if (of.vertices > 0 && *std::max_element(nearest.begin(), nearest.end()) > rounding) return Signs::kSeparated;
    return uncertain ? Signs::kUncertain : Signs::kCertain;
  }
};

/// Where an edge meets a plane: at `from + at * (to - from)`.
struct Crossing {
  int plane;
  double at;
};

/// One edge against all planes of the other body: the signed distances of its ends.
struct EdgeSigns {
  const double *from, *to;
  int stride;
  double length, rounding;

  /// True if the point where the edge crosses plane `g` is certainly inside all others. It is off by the rounding of
  /// two signs as seen along the edge.
  bool certain(Crossing crossing) const {
    const int g = crossing.plane, pair = g & ~1, partner = g ^ 1;
    const Pair at = both(crossing.at);
    const auto height = [&](int j) { return load(from + j) + at * (load(to + j) - load(from + j)); };
    Pair highest = both(from[partner] + crossing.at * (to[partner] - from[partner]));
    for (int j = 0; j < pair; j += 2) highest = larger(highest, height(j));
    for (int j = pair + 2; j < stride; j += 2) highest = larger(highest, height(j));
    return larger(highest) < -2 * rounding * (1 + length / std::abs(to[g] - from[g]));
  }

  Crossing at_plane(int g) const { return {g, from[g] / (from[g] - to[g])}; }

  /// The plane through which it leaves from an end that is inside.
  Crossing exit(bool from_inside, std::vector<double>& ratio) const {
    const double *inner = from_inside ? from : to, *outer = from_inside ? to : from;
    Pair steepest = both(0);
    for (int j = 0; j < stride; j += 2) {
      const Pair r = load(outer + j) / -load(inner + j);
      store(&ratio[j], r);
      steepest = larger(steepest, r);
    }
    const double most = larger(steepest);
    int g = 0;
    while (ratio[g] != most) ++g;
    return at_plane(g);
  }

  /// True if both ends are certainly outside of the same plane.
  bool outside() const {
    Pair highest = both(-kInfinity);
    for (int j = 0; j < stride; j += 2) highest = larger(highest, smaller(load(from + j), load(to + j)));
    return larger(highest) > rounding;
  }

  /// For an edge whose ends are both outside, of different planes: where it enters and leaves.
  std::array<Crossing, 2> passage() const {
    Crossing enter{-1, -kInfinity}, leave{-1, kInfinity};
    for (int j = 0; j < stride; ++j) {
      const double at = from[j] / (from[j] - to[j]);
      if (from[j] > to[j] && from[j] > 0 && at > enter.at) enter = {j, at};
      if (to[j] > from[j] && to[j] > 0 && at < leave.at) leave = {j, at};
    }
    return {enter, leave};
  }

  /// True if the edge is certainly outside of one of two planes all along.
  bool misses(int g, int h) const {
    const double slope_g = to[g] - from[g], slope_h = to[h] - from[h];
    const double level = std::clamp((from[h] - from[g]) / (slope_g - slope_h), 0.0, 1.0);
    return std::max(from[g] + level * slope_g, from[h] + level * slope_h) > 2 * rounding;
  }
};

/// Facets of the second body are numbered after those of the first.
struct Workspace {
  Solid first, second;
  SignTable first_signs, second_signs;
  std::vector<double> ratio;
  std::vector<int> first_vertex, second_vertex;  ///< which common vertex a body's vertex is, or -1
  std::vector<Vec3> vertices;                    ///< of the common polytope
  std::vector<Corner> corners;                   ///< parallel to them
  std::vector<Edge> edges;                       ///< of the common polytope
  std::vector<Edge> seam;  ///< its edges between the first body's facets, on the left, and the second's
  std::vector<int>
      open;  ///< per pair of facets: 1 + the vertex at which their common edge begins, minus that if it ends there
  int unpaired = 0;
  std::vector<int> apex;          ///< per facet: one of its vertices, or -1
  std::vector<double> cone;       ///< per facet: six times the volume of the cone from the origin
  std::vector<double> extent;     ///< per vertex: the sum of its coordinates over their size
  std::vector<Vec3> area_vector;  ///< per facet: twice its
  WideCorners wide;
};

/// Finds the common polytope in a workspace whose solids are in place.
class Tracer {
 public:
  Tracer(Workspace& workspace, double rounding) : w_(workspace), rounding_(rounding) {}

  Signs trace() {
    const Signs one = w_.first_signs.fill(w_.first, w_.second, rounding_);
    if (one == Signs::kSeparated) return one;
    const Signs other = w_.second_signs.fill(w_.second, w_.first, rounding_);
    if (other == Signs::kSeparated) return other;
    if (one == Signs::kUncertain || other == Signs::kUncertain) return Signs::kUncertain;

    w_.vertices.clear();
    w_.corners.clear();
    w_.edges.clear();
    w_.seam.clear();
    w_.unpaired = 0;
    w_.open.resize(static_cast<size_t>(w_.first.facets) * w_.second.facets, 0);
    w_.ratio.resize(std::max(w_.first.stride, w_.second.stride));
    const bool certain = trace(w_.first, w_.first_signs, w_.first_vertex, true) &&
                         trace(w_.second, w_.second_signs, w_.second_vertex, false) && w_.unpaired == 0;
    if (!certain) {
      std::fill(w_.open.begin(), w_.open.end(), 0);
      return Signs::kUncertain;
    }
    return w_.vertices.empty() ? Signs::kSeparated : Signs::kCertain;
  }

 private:
  int add_vertex(Vec3 v, const Corner& corner) {
    w_.vertices.push_back(v);
    w_.corners.push_back(corner);
    return static_cast<int>(w_.vertices.size()) - 1;
  }

  bool trace(const Solid& body, SignTable& signs, std::vector<int>& common_vertex, bool is_first) {
    common_vertex.assign(body.vertices, -1);
    for (int i = 0; i < body.vertices; ++i)
      if (signs.inside[i]) common_vertex[i] = add_vertex(body.vertex(i), {is_first ? 0 : 1, i, {}});
    const int offset = is_first ? 0 : w_.first.facets;
    for (const Edge& e : body.edges) {
      const bool from_inside = signs.inside[e.from], to_inside = signs.inside[e.to];
      Edge common{common_vertex[e.from], common_vertex[e.to], e.left + offset, e.right + offset};
      if (!(from_inside && to_inside)) {
        const Vec3 from = body.vertex(e.from), along = body.vertex(e.to) - from;
        const EdgeSigns edge{signs.row(e.from), signs.row(e.to), signs.stride,
                             std::abs(along.x) + std::abs(along.y) + std::abs(along.z), rounding_};
        const auto cross = [&](Crossing crossing, bool enters) {
          const int facet = crossing.plane + (is_first ? w_.first.facets : 0);
          const int v = add_vertex(from + crossing.at * along, {-1, -1, {common.left, common.right, facet}});
          meet(e, crossing.plane, v, enters, is_first);
          return v;
        };
        if (from_inside || to_inside) {
          const Crossing exit = edge.exit(from_inside, w_.ratio);
          if (!edge.certain(exit)) return false;
          (from_inside ? common.to : common.from) = cross(exit, to_inside);
        } else {
          if (edge.outside()) continue;
          const auto [enter, leave] = edge.passage();
          if (enter.plane < 0 || leave.plane < 0) return false;
          if (edge.misses(enter.plane, leave.plane)) continue;
          if (!edge.certain(enter) || !edge.certain(leave)) return false;
          common.from = cross(enter, true);
          common.to = cross(leave, false);
        }
      }
      w_.edges.push_back(common);
    }
    return true;
  }

  /// An edge of one body meets a facet of the other in a common vertex, where two edges of the seam end: walking around
  /// the facet on its left, one follows the edge up to the exit and turns onto the other body.
  void meet(const Edge& e, int facet, int vertex, bool enters, bool is_first) {
    if (is_first) {
      join(e.left, facet, vertex, !enters);
      join(e.right, facet, vertex, enters);
    } else {
      join(facet, e.left, vertex, enters);
      join(facet, e.right, vertex, !enters);
    }
  }

  void join(int first_facet, int second_facet, int vertex, bool begins) {
    int& other = w_.open[static_cast<size_t>(first_facet) * w_.second.facets + second_facet];
    const int mine = begins ? vertex + 1 : -vertex - 1;
    if (other == 0) {
      other = mine;
      ++w_.unpaired;
    } else if ((other > 0) != begins) {
      const int begin = begins ? vertex : other - 1, end = begins ? -other - 1 : vertex;
      w_.seam.push_back({begin, end, first_facet, w_.first.facets + second_facet});
      other = 0;
      --w_.unpaired;
    }
  }

  Workspace& w_;
  double rounding_;
};

/// Counts coordinates from the middle of the vertices, which it returns.
Vec3 centre(std::vector<Vec3>& vertices) {
  Vec3 middle;
  for (Vec3 v : vertices) middle += v;
  middle = middle / static_cast<double>(vertices.size());
  for (Vec3& v : vertices) v -= middle;
  return middle;
}

/// Sums over the common polytope that a tracer has left, its vertices counted from a point inside.
class Sums {
 public:
  /// `size` is how far the vertices reach along each axis, or any other unit of length.
  Sums(Workspace& workspace, Vec3 size) : w_(workspace) {
    const Vec3 per_size{1 / size.x, 1 / size.y, 1 / size.z};
    w_.apex.assign(w_.first.facets + w_.second.facets, -1);
    w_.cone.assign(w_.first.facets + w_.second.facets, 0);
    w_.extent.clear();
    for (Vec3 v : w_.vertices) w_.extent.push_back(dot(abs(v), per_size));
    for (const auto* list : {&w_.edges, &w_.seam})
      for (const Edge& e : *list) w_.apex[e.left] = w_.apex[e.right] = e.from;
    for (const auto* list : {&w_.edges, &w_.seam})
      for (const Edge& e : *list) add(e);
    for (const Edge& e : w_.seam) add_seam(e);
    // Each product of three coordinates is rounded less than eight times, and then comes the sum of the tetrahedra, of
    // which none is negative.
    const double terms = 2 * static_cast<double>(w_.edges.size() + w_.seam.size());
    rounding_ = 8 * 0x1p-53 * lost_ * size.x * size.y * size.z / 6 + terms * 0x1p-53 * six_volumes_ / 6;
  }

  double volume() const { return six_volumes_ / 6; }
  double volume_rounding() const { return rounding_; }
  Vec3 centroid() const { return moment_ / (4 * six_volumes_); }
  Vec3 pull() const { return pull_; }
  Vec3 moment() const { return turn_ - cross(centroid(), pull_); }

 private:
  void add(const Edge& e) {
    const Vec3 from = w_.vertices[e.from], to = w_.vertices[e.to], sum = from + to;
    const int left_apex = w_.apex[e.left], right_apex = w_.apex[e.right];
    const Vec3 area = cross(from, to), left = w_.vertices[left_apex], right = w_.vertices[right_apex];
    // Tetrahedra from the origin over the edge and a corner of either facet; none is negative.
    const double on_left = dot(left, area), on_right = -dot(right, area);
    lost_ += (w_.extent[left_apex] + w_.extent[right_apex]) * w_.extent[e.from] * w_.extent[e.to];
    w_.cone[e.left] += on_left;
    w_.cone[e.right] += on_right;
    six_volumes_ += on_left + on_right;
    moment_ += on_left * (left + sum) + on_right * (right + sum);
  }

  /// The area vector of a patch, and the integral of x × n over it, are integrals along its border (Stokes).
  void add_seam(const Edge& e) {
    const Vec3 from = w_.vertices[e.from], to = w_.vertices[e.to];
    pull_ += cross(from, to) / 2;
    turn_ -= (norm2(from) + dot(from, to) + norm2(to)) / 6 * (to - from);
  }

  Workspace& w_;
  Vec3 moment_, pull_, turn_;
  double six_volumes_ = 0;
  double lost_ = 0;  ///< the products that the volume is summed from, were none of their terms to cancel
  double rounding_ = 0;
};

/// Distance of a common facet's plane from the middle of the common polytope.
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

/// The volume between the polytope and one whose planes are moved out by `moved`: its area grows on the way.
double moved_volume(double area, double moved, double least_slack) {
  const double grown = 1 + moved / least_slack;
  return moved * area * (grown * grown + grown + 1) / 3;
}

/// Orthogonal axes as rows, the first across the facet nearest to the middle, the second across the one that is nearest
/// to it after that: so along each, coordinates in a sliver or a needle are no larger than its thickness there.
Mat3 thin_axes(const Workspace& w, Vec3 middle) {
  Slack nearest{{}, kInfinity}, next{{}, kInfinity};
  for_each_facet(w, middle, [&](int, const Slack& s) { nearest = s.distance < nearest.distance ? s : nearest; });
  const Vec3 first = unit(nearest.normal);
  for_each_facet(w, middle, [&](int, const Slack& s) {
    const Vec3 along = s.normal - dot(s.normal, first) * first;
    const double length2 = norm2(along);
    if (length2 < 0x1p-10) return;  // a direction of its own has more than rounding left
    const double distance = s.distance / std::sqrt(length2);
    if (distance < next.distance) next = {along, distance};
  });
  const Vec3 along = unit(next.normal), second = unit(along - dot(along, first) * first);
  return {first, second, cross(first, second)};
}

/// Areas of facets from their corners alone.
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

/// What a tracer has left, once more about `middle` from corners placed in wider arithmetic. Leaves `common` as it is
/// where even that is not enough.
void measure_widened(Workspace& w, const Placed& a, const Placed& b, double reach, double least_slack, Vec3 middle,
                     ClippedPair& common) {
  const Mat3 axes = thin_axes(w, middle);
  w.wide.begin(a, b, w.first.facets, static_cast<int>(w.apex.size()), middle, reach);
  for (int f = 0; f < static_cast<int>(w.apex.size()); ++f)
    if (w.apex[f] >= 0 && !w.wide.add_plane(f)) return;
  w.wide.place(w.corners, axes, w.vertices);
  Vec3 size;
  for (Vec3 v : w.vertices) size = max(size, abs(v));
  const Sums sums(w, size);
  const double area = area_by_corners(w);
  // The axes are at right angles and of length 1 but for a few roundings.
  const double error =
      moved_volume(area, w.wide.noise(), least_slack) + sums.volume_rounding() + 16 * 0x1p-53 * sums.volume();
  if (!(error <= kEnough * sums.volume())) return;
  common.measured = common.widened = true;
  common.volume = sums.volume();
  common.volume_error = error;
  common.area = area;
  common.centroid = middle + apply_transposed(axes, sums.centroid());
  common.pull = apply_transposed(axes, sums.pull());
  common.moment = apply_transposed(axes, sums.moment());
}

/// Nothing if a plane passes the middle nearer than `least_slack`.
std::optional<ClippedPair> measure(Workspace& w, const Placed& a, const Placed& b, double reach, double rounding,
                                   double least) {
  const Vec3 middle = centre(w.vertices);
  const Sums sums(w, {1, 1, 1});
  ClippedPair common;
  common.status = Status::kOverlapping;
  common.volume = sums.volume();
  common.centroid = middle + sums.centroid();
  common.pull = sums.pull();
  common.moment = sums.moment();
  double least_slack = kInfinity;
  for_each_facet(w, middle, [&](int f, const Slack& slack) {
    common.area += w.cone[f] / (2 * slack.distance);
    least_slack = std::min(least_slack, slack.distance);
    ++common.facets_touched;
  });
  if (!(least_slack > least)) return std::nullopt;
  common.volume_error = moved_volume(common.area, rounding, least_slack) + sums.volume_rounding();
  common.measured = common.volume_error <= kEnough * common.volume;
  if (!common.measured) measure_widened(w, a, b, reach, least_slack, middle, common);
  return common;
}

/// A bounded polytope in the coordinates of `pose`, or a half-space.
void set_solid(Solid& solid, const Shape& shape, const Pose* pose, double beyond) {
  const auto place = [&](Vec3 v) { return pose ? *pose * v : v; };
  const auto turn = [&](int f, const Plane& plane) {
    const Plane placed = pose ? *pose * plane : plane;
    solid.set_plane(f, placed.normal, placed.offset);
  };
  if (const Box* box = std::get_if<Box>(&shape)) {
    solid.resize(8, 6, beyond);
    for (int i = 0; i < 8; ++i) solid.set_vertex(i, place(corner(*box, i)));
    for (int f = 0; f < 6; ++f) turn(f, side(*box, f));
    solid.edges = kBoxEdges;
  } else if (const Hull* hull = std::get_if<Hull>(&shape)) {
    const HullData& data = *hull->data;
    solid.resize(static_cast<int>(data.vertices.size()), static_cast<int>(data.planes.size()), beyond);
    for (int i = 0; i < solid.vertices; ++i) solid.set_vertex(i, place(data.vertices[i]));
    for (int f = 0; f < solid.facets; ++f) turn(f, data.planes[f]);
    solid.edges = data.edges;
  } else {
    solid.resize(0, 1, beyond);
    turn(0, std::get<HalfSpace>(shape).plane);
    solid.edges = {};
  }
}

/// How far from its own origin a shape reaches; of a half-space, how far its plane is.
double radius(const Shape& shape) {
  if (const Box* box = std::get_if<Box>(&shape)) return norm(box->half_extents);
  if (const Hull* hull = std::get_if<Hull>(&shape)) return hull->data->radius;
  return std::abs(std::get<HalfSpace>(shape).plane.offset);
}

/// What rotating and adding a hull's far origin has cost, as a length.
double lost_far_away(const Placed& body) {
  const Hull* hull = std::get_if<Hull>(&body.shape);
  if (!hull || norm2(hull->data->origin) == 0) return 0;
  const bool turned = body.orientation.w != 1;
  return turned || norm2(body.position) > 0 ? norm(hull->data->origin) + norm(body.position) : 0;
}

int facets(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape)) return static_cast<int>(hull->data->planes.size());
  return std::holds_alternative<Box>(shape) ? 6 : 1;
}

/// Beyond it, asking every vertex of one body against every plane of the other takes longer than the dual hull.
constexpr size_t kMostFacets = 1024;

bool clippable(const Shape& shape) {
  if (const Hull* hull = std::get_if<Hull>(&shape))
    return !hull->data->edges.empty() && hull->data->planes.size() <= kMostFacets;
  return std::holds_alternative<Box>(shape) || std::holds_alternative<HalfSpace>(shape);
}

/// Below it, a table of all signs is sooner filled than a seam found.
constexpr int kLeastFacetsTraced = 64;

bool worth_tracing(const Placed& a, const Placed& b) {
  return traceable(a, b) && facets(a.shape) + facets(b.shape) > kLeastFacetsTraced;
}

Pose relative_pose(const Pose& to, const Pose& of) {
  const Mat3 back = transposed(to.rotation);
  return {back * of.rotation, back * (of.translation - to.translation)};
}

/// The body with more facets comes first, whose coordinates are used; then the order does not depend on the caller's.
bool comes_first(const Placed& a, const Placed& b) {
  const int facets_a = facets(a.shape), facets_b = facets(b.shape);
  return facets_a != facets_b ? facets_a > facets_b : !comes_before(b, a);
}

/// What all signs of a pair are computed from: where the second body is in the first one's own coordinates.
struct Arrangement {
  Pose pose;
  double reach;     ///< how large the numbers are
  double flatness;  ///< by how much planes of facets that are not quite flat miss their corners
  double sign_rounding;
  bool apart;  ///< the balls around the bodies are
};

Arrangement arrange(const Placed& a, const Placed& b) {
  const Pose pose = relative_pose(a.pose, b.pose);
  const double radius_a = radius(a.shape), radius_b = radius(b.shape), between = norm(pose.translation);
  const double reach = std::max(radius_a + lost_far_away(a), between + radius_b + lost_far_away(b));
  double flatness = 0;
  for (const Placed* body : {&a, &b})
    if (const Hull* hull = std::get_if<Hull>(&body->shape)) flatness = std::max(flatness, hull->data->flatness);
  const double sign_rounding = doubt(reach) + 4 * flatness;
  return {pose, reach, flatness, sign_rounding, bounded(b.shape) && between > radius_a + radius_b + sign_rounding};
}

std::optional<ClippedPair> clip_by_table(const Placed& a, const Placed& b) {
  const auto [pose, reach, flatness, sign_rounding, apart] = arrange(a, b);
  if (apart) return ClippedPair{};

  thread_local Workspace workspace;
  set_solid(workspace.first, a.shape, nullptr, 4 * reach);
  set_solid(workspace.second, b.shape, &pose, 4 * reach);
  const Signs signs = Tracer(workspace, sign_rounding).trace();
  if (signs == Signs::kSeparated) return ClippedPair{};
  if (signs == Signs::kUncertain) return std::nullopt;
  // One so thin that rounding might hide it is left to those who look closer.
  return measure(workspace, a, b, reach, rounding(reach) + flatness, 4 * sign_rounding);
}

std::optional<ClippedPair> clip_by_tracing(const Placed& a, const Placed& b) {
  const Arrangement at = arrange(a, b);
  if (at.apart) return ClippedPair{};
  return trace(a, b, at.pose, at.sign_rounding);
}

/// Calls `way` with the body first whose coordinates it will use, and says the answer in terms of `a` and the world.
template <class Way>
std::optional<ClippedPair> in_order(const Placed& a, const Placed& b, bool swapped, Way way) {
  const Placed& first = swapped ? b : a;
  std::optional<ClippedPair> common = way(first, swapped ? a : b);
  if (!common || common->status != Status::kOverlapping) return common;
  common->centroid = first.pose * common->centroid;
  common->pull = first.pose.rotation * common->pull;
  common->moment = first.pose.rotation * common->moment;
  if (swapped) {
    // Not the negatives, which would make negative zeros.
    common->pull = Vec3{} - common->pull;
    common->moment = Vec3{} - common->moment;
  }
  return common;
}

}  // namespace

std::optional<ClippedPair> clip(const Placed& a, const Placed& b) {
  if (worth_tracing(a, b))
    if (auto traced = in_order(a, b, comes_before(b, a), clip_by_tracing)) return traced;
  if (!clippable(a.shape) || !clippable(b.shape) || !(bounded(a.shape) || bounded(b.shape))) return std::nullopt;
  return in_order(a, b, !comes_first(a, b), clip_by_table);
}

std::optional<Region> region_of_clipped(const Placed& a, const Placed& b, Vec3 reference) {
  const Arrangement at = arrange(a, b);
  return traced_region(a, b, at.pose, at.sign_rounding, reference);
}

}  // namespace overlapper
