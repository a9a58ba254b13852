#pragma once

#include <algorithm>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/polytope.h"

namespace overlapper {

/// The directed ridges of a polytope by their ends. The number of a ridge is its place in the polytope's `ring`.
class Ridges {
 public:
  explicit Ridges(const Polytope& polytope)
      : polytope_(polytope), starts_(polytope.vertices.size() + 1, 0), heads_(polytope.ring.size()) {
    const std::vector<int>& ring = polytope.ring;
    facet_.reserve(ring.size());
    for (int f = 0; f < polytope.facets(); ++f) facet_.insert(facet_.end(), polytope.facet(f).size(), f);
    for (int from : ring) ++starts_[from + 1];
    for (size_t v = 1; v < starts_.size(); ++v) starts_[v] += starts_[v - 1];
    for (int place = 0; place < static_cast<int>(ring.size()); ++place)
      heads_[starts_[ring[place]]++] = {ring[next(place)], place};
    // Each start has moved on to the next start.
    for (size_t v = starts_.size() - 1; v > 0; --v) starts_[v] = starts_[v - 1];
    starts_[0] = 0;
    for (size_t v = 0; v + 1 < starts_.size(); ++v) {
      cancellation_point();
      std::sort(heads_.begin() + starts_[v], heads_.begin() + starts_[v + 1],
                [](const Head& a, const Head& b) { return a.vertex < b.vertex; });
    }
  }

  int number(int from, int to) const {
    const auto begin = heads_.begin() + starts_[from], end = heads_.begin() + starts_[from + 1];
    return std::lower_bound(begin, end, to, [](const Head& head, int vertex) { return head.vertex < vertex; })->place;
  }
  int left_of(int from, int to) const { return facet_[number(from, to)]; }
  /// The corner after `to` of the facet left of the ridge.
  int after(int from, int to) const { return polytope_.ring[next(next(number(from, to)))]; }

 private:
  struct Head {
    int vertex, place;
  };

  int next(int place) const {
    const int facet = facet_[place];
    return place + 1 < polytope_.ring_start[facet + 1] ? place + 1 : polytope_.ring_start[facet];
  }

  const Polytope& polytope_;
  std::vector<int> starts_, facet_;
  std::vector<Head> heads_;
};

}  // namespace overlapper
