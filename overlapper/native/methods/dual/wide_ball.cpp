#include "methods/dual/wide_ball.h"

#include <array>
#include <limits>

namespace overlapper {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Row = std::array<DoubleDouble, 4>;

Row row_of(const WidePlane& plane) { return {plane.normal.x, plane.normal.y, plane.normal.z, {1}}; }

/// Solves m z = b by elimination with row pivoting.
Row solve(std::array<Row, 4> m, Row b) {
  for (int k = 0; k < 4; ++k) {
    int pivot = k;
    for (int i = k + 1; i < 4; ++i)
      if (abs(m[i][k]) > abs(m[pivot][k])) pivot = i;
    std::swap(m[k], m[pivot]);
    std::swap(b[k], b[pivot]);
    if (m[k][k].head == 0) continue;
    for (int i = k + 1; i < 4; ++i) {
      const DoubleDouble factor = m[i][k] / m[k][k];
      for (int j = k; j < 4; ++j) m[i][j] = m[i][j] - factor * m[k][j];
      b[i] = b[i] - factor * b[k];
    }
  }
  Row z{};
  for (int k = 3; k >= 0; --k) {
    DoubleDouble sum = b[k];
    for (int j = k + 1; j < 4; ++j) sum = sum - m[k][j] * z[j];
    if (m[k][k].head != 0) z[k] = sum / m[k][k];
  }
  return z;
}

/// Four planes at which the linear programme's optimum over the planes seen so far lies.
class Basis {
 public:
  explicit Basis(const std::array<WidePlane, 4>& planes) : planes_(planes) { weigh(); }

  WideVector centre() const {
    std::array<Row, 4> m;
    Row offsets;
    for (int i = 0; i < 4; ++i) m[i] = row_of(planes_[i]), offsets[i] = planes_[i].offset;
    const Row z = solve(m, offsets);
    return {z[0], z[1], z[2]};
  }

  /// No ball whose centre is within `reach` of `centre` has a larger radius: the weighted sum of the four inequalities.
  double most(const WideVector& centre, double reach) const {
    DoubleDouble total, bound;
    WideVector left_over;
    for (int i = 0; i < 4; ++i) {
      const DoubleDouble w = weight_[i].head > 0 ? weight_[i] : DoubleDouble{};
      total = total + w;
      bound = bound - w * signed_distance(planes_[i], centre);
      left_over = left_over + w * planes_[i].normal;
    }
    return total.head > 0 ? (bound / total).head + norm(left_over).head / total.head * reach : kInfinity;
  }

  /// Takes `entering` for the plane that keeps all weights from getting negative.
  bool exchange(const WidePlane& entering) {
    const Row share = combination_of(row_of(entering));
    // The shares add up to one, so that one of them is a quarter or more.
    constexpr double kNone = 0x1p-80;
    int leaving = -1;
    DoubleDouble least{kInfinity};
    for (int i = 0; i < 4; ++i) {
      if (!(share[i].head > kNone)) continue;
      const DoubleDouble ratio = weight_[i].head > 0 ? weight_[i] / share[i] : DoubleDouble{};
      const bool tie = leaving >= 0 && abs(ratio - least).head <= kNone;
      if (tie ? share[i] > share[leaving] : ratio < least) least = ratio, leaving = i;
    }
    if (leaving < 0) return false;
    planes_[leaving] = entering;
    weigh();
    return true;
  }

 private:
  void weigh() { weight_ = combination_of(Row{DoubleDouble{}, {}, {}, {1}}); }

  /// The shares of the four planes' rows that add up to `row`.
  Row combination_of(const Row& row) const {
    std::array<Row, 4> columns;
    for (int i = 0; i < 4; ++i) {
      const Row r = row_of(planes_[i]);
      for (int j = 0; j < 4; ++j) columns[j][i] = r[j];
    }
    return solve(columns, row);
  }

  std::array<WidePlane, 4> planes_;
  Row weight_;
};

WidePlane supporting(const WideBody& body, const WideVector& outward) {
  const WideVector normal = unit(outward);
  return {normal, dot(normal, body.support(normal))};
}

/// A tetrahedron around one of the bounded bodies; around everything of interest if none is bounded.
std::array<WidePlane, 4> surrounding_simplex(std::span<const WideBody> bodies, double reach) {
  const std::array<Vec3, 4> directions{Vec3{1, 1, 1}, Vec3{1, -1, -1}, Vec3{-1, 1, -1}, Vec3{-1, -1, 1}};
  std::array<WidePlane, 4> simplex;
  for (int k = 0; k < 4; ++k) {
    simplex[k] = {unit(wide(directions[k])), {1e6 * reach}};
    bool first = true;
    for (const WideBody& body : bodies) {
      if (!bounded(body.shape)) continue;
      const WidePlane plane = supporting(body, wide(directions[k]));
      if (first || plane.offset < simplex[k].offset) simplex[k] = plane;
      first = false;
    }
  }
  return simplex;
}

Owned<WidePlane> tightest(std::span<const WideBody> bodies, const WideVector& point) {
  Owned<WidePlane> worst{{}, -1};
  DoubleDouble outside{-kInfinity};
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const WidePlane plane = bodies[i].tightest(point);
    const DoubleDouble d = signed_distance(plane, point);
    if (d > outside) outside = d, worst = {plane, i};
  }
  return worst;
}

}  // namespace

WideBall wide_deepest_ball(std::span<const WideBody> bodies, std::span<const OwnedPlane> hints, double margin,
                           double reach, double noise) {
  const std::array<WidePlane, 4> simplex = surrounding_simplex(bodies, reach);
  Basis basis(simplex);
  WideBall best{{}, -kInfinity, kInfinity, {}};
  for (const WidePlane& plane : simplex) best.cuts.push_back({plane, -1});
  const auto enter = [&](const Owned<WidePlane>& cut) {
    best.cuts.push_back(cut);
    return basis.exchange(cut.plane);
  };
  for (const auto& [plane, owner] : hints) {
    if (owner < 0 || !bounded(bodies[owner].shape)) continue;
    const WidePlane exactly = supporting(bodies[owner], wide(plane.normal));
    if (signed_distance(exactly, basis.centre()).head > 0) enter({exactly, owner});
  }
  constexpr int kMaxRounds = 512;
  for (int round = 0; round < kMaxRounds; ++round) {
    const WideVector centre = basis.centre();
    best.upper = std::min(best.upper, basis.most(centre, reach + norm(centre).head) + noise);
    const Owned<WidePlane> worst = tightest(bodies, centre);
    const double slack = -signed_distance(worst.plane, centre).head - noise;
    if (slack > best.lower) best.lower = slack, best.centre = centre;
    const bool deep = best.lower > margin && best.lower >= best.upper / 4;
    const bool shallow = best.upper <= margin && best.lower >= -margin;
    if (deep || shallow || best.upper < -margin || best.upper - best.lower <= 4 * noise) break;
    if (!enter(worst)) break;
  }
  return best;
}

}  // namespace overlapper
