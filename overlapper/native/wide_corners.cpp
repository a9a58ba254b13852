#include "wide_corners.h"

#include <cassert>

namespace overlapper {
namespace {

constexpr WideColumns kIdentity{WideLanes{Quad{1, 0, 0, 0}, Quad{}}, WideLanes{Quad{0, 1, 0, 0}, Quad{}},
                                WideLanes{Quad{0, 0, 1, 0}, Quad{}}};

bool unturned(Quaternion q) { return q.w == 1 && q.x == 0 && q.y == 0 && q.z == 0; }

/// Where the coordinates of a hull's data begin.
Vec3 data_origin(const Shape& shape) {
  const Hull* hull = std::get_if<Hull>(&shape);
  return hull ? hull->data->origin : Vec3{};
}

/// Columns of a rotation matrix, that of a quaternion of length 1 but for a few roundings.
template <bool fused>
WideColumns rotation_columns(Quaternion q) {
  if (unturned(q)) return kIdentity;
  const Quad xyz{q.x, q.y, q.z}, yzx{q.y, q.z, q.x}, zxy{q.z, q.x, q.y};
  const WideLanes xx = two_product<fused>(xyz, xyz), xy = two_product<fused>(xyz, yzx);
  const WideLanes zw = two_product<fused>(zxy, q.w), zz = two_product<fused>(zxy, zxy);
  WideSum<fused> across(xx), sum(xy), difference(xy);  // zz + xx, xx + yy, yy + zz; xy, yz, zx with zw, xw, yw
  across.add(zz);
  sum.add(zw);
  difference.add(-zw);
  const WideLanes squares = across.lanes();
  const DoubleDouble beyond = lane(squares, 0) + lane(xx, 1) + (two_product(q.w, q.w) - DoubleDouble{1});
  // What the squared length is beyond 1, e, is a few ulps: 1 / (1 + e) = 1 - e + e² to double-double.
  const DoubleDouble twice{2, -2 * beyond.head * (1 - beyond.head)};
  const auto scaled = [&](const WideLanes& v) { return WideSum<fused>(v, twice).lanes(); };
  const WideLanes plus = scaled(sum.lanes()), minus = scaled(difference.lanes());
  const WideLanes diagonal = WideLanes{Quad{1, 1, 1}, Quad{}} - scaled(squares);
  const auto column = [](DoubleDouble x, DoubleDouble y, DoubleDouble z) { return in_lanes(WideVector{x, y, z}); };
  return {column(lane(diagonal, 2), lane(plus, 0), lane(minus, 2)),
          column(lane(minus, 0), lane(diagonal, 0), lane(plus, 1)),
          column(lane(plus, 2), lane(minus, 1), lane(diagonal, 1))};
}

/// The first three lanes moved on by one and by two.
struct Turned {
  explicit Turned(const Quad& a) : yzx{a[1], a[2], a[0], a[3]}, zxy{a[2], a[0], a[1], a[3]} {}
  Quad yzx, zxy;
};

/// The arithmetic of one pair, with fused multiply-adds or without.
template <bool fused>
class WideCorners {
 public:
  WideCorners(const CommonCorners& common, std::span<WideLanes> planes)
      : common_(common), planes_(planes), lost_(0x1p-96 * common.reach), noise_(lost_) {
    const Placed &a = common.a, &b = common.b;
    columns_ = rotation_columns<fused>(b.orientation);
    translation_ = in_lanes(wide_difference(b.position, a.position));
    const Vec3 origin_a = data_origin(a.shape), origin_b = data_origin(b.shape);
    if (norm2(origin_b) > 0) translation_ = translation_ + WideSum<fused>(columns_, origin_b).lanes();
    if (!unturned(a.orientation)) {
      // The rows of a rotation are the columns of its inverse.
      const WideColumns of_a = rotation_columns<fused>(a.orientation);
      const WideColumns back = transposed(of_a[0], of_a[1], of_a[2]);
      for (int i = 0; i < 3; ++i) columns_[i] = turned(back, columns_[i]);
      translation_ = turned(back, translation_);
    }
    if (norm2(origin_a) > 0) translation_ = translation_ - in_lanes(origin_a);
    translation_ = translation_ - in_lanes(common.origin);
  }

