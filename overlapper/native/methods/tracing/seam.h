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
  int body;              ///< 0 or 1: the body of the edge
  int edge;              ///< its half-edge that enters the other body here
  int next, previous;    ///< along the seam, with the kept part of the first body on its left
  CrossingFacets ahead;  ///< the facets of the segment to the next corner
};

/// The closed lines in which the surfaces of two polytopes cross, followed from facet to facet. The signs of corners
/// tell over which edge the line of two facets' planes leaves each facet. The orientation of the two edges tells which
/// exit comes first. An uncertain sign ends the search: the result is then incomplete, and `certain()` is false.
class Seam {
 public:
  void begin(CloseBody& first, CloseBody& second);

  /// Follows the line that has a segment in both facets. False if there is none, if it is known already, or if a sign
  /// is uncertain.
  bool follow(CrossingFacets start);

  bool certain() const { return certain_; }
  const std::vector<SeamCorner>& corners() const { return corners_; }

  struct Line {
    int first_corner;
    std::array<bool, 2> crosses_edges_of;  ///< per body; if false, all of the line lies in one facet of this body
  };
  const std::vector<Line>& lines() const { return lines_; }

  /// The corner at which a half-edge of body 0 or 1 enters the other, or -1.
  int entry(int body, int half_edge) const {
    const Marks& m = marks_[body];
    return m.entered[half_edge] == now_ ? m.corner[half_edge] : -1;
  }
  /// The largest distance of a corner from the common point.
  double reach() const { return reach_; }

  /// m: bound of the distance of corners from the planes of a body's facets, by rounding.
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

  /// The results on a body.
  struct Marks {
    std::vector<int> entered, corner;  ///< per half-edge: the last run that entered it, and the corner
    double farthest = 0;               ///< distance of the farthest corner of a visited facet from the common point
    double rounding = 0;               ///< m: see rounding(), without the part of those corners' planes
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
