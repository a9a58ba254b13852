#include "batch/box_volumes.h"

#include <cmath>

#include "geometry/constants.h"
#include "geometry/lanes.h"
#include "shapes/canonical_order.h"

namespace overlapper {
namespace {

template <class Lanes>
constexpr int kPairsOf = sizeof(Lanes) / sizeof(double);

const Vec3& half_extents_of(const Placed& box) { return std::get_if<Box>(&box.shape)->half_extents; }

/// Boxes with their poses, one in each lane.
template <class Lanes>
struct BoxLanes {
  Lanes rotation[3][3], position[3], half[3];

  explicit BoxLanes(const Placed* const* boxes) {
    for (int n = 0; n < kPairsOf<Lanes>; ++n) {
      const auto& [rows, translation] = boxes[n]->pose;
      const Vec3& half_extents = half_extents_of(*boxes[n]);
      for (int k = 0; k < 3; ++k) {
        rotation[0][k][n] = rows.row0[k], rotation[1][k][n] = rows.row1[k], rotation[2][k][n] = rows.row2[k];
        position[k][n] = translation[k], half[k][n] = half_extents[k];
      }
    }
  }
};

// Results are arguments, because machines return four lanes in different ways.
template <class Lanes>
inline void keep_larger(Lanes& kept, const Lanes& other) {
  choose(kept > other, kept, other, kept);
}
template <class Lanes>
inline void keep_smaller(Lanes& kept, const Lanes& other) {
  choose(kept < other, kept, other, kept);
}
template <class Lanes>
inline void set_size(const Lanes& number, Lanes& size) {
  size = -number;
  keep_larger(size, number);
}
template <class Lanes>
inline void set_root(const Lanes& number, Lanes& root) {
  for (int n = 0; n < kPairsOf<Lanes>; ++n) root[n] = std::sqrt(number[n]);
}
template <class Lanes>
inline void set_norm(const Lanes* vector, Lanes& norm) {
  set_root(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2], norm);
}

/// Half of what a slab cuts out of a line, with the slab's planes moved out and in by a margin.
template <class Lanes>
struct SlabWidth {
  Lanes out, in;

  SlabWidth(const Lanes& half, const Lanes& margin, const Lanes& per_length)
      : out((half + margin) * per_length), in((half - margin) * per_length) {}
};

/// The part of a line inside slabs. The true part lies within the longest one, and contains the shortest one.
template <class Lanes>
struct LinePart {
  Lanes longest_begin, longest_end, shortest_begin, shortest_end;

  explicit LinePart(const Lanes& half)
      : longest_begin(-half), longest_end(half), shortest_begin(-half), shortest_end(half) {}
  LinePart(const Lanes& centre, const SlabWidth<Lanes>& width)
      : longest_begin(centre - width.out),
        longest_end(centre + width.out),
        shortest_begin(centre - width.in),
        shortest_end(centre + width.in) {}

  void cut(const Lanes& centre, const SlabWidth<Lanes>& width) {
    const LinePart other(centre, width);
    keep_larger(longest_begin, other.longest_begin);
    keep_smaller(longest_end, other.longest_end);
    keep_larger(shortest_begin, other.shortest_begin);
    keep_smaller(shortest_end, other.shortest_end);
  }
};

/// Sums over the parts of lines.
template <class Lanes>
struct LineSums {
  Lanes volumes{};  ///< twelve times the volume
  Lanes doubt{};    ///< twelve times the error of the volume from the ends of parts
  Lanes lengths{};
  Lanes squares{};  ///< of lengths times squares

