#include "geometry/expanding_hull.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <tuple>
#include <utility>

#include "geometry/cancellation.h"
#include "geometry/predicates.h"
#include "geometry/thresholds.h"

namespace overlapper {
namespace {

/// The number of the point with the largest `measure(point)`.
template <class Measure>
int farthest(std::span<const Vec3> points, Measure measure) {
  int best = 0;
  double largest = -1;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const double value = measure(points[i]);
    if (value > largest) largest = value, best = i;
  }
  return best;
}

Vec3 flushed(Vec3 p, double negligible) {
  const auto keep = [negligible](double value) { return std::abs(value) < negligible ? 0 : value; };
  return {keep(p.x), keep(p.y), keep(p.z)};
}

/// Four points that span a solid, roughly as large as possible, counter-clockwise seen from the far side of the fourth
/// point. False if there are none.
bool extreme_tetrahedron(std::span<const Vec3> points, std::array<int, 4>& corner) {
  if (points.size() < 4) return false;
  const Vec3 first = points[0];
  corner[0] = farthest(points, [&](Vec3 p) { return norm2(p - first); });
  const Vec3 a = points[corner[0]];
  corner[1] = farthest(points, [&](Vec3 p) { return norm2(p - a); });
  const Vec3 ab = points[corner[1]] - a;
  corner[2] = farthest(points, [&](Vec3 p) { return norm2(cross(ab, p - a)); });
  const Vec3 normal = accurate_normal(a, points[corner[1]], points[corner[2]]);
  corner[3] = farthest(points, [&](Vec3 p) { return std::abs(dot(normal, p - a)); });

  const auto side = [&](int d) { return orientation(a, points[corner[1]], points[corner[2]], points[d]); };
  int sign = side(corner[3]);
  // Rounding may select a point in the plane although another point lies just off the plane.
  for (int d = 0; sign == 0 && d < static_cast<int>(points.size()); ++d) {
    sign = side(d);
    if (sign != 0) corner[3] = d;
  }
  if (sign > 0) std::swap(corner[1], corner[2]);
  return sign != 0;
}

}  // namespace

int ExpandingHull::make_facet(int a, int b, int c) {
  const Vec3 u = points[b] - points[a], v = points[c] - points[a];
  Facet facet;
  facet.vertex = {a, b, c};
  facet.normal = cross(u, v);
  facet.normal_rounding = {std::abs(u.y * v.z) + std::abs(u.z * v.y), std::abs(u.z * v.x) + std::abs(u.x * v.z),
                           std::abs(u.x * v.y) + std::abs(u.y * v.x)};
  if (!vacant_.empty()) {
    const int number = vacant_.back();
    vacant_.pop_back();
    facets[number] = facet;
    visited_[number] = 0;
    born_[number] = made_++;
    return number;
  }
  facets.push_back(facet);
  visited_.push_back(0);
  if (!born_.empty()) born_.push_back(made_++);
  return static_cast<int>(facets.size()) - 1;
}

void ExpandingHull::vacate_removed() {
  if (facets.size() < kLeastReused) return;
  if (born_.empty()) {
    made_ = static_cast<int>(facets.size());
    born_.resize(facets.size());
    std::iota(born_.begin(), born_.end(), 0);
  }
  vacant_.insert(vacant_.end(), removed_.begin(), removed_.end());
}

void ExpandingHull::order_by_birth() {
  if (born_.empty()) return;
  struct Place {
    int born, from;
  };
  std::vector<Place> order;
  for (int f = 0; f < static_cast<int>(facets.size()); ++f)
    if (!facets[f].removed()) order.push_back({born_[f], f});
  std::sort(order.begin(), order.end(), [](const Place& a, const Place& b) { return a.born < b.born; });
  std::vector<int> number(facets.size(), -1);
  for (int i = 0; i < static_cast<int>(order.size()); ++i) number[order[i].from] = i;
  std::vector<Facet> ordered;
  ordered.reserve(order.size());
  for (const Place& place : order) {
    cancellation_point();
    ordered.push_back(facets[place.from]);
    for (int& other : ordered.back().neighbour) other = number[other];
  }
  facets = std::move(ordered);
  visited_.assign(facets.size(), 0);
  for (int& facet : cone_) facet = number[facet];
  removed_.clear(), vacant_.clear(), born_.clear();
}

