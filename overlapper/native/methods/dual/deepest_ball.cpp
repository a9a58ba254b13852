#include "methods/dual/deepest_ball.h"

#include <algorithm>
#include <numeric>

#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/rounding.h"
#include "methods/dual/basis.h"

namespace overlapper {
namespace {

/// The largest number that the planes were computed from.
double magnitude(std::span<const OwnedPlane> planes, std::span<const double> reach) {
  double largest = 0;
  for (const OwnedPlane& p : planes)
    largest = std::max(largest, p.owner >= 0 ? reach[p.owner] : std::abs(p.plane.offset));
  return largest;
}

/// The plane that `point` violates most, of the listed planes and those of the smooth bodies.
OwnedPlane tightest(std::span<const Placed> bodies, std::span<const OwnedPlane> planes, Vec3 point) {
  const OwnedPlane* worst = nullptr;
  double outside = -kInfinity;
  for (const OwnedPlane& candidate : planes) {
    const double d = signed_distance(candidate.plane, point);
    if (d > outside) outside = d, worst = &candidate;
  }
  OwnedPlane result = worst ? *worst : OwnedPlane{{}, -1};
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    if (!smooth(bodies[i].shape)) continue;
    const Plane plane = bodies[i].tightest(point);
    const double d = signed_distance(plane, point);
    if (d > outside) outside = d, result = {plane, i};
  }
  return result;
}

/// A tetrahedron of supporting planes around one of the bounded bodies. If none is bounded, a tetrahedron around
/// everything relevant.
std::array<OwnedPlane, 4> surrounding_simplex(std::span<const Placed> bodies, std::span<const OwnedPlane> planes) {
  const double s = 1 / std::sqrt(3.0);
  const std::array<Vec3, 4> directions{Vec3{s, s, s}, Vec3{s, -s, -s}, Vec3{-s, s, -s}, Vec3{-s, -s, s}};
  double reach = 1;
  for (const OwnedPlane& p : planes) reach = std::max(reach, std::abs(p.plane.offset));
  std::array<OwnedPlane, 4> simplex;
  for (int k = 0; k < 4; ++k) {
    simplex[k] = {{directions[k], 1e6 * reach}, -1};
    bool first = true;
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
      if (!bounded(bodies[i].shape)) continue;
      const double offset = dot(directions[k], bodies[i].support(directions[k]));
      if (first || offset < simplex[k].plane.offset) simplex[k] = {{directions[k], offset}, i};
      first = false;
    }
  }
  return simplex;
}

}  // namespace

DeepestBall deepest_ball(std::span<const Placed> bodies, std::span<const double> reach,
                         std::span<const OwnedPlane> planes, std::span<const OwnedPlane> hints) {
  DeepestBall best{{}, -kInfinity, kInfinity, 0, false, false, {}};
  const std::array<OwnedPlane, 4> simplex = surrounding_simplex(bodies, planes);
  best.cuts.assign(simplex.begin(), simplex.end());
  Basis basis(simplex);
  for (const OwnedPlane& hint : hints) {
    best.cuts.push_back(hint);
    basis.exchange(hint);
  }
  // Each exchange lowers the optimum or, at a degenerate corner, keeps it. Smooth bodies add planes without end.
  constexpr int kMaxRounds = 256;
  const double largest_reach = *std::max_element(reach.begin(), reach.end());
  for (int round = 0; round < kMaxRounds; ++round) {
    cancellation_point(planes.size());
    const auto [centre, radius] = basis.ball();
    // At a nearly singular corner the centre runs away, and so do both bounds.
    const OwnedPlane worst = tightest(bodies, planes, centre);
    const double made_from = std::max(magnitude(basis.cuts(), reach), worst.owner >= 0 ? reach[worst.owner] : 0);
    const double rounding_here = rounding(std::max(made_from, norm(centre)));
    best.upper = std::min(best.upper, radius + rounding_here);
    const double certain = doubt(std::max(made_from, norm(centre)));
    best.apart = radius < -certain && basis.certified_radius(centre, largest_reach + norm(centre)) < -certain;
    const double slack = -signed_distance(worst.plane, centre);
    if (slack > best.lower)
      best.lower = slack, best.centre = centre, best.rounding = rounding_here, best.sure = slack > certain;
    // Newton's method starts from any inner point; a fraction of the depth is enough.
    const bool deep = best.lower > best.rounding && best.lower >= best.upper / 4;
    const bool optimal = best.upper - best.lower <= 2 * best.rounding;
    if (deep || best.apart || optimal || !basis.exchange(worst)) break;
    best.cuts.push_back(worst);
  }
  return best;
}

