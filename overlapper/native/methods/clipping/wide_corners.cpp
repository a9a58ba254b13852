#include "methods/clipping/wide_corners.h"

#include <cassert>

namespace overlapper {
namespace {

constexpr WideColumns kIdentity{WideLanes{Quad{1, 0, 0, 0}, Quad{}}, WideLanes{Quad{0, 1, 0, 0}, Quad{}},
                                WideLanes{Quad{0, 0, 1, 0}, Quad{}}};

/// The columns of the rotation of a quaternion of any length.
template <bool fused>
WideColumns rotation_columns(Quaternion given) {
  if (unturned(given)) return kIdentity;
  const Quaternion q = in_range(given);
  const Quad xyz{q.x, q.y, q.z}, yzx{q.y, q.z, q.x}, zxy{q.z, q.x, q.y};
  const WideLanes xx = two_product<fused>(xyz, xyz), xy = two_product<fused>(xyz, yzx);
  const WideLanes zw = two_product<fused>(zxy, q.w), zz = two_product<fused>(zxy, zxy);
  WideSum<fused> across(xx), sum(xy), difference(xy);  // zz + xx, xx + yy, yy + zz; xy, yz, zx with zw, xw, yw
  across.add(zz);
  sum.add(zw);
  difference.add(-zw);
  const WideLanes squares = across.lanes();
  const DoubleDouble twice = DoubleDouble{2} / (lane(squares, 0) + lane(xx, 1) + two_product(q.w, q.w));
  const auto scaled = [&](const WideLanes& v) { return WideSum<fused>(v, twice).lanes(); };
  const WideLanes plus = scaled(sum.lanes()), minus = scaled(difference.lanes());
  const WideLanes diagonal = WideLanes{Quad{1, 1, 1}, Quad{}} - scaled(squares);
  const auto column = [](DoubleDouble x, DoubleDouble y, DoubleDouble z) { return in_lanes(WideVector{x, y, z}); };
  return {column(lane(diagonal, 2), lane(plus, 0), lane(minus, 2)),
          column(lane(minus, 0), lane(diagonal, 0), lane(plus, 1)),
          column(lane(plus, 2), lane(minus, 1), lane(diagonal, 1))};
}

/// Four vectors, one in each lane.
struct QuadVector {
  QuadVector(const Quad& xs, const Quad& ys, const Quad& zs) : x(xs), y(ys), z(zs) {}
  QuadVector(Vec3 a, Vec3 b, Vec3 c, Vec3 d)
      : QuadVector(Quad{a.x, b.x, c.x, d.x}, Quad{a.y, b.y, c.y, d.y}, Quad{a.z, b.z, c.z, d.z}) {}
  Quad x, y, z;
};

QuadVector cross(const WideColumns& a, const WideColumns& b) {
  const Quad &ax = a[0].head, &ay = a[1].head, &az = a[2].head, &bx = b[0].head, &by = b[1].head, &bz = b[2].head;
  return {ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx};
}

/// The arithmetic of one pair, with fused multiply-adds or without.
template <bool fused>
class WideCorners {
 public:
  WideCorners(const CommonCorners& common, std::span<WideLanes> planes)
      : common_(common), planes_(planes), wide_rounding_(0x1p-96 * common.reach), corner_rounding_(wide_rounding_) {
    const Placed &a = common.a, &b = common.b;
    columns_ = rotation_columns<fused>(b.orientation);
    translation_ = in_lanes(wide_difference(b.position, a.position));
    const Vec3 origin_a = data_origin(a.shape), origin_b = data_origin(b.shape);
    if (norm2(origin_b) > 0) translation_ = translation_ + WideSum<fused>(columns_, origin_b).lanes();
    if (!unturned(a.orientation)) {
      // The rows of a rotation are the columns of its inverse.
      const WideColumns of_a = rotation_columns<fused>(a.orientation);
      const WideColumns back = transposed<fused>(of_a[0], of_a[1], of_a[2]);
      for (int i = 0; i < 3; ++i) columns_[i] = turned(back, columns_[i]);
      translation_ = turned(back, translation_);
    }
    if (norm2(origin_a) > 0) translation_ = translation_ - in_lanes(origin_a);
    translation_ = translation_ - in_lanes(common.origin);
  }