bool ExpandingHull::start() {
  facets.clear();
  visited_.clear(), vacant_.clear(), born_.clear();
  visit_ = 0;
  double largest = 0;
  for (Vec3 p : points) largest = std::max(largest, max_component(abs(p)));
  negligible_coordinate_ = 0x1p-200 * largest;
  for (Vec3& p : points) p = flushed(p, negligible_coordinate_);
  std::array<int, 4> corner;
  if (!extreme_tetrahedron(points, corner)) return false;
  const auto [a, b, c, d] = corner;
  inserted_ = 4;
  make_facet(a, b, c);
  make_facet(a, d, b);
  make_facet(b, d, c);
  make_facet(c, d, a);
  facets[0].neighbour = {1, 2, 3};
  facets[1].neighbour = {3, 2, 0};
  facets[2].neighbour = {1, 3, 0};
  facets[3].neighbour = {2, 1, 0};
  return true;
}

bool ExpandingHull::assemble(std::span<const std::array<int, 3>> triangles) {
  facets.clear();
  visited_.clear(), vacant_.clear(), born_.clear();
  struct Side {
    int low, high, facet, number;
  };
  std::vector<Side> sides;
  for (const auto& [a, b, c] : triangles) {
    if (a == b || b == c || c == a) return false;
    const int facet = make_facet(a, b, c);
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(facets[facet].vertex[i], facets[facet].vertex[(i + 1) % 3]);
      sides.push_back({low, high, facet, i});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& s, const Side& t) {
    return std::tie(s.low, s.high, s.facet) < std::tie(t.low, t.high, t.facet);
  });
  if (sides.empty() || sides.size() % 2 != 0) return false;
  for (size_t i = 0; i < sides.size(); i += 2) {
    const Side &s = sides[i], &t = sides[i + 1];
    Facet &f = facets[s.facet], &g = facets[t.facet];
    const bool again = i > 0 && sides[i - 1].low == s.low && sides[i - 1].high == s.high;
    if (again || s.low != t.low || s.high != t.high || f.vertex[s.number] == g.vertex[t.number]) return false;
    f.neighbour[s.number] = t.facet;
    g.neighbour[t.number] = s.facet;
    if (sees(s.facet, g.vertex[(t.number + 2) % 3]) || sees(t.facet, f.vertex[(s.number + 2) % 3])) return false;
  }
  // A convex solid has the surface of a sphere. It is the only connected surface with Euler characteristic 2.
  std::vector<char> met(facets.size(), false), used(points.size(), false);
  std::vector<int> stack{0};
  met[0] = true;
  size_t reached = 0;
  while (!stack.empty()) {
    const Facet& f = facets[stack.back()];
    stack.pop_back();
    ++reached;
    for (int i = 0; i < 3; ++i) {
      used[f.vertex[i]] = true;
      if (!std::exchange(met[f.neighbour[i]], true)) stack.push_back(f.neighbour[i]);
    }
  }
  const bool all_used = std::ranges::all_of(used, [](char each) { return each; });
  return reached == facets.size() && all_used && points.size() + facets.size() == sides.size() / 2 + 2;
}

int ExpandingHull::add(Vec3 point) {
  points.push_back(flushed(point, negligible_coordinate_));
  return static_cast<int>(points.size()) - 1;
}

bool ExpandingHull::sees(int facet, int p) const {
  const Facet& f = facets[facet];
  const Vec3 w = points[p] - points[f.vertex[0]];
  const double det = dot(f.normal, w);
  // The static filter of orientation(). The facet's part of it is computed once.
  const double error = 8 * 0x1p-53 * dot(f.normal_rounding, abs(w));
  if (det > error) return true;
  if (det < -error) return false;
  return orientation(points[f.vertex[0]], points[f.vertex[1]], points[f.vertex[2]], points[p]) > 0;
}

double ExpandingHull::height(int facet, int p) const {
  const Facet& f = facets[facet];
  const double length = std::sqrt(norm2(f.normal));
  return length > 0 ? dot(f.normal, points[p] - points[f.vertex[0]]) / length : 0;
}