namespace {

/// The rows of dual points a, factored as a = R^T q with orthonormal columns of q. The Dikin frame of the rows is R^-1.
struct Orthogonalised {
  std::vector<Vec3> rows;  ///< q
  Mat3 inverse_r;          ///< x = inverse_r * y
};

double column(const Vec3& v, int j) { return v[j]; }

/// Gram-Schmidt, twice, on the three columns of the rows, the longest remaining column first. Rows of sliver planes may
/// be larger than the others by any factor. Each column is therefore first divided by its length.
Orthogonalised orthogonalise(std::span<const Vec3> a) {
  const int n = static_cast<int>(a.size());
  std::array<std::vector<double>, 3> q;
  std::array<Vec3, 3> combination{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};  // q[j] = a * combination[j]
  for (int j = 0; j < 3; ++j) {
    q[j].resize(n);
    for (int i = 0; i < n; ++i) q[j][i] = column(a[i], j);
  }
  const auto product = [&](int j, int k) { return std::inner_product(q[j].begin(), q[j].end(), q[k].begin(), 0.0); };
  for (int j = 0; j < 3; ++j) {
    int longest = j;
    for (int k = j + 1; k < 3; ++k)
      if (product(k, k) > product(longest, longest)) longest = k;
    std::swap(q[j], q[longest]);
    std::swap(combination[j], combination[longest]);
    for (int repeat = 0; repeat < 2; ++repeat) {
      for (int k = 0; k < j; ++k) {
        const double along = product(j, k);
        for (int i = 0; i < n; ++i) q[j][i] -= along * q[k][i];
        combination[j] -= along * combination[k];
      }
    }
    const double length = std::sqrt(product(j, j));
    if (!(length > 0)) continue;
    for (double& value : q[j]) value /= length;
    combination[j] = combination[j] / length;
    for (int k = j + 1; k < 3; ++k) {
      const double along = product(j, k);
      for (int i = 0; i < n; ++i) q[k][i] -= along * q[j][i];
      combination[k] -= along * combination[j];
    }
  }
  Orthogonalised result;
  result.inverse_r = transposed({combination[0], combination[1], combination[2]});
  if (determinant(result.inverse_r) < 0) {
    for (double& value : q[2]) value = -value;
    combination[2] = -combination[2];
    result.inverse_r = transposed({combination[0], combination[1], combination[2]});
  }
  for (int i = 0; i < n; ++i) result.rows.push_back({q[0][i], q[1][i], q[2][i]});
  return result;
}

/// Three orthonormal axes by rows. The first is the normal of the plane with the least slack. In these axes, the large
/// entries of the rows of a sliver are in one column. If the set is also narrow beside that normal, the second axis
/// lies along the narrowest direction: the large entries of the rows of a needle are in two columns.
Mat3 axes_of(std::span<const Vec3> normals, std::span<const double> slacks) {
  constexpr double kNarrow = 0x1p-20;
  const Vec3 first = normals[std::ranges::min_element(slacks) - slacks.begin()];
  Vec3 second = any_orthogonal(first);
  double narrowest = kNarrow * std::ranges::max(slacks);
  for (size_t i = 0; i < normals.size(); ++i) {
    const Vec3 across = normals[i] - dot(first, normals[i]) * first;
    const double length = norm(across);
    if (length > kNarrow && slacks[i] < narrowest * length)
      narrowest = slacks[i] / length, second = unit(across - dot(first, across) * first);
  }
  return {first, second, cross(first, second)};
}

/// The step along `direction` that maximizes the product of the slacks. The step multiplies the slack of row q by 1 -
/// step * dot(q, direction). The sum of the logarithms is concave, so bisection of its slope finds the maximum. A
/// damped step at most doubles a slack; this step crosses a sliver of any aspect at once.
double best_step(std::span<const Vec3> rows, Vec3 direction) {
  double steepest = 0;
  for (Vec3 q : rows) steepest = std::max(steepest, dot(q, direction));
  if (!(steepest > 0)) return 0;
  const auto rising = [&](double step) {
    double slope = 0;
    for (Vec3 q : rows) {
      const double rate = dot(q, direction);
      slope -= rate / (1 - step * rate);
    }
    return slope > 0;
  };
  double low = 0, high = 1 / steepest;
  for (int i = 0; i < 12; ++i) {
    const double middle = (low + high) / 2;
    (rising(middle) ? low : high) = middle;
  }
  return low;
}

/// The point moved by transposed(axes) * way.
Vec3 moved(Vec3 point, const Mat3& axes, Vec3 way) { return point + apply_transposed(axes, way); }
WideVector moved(const WideVector& point, const Mat3& axes, Vec3 way) {
  return point + apply_transposed(axes, wide(way));
}

/// Newton's method for the analytic centre of the planes, from a point strictly inside all of them. It works in the
/// frame of the last step, so that slacks of any ratio become numbers near one.
template <class AnyPlane>
class AnalyticCentre {
 public:
  using Point = decltype(AnyPlane::normal);

