#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "geometry/wide.h"

namespace overlapper {

template <class Scalar>
using Row4 = std::array<Scalar, 4>;

/// Solves m z = b by elimination with row pivoting, which is backward stable.
template <class Scalar>
Row4<Scalar> solve(std::array<Row4<Scalar>, 4> m, Row4<Scalar> b) {
  using std::abs;
  for (int k = 0; k < 4; ++k) {
    int pivot = k;
    for (int i = k + 1; i < 4; ++i)
      if (abs(m[i][k]) > abs(m[pivot][k])) pivot = i;
    std::swap(m[k], m[pivot]);
    std::swap(b[k], b[pivot]);
    if (rounded(m[k][k]) == 0) continue;
    for (int i = k + 1; i < 4; ++i) {
      const Scalar factor = m[i][k] / m[k][k];
      for (int j = k; j < 4; ++j) m[i][j] = m[i][j] - factor * m[k][j];
      b[i] = b[i] - factor * b[k];
    }
  }
  Row4<Scalar> z{};
  for (int k = 3; k >= 0; --k) {
    Scalar sum = b[k];
    for (int j = k + 1; j < 4; ++j) sum = sum - m[k][j] * z[j];
    if (rounded(m[k][k]) != 0) z[k] = sum / m[k][k];
  }
  return z;
}

/// A plane of the basis that may leave it: the ratio of its weight to its share of the entering plane, and that share.
template <class Scalar>
struct Leaving {
  int plane = -1;
  Scalar ratio{std::numeric_limits<double>::infinity()}, share{};
};

/// Larger shares are not rounding.
inline bool has_share(double share) { return share > 1e-12; }
/// The shares add up to one, so at least one of them is a quarter or more.
inline bool has_share(DoubleDouble share) { return share.head > 0x1p-80; }

/// Rounding orders equal ratios at random, so any least ratio is good.
inline bool leaves_sooner(const Leaving<double>& a, const Leaving<double>& b) { return a.ratio < b.ratio; }
/// Double-doubles recognize equal ratios. The largest share among equal ratios keeps the basis farthest from singular.
inline bool leaves_sooner(const Leaving<DoubleDouble>& a, const Leaving<DoubleDouble>& b) {
  const bool equal = b.plane >= 0 && abs(a.ratio - b.ratio).head <= 0x1p-80;
  return equal ? a.share > b.share : a.ratio < b.ratio;
}

/// The four planes at the optimum of a linear programme: the largest ball within all planes seen so far, max r with
/// dot(n, x) + r <= offset. Scalars are doubles or double-doubles; a `Cut` has a `plane` with a unit normal.
template <class Cut>
class Basis {
 public:
  using AnyPlane = decltype(Cut::plane);
  using Vector = decltype(AnyPlane::normal);
  using Scalar = decltype(AnyPlane::offset);

  explicit Basis(const std::array<Cut, 4>& cuts) : cuts_(cuts) { weigh(); }

  std::span<const Cut, 4> cuts() const { return cuts_; }

  /// The ball that touches all four planes: centre and radius.
  std::pair<Vector, Scalar> ball() const {
    std::array<Row4<Scalar>, 4> m;
    Row4<Scalar> offsets;
    for (int i = 0; i < 4; ++i) m[i] = row_of(cuts_[i].plane), offsets[i] = cuts_[i].plane.offset;
    const Row4<Scalar> z = solve(m, offsets);
    return {{z[0], z[1], z[2]}, z[3]};
  }

  /// Exchanges one plane for `entering` so that the weights stay non-negative. False if rounding leaves no choice.
  bool exchange(const Cut& entering) {
    const Row4<Scalar> share = combination_of(row_of(entering.plane));
    Leaving<Scalar> leaving;
    for (int i = 0; i < 4; ++i) {
      if (!has_share(share[i])) continue;
      const Leaving<Scalar> candidate{i, weight_[i] / share[i], share[i]};
      if (leaves_sooner(candidate, leaving)) leaving = candidate;
    }
    if (leaving.plane < 0) return false;
    cuts_[leaving.plane] = entering;
    weigh();
    return true;
  }

  /// An upper bound of the radius that holds despite the rounding of the basis, for balls with a centre within `reach`
  /// of `centre`. It is the mean of the four inequalities by non-negative weights, about `centre`.
  double certified_radius(const Vector& centre, double reach) const {
    Scalar total{}, bound{};
    Vector left_over;
    for (int i = 0; i < 4; ++i) {
      total = total + weight_[i];
      bound = bound - weight_[i] * signed_distance(cuts_[i].plane, centre);
      left_over = left_over + weight_[i] * cuts_[i].plane.normal;
    }
    if (!(rounded(total) > 0)) return std::numeric_limits<double>::infinity();
    return rounded(bound / total) + rounded(norm(left_over)) / rounded(total) * reach;
  }

 private:
  static Row4<Scalar> row_of(const AnyPlane& plane) {
    return {plane.normal.x, plane.normal.y, plane.normal.z, Scalar{1}};
  }

  /// The weights of the four inequalities that bound the radius. Only rounding can make one of them negative.
  void weigh() {
    weight_ = combination_of(Row4<Scalar>{Scalar{}, Scalar{}, Scalar{}, Scalar{1}});
    for (Scalar& w : weight_)
      if (!(rounded(w) > 0)) w = {};
  }

  /// The shares of the four planes' rows that add up to `row`.
  Row4<Scalar> combination_of(const Row4<Scalar>& row) const {
    std::array<Row4<Scalar>, 4> columns;
    for (int i = 0; i < 4; ++i) {
      const Row4<Scalar> r = row_of(cuts_[i].plane);
      for (int j = 0; j < 4; ++j) columns[j][i] = r[j];
    }
    return solve(columns, row);
  }

  std::array<Cut, 4> cuts_;
  Row4<Scalar> weight_;
};

}  // namespace overlapper