  /// `square` is the sum of the squares of the distances of both faces from O.
  void add(const LinePart<Lanes>& part, const Lanes& weight, const Lanes& square) {
    Lanes longest = part.longest_end - part.longest_begin, shortest = part.shortest_end - part.shortest_begin, size;
    keep_larger(longest, Lanes{});
    keep_larger(shortest, Lanes{});
    set_size(weight, size);
    volumes += weight * (longest + shortest);
    doubt += size * (longest - shortest);
    lengths += longest;
    squares += longest * square;
  }
  void add(const LineSums& other) {
    volumes += other.volumes, doubt += other.doubt;
    lengths += other.lengths, squares += other.squares;
  }
};

// Errors, with u = 2^-53. The corners of the two boxes are H and K from their centres, and H is the smaller one. C is
// the first centre, and T is its distance from the second centre. Points of the common set are at most H from C.
//
// Each entry of a rotation is off by at most u of itself. A sum of three products rounds three times. So an entry of
// the turn between the boxes is off by 5 u at most, a row or a column of it by 5 √3 u, two entries of one by 5 √2 u,
// and a coordinate of the way between the centres by 5 u T.
//
// A *margin* bounds how far rounding moves a point of a line against a slab. Moved in and out by the margin, the slab
// cuts out a shortest and a longest part. The true part is between both.
//
// Edges: 5 √3 u H of the turned point and 5 u T of the centre; 3 u H and u T of the shifts and the middle; u (K + H) of
// their difference; u H of the reciprocal; 2 u K of the width; u H of the part's end. The sum is less than
// u (16 H + 6 T + 4 K) for edges of the first box. For edges of the second box, H and K change places.
//
// Seams: The other face's normal n lies in the plane of a face, and s = |n| is the sine between the faces. The foot of
// C in this plane is q from the other face. So the line's nearest point to the foot is q n / s² from it. This is at
// most H. If n is off by ν and q by δ, this point is off by (δ + H ν) / s, as |n / n² - m / m²| = |n - m| / |n| |m|.
// The way along the line adds H ν / s. Here ν = 5 √2 u and δ = u (5 T + 9 H). The roundings of a place on the line and
// of widths add 10 u H, and for slabs of the second box u (6 T + 9 H + 3 K). The sum is less than u (36 H + 12 T + 4 K)
// / s, even if s is off by 2^-12 of itself. The smaller reciprocal of the entries of n is at least 1 / s.
//
// Weights: A weight depends on the distances f and g of two faces from O, which is at most (H + T) / 2 from C. A
// distance is off by at most u (12.5 T + 6.5 H) and u of itself. The weight is at most 2 (f² + g²). It is off by
// u (25 T + 13 H) (|f| + |g|) and 17 u (f² + g²). A line's length and product round twice, and the sums 20 times, so
// the last term is less than 64 u (f² + g²) for each length. The sum of the lengths times |f| + |g| is at most the root
// of twice the sum of the lengths and their sum times f² + g².
//
// The sum over the edges is exact for boxes in general position. All other boxes are limits of such boxes, with the
// same bounds. Where planes nearly coincide, shortest and longest parts differ much, and so the error is large.

/// Pairs of boxes. The first box of each pair is the smaller one.
template <class Lanes>
class BoxPairs {
 public:
  BoxPairs(const BoxLanes<Lanes>& a, const BoxLanes<Lanes>& b) : half_{a.half, b.half} {
    constexpr double kLeast = 0x1p-60;  // is lost in the rounding of an entry; keeps quotients finite
    Lanes between[3];
    for (int k = 0; k < 3; ++k) between[k] = b.position[k] - a.position[k];
    for (int i = 0; i < 3; ++i) {
      const Lanes in_a = a.rotation[0][i] * between[0] + a.rotation[1][i] * between[1] + a.rotation[2][i] * between[2];
      const Lanes in_b = b.rotation[0][i] * between[0] + b.rotation[1][i] * between[1] + b.rotation[2][i] * between[2];
      other_[0][i] = in_b, other_[1][i] = -in_a;
      for (int j = 0; j < 3; ++j) {
        Lanes entry = a.rotation[0][i] * b.rotation[0][j] + a.rotation[1][i] * b.rotation[1][j] +
                      a.rotation[2][i] * b.rotation[2][j];
        Lanes size;
        set_size(entry, size);
        choose(size > kLeast - Lanes{}, entry, kLeast - Lanes{}, entry);
        turn_[i][j] = entry;
        per_[i][j] = 1.0 / entry;
        set_size(per_[i][j], steep_[i][j]);
      }
    }
    measure_faces();
    set_norm(half_[0], reach_[0]);
    set_norm(half_[1], reach_[1]);
    set_norm(between, apart_);
  }

  /// Leaves the zeros of pairs in which no edge of either box is inside the other box.
  void measure(double* volumes, double* errors) const {
    LineSums<Lanes> sums;
    for (int body : {0, 1})
      for (int axis = 0; axis < 3; ++axis) add_edges(body, axis, sums);
    const Lanes edges = sums.lengths;
    bool separated = true;
    for (int n = 0; n < kPairsOf<Lanes>; ++n) separated &= edges[n] == 0;
    if (separated) return;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) add_seams(i, j, sums);
    const Lanes of_faces = kUnit * (26.0 * apart_ + 14.0 * reach_[0]);
    Lanes root;
    set_root(2.0 * sums.lengths * sums.squares, root);
    const Lanes of_weights = 64.0 * kUnit * sums.squares + of_faces * root;
    for (int n = 0; n < kPairsOf<Lanes>; ++n) {
      if (edges[n] == 0) continue;
      volumes[n] = sums.volumes[n] / 12;
      errors[n] = kUp * (sums.doubt[n] / 12 + of_weights[n] / 6);
    }
  }

