#include "overlap/errors.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <unordered_map>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/ridges.h"
#include "methods/dual/wide_dual.h"
#include "overlap/dual_tree.h"

namespace overlapper {
namespace {

/// Error of a sum of products of coordinates, relative to the sum of their sizes; the same as for a region's volume.
constexpr double kSums = 256 * DBL_EPSILON;

/// Two planes with a smaller sine between them are nearly flush: the length of their common strip is then measured.
constexpr double kNearlyFlush = 0x1p-4;

/// A plane relative to the origin of a region's frame.
struct FramePlane {
  Vec3 dual;    ///< in the frame
  Vec3 normal;  ///< unit, in the world
  double slack, moved;
  int owner;

  double slack_at(Vec3 y) const { return slack * (1 - dot(dual, y)); }
};

/// The numbers of all corners of a polygon.
std::vector<int> numbers(const std::vector<Vec3>& polygon) {
  std::vector<int> all(polygon.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Finds the planes of other bodies that pass near a facet, in trees.
class OthersNear {
 public:
  OthersNear(std::vector<FramePlane> planes, std::span<const FramePlane> facets, int bodies)
      : planes_(std::move(planes)), bodies_(bodies) {
    double facet_moved = 0;
    for (const FramePlane& facet : facets) facet_moved = std::max(facet_moved, facet.moved);
    std::vector<std::vector<DualTree::Entry>> of_body(bodies);
    for (size_t i = 0; i < planes_.size(); ++i) {
      const FramePlane& plane = planes_[i];
      most_moved_ = std::max(most_moved_, plane.moved);
      // The plane moved inwards by its error: slack_at(y) <= distance where the dual point of the moved plane reaches
      // y.
      const double left = 1 - (facet_moved + plane.moved) / plane.slack;
      if (!(plane.slack > 0 && left >= 0.5)) {
        everywhere_.push_back(static_cast<int>(i));
        continue;
      }
      const Vec3 point = plane.dual / left;
      largest_ = std::max(largest_, norm(point));
      of_body[plane.owner].push_back({point, static_cast<int>(i)});
    }
    halve(of_body, 0, bodies);
  }

  double most_moved() const { return most_moved_; }

  /// Calls `visit(plane, corners)` for each plane of another body than `owner` that is near some corners of the
  /// polygon: no farther than both planes may have moved. Ends once `visit` returns false.
  template <class Visit>
  void visit(int owner, const std::vector<Vec3>& polygon, Visit visit) const {
    const std::vector<int> all = everywhere_.empty() ? std::vector<int>() : numbers(polygon);
    for (int i : everywhere_)
      if (planes_[i].owner != owner && !visit(planes_[i], std::span<const int>(all))) return;
    double farthest = 0;
    for (Vec3 corner : polygon) farthest = std::max(farthest, norm(corner));
    const double level = 1 - 64 * DBL_EPSILON * std::max(1.0, largest_ * farthest);
    for (int at = 0, begin = 0, end = bodies_; end - begin > 1;) {
      const Halves& here = halves_[at];
      const int middle = begin + (end - begin) / 2;
      const bool first = owner < middle;
      const DualTree& others = first ? here.second : here.first;
      if (!others.reaching(polygon, level, [&](int i, std::span<const int> near) { return visit(planes_[i], near); }))
        return;
      at = first ? here.within_first : here.within_second;
      (first ? end : begin) = middle;
    }
  }

 private:
  /// One tree for the planes of the first half of some bodies, and one for the second half. By repeated halving, the
  /// planes of all bodies but one then lie in log2(bodies) trees.
  struct Halves {
    DualTree first, second;
    int within_first, within_second;
  };

  int halve(const std::vector<std::vector<DualTree::Entry>>& of_body, int begin, int end) {
    if (end - begin < 2) return -1;
    const int middle = begin + (end - begin) / 2, at = static_cast<int>(halves_.size());
    const auto tree = [&](int from, int to) {
      std::vector<DualTree::Entry> entries;
      for (int i = from; i < to; ++i) entries.insert(entries.end(), of_body[i].begin(), of_body[i].end());
      return DualTree(std::move(entries));
    };
    halves_.push_back({tree(begin, middle), tree(middle, end), -1, -1});
    const int within_first = halve(of_body, begin, middle), within_second = halve(of_body, middle, end);
    halves_[at].within_first = within_first, halves_[at].within_second = within_second;
    return at;
  }

  std::vector<FramePlane> planes_;
  std::vector<Halves> halves_;
  std::vector<int> everywhere_;  ///< planes with so large an error that they are near every polygon
  int bodies_;
  double most_moved_ = 0, largest_ = 0;
};

/// The distance of a polytope's surface from the surface between its planes, as a fraction of the distance from the
/// origin.
///
/// Each corner lies on its own planes and inside the neighbouring planes, up to this fraction. The closed surface of
/// the corners then lies between the polytope shrunk and grown by this fraction. Where planes nearly coincide, a corner
/// may be anywhere along their line without harm to the surface.
double misfit(const Polytope& p) {
  const Ridges ridges(p);
  const auto off = [&](int facet, int vertex) { return dot(p.dual[facet], p.vertices[vertex]) - 1; };
  double worst = 0, product = 0;
  for (int f = 0; f < p.facets(); ++f) {
    cancellation_point();
    const auto ring = p.facet(f);
    for (size_t i = 0; i < ring.size(); ++i) {
      const int from = ring[i], to = ring[(i + 1) % ring.size()], next = ring[(i + 2) % ring.size()];
      worst = std::max({worst, std::abs(off(f, from)), off(ridges.left_of(to, from), next)});
      product = std::max(product, norm(p.dual[f]) * norm(p.vertices[from]));
    }
  }
  return worst + 2 * DBL_EPSILON * product;
}

/// The polytope of a region in metres about the origin of its frame, with the error bounds of its planes.
class Sandwich {
 public:
  Sandwich(const Region& region, std::span<const Placed> bodies)
      : region_(region), bodies_(bodies), polyhedral_(polyhedral(bodies)) {
    for (const Placed& body : bodies) relative_.push_back(body.seen_from(region.reference));
    const Polytope& p = region.polytope;
    for (Vec3 y : p.vertices) corners_.push_back(region.frame.axes * y);
    for (double inner : region.inner) pulled_ = std::max(pulled_, 1 - inner);
    for (int f = 0; f < p.facets(); ++f) {
      const Region::Facet& facet = region.facets[f];
      double pulled = 0;
      for (int v : p.facet(f)) pulled = std::max(pulled, 1 - region.inner[v]);
      facets_.push_back({p.dual[f], facet.normal, facet.slack, facet.rounding + pulled * facet.slack, facet.owner});
      moved_ = std::max(moved_, facet.rounding / facet.slack);
    }
  }

  double outer() const { return 1 + moved_; }
  double inner() const { return std::max(0.0, 1 - moved_ - pulled_); }

  /// m: the distance of the farthest corner from `about`.
  double radius(Vec3 about) const {
    double farthest = 0;
    for (Vec3 corner : corners_) farthest = std::max(farthest, norm2(corner - about));
    return outer() * std::sqrt(farthest);
  }

  /// m: error by the placing of corners and by the movement of planes.
  double vertices() const { return (misfit(region_.polytope) + outer() - inner()) * radius({}); }

  /// m²: the area whose owner is uncertain.
  double doubtful_area() const {
    const std::vector<double> of_facets = polyhedral_ ? doubtful_among_planes() : doubtful_beside_smooth();
    double sum = 0;
    for (size_t f = 0; f < of_facets.size(); ++f) sum += std::min(area(f), of_facets[f]);
    return sum;
  }

 private:
  std::vector<Vec3> polygon(size_t facet) const {
    std::vector<Vec3> corners;
    for (int v : region_.polytope.facet(static_cast<int>(facet))) corners.push_back(region_.polytope.vertices[v]);
    return corners;
  }

  static Vec3 middle(const std::vector<Vec3>& corners) {
    Vec3 sum;
    for (Vec3 y : corners) sum += y;
    return sum / static_cast<double>(corners.size());
  }

  double area(size_t facet) const {
    const auto ring = region_.polytope.facet(static_cast<int>(facet));
    const Vec3 from = corners_[ring[0]];
    double sum = 0;
    for (size_t i = 1; i + 1 < ring.size(); ++i)
      sum += norm(cross(corners_[ring[i]] - from, corners_[ring[i + 1]] - from)) / 2;
    return sum;
  }

  /// m², per facet: the area where a plane of another body, in the surface or just behind it, may be the outer plane.
  /// The search ends once this is the whole facet.
  std::vector<double> doubtful_among_planes() const {
    const OthersNear near(planes_of_bodies(), facets_, static_cast<int>(bodies_.size()));
    std::vector<double> areas;
    for (size_t f = 0; f < facets_.size(); ++f) {
      cancellation_point();
      const FramePlane& facet = facets_[f];
      const auto ring = region_.polytope.facet(static_cast<int>(f));
      double around = 0;
      for (size_t i = 0; i < ring.size(); ++i)
        around += norm(corners_[ring[i]] - corners_[ring[(i + 1) % ring.size()]]);
      // Along a plane that is not nearly flush, the slack grows by at least kNearlyFlush times the distance from the
      // facet's border.
      double doubtful = around * 2 * (facet.moved + near.most_moved()) / kNearlyFlush;
      const double all = area(f);
      const std::vector<Vec3> corners = polygon(f);
      near.visit(facet.owner, corners, [&](const FramePlane& plane, std::span<const int> near_corners) {
        const bool flush = norm2(cross(plane.normal, facet.normal)) <= kNearlyFlush * kNearlyFlush;
        if (flush) doubtful += area_within(corners, near_corners, plane, facet.moved + plane.moved);
        return !(doubtful >= all);
      });
      areas.push_back(doubtful);
    }
    return areas;
  }

  /// The cell of a direction in the cube around all directions. Cells are as wide as the difference of directions that
  /// count as nearly flush.
  static int64_t cell_of(Vec3 direction, Vec3 step) {
    const auto place = [](double x, double by) { return static_cast<int64_t>(std::floor(x / kNearlyFlush) + by) + 64; };
    return (place(direction.x, step.x) * 128 + place(direction.y, step.y)) * 128 + place(direction.z, step.z);
  }

  /// m², per facet: the area along the seam, or the whole facet if a smooth body is just behind its middle.
  std::vector<double> doubtful_beside_smooth() const {
    const Ridges ridges(region_.polytope);
    std::vector<double> areas;
    for (size_t f = 0; f < facets_.size(); ++f) {
      cancellation_point();
      const std::vector<Vec3> corners = polygon(f);
      double doubtful = beside_smooth(corners, facets_[f]) ? kInfinity : 0;
      const double all = area(f);
      const auto ring = region_.polytope.facet(static_cast<int>(f));
      for (size_t i = 0; i < ring.size() && !(doubtful >= all); ++i) {
        const FramePlane& plane = facets_[ridges.left_of(ring[(i + 1) % ring.size()], ring[i])];
        if (plane.owner == facets_[f].owner) continue;
        const double moved = facets_[f].moved + plane.moved;
        const std::vector<int> near = near_edge(corners, i, plane, moved);
        if (!near.empty()) doubtful += area_within(corners, near, plane, moved);
      }
      areas.push_back(doubtful);
    }
    return areas;
  }

  /// The corners of a convex polygon no farther than `distance` from a plane through its edge number `edge`, in order.
  /// From either end of the edge, the distance from the plane grows until the ring turns back to the edge.
  static std::vector<int> near_edge(const std::vector<Vec3>& polygon, size_t edge, const FramePlane& plane,
                                    double distance) {
    const size_t corners = polygon.size();
    std::vector<int> near;
    const auto add = [&](size_t place) {
      if (near.size() == corners || !(plane.slack_at(polygon[place % corners]) - distance <= 0)) return false;
      near.push_back(static_cast<int>(place % corners));
      return true;
    };
    for (size_t ahead = 1; add(edge + ahead);) ++ahead;
    for (size_t back = 0; add(edge + corners - back);) ++back;
    std::ranges::sort(near);
    return near;
  }

  /// The planes that may pass through the polytope's facets, each once. A facet of many corners has several triangles
  /// in one plane, but for rounding.
  std::vector<FramePlane> planes_of_bodies() const {
    std::vector<FramePlane> planes;
    std::unordered_map<int64_t, int> last_in_cell;
    const double farthest = farthest_vertex(region_.polytope);
    for (const WideDual& dual : wide_duals(bodies_, region_.reference, region_.frame, farthest)) {
      const double rounding = rounding_of_dual(dual.slack, dual.point, farthest);
      const auto [last, first] = last_in_cell.try_emplace(cell_of(dual.normal, {}) * 64 + dual.owner % 64, -1);
      if (!first) {
        FramePlane& before = planes[last->second];
        const double off = dual.slack * norm(dual.point - before.dual) * farthest;
        if (before.owner == dual.owner && off <= rounding) {
          before.moved = std::max(before.moved, rounding + off);
          continue;
        }
      }
      last->second = static_cast<int>(planes.size());
      planes.push_back({dual.point, dual.normal, dual.slack, rounding, dual.owner});
    }
    return planes;
  }

  /// m²: the area of a polygon in the frame where the plane is no farther than the given distance. Only the corners
  /// `near`, in order, may be so near.
  double area_within(const std::vector<Vec3>& polygon, std::span<const int> near, const FramePlane& plane,
                     double distance) const {
    std::vector<Vec3> kept;
    const int corners = static_cast<int>(polygon.size());
    const auto keep_from = [&](int corner) {
      const Vec3 from = polygon[corner], to = polygon[(corner + 1) % corners];
      const double before = plane.slack_at(from) - distance, after = plane.slack_at(to) - distance;
      if (before <= 0) kept.push_back(from);
      if ((before < 0) != (after < 0)) kept.push_back(from + before / (before - after) * (to - from));
    };
    for (size_t i = 0; i < near.size(); ++i) {
      if (near[i] > 0 && (i == 0 || near[i - 1] < near[i] - 1)) keep_from(near[i] - 1);
      keep_from(near[i]);
    }
    if (near.front() == 0 && near.back() < corners - 1) keep_from(corners - 1);
    double area = 0;
    for (size_t i = 1; i + 1 < kept.size(); ++i) {
      const Mat3& axes = region_.frame.axes;
      area += norm(cross(axes * (kept[i] - kept[0]), axes * (kept[i + 1] - kept[0]))) / 2;
    }
    return area;
  }

  /// True if a smooth body of another owner is behind the middle of a facet, no farther than the facet may have moved.
  bool beside_smooth(const std::vector<Vec3>& polygon, const FramePlane& facet) const {
    const Vec3 direction = region_.frame.axes * middle(polygon);
    for (size_t i = 0; i < bodies_.size(); ++i) {
      if (static_cast<int>(i) == facet.owner || !smooth(bodies_[i].shape)) continue;
      const Plane plane = relative_[i].ray_exit(region_.frame.origin, direction);
      if (signed_distance(plane, region_.frame.origin + direction) > -4 * facet.moved) return true;
    }
    return false;
  }

  const Region& region_;
  std::span<const Placed> bodies_;
  bool polyhedral_;
  std::vector<Placed> relative_;  ///< about the region's reference
  std::vector<Vec3> corners_;     ///< m, about the frame's origin
  std::vector<FramePlane> facets_;
  double moved_ = 0;   ///< largest movement of a plane by rounding, relative to its slack
  double pulled_ = 0;  ///< of vertices into smooth shapes, by tangent planes
};

Stated stated_of(const MeasuresAndInertia& values, size_t bodies) {
  const Measures& m = values.measures;
  Stated stated{m.area, m.centroid, *values.inertia, {}};
  for (size_t i = 0; i < bodies; ++i)
    stated.gradient.push_back(gradient_row(bodies == 2 ? m.pulls[i] : m.pulls_of_group[i]));
  return stated;
}

/// The lengths of the differences of force and moment between two rows of a gradient.
std::array<double, 2> apart(const std::array<double, 6>& a, const std::array<double, 6>& b) {
  return {norm(Vec3{a[0] - b[0], a[1] - b[1], a[2] - b[2]}), norm(Vec3{a[3] - b[3], a[4] - b[4], a[5] - b[5]})};
}

double apart(const Mat3& a, const Mat3& b) {
  return std::max(
      {max_component(abs(a.row0 - b.row0)), max_component(abs(a.row1 - b.row1)), max_component(abs(a.row2 - b.row2))});
}

double most_distance2(const MeasuresAndInertia& values) {
  return most_distance2(*values.inertia, values.measures.volume);
}

/// The box around the smallest body.
struct Room {
  double diameter = kInfinity, surface = kInfinity;
  Vec3 middle;
};
Room room(std::span<const Placed> bodies) {
  Room least;
  for (const Placed& body : bodies) {
    if (!bounded(body.shape)) continue;
    const Bounds box = bounds(body);
    const Vec3 side = box.upper - box.lower;
    if (!(norm(side) < least.diameter)) continue;
    least = {norm(side), surface(box), box.lower + side / 2};
  }
  return least;
}

}  // namespace

StatedWithErrors measured_with_errors(const Region& region, std::span<const Placed> bodies) {
  const MeasuresAndInertia values = measure(region, bodies);
  const Measures& m = values.measures;
  const Sandwich sandwich(region, bodies);
  const double outer = sandwich.outer(), inner = sandwich.inner();
  const double between = outer * outer * outer - inner * inner * inner;

  Errors errors;
  errors.volume = m.volume_error;
  errors.area = m.area * (std::max(outer * outer - 1, 1 - inner * inner) + kSums);
  const double radius = sandwich.radius(m.centroid - region.reference - region.frame.origin);
  const double last_bits = 4 * DBL_EPSILON * norm(m.centroid);
  const double displaced = (between / (inner * inner * inner) + kSums) * radius;
  errors.centroid = displaced + last_bits;
  const double most = m.volume * (1 + between);
  errors.inertia = most * ((between + kSums) * radius * radius + displaced * displaced);

  // Patches grow and shrink with the set. In addition, the area of uncertain owner may belong to either body.
  const double force = sandwich.doubtful_area() + (between + kSums) * m.area;
  for (const Placed& body : bodies)
    errors.gradient.push_back({force, force * (norm(m.centroid - body.position) + radius)});
  return {stated_of(values, bodies.size()), std::move(errors), displaced, radius};
}

double error_of_vertices(const Region& region, const Boundary& boundary, std::span<const Placed> bodies) {
  const Sandwich sandwich(region, bodies);
  double world = 0;
  for (Vec3 v : boundary.vertices) world = std::max(world, norm(v));
  const double error = sandwich.vertices() + boundary.merged + 4 * DBL_EPSILON * world, most = least_diameter(bodies);
  return error <= most ? error : most;
}

Errors errors_beside(const StatedWithErrors& other, const Stated& stated) {
  Errors errors = other.errors;
  errors.area += std::abs(stated.area - other.stated.area);
  errors.centroid += norm(stated.centroid - other.stated.centroid);
  errors.inertia += apart(stated.inertia, other.stated.inertia);
  for (size_t i = 0; i < errors.gradient.size(); ++i) {
    const auto [force, moment] = apart(stated.gradient[i], other.stated.gradient[i]);
    errors.gradient[i][0] += force;
    errors.gradient[i][1] += moment;
  }
  return errors;
}

Errors errors_of_slices(const MeasuresAndInertia& sliced, const Spread& spread, const Stated& stated,
                        std::span<const Placed> bodies) {
  const Measures& m = sliced.measures;
  const double relative = 4 * m.volume_error / m.volume;
  const double radius = std::sqrt(most_distance2(sliced));
  const Stated of_slices = stated_of(sliced, bodies.size());
  Errors errors;
  errors.area = relative * m.area + spread.area + std::abs(stated.area - of_slices.area);
  errors.centroid = (relative + spread.volume / m.volume) * 2 * radius + 4 * DBL_EPSILON * norm(m.centroid) +
                    norm(stated.centroid - of_slices.centroid);
  errors.inertia = error_of_integrated_inertia(sliced, spread) + apart(stated.inertia, of_slices.inertia);
  const double owned = relative * m.area + spread.owned;
  // Moments are about the position of one of the bodies.
  double farthest = 0;
  for (const Placed& body : bodies) farthest = std::max(farthest, norm(m.centroid - body.position));
  const double last_bits = 8 * DBL_EPSILON * m.area * (farthest + radius);
  for (size_t i = 0; i < bodies.size(); ++i) {
    const auto [force, moment] = apart(stated.gradient[i], of_slices.gradient[i]);
    const double lever = norm(m.centroid - bodies[i].position) + radius;
    errors.gradient.push_back({std::max(owned, force), std::max(owned * lever + last_bits, moment)});
  }
  return errors;
}

double error_of_integrated_inertia(const MeasuresAndInertia& values, const Spread& spread) {
  return (4 * values.measures.volume_error + spread.volume) * most_distance2(values) + values.inertia_error;
}

double most_distance2(const Mat3& inertia, double volume) {
  return 45.0 / 4 * (inertia.row0.x + inertia.row1.y + inertia.row2.z) / volume;
}

double farthest_apart(std::span<const Vec3> a, std::span<const Vec3> b) {
  constexpr double kMostCompared = 1e7;
  if (static_cast<double>(a.size()) * static_cast<double>(b.size()) > kMostCompared) return kInfinity;
  double farthest = 0;
  for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
    for (Vec3 p : from) {
      cancellation_point();
      double nearest = kInfinity;
      for (Vec3 q : to) nearest = std::min(nearest, norm2(p - q));
      farthest = std::max(farthest, nearest);
    }
  }
  return std::sqrt(farthest);
}

Errors errors_of_anything(double volume, std::span<const Placed> bodies) {
  Errors errors{volume, kInfinity, kInfinity, kInfinity, {}};
  errors.gradient.assign(bodies.size(), {kInfinity, kInfinity});
  errors = no_more_than_all(std::move(errors), bodies);
  errors.inertia = volume * room(bodies).diameter * room(bodies).diameter;
  return errors;
}

double least_diameter(std::span<const Placed> bodies) { return room(bodies).diameter; }

Errors no_more_than_all(Errors errors, std::span<const Placed> bodies) {
  const auto [diameter, surface, middle] = room(bodies);
  // NaN is no bound.
  const auto cap = [](double& error, double most) { error = error <= most ? error : most; };
  cap(errors.area, surface);
  cap(errors.centroid, diameter);
  cap(errors.inertia, surface * diameter * diameter * diameter);
  for (size_t i = 0; i < bodies.size(); ++i) {
    cap(errors.gradient[i][0], surface);
    cap(errors.gradient[i][1], surface * (diameter + norm(middle - bodies[i].position)));
  }
  return errors;
}

}  // namespace overlapper