void ExpandingHull::collect_visible(int p, int seen) {
  assert(sees(seen, p));
  removed_.clear();
  horizon_.clear();
  stack_.assign(1, seen);
  ++visit_;
  visited_[seen] = visit_;
  while (!stack_.empty()) {
    const int facet = stack_.back();
    stack_.pop_back();
    removed_.push_back(facet);
    for (int i = 0; i < 3; ++i) {
      const int other = facets[facet].neighbour[i];
      if (visited_[other] == visit_) continue;
      if (sees(other, p)) {
        visited_[other] = visit_;
        stack_.push_back(other);
      } else {
        horizon_.push_back({facets[facet].vertex[i], facets[facet].vertex[(i + 1) % 3], other});
      }
    }
  }
}

void ExpandingHull::insert(int p, int seen) {
  cancellation_point();
  collect_visible(p, seen);
  link_cone(p);
  ++inserted_;
  for (int facet : removed_) facets[facet].vertex = {-1, -1, -1};
}

void ExpandingHull::link_cone(int p) {
  cone_.clear();
  cone_start_.resize(points.size(), -1);
  for (const HorizonRidge& ridge : horizon_) {
    const int facet = make_facet(ridge.from, ridge.to, p);
    cone_.push_back(facet);
    cone_start_[ridge.from] = facet;
    facets[facet].neighbour[0] = ridge.outside;
    Facet& outside = facets[ridge.outside];
    for (int i = 0; i < 3; ++i)
      if (outside.vertex[i] == ridge.to && outside.vertex[(i + 1) % 3] == ridge.from) outside.neighbour[i] = facet;
  }
  // The horizon is one closed loop, so every vertex on it begins exactly one ridge.
  for (int facet : cone_) {
    const int next = cone_start_[facets[facet].vertex[1]];
    assert(next >= 0);
    facets[facet].neighbour[1] = next;
    facets[next].neighbour[2] = facet;
  }
}

void ExpandingHull::wait(int facet, int p) {
  Facet& f = facets[facet];
  const double distance = height(facet, p);
  next_conflict_[p] = f.first_conflict;
  f.first_conflict = p;
  if (f.farthest_conflict < 0 || distance > f.farthest_height) f.farthest_conflict = p, f.farthest_height = distance;
}

int ExpandingHull::first_that_sees(std::span<const int> candidates, int p) const {
  const auto seen = std::ranges::find_if(candidates, [&](int facet) { return sees(facet, p); });
  return seen == candidates.end() ? -1 : *seen;
}

void ExpandingHull::order_cone() {
  fan_.clear();
  if (cone_.size() <= kMostConeScanned) return;
  for (int facet = cone_[0]; fan_.empty() || facet != cone_[0]; facet = facets[facet].neighbour[1])
    fan_.push_back(facet);
}

int ExpandingHull::fan_facet_that_sees(int p, size_t base) const {
  const size_t size = fan_.size();
  const auto facet = [&](size_t k) { return fan_[(base + k) % size]; };
  if (sees(facet(0), p)) return facet(0);
  if (sees(facet(size - 1), p)) return facet(size - 1);
  // Consider the planes through the apex, the first corner of the horizon and its k-th corner. From the first facet to
  // the last, they turn by less than half a turn about the line of the first two points. `p` is behind both facets, so
  // it lies between two of these planes.
  const std::array<int, 3>& corner = facets[facet(0)].vertex;
  const Vec3 first = points[corner[0]], apex = points[corner[2]];
  const auto side = [&](size_t k) { return orientation(first, points[facets[facet(k)].vertex[0]], apex, points[p]); };
  const auto last_with = [&](auto holds) {
    size_t low = 1, high = size - 1;
    while (high - low > 1) {
      const size_t middle = low + (high - low) / 2;
      (holds(side(middle)) ? low : high) = middle;
    }
    return low;
  };
  const size_t between = last_with([](int s) { return s <= 0; });
  if (sees(facet(between), p)) return facet(between);
  if (side(between) < 0) return -1;
  // `p` is on one of the planes. Several corners of the horizon may share this plane.
  const size_t before = last_with([](int s) { return s < 0; });
  if (sees(facet(before), p)) return facet(before);
  // `p` is on the line: before the first corner, or behind the apex.
  const bool on_line = side(1) == 0 && side(size - 1) == 0;
  return on_line && base == 0 ? fan_facet_that_sees(p, size / 2) : -1;
}