  /// Planes of facets: a normal, of length 1 but for rounding, and then the negative offset.
  bool add_planes() {
    const int facets = static_cast<int>(common_.apex.size()), first_facets = common_.first_facets;
    const Box *box_a = std::get_if<Box>(&common_.a.shape), *box_b = std::get_if<Box>(&common_.b.shape);
    if (box_a) add_sides(*box_a, kIdentity, in_lanes(-common_.origin), planes_.first(6));
    if (box_b) {
      const WideColumns rows = transposed<fused>(columns_[0], columns_[1], columns_[2]);
      add_sides(*box_b, rows, heights(rows, translation_), planes_.subspan(first_facets, 6));
    }
    for (int f = box_a ? first_facets : 0; f < (box_b ? first_facets : facets); ++f)
      if (common_.apex[f] >= 0 && !add_plane(f)) return false;
    return true;
  }

  void place(const Mat3& axes, std::span<Vec3> vertices, Approach approach) {
    approach_ = approach;
    for (size_t i = 0; i < vertices.size(); i += 4) {
      const size_t last = vertices.size() - 1;
      place_four(axes, vertices, {i, std::min(i + 1, last), std::min(i + 2, last), std::min(i + 3, last)});
    }
  }

  double corner_rounding() const { return corner_rounding_; }

 private:
  static WideLanes turned(const WideColumns& columns, const WideLanes& v) {
    return WideSum<fused>(columns, vector(v)).lanes();
  }

  /// Heights of a point above planes through the origin. Each column holds one coordinate of the normals.
  static WideLanes heights(const WideColumns& normals, const WideLanes& point) {
    const auto [x, y, z] = vector(point);
    return product<fused>(normals[0], x) + product<fused>(normals[1], y) + product<fused>(normals[2], z);
  }

  /// Adds the sides of a box. `middle` is the height of its middle above planes across its axes.
  void add_sides(const Box& box, const WideColumns& axes, const WideLanes& middle, std::span<WideLanes> planes) {
    const Vec3 half = box.half_extents;
    const WideLanes extents{Quad{half.x, half.y, half.z}, Quad{}};
    const WideColumns inner = transposed<fused>(-axes[0], -axes[1], -axes[2], middle - extents);
    const WideColumns outer = transposed<fused>(axes[0], axes[1], axes[2], -(extents + middle));
    for (int k = 0; k < 3; ++k) planes[2 * k] = inner[k], planes[2 * k + 1] = outer[k];
  }

  bool add_plane(int facet) {
    const bool second = facet >= common_.first_facets;
    const Shape& shape = second ? common_.b.shape : common_.a.shape;
    const std::optional<WidePlane> plane = wide_facet(shape, second ? facet - common_.first_facets : facet);
    if (!plane) return false;
    auto [normal, level] = *plane;
    const DoubleDouble scale{1 / norm(overlapper::rounded(normal))};
    normal = scale * normal;
    level = scale * level;
    if (second) normal = vector(WideSum<fused>(columns_, normal).lanes());
    level = second ? level + dot(normal, vector(translation_)) : level - dot(normal, wide(common_.origin));
    planes_[facet] = in_lanes(normal, -level);
    return true;
  }