  /// Planes of facets: a normal, of length 1 but for rounding, and last the offset with the other sign.
  bool add_planes() {
    const int facets = static_cast<int>(common_.apex.size()), first_facets = common_.first_facets;
    const Box *box_a = std::get_if<Box>(&common_.a.shape), *box_b = std::get_if<Box>(&common_.b.shape);
    if (box_a) add_sides(*box_a, kIdentity, in_lanes(-common_.origin), planes_.first(6));
    if (box_b) {
      const WideColumns rows = transposed(columns_[0], columns_[1], columns_[2]);
      add_sides(*box_b, rows, heights(rows, translation_), planes_.subspan(first_facets, 6));
    }
    for (int f = box_a ? first_facets : 0; f < (box_b ? first_facets : facets); ++f)
      if (common_.apex[f] >= 0 && !add_plane(f)) return false;
    return true;
  }

  void place(const Mat3& axes, std::span<Vec3> vertices) {
    const auto& [first, second, third] = axes;
    const Quad x{first.x, second.x, third.x}, y{first.y, second.y, third.y}, z{first.z, second.z, third.z};
    for (size_t i = 0; i < vertices.size(); ++i) {
      const Corner& c = common_.corners[i];
      const Vec3 vertex = vertices[i];
      const WideLanes way = c.vertex < 0 ? beside_planes(c.facets, vertex) : beside_vertex(c, vertex);
      WideSum<fused> along(x, vertex.x);
      along.add_product(y, vertex.y);
      along.add_product(z, vertex.z);
      along.tail += x * way.head[0] + y * way.head[1] + z * way.head[2];
      vertices[i] = along.rounded();
    }
  }

  double noise() const { return noise_; }

 private:
  static WideLanes turned(const WideColumns& columns, const WideLanes& v) {
    return WideSum<fused>(columns, vector(v)).lanes();
  }

  /// Of a point above planes through the origin, a coordinate of whose normals is in each of the columns.
  static WideLanes heights(const WideColumns& normals, const WideLanes& point) {
    const auto [x, y, z] = vector(point);
    return product<fused>(normals[0], x) + product<fused>(normals[1], y) + product<fused>(normals[2], z);
  }

  /// The box has its middle at the given heights above planes across its axes.
  void add_sides(const Box& box, const WideColumns& axes, const WideLanes& middle, std::span<WideLanes> planes) {
    const Vec3 half = box.half_extents;
    const WideLanes extents{Quad{half.x, half.y, half.z}, Quad{}};
    const WideColumns inner = transposed(-axes[0], -axes[1], -axes[2], middle - extents);
    const WideColumns outer = transposed(axes[0], axes[1], axes[2], -(extents + middle));
    for (int k = 0; k < 3; ++k) planes[2 * k] = inner[k], planes[2 * k + 1] = outer[k];
  }

  bool add_plane(int facet) {
    const bool second = facet >= common_.first_facets;
    const Shape& shape = second ? common_.b.shape : common_.a.shape;
    WideVector normal;
    DoubleDouble level;
    if (const Hull* hull = std::get_if<Hull>(&shape)) {
      const HullData& data = *hull->data;
      const auto& [i, j, k] = data.facet_corners[second ? facet - common_.first_facets : facet];
      if (i < 0) return false;
      normal = wide_normal(data.corners[i], data.corners[j], data.corners[k]);
      level = dot(normal, wide(data.corners[i]));
    } else {
      const HalfSpace& half = std::get<HalfSpace>(shape);
      normal = wide(half.given_normal);
      level = {half.given_offset};
    }
    const DoubleDouble scale{1 / norm(overlapper::rounded(normal))};
    normal = scale * normal;
    level = scale * level;
    if (second) normal = vector(WideSum<fused>(columns_, normal).lanes());
    level = second ? level + dot(normal, vector(translation_)) : level - dot(normal, wide(common_.origin));
    planes_[facet] = in_lanes(normal, -level);
    return true;
  }