  explicit AnalyticCentre(const Point& inside) { frame_.origin = inside; }

  void settle(std::span<const Owned<AnyPlane>> planes) {
    std::vector<Vec3> normals, a;
    std::vector<double> slacks(planes.size());
    for (const Owned<AnyPlane>& p : planes) normals.push_back(rounded(p.plane.normal));
    for (int step = 0; step < kMaxSteps; ++step) {
      cancellation_point(planes.size());
      for (size_t i = 0; i < planes.size(); ++i) slacks[i] = -rounded(signed_distance(planes[i].plane, frame_.origin));
      // By rounding, the origin may lie on a plane or beyond it. Newton's method then takes the rounding for the slack.
      const double least = kRounding * std::max(norm(rounded(frame_.origin)), std::ranges::max(slacks));
      const Mat3 axes = axes_of(normals, slacks);
      a.clear();
      for (size_t i = 0; i < planes.size(); ++i)
        a.push_back(rounded(axes * planes[i].plane.normal) / std::max(slacks[i], least));
      const Orthogonalised frame = orthogonalise(a);
      frame_.axes = transposed(axes) * frame.inverse_r;
      Vec3 newton;
      for (Vec3 q : frame.rows) newton -= q;
      if (norm(newton) < 0.25) return;
      frame_.origin = moved(frame_.origin, axes, frame.inverse_r * (best_step(frame.rows, newton) * newton));
    }
  }

  const FrameAbout<Point>& frame() const { return frame_; }
  void restart(const Point& inside) { frame_.origin = inside; }

 private:
  static constexpr double kRounding = std::is_same_v<Point, Vec3> ? 0x1p-53 : 0x1p-106;
  static constexpr int kMaxSteps = 64;
  FrameAbout<Point> frame_;
};

}  // namespace

template <class Body>
FrameAbout<PointOf<Body>> round_frame(std::span<const Body> bodies, std::span<const Owned<PlaneOf<Body>>> planes,
                                      std::vector<Owned<PlaneOf<Body>>> cuts, const PointOf<Body>& inside) {
  using Cut = Owned<PlaneOf<Body>>;
  PointOf<Body> safe = inside;
  // A plane may pass through the point only by rounding. It would stop Newton's method at the start.
  AnalyticCentre<PlaneOf<Body>> centre(safe);
  constexpr int kMaxRounds = 64;
  for (int round = 0; round < kMaxRounds; ++round) {
    cancellation_point(planes.size() + cuts.size());
    centre.settle(cuts);
    const FrameAbout<PointOf<Body>>& frame = centre.frame();
    // The nearest or a violated plane, in the metric of the frame.
    Cut worst{{}, -1};
    double eccentricity = kEccentricity;
    const auto consider = [&](const Cut& p) {
      const double slack = -rounded(signed_distance(p.plane, frame.origin));
      const double length = slack > 0 ? norm(rounded(apply_transposed(frame.axes, p.plane.normal))) / slack : kInfinity;
      if (length > eccentricity) eccentricity = length, worst = p;
    };
    for (const Cut& p : planes) consider(p);
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i)
      if (smooth(bodies[i].shape)) consider({bodies[i].tightest(frame.origin), i});
    if (eccentricity == kEccentricity) return frame;
    if (round == kMaxRounds - 1) break;
    cuts.push_back(worst);
    const double slack = -rounded(signed_distance(worst.plane, frame.origin));
    const double safe_slack = -rounded(signed_distance(worst.plane, safe));
    if (slack > 0) continue;
    // The centre moves back towards the safe point, to the middle of the part that the new plane leaves.
    const double reach = safe_slack / (safe_slack - slack);
    centre.restart(safe + reach / 2 * (frame.origin - safe));
  }
  // The axes stay, about the point known to be inside. No known input gets here.
  return {safe, centre.frame().axes};
}

template Frame round_frame<Placed>(std::span<const Placed>, std::span<const OwnedPlane>, std::vector<OwnedPlane>,
                                   const Vec3&);
template FrameAbout<WideVector> round_frame<WideBody>(std::span<const WideBody>, std::span<const Owned<WidePlane>>,
                                                      std::vector<Owned<WidePlane>>, const WideVector&);

}  // namespace overlapper
