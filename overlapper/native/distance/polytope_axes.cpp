#include "distance/polytope_axes.h"

#include <limits>
#include <vector>

#include "geometry/rounding.h"
#include "geometry/thresholds.h"
#include "geometry/wide.h"
#include "shapes/solid.h"

namespace overlapper {
namespace {

/// A direction, and the lowest vertex of the other solid along it.
struct Lowest {
  Vec3 direction;  ///< unit
  int vertex;      ///< lowest along the direction
  double height;   ///< height of that vertex
};

/// The ways out along the facet normals of one solid. If the first few vertices already show that a way is longer than
/// the best known one, its search ends at the lowest of these vertices.
void lowest_along_normals(const Solid& faces, const Solid& other, double best, std::vector<Lowest>& ways) {
  ways.resize(faces.stride);
  for (int f = 0; f < faces.facets; f += 4) {
    const TwoLanes ax = load(&faces.nx[f]), ay = load(&faces.ny[f]), az = load(&faces.nz[f]),
                   top_a = load(&faces.offset[f]);
    const TwoLanes bx = load(&faces.nx[f + 2]), by = load(&faces.ny[f + 2]), bz = load(&faces.nz[f + 2]);
    const TwoLanes top_b = load(&faces.offset[f + 2]);
    TwoLanes height_a = TwoLanes{} + std::numeric_limits<double>::infinity(), height_b = height_a, lowest_a{},
             lowest_b{};
    for (int v = 0; v < other.vertices;) {
      for (const int end = std::min(v + kGlance, other.vertices); v < end; ++v) {
        const double x = other.x[v], y = other.y[v], z = other.z[v];
        const TwoLanes a = ax * x + ay * y + az * z, b = bx * x + by * y + bz * z,
                       number = TwoLanes{} + static_cast<double>(v);
        choose(a < height_a, number, lowest_a, lowest_a);
        choose(a < height_a, a, height_a, height_a);
        choose(b < height_b, number, lowest_b, lowest_b);
        choose(b < height_b, b, height_b, height_b);
      }
      const auto shorter = (top_a - height_a < best) | (top_b - height_b < best);
      if (!(shorter[0] | shorter[1])) break;
    }
    for (int i = 0; i < 2; ++i) {
      ways[f + i] = {faces.normal(f + i), static_cast<int>(lowest_a[i]), height_a[i]};
      ways[f + 2 + i] = {faces.normal(f + 2 + i), static_cast<int>(lowest_b[i]), height_b[i]};
    }
    for (int i = f; i < std::min(f + 4, faces.facets); ++i) best = std::min(best, faces.offset[i] - ways[i].height);
  }
}

/// The least translation that separates two solids in the same coordinates.
class PartingSearch {
 public:
  PartingSearch(const Solid& a, const Solid& b, double rounding) : a_(a), b_(b), rounding_(rounding) {}

  /// False if the solids may be separated, or if doubles cannot decide.
  bool run() {
    thread_local std::vector<Lowest> of_a, of_b;
    lowest_along_normals(a_, b_, best_.depth, of_a);
    for (int f = 0; f < a_.facets; ++f) keep(of_a[f].direction, a_.offset[f] - of_a[f].height);
    if (best_.depth <= 4 * rounding_) return false;
    lowest_along_normals(b_, a_, best_.depth, of_b);
    for (int f = 0; f < b_.facets; ++f) keep(-of_b[f].direction, b_.offset[f] - of_b[f].height);
    for (const Edge& e : a_.edges) {
      if (best_.depth <= 4 * rounding_) return false;
      if (!search_arc(e, of_a[e.left], of_a[e.right], kMostTurns)) return false;
    }
    return best_.depth > 4 * rounding_;
  }

  const Penetration& best() const { return best_; }

 private:
  void keep(Vec3 direction, double depth) {
    if (depth < best_.depth) best_ = {depth, Vec3{} - direction};
  }