  /// From a vertex that doubles have placed to where the three planes meet.
  WideLanes beside_planes(const std::array<int, 3>& facets, Vec3 vertex) {
    const WideLanes &p = planes_[facets[0]], &q = planes_[facets[1]], &r = planes_[facets[2]];
    const WideColumns planes = transposed(p, q, r);
    WideSum<fused> heights(planes, vertex);
    heights.add(planes[3]);
    const Vec3 height = heights.rounded();
    const Turned next_p(p.head), next_q(q.head), next_r(r.head);
    const Quad qr = next_q.yzx * next_r.zxy - next_q.zxy * next_r.yzx;
    const Quad rp = next_r.yzx * next_p.zxy - next_r.zxy * next_p.yzx;
    const Quad pq = next_p.yzx * next_q.zxy - next_p.zxy * next_q.yzx;
    const Quad products = p.head * qr;
    const double volume = products[0] + products[1] + products[2];
    // The sum is off by what the heights are and by the roundings of its own terms.
    const double largest = max_component(abs(height));
    noise_ = std::max(noise_, 4 * (lost_ + 0x1p-50 * largest / std::abs(volume)) / std::abs(volume));
    return {(height.x * qr + height.y * rp + height.z * pq) / -volume, Quad{}};
  }

  /// From a vertex that doubles have placed to the body's own.
  WideLanes beside_vertex(const Corner& corner, Vec3 vertex) const {
    const Shape& shape = corner.body == 0 ? common_.a.shape : common_.b.shape;
    const Box* box = std::get_if<Box>(&shape);
    const Vec3 local =
        box ? overlapper::corner(*box, corner.vertex) : std::get<Hull>(shape).data->vertices[corner.vertex];
    const Vec3 origin = common_.origin;
    if (corner.body == 0)
      return two_sum(Quad{local.x, local.y, local.z}, Quad{-origin.x, -origin.y, -origin.z}) - in_lanes(vertex);
    WideSum<fused> sum(columns_, local);
    sum.add(translation_);
    sum.add(Quad{-vertex.x, -vertex.y, -vertex.z});
    return sum.lanes();
  }

  const CommonCorners& common_;
  std::span<WideLanes> planes_;
  WideColumns columns_;    ///< of the rotation from the second body's coordinates to the first's
  WideLanes translation_;  ///< and what follows it
  double lost_;            ///< m: what a few dozen operations in double-double lose
  double noise_;
};

using Way = std::optional<double>(const CommonCorners&, const Mat3& axes, std::span<Vec3> vertices,
                                  std::span<WideLanes> planes);

template <bool fused>
std::optional<double> place_by(const CommonCorners& common, const Mat3& axes, std::span<Vec3> vertices,
                               std::span<WideLanes> planes) {
  WideCorners<fused> wide(common, planes);
  if (!wide.add_planes()) return std::nullopt;
  wide.place(axes, vertices);
  return wide.noise();
}

#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
Way* fastest_way() { return place_by<true>; }
#elif defined(__x86_64__)
/// With all that it calls, for machines that have more than the rest is compiled for.
__attribute__((target("avx2,fma"), flatten)) std::optional<double> place_by_avx2(const CommonCorners& common,
                                                                                 const Mat3& axes,
                                                                                 std::span<Vec3> vertices,
                                                                                 std::span<WideLanes> planes) {
  return place_by<true>(common, axes, vertices, planes);
}
Way* fastest_way() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? place_by_avx2 : place_by<false>;
}
#else
Way* fastest_way() { return place_by<false>; }
#endif

/// But for what underflows, which is nothing beside any body's size.
[[maybe_unused]] bool same(Vec3 a, Vec3 b) { return !(max_component(abs(a - b)) > 1e-250); }

}  // namespace

std::optional<double> place_in_wide(const CommonCorners& common, const Mat3& axes, std::span<Vec3> vertices,
                                    std::vector<WideLanes>& planes) {
  planes.resize(common.apex.size());
#ifndef NDEBUG
  std::vector<Vec3> expected(vertices.begin(), vertices.end());
  place_by<false>(common, axes, expected, planes);
#endif
  const std::optional<double> noise = fastest_way()(common, axes, vertices, planes);
  assert(std::ranges::equal(vertices, expected, same));
  return noise;
}

}  // namespace overlapper