template <class Wait>
void ExpandingHull::hand_on_conflicts(int facet, int except, Wait wait_elsewhere) {
  int p = facets[facet].first_conflict;
  facets[facet].first_conflict = facets[facet].farthest_conflict = -1;
  while (p >= 0) {
    cancellation_point();
    const int next = next_conflict_[p];
    if (p != except) wait_elsewhere(p);
    p = next;
  }
}

int ExpandingHull::cone_facet_that_sees(int p) const {
  if (fan_.empty()) return first_that_sees(cone_, p);
  const int facet = fan_facet_that_sees(p, 0);
  assert(facet >= 0 || first_that_sees(cone_, p) < 0);
  if (facet < 0) return -1;
  // The facet that a point waits with determines the numbers of later facets. It is the first facet that sees the
  // point, except in very large cones.
  constexpr size_t kMostInOrder = 512;
  const int first = first_that_sees(std::span(cone_).first(std::min(cone_.size(), kMostInOrder)), p);
  return first < 0 ? facet : first;
}

void ExpandingHull::hand_on_to_cone(int apex) {
  order_cone();
  // A point that saw a removed facet, and is still outside, sees a facet of the cone. At the horizon, the plane of a
  // cone facet lies between the planes of the two facets that met there.
  for (int gone : removed_)
    hand_on_conflicts(gone, apex, [&](int p) {
      const int facet = cone_facet_that_sees(p);
      if (facet >= 0) wait(facet, p);
    });
}

bool ExpandingHull::rises_above_facet(int facet, int p, double fraction) const {
  const Facet& f = facets[facet];
  const auto [a, b, c] = f.vertex;
  const Vec3 rise = points[p] - points[a];
  // As in sees(), and the same for the facet's distance from the origin.
  const double rounding = 8 * 0x1p-53 * dot(f.normal_rounding, abs(rise) + fraction * abs(points[a]));
  const double excess = dot(f.normal, rise) - fraction * std::max(0.0, dot(f.normal, points[a]));
  if (std::abs(excess) > rounding) return excess > 0;
  const Vec3 normal = accurate_normal(points[a], points[b], points[c]);
  return dot(normal, rise) > fraction * std::max(0.0, dot(normal, points[a]));
}

bool ExpandingHull::rises_above(int facet, int p, double fraction) {
  cancellation_point();
  if (rises_above_facet(facet, p, fraction)) return true;
  collect_visible(p, facet);
  return std::any_of(removed_.begin(), removed_.end(), [&](int seen) { return rises_above_facet(seen, p, fraction); });
}

bool ExpandingHull::build(std::span<const double> negligible) {
  if (!start()) return false;
  next_conflict_.assign(points.size(), -1);
  const std::array<int, 4> first_facets{0, 1, 2, 3};
  for (int p = 0; p < static_cast<int>(points.size()); ++p) {
    cancellation_point();
    const int facet = first_that_sees(first_facets, p);
    if (facet >= 0) wait(facet, p);
  }

  std::vector<int> pending(first_facets.begin(), first_facets.end());
  while (!pending.empty()) {
    const int facet = pending.back();
    if (facets[facet].removed() || facets[facet].first_conflict < 0) {
      pending.pop_back();
      continue;
    }
    const int apex = facets[facet].farthest_conflict;
    if (!negligible.empty() && !rises_above(facet, apex, negligible[apex])) {
      // The hull only grows, so a negligible point stays negligible.
      hand_on_conflicts(facet, apex, [&](int p) { wait(facet, p); });
      continue;
    }
    insert(apex, facet);
    hand_on_to_cone(apex);
    vacate_removed();
    // A removed facet's number may still be in the queue. If a new facet reuses the number, the new facet has already
    // had its turn.
    pending.insert(pending.end(), cone_.begin(), cone_.end());
  }
  order_by_birth();
  return true;
}

std::vector<int> ExpandingHull::facet_at_vertex() const {
  std::vector<int> at(points.size(), -1);
  for (int f = 0; f < static_cast<int>(facets.size()); ++f)
    if (!facets[f].removed())
      for (int v : facets[f].vertex) at[v] = f;
  return at;
}

int ExpandingHull::next_around(int facet, int vertex) const {
  const Facet& f = facets[facet];
  const int i = f.vertex[0] == vertex ? 0 : f.vertex[1] == vertex ? 1 : 2;
  return f.neighbour[(i + 2) % 3];
}

}  // namespace overlapper