  /// Searches for shorter ways out between two directions along which the support of a is the same edge.
  bool search_arc(const Edge& edge, const Lowest& left, const Lowest& right, int turns) {
    if (left.vertex == right.vertex) return true;
    const Vec3 from = a_.vertex(edge.from), low_left = b_.vertex(left.vertex), low_right = b_.vertex(right.vertex);
    const Vec3 step = low_right - low_left;
    const double rise = dot(left.direction, step), fall = -dot(right.direction, step);
    // The vertex of one end is also lowest at the other end. One vertex then bounds the whole arc.
    if (!(rise > 0 && fall > 0)) return true;
    // Both vertices of b are equally low in this direction, which gives a lower bound of the support of the difference.
    // Between this direction and either end, the vertex of that end bounds the support: it is at least the lesser of
    // the two supports.
    const Vec3 crossing = left.direction + rise / (rise + fall) * (right.direction - left.direction);
    if (dot(crossing, from - low_left) - rounding_ >= best_.depth * std::sqrt(norm2(crossing))) return true;
    if (turns == 0) return false;
    const Lowest across = lowest(orthogonal(edge, left.vertex, right.vertex));
    if (dot(across.direction, from) - across.height < best_.depth - rounding_) {
      const double depth = highest(across.direction) - across.height;
      // Where a face and two edges agree to rounding, the face is the better witness.
      if (depth < best_.depth - rounding_) keep(across.direction, depth);
    }
    if (dot(across.direction, low_left) - across.height <= rounding_) return true;
    return search_arc(edge, left, across, turns - 1) && search_arc(edge, across, right, turns - 1);
  }

  /// The unit vector that is orthogonal to the edge and to the segment between two vertices of b.
  Vec3 orthogonal(const Edge& edge, int left, int right) const {
    const Vec3 along = a_.vertex(edge.to) - a_.vertex(edge.from), step = b_.vertex(right) - b_.vertex(left);
    const Vec3 product = cross(along, step);
    if (16 * norm2(product) > norm2(along) * norm2(step)) return unit(product);
    // In doubles, rounding would tilt the product of two nearly parallel edges along these edges.
    return unit(rounded(cross(wide_difference(a_.vertex(edge.to), a_.vertex(edge.from)),
                              wide_difference(b_.vertex(right), b_.vertex(left)))));
  }

  Lowest lowest(Vec3 direction) const {
    Lowest way{direction, 0, std::numeric_limits<double>::infinity()};
    for (int v = 0; v < b_.vertices; ++v) {
      const double height = dot(direction, b_.vertex(v));
      if (height < way.height) way.height = height, way.vertex = v;
    }
    return way;
  }

  double highest(Vec3 direction) const {
    double height = -std::numeric_limits<double>::infinity();
    for (int v = 0; v < a_.vertices; ++v) height = std::max(height, dot(direction, a_.vertex(v)));
    return height;
  }

  const Solid &a_, &b_;
  double rounding_;  ///< m: error of heights, by rounding and by facets that are not quite flat
  Penetration best_{std::numeric_limits<double>::infinity(), {}};
};

}  // namespace

std::optional<Penetration> polytope_penetration(const Placed& a, const Placed& b) {
  if (edges(a.shape).empty() || edges(b.shape).empty()) return std::nullopt;
  if (facets(a.shape) + facets(b.shape) > kMostFacetsParted) return std::nullopt;
  if (facets(b.shape) < facets(a.shape)) {
    auto swapped = polytope_penetration(b, a);
    if (swapped) swapped->normal = Vec3{} - swapped->normal;
    return swapped;
  }
  const Pose pose = relative_pose(a.pose, b.pose);
  const double between = radius(a.shape) + radius(b.shape) + norm(pose.translation);
  const double of_heights = rounding(reach(b, reach(a, between))), flat = flatness(a.shape) + flatness(b.shape);
  if (flat > 4 * of_heights) return std::nullopt;
  thread_local Solid solid_a, solid_b;
  constexpr double beyond = std::numeric_limits<double>::infinity();
  set_solid(solid_a, a, 0, nullptr, beyond);
  set_solid(solid_b, b, 1, &pose, beyond);
  PartingSearch search(solid_a, solid_b, of_heights + flat);
  if (!search.run()) return std::nullopt;
  return Penetration{search.best().depth, a.pose.rotation * search.best().normal};
}

}  // namespace overlapper
