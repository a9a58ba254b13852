#include "methods/half_spaces_alone.h"

#include <array>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/exact.h"
#include "geometry/expanding_hull.h"

namespace overlapper {
namespace {

/// Error of the determinant of three unit normals in doubles, with a wide margin.
constexpr double kClearOfRounding = 1e-14;

/// { x : dot(normal, x) <= offset }, with a normal of any length. `direction` is the unit normal in doubles.
struct ExactPlane {
  ExactVector normal;
  Exact offset;
  Vec3 direction;
};

/// The rotation that a quaternion stands for, times the square of its length.
std::array<ExactVector, 3> exact_rotation(Quaternion q) {
  const Exact x(q.x), y(q.y), z(q.z), w(q.w), two(2.0);
  const Exact xx = x * x, yy = y * y, zz = z * z, ww = w * w;
  return {{{ww + xx - yy - zz, two * (x * y - z * w), two * (x * z + y * w)},
           {two * (x * y + z * w), ww - xx + yy - zz, two * (y * z - x * w)},
           {two * (x * z - y * w), two * (y * z + x * w), ww - xx - yy + zz}}};
}

ExactPlane exact_plane(const Placed& body) {
  // The numbers as given are the heads.
  const WidePlane facet = *wide_facet(body.shape, 0);
  const Vec3 given = rounded(facet.normal);
  const int down = -std::ilogb(max_component(abs(given)));
  const auto scaled_down = [&](double value) { return Exact(std::scalbn(value, down)); };
  const ExactVector own{scaled_down(given.x), scaled_down(given.y), scaled_down(given.z)};
  const ExactVector position{body.position.x, body.position.y, body.position.z};
  ExactPlane plane{own, scaled_down(facet.offset.head), body.pose.rotation * only_plane(body.shape)->normal};
  if (!unturned(body.orientation)) {
    const Quaternion q = in_range(body.orientation);
    const std::array<ExactVector, 3> rotation = exact_rotation(q);
    for (int i = 0; i < 3; ++i) plane.normal[i] = dot(rotation[i], own);
    const ExactVector imaginary{q.x, q.y, q.z};
    plane.offset = plane.offset * (dot(imaginary, imaginary) + Exact(q.w) * Exact(q.w));
  }
  plane.offset = plane.offset + dot(plane.normal, position);
  return plane;
}

std::vector<ExactPlane> exact_planes(std::span<const Placed> bodies) {
  std::vector<ExactPlane> planes;
  for (const Placed& body : bodies) planes.push_back(exact_plane(body));
  return planes;
}

/// The sign of the determinant of three normals.
int orientation(const ExactPlane& a, const ExactPlane& b, const ExactPlane& c) {
  const double about = dot(cross(a.direction, b.direction), c.direction);
  if (std::abs(about) > kClearOfRounding) return about > 0 ? 1 : -1;
  return dot(cross(a.normal, b.normal), c.normal).sign();
}

/// Whether all weights have one sign, and the sum of the offsets by the sizes of these weights is negative. The
/// weighted sum of the normals is zero by construction. No point then satisfies all inequalities (Farkas).
template <size_t kCount>
bool contradict(const std::array<const ExactPlane*, kCount>& planes, const std::array<Exact, kCount>& weight) {
  const int sign = weight[0].sign();
  Exact sum;
  for (size_t i = 0; i < kCount; ++i) {
    if (sign == 0 || weight[i].sign() != sign) return false;
    sum = sum + weight[i] * planes[i]->offset;
  }
  return sum.sign() * sign < 0;
}

bool contradict(const ExactPlane& a, const ExactPlane& b) {
  if (dot(a.direction, b.direction) > 0 || norm2(cross(a.direction, b.direction)) > kClearOfRounding) return false;
  for (const Exact& part : cross(a.normal, b.normal))
    if (part.sign() != 0) return false;
  for (int i = 0; i < 3; ++i)
    if (a.normal[i].sign() != 0) return contradict<2>({&a, &b}, {-b.normal[i], a.normal[i]});
  return false;
}

/// Only for normals in one plane. For others, a fourth plane is needed.
bool contradict(const ExactPlane& a, const ExactPlane& b, const ExactPlane& c) {
  if (orientation(a, b, c) != 0) return false;
  const ExactVector of_a = cross(b.normal, c.normal), of_b = cross(c.normal, a.normal),
                    of_c = cross(a.normal, b.normal);
  for (int i = 0; i < 3; ++i)
    if (of_a[i].sign() != 0) return contradict<3>({&a, &b, &c}, {of_a[i], of_b[i], of_c[i]});
  return false;
}

bool contradict(const ExactPlane& a, const ExactPlane& b, const ExactPlane& c, const ExactPlane& d) {
  const int sign = orientation(b, c, d);
  if (sign == 0 || orientation(a, c, d) != -sign || orientation(a, b, d) != sign || orientation(a, b, c) != -sign)
    return false;
  const ExactVector ab = cross(a.normal, b.normal), cd = cross(c.normal, d.normal);
  return contradict<4>({&a, &b, &c, &d},
                       {dot(b.normal, cd), -dot(a.normal, cd), dot(d.normal, ab), -dot(c.normal, ab)});
}

}  // namespace

/// By Helly's theorem, at most four of the half-spaces then have no common point.
bool have_no_common_point(std::span<const Placed> half_spaces) {
  const std::vector<ExactPlane> planes = exact_planes(half_spaces);
  for (size_t i = 0; i < planes.size(); ++i)
    for (size_t j = 0; j < i; ++j) {
      if (contradict(planes[i], planes[j])) return true;
      for (size_t k = 0; k < j; ++k) {
        if (contradict(planes[i], planes[j], planes[k])) return true;
        cancellation_point(256 * k);
        for (size_t l = 0; l < k; ++l)
          if (contradict(planes[i], planes[j], planes[k], planes[l])) return true;
      }
    }
  return false;
}

bool bound_a_set(std::span<const Placed> half_spaces) {
  const std::vector<ExactPlane> planes = exact_planes(half_spaces);
  ExpandingHull normals;
  for (const ExactPlane& plane : planes) normals.points.push_back(plane.direction);
  if (!normals.build()) return false;
  for (const ExpandingHull::Facet& facet : normals.facets) {
    if (facet.removed()) continue;
    const auto [a, b, c] = facet.vertex;
    if (orientation(planes[a], planes[b], planes[c]) <= 0) return false;
  }
  return true;
}

}  // namespace overlapper
