#include "clip.h"

#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "canonical_order.h"
#include "minkowski.h"

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
/// Vertex number's bit k and facet 2 k + that bit say on which side of axis k they are.
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
  std::vector<Edge> edges;                       ///< of the common polytope
  std::vector<Edge> seam;  ///< its edges between the first body's facets, on the left, and the second's
  std::vector<int>
      open;  ///< per pair of facets: 1 + the vertex at which their common edge begins, minus that if it ends there
  int unpaired = 0;
  std::vector<int> apex;     ///< per facet: one of its vertices, or -1
  std::vector<double> cone;  ///< per facet: six times the volume of the cone from the origin
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
  int add_vertex(Vec3 v) {
    w_.vertices.push_back(v);
    return static_cast<int>(w_.vertices.size()) - 1;
  }

  bool trace(const Solid& body, SignTable& signs, std::vector<int>& common_vertex, bool is_first) {
    common_vertex.assign(body.vertices, -1);
    for (int i = 0; i < body.vertices; ++i)
      if (signs.inside[i]) common_vertex[i] = add_vertex(body.vertex(i));
    const int offset = is_first ? 0 : w_.first.facets;
    for (const Edge& e : body.edges) {
      const bool from_inside = signs.inside[e.from], to_inside = signs.inside[e.to];
      Edge common{common_vertex[e.from], common_vertex[e.to], e.left + offset, e.right + offset};
      if (!(from_inside && to_inside)) {
        const Vec3 from = body.vertex(e.from), along = body.vertex(e.to) - from;
        const EdgeSigns edge{signs.row(e.from), signs.row(e.to), signs.stride,
                             std::abs(along.x) + std::abs(along.y) + std::abs(along.z), rounding_};
        const auto cross = [&](Crossing crossing, bool enters) {
          const int v = add_vertex(from + crossing.at * along);
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

/// Sums over the common polytope that a tracer has left.
class Sums {
 public:
  explicit Sums(Workspace& workspace) : w_(workspace) {
    for (Vec3 v : w_.vertices) origin_ += v;
    origin_ = origin_ / static_cast<double>(w_.vertices.size());
    for (Vec3& v : w_.vertices) v -= origin_;
    w_.apex.assign(w_.first.facets + w_.second.facets, -1);
    w_.cone.assign(w_.first.facets + w_.second.facets, 0);
    for (const auto* list : {&w_.edges, &w_.seam})
      for (const Edge& e : *list) w_.apex[e.left] = w_.apex[e.right] = e.from;
    for (const auto* list : {&w_.edges, &w_.seam})
      for (const Edge& e : *list) add(e);
    for (const Edge& e : w_.seam) add_seam(e);
  }

  /// Nothing if a plane passes the middle nearer than `least`.
  std::optional<ClippedPair> measures(double rounding, double least) const {
    ClippedPair common;
    common.status = Status::kOverlapping;
    common.volume = six_volumes_ / 6;
    common.centroid = origin_ + moment_ / (4 * six_volumes_);
    common.pull = pull_;
    common.moment = turn_ - cross(common.centroid - origin_, pull_);
    double least_slack = kInfinity;
    for (size_t f = 0; f < w_.cone.size(); ++f) {
      if (w_.apex[f] < 0) continue;
      const bool first = f < static_cast<size_t>(w_.first.facets);
      const Solid& body = first ? w_.first : w_.second;
      const int plane = static_cast<int>(first ? f : f - w_.first.facets);
      const double slack = body.offset[plane] - dot(body.normal(plane), origin_);
      common.area += w_.cone[f] / (2 * slack);
      least_slack = std::min(least_slack, slack);
      ++common.facets_touched;
    }
    if (!(least_slack > least)) return std::nullopt;
    // As for a region: every plane moved by its rounding, growth on the way included. Then each product of three
    // coordinates, rounded less than eight times, and the sum of the tetrahedra, of which none is negative.
    const double grown = 1 + rounding / least_slack;
    const double terms = 2 * static_cast<double>(w_.edges.size() + w_.seam.size());
    const double summed = 8 * 0x1p-53 * lost_ / 6 + terms * 0x1p-53 * common.volume;
    common.volume_error = rounding * common.area * (grown * grown + grown + 1) / 3 + summed;
    common.measured = common.volume_error <= kEnough * common.volume;
    return common;
  }

 private:
  static double extent(Vec3 v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }

  void add(const Edge& e) {
    const Vec3 from = w_.vertices[e.from], to = w_.vertices[e.to], sum = from + to;
    const Vec3 area = cross(from, to), left = w_.vertices[w_.apex[e.left]], right = w_.vertices[w_.apex[e.right]];
    // Tetrahedra from the origin over the edge and a corner of either facet; none is negative.
    const double on_left = dot(left, area), on_right = -dot(right, area);
    lost_ += (extent(left) + extent(right)) * extent(from) * extent(to);
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
  Vec3 origin_, moment_, pull_, turn_;
  double six_volumes_ = 0;
  double lost_ = 0;  ///< the products that the volume is summed from, were none of their terms to cancel
};

/// A bounded polytope in the coordinates of `pose`, or a half-space.
void set_solid(Solid& solid, const Shape& shape, const Pose* pose, double beyond) {
  const auto place = [&](Vec3 v) { return pose ? *pose * v : v; };
  const auto turn = [&](int f, const Plane& plane) {
    const Plane placed = pose ? *pose * plane : plane;
    solid.set_plane(f, placed.normal, placed.offset);
  };
  if (const Box* box = std::get_if<Box>(&shape)) {
    const Vec3 h = box->half_extents;
    solid.resize(8, 6, beyond);
    for (int i = 0; i < 8; ++i)
      solid.set_vertex(i, place({i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z}));
    for (int f = 0; f < 6; ++f) {
      const double side = f & 1 ? 1 : -1;
      const int k = f / 2;
      turn(f, {{k == 0 ? side : 0, k == 1 ? side : 0, k == 2 ? side : 0}, h[k]});
    }
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

Pose relative_pose(const Pose& to, const Pose& of) {
  const Mat3 back = transposed(to.rotation);
  return {back * of.rotation, back * (of.translation - to.translation)};
}

/// The body with more facets comes first, whose coordinates are used; then the order does not depend on the caller's.
bool comes_first(const Placed& a, const Placed& b) {
  const int facets_a = facets(a.shape), facets_b = facets(b.shape);
  return facets_a != facets_b ? facets_a > facets_b : !comes_before(b, a);
}

std::optional<ClippedPair> clip_in_order(const Placed& a, const Placed& b) {
  const Pose pose = relative_pose(a.pose, b.pose);
  const double radius_a = radius(a.shape), radius_b = radius(b.shape), apart = norm(pose.translation);
  const double reach = std::max(radius_a + lost_far_away(a), apart + radius_b + lost_far_away(b));
  double flatness = 0;
  for (const Placed* body : {&a, &b})
    if (const Hull* hull = std::get_if<Hull>(&body->shape)) flatness = std::max(flatness, hull->data->flatness);
  const double sign_rounding = doubt(reach) + 4 * flatness;
  if (bounded(b.shape) && apart > radius_a + radius_b + sign_rounding) return ClippedPair{};

  thread_local Workspace workspace;
  set_solid(workspace.first, a.shape, nullptr, 4 * reach);
  set_solid(workspace.second, b.shape, &pose, 4 * reach);
  const Signs signs = Tracer(workspace, sign_rounding).trace();
  if (signs == Signs::kSeparated) return ClippedPair{};
  if (signs == Signs::kUncertain) return std::nullopt;
  // One so thin that rounding might hide it is left to those who look closer.
  std::optional<ClippedPair> common = Sums(workspace).measures(rounding(reach) + flatness, 4 * sign_rounding);
  if (!common) return std::nullopt;
  common->centroid = a.pose * common->centroid;
  common->pull = a.pose.rotation * common->pull;
  common->moment = a.pose.rotation * common->moment;
  return common;
}

}  // namespace

std::optional<ClippedPair> clip(const Placed& a, const Placed& b) {
  if (!clippable(a.shape) || !clippable(b.shape) || !(bounded(a.shape) || bounded(b.shape))) return std::nullopt;
  if (comes_first(a, b)) return clip_in_order(a, b);
  std::optional<ClippedPair> common = clip_in_order(b, a);
  if (common) {
    // Not the negatives, which would make negative zeros.
    common->pull = Vec3{} - common->pull;
    common->moment = Vec3{} - common->moment;
  }
  return common;
}

}  // namespace overlapper
