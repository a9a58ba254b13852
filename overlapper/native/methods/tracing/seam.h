#pragma once

#include <array>
#include <optional>
#include <vector>

#include "methods/tracing/close_body.h"

namespace overlapper {

/// A facet of the first body and one of the second that cross in a segment.
struct CrossingFacets {
  int first, second;
};

/// A point of the seam: an edge of one body meets a facet of the other.
struct SeamCorner {
  Vec3 at;
  int body;              ///< whose edge: 0 or 1
  int edge;              ///< its half-edge that enters the other body here
  int next, previous;    ///< along the seam, which has what the first body keeps on its left
  CrossingFacets ahead;  ///< the facets of the segment to the next corner
};

/// The closed lines in which the surfaces of two polytopes cross, followed from facet to facet. The line through two
/// facets' planes leaves either facet over an edge that its corners' signs name; which of the two comes first is the
/// orientation of the two edges. A sign that rounding might turn ends it all: what is found is then incomplete, and
/// `certain()` false.
class Seam {
 public:
  void begin(CloseBody& first, CloseBody& second);

  /// Follows the line that has a segment in both facets. False if there is none, if it is known already, or a sign is
  /// not certain.
  bool follow(CrossingFacets start);

  bool certain() const { return certain_; }
  const std::vector<SeamCorner>& corners() const { return corners_; }

  struct Line {
    int first_corner;
    std::array<bool, 2> crosses_edges_of;  ///< per body; if none, all of the line lies in one of its facets
  };
  const std::vector<Line>& lines() const { return lines_; }

  /// The corner at which a half-edge of body 0 or 1 enters the other, or -1.
  int entry(int body, int half_edge) const {
    const Marks& m = marks_[body];
    return m.entered[half_edge] == now_ ? m.corner[half_edge] : -1;
  }
  /// The largest distance of a corner from the common point.
  double reach() const { return reach_; }

  /// m: how far rounding may have put corners off the planes of a body's facets.
  double rounding(int body) const {
    const Marks& m = marks_[body];
    return bodies_[body]->corner_rounding() * m.farthest + m.rounding;
  }

 private:
  double height(CloseBody& of, int vertex, CloseBody& over, int facet);
  int turning_edge(int body, int from, CrossingFacets at);
  double order(int body, int entering, int other_edge);
  bool crosses(CrossingFacets facets, std::array<int, 2> exit);
  bool step(CrossingFacets& at, std::array<int, 2>& exit);
  Vec3 meet(int body, int entering, int plane);
  int other_facet(CrossingFacets at, int body) const { return body == 0 ? at.second : at.first; }

  /// What was found on a body.
  struct Marks {
    std::vector<int> entered, corner;  ///< per half-edge: the run in which it was last entered, and where
    double farthest = 0;               ///< corner of a facet passed, from the common point
    double rounding = 0;               ///< m: see rounding(), without what that of those corners moves its planes
  };

  std::array<CloseBody*, 2> bodies_{};
  std::array<Marks, 2> marks_;
  int now_ = 0;
  bool certain_ = true;
  double reach_ = 0;
  std::vector<SeamCorner> corners_;
  std::vector<Line> lines_;
};

}  // namespace overlapper
