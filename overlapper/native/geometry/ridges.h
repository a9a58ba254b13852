#pragma once

#include <cstdint>
#include <unordered_map>

#include "geometry/polytope.h"

namespace overlapper {

/// The facet on the other side of each directed ridge of a polytope.
class Ridges {
 public:
  explicit Ridges(const Polytope& polytope)
      : polytope_(polytope), count_(static_cast<int64_t>(polytope.vertices.size())) {
    for (int f = 0; f < polytope.facets(); ++f) {
      const auto ring = polytope.facet(f);
      for (size_t i = 0; i < ring.size(); ++i) facet_left_of_[key(ring[i], ring[(i + 1) % ring.size()])] = f;
    }
  }
  int left_of(int from, int to) const { return facet_left_of_.at(key(from, to)); }
  int next_in(int facet, int vertex) const {
    const auto ring = polytope_.facet(facet);
    size_t i = 0;
    while (ring[i] != vertex) ++i;
    return ring[(i + 1) % ring.size()];
  }

 private:
  int64_t key(int from, int to) const { return from * count_ + to; }
  const Polytope& polytope_;
  int64_t count_;
  std::unordered_map<int64_t, int> facet_left_of_;
};

}  // namespace overlapper
