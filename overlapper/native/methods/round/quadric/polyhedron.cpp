#include "methods/round/quadric/polyhedron.h"

#include <algorithm>
#include <array>
#include <utility>

namespace overlapper::quadric {
namespace {

constexpr int kNone = -1;

}  // namespace

bool Rings::become(const Shape& shape, const Pose& pose) {
  clear();
  if (edges(shape).empty()) return false;
  ask_flat(shape, [&](const auto& s) {
    for (int i = 0; i < s.vertex_count(); ++i) corners_.push_back(pose * s.vertex(i));
    for (int f = 0; f < s.facet_count(); ++f) {
      planes_.push_back(pose * s.facet(f));
      const auto around = s.ring(f);
      ring_.insert(ring_.end(), around.begin(), around.end());
      start_.push_back(static_cast<int>(ring_.size()));
    }
  });
  return true;
}

/// The corner where a cut edge passes the height: the same for both of its faces.
int Rings::between(int above, int below, double height) {
  // Faces beside each other mostly follow each other.
  for (size_t k = crossed_.size(); k-- > 0;)
    if (crossed_[k][0] == above && crossed_[k][1] == below) return crossed_[k][2];
  crossed_.push_back({above, below, static_cast<int>(corners_.size())});
  const Vec3 p = corners_[above], q = corners_[below];
  Vec3 at = p + (p.z - height) / (p.z - q.z) * (q - p);
  at.z = height;
  corners_.push_back(at);
  return crossed_.back()[2];
}

/// Adds the rest of a face without the corners that are `outside`. False if rounding has made the face not convex.
/// Around the new face, after_ has the next corner of each corner. Its corners have numbers from `before` on.
template <class Outside>
bool Rings::cut_face(size_t f, double height, int before, Outside outside) {
  const size_t begin = kept_ring_.size();
  int leaves = kNone, enters = kNone;
  const auto corners = ring(f);
  for (size_t k = 0; k < corners.size(); ++k) {
    const int i = corners[k], j = corners[k + 1 < corners.size() ? k + 1 : 0];
    if (!outside(i)) kept_ring_.push_back(i);
    if (outside(i) == outside(j)) continue;
    const int corner = outside(i) ? between(i, j, height) : between(j, i, height);
    kept_ring_.push_back(corner);
    int& side = outside(i) ? enters : leaves;
    if (side != kNone) return false;
    side = corner;
  }
  if (kept_ring_.size() == begin) return true;
  if (enters != kNone) {
    after_.resize(corners_.size() - before, kNone);
    after_[enters - before] = leaves;
  }
  kept_.push_back(planes_[f]);
  kept_start_.push_back(static_cast<int>(kept_ring_.size()));
  return true;
}

/// Adds the new face in the plane of the cut; false if its border does not close.
bool Rings::close_cut(const Plane& plane, int before) {
  kept_.push_back(plane);
  int at = before;
  for (size_t k = 0; k < after_.size(); ++k, at = after_[at - before]) {
    if (at == kNone || (k > 0 && at == before)) return false;
    kept_ring_.push_back(at);
  }
  if (at != before) return false;
  kept_start_.push_back(static_cast<int>(kept_ring_.size()));
  return true;
}

bool Rings::cut(double height, bool keep_below) {
  const auto outside = [&](int i) { return keep_below ? corners_[i].z > height : corners_[i].z < height; };
  const int before = static_cast<int>(corners_.size());
  bool some = false, all = true;
  for (int i = 0; i < before; ++i) (outside(i) ? some : all) = outside(i);
  if (!some) return true;
  if (all) {
    planes_.clear(), cuts_ = 0;
    return true;
  }
  kept_.clear(), kept_ring_.clear(), kept_start_.assign(1, 0), crossed_.clear(), after_.clear();
  size_t cuts = 1;
  for (size_t f = 0; f < planes_.size(); ++f) {
    const size_t kept = kept_.size();
    if (!cut_face(f, height, before, outside)) return false;
    cuts += kept_.size() > kept && !face(f);
  }
  const double side = keep_below ? 1 : -1;
  if (!close_cut({{0, 0, side}, side * height}, before)) return false;
  cuts_ = cuts;
  std::swap(planes_, kept_), std::swap(ring_, kept_ring_), std::swap(start_, kept_start_);
  return true;
}

Polyhedron Rings::polyhedron() {
  edges_.clear();
  // Edges from a corner of higher number, with the face on their left: (lower corner, higher corner, face).
  thread_local std::vector<std::array<int, 3>> back;
  back.clear();
  for (size_t f = 0; f < planes_.size(); ++f) {
    const auto corners = ring(f);
    for (size_t k = 0; k < corners.size(); ++k) {
      const int i = corners[k], j = corners[k + 1 < corners.size() ? k + 1 : 0];
      if (i < j) edges_.push_back({i, j, static_cast<int>(f), kNone});
      else back.push_back({j, i, static_cast<int>(f)});
    }
  }
  if (edges_.size() != back.size()) return {};
  std::ranges::sort(edges_, {}, [](const Edge& e) { return std::array{e.from, e.to}; });
  std::ranges::sort(back);
  for (size_t k = 0; k < edges_.size(); ++k) edges_[k].right = back[k][2];
  // Numbers the corners anew, without those that were cut off.
  number_.assign(corners_.size(), kNone);
  left_.clear();
  const auto number = [&](int corner) {
    if (number_[corner] == kNone) {
      number_[corner] = static_cast<int>(left_.size());
      left_.push_back(corners_[corner]);
    }
    return number_[corner];
  };
  for (Edge& edge : edges_) edge.from = number(edge.from), edge.to = number(edge.to);
  return {left_, planes_, edges_, planes_.size() - cuts_};
}

}  // namespace overlapper::quadric