 private:
  static constexpr double kUnit = 0x1p-53;
  static constexpr double kUp = 1 + 0x1p-40;  ///< more than the rounding of an error

  /// Entry (i, l) of the matrix to the other body's axes.
  static const Lanes& entry(const Lanes (&matrix)[3][3], int body, int i, int l) {
    return body == 0 ? matrix[i][l] : matrix[l][i];
  }

  /// Chooses O: the middle between the point of each box that is nearest to the other centre. Where the boxes overlap
  /// at a corner, weights are then as small as the common set.
  void measure_faces() {
    Lanes origin[3], nearest_a[3], nearest_b[3];
    for (int k = 0; k < 3; ++k) {
      nearest_a[k] = -other_[1][k], nearest_b[k] = -other_[0][k];
      keep_larger(nearest_a[k], -half_[0][k]);
      keep_smaller(nearest_a[k], half_[0][k]);
      keep_larger(nearest_b[k], -half_[1][k]);
      keep_smaller(nearest_b[k], half_[1][k]);
    }
    for (int i = 0; i < 3; ++i) {
      const Lanes turned = turn_[i][0] * nearest_b[0] + turn_[i][1] * nearest_b[1] + turn_[i][2] * nearest_b[2];
      origin[i] = 0.5 * (nearest_a[i] + (turned - other_[1][i]));
      face_[0][i][0] = half_[0][i] + origin[i], face_[0][i][1] = half_[0][i] - origin[i];
    }
    for (int j = 0; j < 3; ++j) {
      const Lanes ahead = other_[0][j] - (turn_[0][j] * origin[0] + turn_[1][j] * origin[1] + turn_[2][j] * origin[2]);
      face_[1][j][0] = half_[1][j] - ahead, face_[1][j][1] = half_[1][j] + ahead;
    }
  }

  /// The four edges of a body along one of its axes, cut by the three slabs of the other body.
  void add_edges(int body, int axis, LineSums<Lanes>& sums) const {
    const int one = (axis + 1) % 3, two = (axis + 2) % 3;
    const Lanes* half = half_[body];
    const Lanes margin = kUnit * (16.0 * reach_[body] + 6.0 * apart_ + 4.0 * reach_[1 - body]);
    Lanes middle[3], sum[3], difference[3], steep[3];
    for (int l = 0; l < 3; ++l) {
      const Lanes& per = entry(per_, body, axis, l);
      const Lanes along_one = entry(turn_, body, one, l) * half[one],
                  along_two = entry(turn_, body, two, l) * half[two];
      middle[l] = other_[body][l] * per;
      sum[l] = (along_one + along_two) * per;
      difference[l] = (along_one - along_two) * per;
      steep[l] = entry(steep_, body, axis, l);
    }
    const Lanes* other_half = half_[1 - body];
    const SlabWidth<Lanes> widths[3] = {
        {other_half[0], margin, steep[0]}, {other_half[1], margin, steep[1]}, {other_half[2], margin, steep[2]}};
    LineSums<Lanes> own;
    for (int end_one : {0, 1})
      for (int end_two : {0, 1}) {
        const Lanes* shift = end_one == end_two ? sum : difference;
        LinePart<Lanes> part(half[axis]);
        for (int l = 0; l < 3; ++l) {
          const Lanes centre = end_one ? middle[l] - shift[l] : middle[l] + shift[l];
          part.cut(centre, widths[l]);
        }
        const Lanes &f = face_[body][one][end_one], &g = face_[body][two][end_two];
        own.add(part, 2.0 * (f * g), f * f + g * g);
      }
    sums.add(own);
  }

