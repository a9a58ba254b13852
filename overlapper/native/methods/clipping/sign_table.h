#pragma once

#include <cassert>
#include <cstdint>
#include <vector>

#include "methods/clipping/wide_corners.h"
#include "shapes/solid.h"

namespace overlapper {

enum class Signs { kCertain, kUncertain, kSeparated };

/// Signed distances of the vertices of one body from the planes of the other.
struct SignTable {
  int stride = 0;
  std::vector<double> rows;            ///< by vertex
  std::vector<std::uint64_t> outside;  ///< per vertex: bit j % 64 is set if it is outside of plane j
  std::vector<std::uint64_t> beyond;   ///< likewise, if it is outside by more than the rounding of signs
  bool plain = false;                  ///< each bit stands for one plane, and vertices have no doubts of their own

  const double* row(int vertex) const { return rows.data() + static_cast<ptrdiff_t>(vertex) * stride; }

  template <class Lanes>
  Signs fill(const Solid& of, const Solid& by, double rounding);

 private:
  bool beyond_a_plane(double margin) const;
};

/// A list that reserves room for all elements at the start. Adding an element then calls no function, so a loop keeps
/// its numbers in registers.
template <class T>
class RoomyList {
 public:
  RoomyList() = default;
  RoomyList(const RoomyList&) = delete;

  void begin_with_room(size_t most) {
    if (places_.size() < most) places_.resize(most);
    end_ = places_.data();
  }
  void push_back(const T& value) {
    assert(size() < places_.size());
    *end_++ = value;
  }

  size_t size() const { return end_ - places_.data(); }
  bool empty() const { return size() == 0; }
  T* data() { return places_.data(); }
  T* begin() { return places_.data(); }
  T* end() { return end_; }
  const T* begin() const { return places_.data(); }
  const T* end() const { return end_; }
  const T& operator[](size_t i) const { return places_[i]; }

 private:
  std::vector<T> places_;
  T* end_ = nullptr;
};

/// Two solids and their common polytope. The second solid's facets are numbered after the first one's.
struct TableClipping {
  Solid first, second;
  RoomyList<Vec3> vertices;         ///< of the common polytope
  RoomyList<CornerSource> corners;  ///< parallel to `vertices`
  RoomyList<double> doubt;          ///< parallel to `vertices`: see Solid
  RoomyList<Edge> edges;            ///< of the common polytope
  RoomyList<Edge> seam;             ///< its edges between facets of the first body, on the left, and of the second body
  bool shallow = false;  ///< a corner is certain beside its planes alone, as an edge is nearly parallel to a plane

  /// Finds the common polytope; none for separated or uncertain solids. Corners on edges that are nearly parallel to a
  /// plane are uncertain unless `may_be_shallow`.
  Signs run(double rounding, bool may_be_shallow = false);

  int owner(int facet) const { return facet < first.facets ? first.owner[facet] : second.owner[facet - first.facets]; }

  /// Makes the common polytope the first solid; see set_solid for `beyond`.
  void take_common(double beyond);
  /// Makes the first solid the common polytope.
  void show_first();

 private:
  template <class Lanes>
  friend class EdgeCutter;

  SignTable first_signs, second_signs;
  std::vector<int> first_vertex, second_vertex;  ///< per vertex of a body: its number in the common polytope, or -1
  /// The open end of each pair of facets: 1 + the vertex where their common edge begins, or the negative of that where
  /// it ends.
  std::vector<int> open;
  int unpaired = 0;
  Solid next;
  std::vector<int> facet_number;
};

}  // namespace overlapper
