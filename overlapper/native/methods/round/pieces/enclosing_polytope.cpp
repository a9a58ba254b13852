#include "methods/round/pieces/enclosing_polytope.h"

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <limits>
#include <utility>

namespace overlapper::pieces {

void EnclosingPolytope::become(const Bounds& box) {
  const auto& [lower, upper] = box;
  faces = {{{-1, 0, 0}, -lower.x, kNoWall}, {{1, 0, 0}, upper.x, kNoWall},   {{0, -1, 0}, -lower.y, kNoWall},
           {{0, 1, 0}, upper.y, kNoWall},   {{0, 0, -1}, -lower.z, kNoWall}, {{0, 0, 1}, upper.z, kNoWall}};
  corners.clear();
  for (int i = 0; i < 8; ++i) {
    const int x = i & 1, y = i >> 1 & 1, z = i >> 2;
    Corner corner{{x ? upper.x : lower.x, y ? upper.y : lower.y, z ? upper.z : lower.z},
                  {i ^ 1, i ^ 2, i ^ 4},
                  {4 + z, x, 2 + y}};
    // Seen from outside, the edges along x, y and z have one cyclic order at a corner and the opposite order at the
    // next corner.
    if ((x + y + z) % 2 == 0) std::swap(corner.beside[1], corner.beside[2]), corner.face = {2 + y, x, 4 + z};
    corners.push_back(corner);
  }
}

namespace {

/// Memory for a cut. `left` is the distance of each corner from the plane. A crossing is an edge across the plane, from
/// a corner that stays to a removed one.
struct CutScratch {
  struct Crossing {
    int inner, outer;
  };
  std::vector<double> left;
  std::vector<int> removed;
  std::vector<Crossing> crossing;
};

}  // namespace

// Conditions of single corners and edges come out at random, so they move an end instead of choosing a branch.
bool EnclosingPolytope::cut(const Face& face) {
  constexpr int kFew = 64;
  std::array<double, kFew> few_left;
  std::array<int, kFew> few_removed;
  std::array<CutScratch::Crossing, 3 * kFew> few_crossing;
  double* left = few_left.data();
  int* removed = few_removed.data();
  CutScratch::Crossing* crossing = few_crossing.data();
  const int before = static_cast<int>(corners.size());
  if (before > kFew) {
    thread_local CutScratch of_thread;
    CutScratch& many = of_thread;  // avoids repeated lookups of thread_local
    many.left.resize(before), many.removed.resize(before), many.crossing.resize(3 * before);
    left = many.left.data(), removed = many.removed.data(), crossing = many.crossing.data();
  }
  int gone = 0;
  for (int i = 0; i < before; ++i) {
    left[i] = face.slack - dot(face.normal, corners[i].at);
    removed[gone] = i;
    gone += static_cast<int>(!(left[i] >= 0));
  }
  if (gone == 0) return true;
  if (gone == before) return false;
  int crossings = 0;
  for (int i = 0; i < gone; ++i)
    for (const int inner : corners[removed[i]].beside) {
      crossing[crossings] = {inner, removed[i]};
      crossings += static_cast<int>(left[inner] >= 0);
    }
  const int number = static_cast<int>(faces.size()), all = before + crossings;
  faces.push_back(face);
  corners.resize(all);
  for (int i = 0; i < crossings; ++i) {
    const auto [inner, outer] = crossing[i];
    Corner& stays = corners[inner];
    const int along = stays.edge_to(outer);
    const double share = left[inner] / (left[inner] - left[outer]);
    corners[before + i] = {stays.at + share * (corners[outer].at - stays.at),
                           {inner, -1, -1},
                           {stays.face[before_edge(along)], number, stays.face[along]}};
    stays.beside[along] = before + i;
  }
  // Follows each cut face from the corner where its border enters the inside to the corner where it has left it.
  for (int start = before; start < all; ++start) {
    int from = start, to = corners[start].beside[0];
    while (to < before) {
      const int next = corners[to].beside[after_edge(corners[to].edge_to(from))];
      from = to, to = next;
    }
    corners[start].beside[2] = to;
    corners[to].beside[1] = start;
  }
  // The last corners replace the removed ones.
  const int kept = all - gone;
  size_t place = 0;
  for (int last = all - 1; last >= kept; --last) {
    if (last < before && !(left[last] >= 0)) continue;
    const int to = removed[place++];
    corners[to] = corners[last];
    for (const int other : corners[to].beside) corners[other].beside[corners[other].edge_to(last)] = to;
  }
  corners.resize(kept);
  return true;
}

void EnclosingPolytope::drop_faces() {
  thread_local std::vector<int> of_thread;
  std::vector<int>& place = of_thread;  // avoids repeated lookups of thread_local
  place.assign(faces.size(), -1);
  for (const Corner& corner : corners)
    for (const int face : corner.face) place[face] = 0;
  int next = 0;
  for (size_t i = 0; i < faces.size(); ++i)
    if (place[i] == 0) faces[next] = faces[i], place[i] = next++;
  faces.resize(next);
  for (Corner& corner : corners)
    for (int& face : corner.face) face = place[face];
}

double EnclosingPolytope::settle() {
  const double rounding = 4 * DBL_EPSILON * extent();
  double remaining = 0;
  for (Corner& corner : corners) {
    const Face &a = faces[corner.face[0]], &b = faces[corner.face[1]], &c = faces[corner.face[2]];
    const auto beyond = [&](Vec3 at) {
      return Vec3{a.slack - dot(a.normal, at), b.slack - dot(b.normal, at), c.slack - dot(c.normal, at)};
    };
    const Vec3 off = beyond(corner.at);
    const double distance = max_component(abs(off));
    if (distance <= rounding) continue;
    const Vec3 bc = cross(b.normal, c.normal), ca = cross(c.normal, a.normal), ab = cross(a.normal, b.normal);
    const Vec3 at = corner.at + (off.x * bc + off.y * ca + off.z * ab) / dot(a.normal, bc);
    const double left = max_component(abs(beyond(at)));
    if (left < distance) corner.at = at;
    if (const double now = std::min(left, distance); now > rounding) remaining = std::max(remaining, now);
  }
  return remaining;
}

void EnclosingPolytope::number_faces(std::vector<std::array<int, 3>>& number, std::vector<int>& left) const {
  number.assign(corners.size(), {kNoWall, kNoWall, kNoWall});
  left.clear();
  for (size_t first = 0; first < corners.size(); ++first)
    for (int k = 0; k < 3; ++k) {
      if (number[first][k] != kNoWall) continue;
      for_ring(static_cast<int>(first), k,
               [&](int corner, int along) { number[corner][along] = static_cast<int>(left.size()); });
      left.push_back(corners[first].face[k]);
    }
}

bool EnclosingPolytope::excludes(Vec3 point) const {
  return std::ranges::any_of(faces, [&](const Face& face) { return dot(face.normal, point) > face.slack; });
}

Bounds EnclosingPolytope::bounds() const {
  Bounds box{corners[0].at, corners[0].at};
  for (const Corner& corner : corners) box = {min(box.lower, corner.at), max(box.upper, corner.at)};
  return box;
}

std::pair<double, double> EnclosingPolytope::range(Vec3 direction) const {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const Corner& corner : corners) {
    const double at = dot(direction, corner.at);
    least = std::min(least, at), most = std::max(most, at);
  }
  return {least, most};
}

Vec3 EnclosingPolytope::middle() const {
  Vec3 sum;
  for (const Corner& corner : corners) sum += corner.at;
  return sum / static_cast<double>(corners.size());
}

double EnclosingPolytope::reach(Vec3 point) const {
  double reach2 = 0;
  for (const Corner& corner : corners) reach2 = std::max(reach2, norm2(corner.at - point));
  return std::sqrt(reach2);
}

double EnclosingPolytope::inner_radius() const { return std::ranges::min(faces, {}, &Face::slack).slack; }

double EnclosingPolytope::surface() const {
  double twice = 0;
  for_faces([&](const Face& face, std::span<const int> ring) {
    Vec3 sum;
    for (size_t i = 2; i < ring.size(); ++i)
      sum += cross(corners[ring[i - 1]].at - corners[ring[0]].at, corners[ring[i]].at - corners[ring[0]].at);
    twice += std::abs(dot(face.normal, sum));
  });
  return twice / 2;
}

}  // namespace overlapper::pieces