  /// The four lines where the faces across axis `i` of the first body meet the faces across axis `j` of the second one,
  /// cut by the other two slabs of each body. A place on a line is its distance from the point nearest to C, over the
  /// sine between the faces. Where this sine is less than 2^-38, there is no line if the faces are clearly apart, and
  /// infinite doubt otherwise.
  void add_seams(int i, int j, LineSums<Lanes>& sums) const {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    const Lanes& cosine = turn_[i][j];
    // The other body's normal within each face. Its length is the sine between the faces.
    const Lanes &a1 = turn_[i1][j], &a2 = turn_[i2][j], &b1 = turn_[i][j1], &b2 = turn_[i][j2];
    const Lanes sine2_a = a1 * a1 + a2 * a2, sine2_b = b1 * b1 + b2 * b2;
    const Lanes per_sine2_a = 1.0 / sine2_a, per_sine2_b = 1.0 / sine2_b;
    Lanes margin_a = steep_[i1][j], margin_b = steep_[i][j1];
    keep_smaller(margin_a, steep_[i2][j]);
    keep_smaller(margin_b, steep_[i][j2]);
    const Lanes margin = kUnit * (36.0 * reach_[0] + 12.0 * apart_ + 4.0 * reach_[1]);
    margin_a = margin * margin_a;
    margin_b = margin * margin_b;
    SlabWidth<Lanes> across_a1(half_[0][i1], margin_a, steep_[i2][j]);
    const SlabWidth<Lanes> across_a2(half_[0][i2], margin_a, steep_[i1][j]);
    const SlabWidth<Lanes> across_b1(half_[1][j1], margin_b, steep_[i][j2]),
        across_b2(half_[1][j2], margin_b, steep_[i][j1]);
    const Lanes to_a1 = per_sine2_a * a1 * per_[i2][j], to_a2 = per_sine2_a * a2 * per_[i1][j];
    const Lanes to_b1 = per_sine2_b * b1 * per_[i][j2], to_b2 = per_sine2_b * b2 * per_[i][j1];
    const Lanes middle1 = other_[0][j1] * per_[i][j2], middle2 = other_[0][j2] * per_[i][j1];
    const auto parallel = sine2_a < 0x1p-76 - Lanes{};
    choose(parallel, -kInfinity - Lanes{}, across_a1.out, across_a1.out);
    choose(parallel, -kInfinity - Lanes{}, across_a1.in, across_a1.in);
    Lanes nearest = kInfinity - Lanes{};
    LineSums<Lanes> own;
    for (int end : {0, 1}) {
      const Lanes& g = face_[1][j][end];
      const Lanes along_b = end ? other_[0][j] + half_[1][j] : other_[0][j] - half_[1][j];
      for (int side : {0, 1}) {
        const Lanes& f = face_[0][i][side];
        const Lanes along_a = side ? half_[0][i] - Lanes{} : -half_[0][i];
        const Lanes beyond_a = along_b - cosine * along_a, beyond_b = along_a - cosine * along_b;
        LinePart<Lanes> part(beyond_a * to_a1, across_a1);
        part.cut(-(beyond_a * to_a2), across_a2);
        part.cut(middle1 - beyond_b * to_b1, across_b1);
        part.cut(beyond_b * to_b2 - middle2, across_b2);
        const Lanes product = 2.0 * (f * g), squares = f * f + g * g, turned = cosine * squares;
        own.add(part, side == end ? product - turned : product + turned, squares);
        Lanes gap;
        set_size(beyond_a, gap);
        keep_smaller(nearest, gap);
      }
    }
    Lanes in_doubt;
    choose(nearest > 0x1p-37 * (reach_[0] + apart_), Lanes{}, kInfinity - Lanes{}, in_doubt);
    choose(parallel, in_doubt, Lanes{}, in_doubt);
    own.doubt += in_doubt;
    sums.add(own);
  }

  const Lanes* half_[2];
  Lanes turn_[3][3];     ///< column j is the second body's axis j, in the axes of the first body
  Lanes per_[3][3];      ///< 1 / turn_
  Lanes steep_[3][3];    ///< |1 / turn_|
  Lanes other_[2][3];    ///< from each body's centre to the other one, in the axes of the other body
  Lanes face_[2][3][2];  ///< m: distance of each body's faces from O, at the negative and the positive end of each axis
  Lanes reach_[2], apart_;
};

template <class Lanes>
void measure(const BoxList& a, const BoxList& b, BoxVolumes& found) {
  for (int n = 0; n < kPairsAtOnce; n += kPairsOf<Lanes>)
    BoxPairs<Lanes>(BoxLanes<Lanes>(&a[n]), BoxLanes<Lanes>(&b[n])).measure(&found.volume[n], &found.error[n]);
}

#ifdef OVERLAPPER_WIDER
OVERLAPPER_WIDER void measure_wider(const BoxList& a, const BoxList& b, BoxVolumes& found) {
  measure<Quad>(a, b, found);
}
auto* const fastest = is_wider() ? measure_wider : measure<MostLanes>;
#else
constexpr auto* fastest = measure<MostLanes>;
#endif

bool smaller_first(const Placed& a, const Placed& b) {
  const double size_a = norm2(half_extents_of(a)), size_b = norm2(half_extents_of(b));
  return size_a != size_b ? size_a < size_b : !comes_before(b, a);
}

}  // namespace

BoxVolumes volumes_of_boxes(const BoxList& a, const BoxList& b) {
  BoxList first, second;
  for (int n = 0; n < kPairsAtOnce; ++n) {
    const bool in_order = smaller_first(*a[n], *b[n]);
    first[n] = in_order ? a[n] : b[n], second[n] = in_order ? b[n] : a[n];
  }
  BoxVolumes volumes;
  fastest(first, second, volumes);
  return volumes;
}

}  // namespace overlapper