  /// Places four corners, one in each lane.
  void place_four(const Mat3& axes, std::span<Vec3> vertices, const std::array<size_t, 4>& at) {
    const QuadVector vertex(vertices[at[0]], vertices[at[1]], vertices[at[2]], vertices[at[3]]);
    QuadVector way{Vec3{}, Vec3{}, Vec3{}, Vec3{}};
    const std::span<const CornerSource> corners = common_.corners;
    if (std::ranges::any_of(at, [&](size_t i) { return corners[i].vertex < 0; })) {
      if (approach_ == Approach::kOnce) beside_planes(at, vertex, way);
      else beside_parallel_planes(at, vertex, way);
    }
    for (int n = 0; n < 4; ++n) {
      if (corners[at[n]].vertex < 0) continue;
      const Vec3 beside = beside_vertex(corners[at[n]], vertices[at[n]]);
      way.x[n] = beside.x, way.y[n] = beside.y, way.z[n] = beside.z;
    }
    const auto along = [&](Vec3 axis) {
      WideSum<fused> sum(vertex.x, axis.x);
      sum.add_product(vertex.y, axis.y);
      sum.add_product(vertex.z, axis.z);
      sum.tail += way.x * axis.x + way.y * axis.y + way.z * axis.z;
      return sum.lanes();
    };
    const WideLanes x = along(axes.row0), y = along(axes.row1), z = along(axes.row2);
    for (int n = 0; n < 4; ++n) vertices[at[n]] = {x.head[n], y.head[n], z.head[n]};
  }

  /// Four planes, those number n of each corner, with a coordinate of their normals in each column.
  WideColumns planes(const std::array<size_t, 4>& at, int n) const {
    const auto plane = [&](size_t i) -> const WideLanes& { return planes_[common_.corners[i].facets[n]]; };
    return transposed<fused>(plane(at[0]), plane(at[1]), plane(at[2]), plane(at[3]));
  }

  /// The steps from vertices placed by doubles to the point where three planes meet; meaningless for other corners.
  void beside_planes(const std::array<size_t, 4>& at, const QuadVector& vertex, QuadVector& way) {
    const WideColumns p = planes(at, 0), q = planes(at, 1), r = planes(at, 2);
    const auto height = [&](const WideColumns& normal) {
      WideSum<fused> sum(normal, vertex);
      sum.add(normal[3]);
      return sum.lanes();
    };
    const WideLanes height_p = height(p), height_q = height(q), height_r = height(r);
    const QuadVector qr = cross(q, r), rp = cross(r, p), pq = cross(p, q);
    const Quad volume = p[0].head * qr.x + p[1].head * qr.y + p[2].head * qr.z;
    const Quad& a = height_p.head;
    const Quad& b = height_q.head;
    const Quad& c = height_r.head;
    way = {(a * qr.x + b * rp.x + c * pq.x) / -volume, (a * qr.y + b * rp.y + c * pq.y) / -volume,
           (a * qr.z + b * rp.z + c * pq.z) / -volume};
    // The error of the sum is the error of the heights plus the roundings of its own terms.
    Quad size, high_a, high_b, high_c, high, highest;
    choose(volume < 0, -volume, volume, size);
    choose(a < 0, -a, a, high_a);
    choose(b < 0, -b, b, high_b);
    choose(c < 0, -c, c, high_c);
    choose(high_a < high_b, high_b, high_a, high);
    choose(high < high_c, high_c, high, highest);
    const Quad rounding = 4 * (wide_rounding_ + 0x1p-50 * highest / size) / size;
    for (int n = 0; n < 4; ++n)
      if (common_.corners[at[n]].vertex < 0) corner_rounding_ = std::max(corner_rounding_, rounding[n]);
  }

  /// The same in two steps: the second ends the error of the first where two of the planes are nearly parallel.
  void beside_parallel_planes(const std::array<size_t, 4>& at, const QuadVector& vertex, QuadVector& way) {
    const std::array<WideColumns, 3> normals{planes(at, 0), planes(at, 1), planes(at, 2)};
    const QuadVector qr = cross(normals[1], normals[2]), rp = cross(normals[2], normals[0]),
                     pq = cross(normals[0], normals[1]);
    const Quad volume = normals[0][0].head * qr.x + normals[0][1].head * qr.y + normals[0][2].head * qr.z;
    Quad height[3];
    const auto find_heights = [&] {
      for (int n = 0; n < 3; ++n) {
        WideSum<fused> sum(normals[n], vertex);
        sum.add(normals[n][3]);
        sum.add_product(normals[n][0], way.x);
        sum.add_product(normals[n][1], way.y);
        sum.add_product(normals[n][2], way.z);
        height[n] = sum.lanes().head;
      }
    };
    find_heights();
    for (int step = 0; step < 2; ++step) {
      const Quad &a = height[0], &b = height[1], &c = height[2];
      way.x -= (a * qr.x + b * rp.x + c * pq.x) / volume;
      way.y -= (a * qr.y + b * rp.y + c * pq.y) / volume;
      way.z -= (a * qr.z + b * rp.z + c * pq.z) / volume;
      find_heights();
    }
    for (int i = 0; i < 4; ++i) {
      if (common_.corners[at[i]].vertex >= 0) continue;
      double highest = 0;
      for (const Quad& each : height) highest = std::max(highest, std::abs(each[i]));
      // The sums along the axes round the way once more.
      const double rounded = 0x1p-50 * (std::abs(way.x[i]) + std::abs(way.y[i]) + std::abs(way.z[i]));
      const double off = highest + rounded + 2 * wide_rounding_;
      corner_rounding_ = off > corner_rounding_ || std::isnan(off) ? off : corner_rounding_;
    }
  }

  /// The step from a vertex placed by doubles to the body's own vertex.
  Vec3 beside_vertex(const CornerSource& corner, Vec3 vertex) const {
    const Shape& shape = corner.body == 0 ? common_.a.shape : common_.b.shape;
    const Vec3 local = overlapper::vertex(shape, corner.vertex);
    const Vec3 origin = common_.origin;
    if (corner.body == 0) {
      const WideLanes exactly = two_sum(Quad{local.x, local.y, local.z}, Quad{-origin.x, -origin.y, -origin.z});
      return rounded(vector(exactly - in_lanes(vertex)));
    }
    WideSum<fused> sum(columns_, local);
    sum.add(translation_);
    sum.add(Quad{-vertex.x, -vertex.y, -vertex.z});
    return rounded(vector(sum.lanes()));
  }

  const CommonCorners& common_;
  std::span<WideLanes> planes_;
  WideColumns columns_;     ///< of the rotation from the second body's coordinates to the first's
  WideLanes translation_;   ///< applied after the rotation
  double wide_rounding_;    ///< m: of a few dozen operations in double-double
  double corner_rounding_;  ///< m: largest, of the corners placed so far
  Approach approach_ = Approach::kOnce;
};

using Placing = std::optional<double>(const CommonCorners&, const Mat3& axes, std::span<Vec3> vertices,
                                      std::span<WideLanes> planes, Approach approach);

template <bool fused>
std::optional<double> place_by(const CommonCorners& common, const Mat3& axes, std::span<Vec3> vertices,
                               std::span<WideLanes> planes, Approach approach) {
  WideCorners<fused> wide(common, planes);
  if (!wide.add_planes()) return std::nullopt;
  wide.place(axes, vertices, approach);
  return wide.corner_rounding();
}

#ifdef OVERLAPPER_WIDER
OVERLAPPER_WIDER std::optional<double> place_by_wider(const CommonCorners& common, const Mat3& axes,
                                                      std::span<Vec3> vertices, std::span<WideLanes> planes,
                                                      Approach approach) {
  return place_by<true>(common, axes, vertices, planes, approach);
}
Placing* fastest_placing() { return is_wider() ? place_by_wider : place_by<kFused>; }
#else
Placing* fastest_placing() { return place_by<kFused>; }
#endif

/// Equal but for underflow, which is negligible beside any body's size.
[[maybe_unused]] bool same(Vec3 a, Vec3 b) { return !(max_component(abs(a - b)) > 1e-250); }

}  // namespace

std::optional<double> place_in_wide(const CommonCorners& common, const Mat3& axes, std::span<Vec3> vertices,
                                    std::vector<WideLanes>& planes, Approach approach) {
  planes.resize(common.apex.size());
#ifndef NDEBUG
  std::vector<Vec3> expected(vertices.begin(), vertices.end());
  place_by<false>(common, axes, expected, planes, approach);
#endif
  static Placing* const place_fastest = fastest_placing();
  const std::optional<double> rounding = place_fastest(common, axes, vertices, planes, approach);
  assert(std::ranges::equal(vertices, expected, same));
  return rounding;
}

}  // namespace overlapper
