#include "wide_corners.h"

namespace overlapper {
namespace {

constexpr WideColumns kIdentity{WideLanes{Quad{1, 0, 0, 0}, Quad{}}, WideLanes{Quad{0, 1, 0, 0}, Quad{}},
                                WideLanes{Quad{0, 0, 1, 0}, Quad{}}};

bool unturned(Quaternion q) { return q.w == 1 && q.x == 0 && q.y == 0 && q.z == 0; }

/// Rows of a rotation matrix in lanes 0 to 2, that of a quaternion of length 1 but for a few roundings.
WideColumns rotation_rows(Quaternion q) {
  if (unturned(q)) return kIdentity;
  const Quad xyz{q.x, q.y, q.z}, yzx{q.y, q.z, q.x}, zxy{q.z, q.x, q.y};
  const WideLanes xx = two_product(xyz, xyz), xy = two_product(xyz, yzx), zw = two_product(zxy, q.w);
  const WideLanes zz{Quad{xx.head[2], xx.head[0], xx.head[1]}, Quad{xx.tail[2], xx.tail[0], xx.tail[1]}};
  WideSum across, sum, difference;  // zz + xx, xx + yy, yy + zz; xy, yz, zx with zw, xw, yw
  for (const WideLanes* term : {&xx, &zz}) across.add(*term);
  for (const WideLanes* term : {&xy, &zw}) sum.add(*term);
  difference.add(xy);
  difference.add(WideLanes{-zw.head, -zw.tail});
  const WideLanes squares = across.lanes();
  const DoubleDouble beyond = lane(squares, 0) + two_product(q.y, q.y) + (two_product(q.w, q.w) - DoubleDouble{1});
  // What the squared length is beyond 1, e, is a few ulps: 1 / (1 + e) = 1 - e + e² to double-double.
  const DoubleDouble twice{2, -2 * beyond.head * (1 - beyond.head)};
  const auto scaled = [&](const WideLanes& v) {
    WideSum product;
    product.add_product(v, twice);
    return product.lanes();
  };
  const WideLanes less = scaled(squares), plus = scaled(sum.lanes()), minus = scaled(difference.lanes());
  const auto diagonal = [&](int i) { return DoubleDouble{1} - lane(less, i); };
  const auto row = [](DoubleDouble x, DoubleDouble y, DoubleDouble z) {
    return WideLanes{Quad{x.head, y.head, z.head}, Quad{x.tail, y.tail, z.tail}};
  };
  return {row(diagonal(2), lane(minus, 0), lane(plus, 2)), row(lane(plus, 0), diagonal(0), lane(minus, 1)),
          row(lane(minus, 2), lane(plus, 1), diagonal(1))};
}

WideColumns transposed(const WideColumns& m) {
  const auto column = [&](int j) {
    return WideLanes{Quad{m[0].head[j], m[1].head[j], m[2].head[j]}, Quad{m[0].tail[j], m[1].tail[j], m[2].tail[j]}};
  };
  return {column(0), column(1), column(2)};
}

/// Where the coordinates of a hull's data begin.
Vec3 data_origin(const Shape& shape) {
  const Hull* hull = std::get_if<Hull>(&shape);
  return hull ? hull->data->origin : Vec3{};
}

}  // namespace

void WideCorners::begin(const Placed& a, const Placed& b, int first_facets, int facets, Vec3 origin, double reach) {
  a_ = &a, b_ = &b;
  first_facets_ = first_facets;
  planes_.resize(facets);
  lost_ = 0x1p-96 * reach;
  const WideColumns of_a = rotation_rows(a.orientation), of_b = rotation_rows(b.orientation);
  columns_ = transposed(of_b);
  translation_ = wide_difference(b.position, a.position);
  const Vec3 origin_a = data_origin(a.shape), origin_b = data_origin(b.shape);
  if (norm2(origin_b) > 0) translation_ = translation_ + vector(columns_ * origin_b);
  rows_ = of_b;
  if (!unturned(a.orientation)) {
    // The rows of a rotation are the columns of its inverse.
    for (WideLanes& column : columns_) column = of_a * vector(column);
    rows_ = transposed(columns_);
    translation_ = vector(of_a * translation_);
  }
  if (norm2(origin_a) > 0) translation_ = translation_ - wide(origin_a);
  translation_ = translation_ - wide(origin);
  origin_ = origin;
}

bool WideCorners::add_plane(int facet) {
  const bool second = facet >= first_facets_;
  const Shape& shape = second ? b_->shape : a_->shape;
  const int f = second ? facet - first_facets_ : facet;
  auto& [normal, level] = planes_[facet];
  if (const Box* box = std::get_if<Box>(&shape)) {
    const Plane plane = side(*box, f);
    level = {plane.offset};
    normal = wide(plane.normal);
    if (second) normal = f % 2 ? vector(columns_[f / 2]) : -vector(columns_[f / 2]);
  } else {
    if (const Hull* hull = std::get_if<Hull>(&shape)) {
      const HullData& data = *hull->data;
      const auto& [i, j, k] = data.facet_corners[f];
      if (i < 0) return false;
      normal = wide_normal(data.corners[i], data.corners[j], data.corners[k]);
      level = dot(normal, wide(data.corners[i]));
    } else {
      const HalfSpace& half = std::get<HalfSpace>(shape);
      normal = wide(half.given_normal);
      level = {half.given_offset};
    }
    const DoubleDouble scale{1 / norm(rounded(normal))};
    normal = scale * normal;
    level = scale * level;
    if (second) normal = vector(columns_ * normal);
  }
  level = second ? level + dot(normal, translation_) : level - dot(normal, wide(origin_));
  return true;
}

/// From a vertex that doubles have placed to where the three planes meet.
Vec3 WideCorners::beside_planes(const std::array<int, 3>& facets, Vec3 vertex) {
  const WidePlane &p = planes_[facets[0]], &q = planes_[facets[1]], &r = planes_[facets[2]];
  const auto three = [](DoubleDouble x, DoubleDouble y, DoubleDouble z) {
    return WideLanes{Quad{x.head, y.head, z.head}, Quad{x.tail, y.tail, z.tail}};
  };
  WideSum heights;
  heights.add_product(three(p.normal.x, q.normal.x, r.normal.x), vertex.x);
  heights.add_product(three(p.normal.y, q.normal.y, r.normal.y), vertex.y);
  heights.add_product(three(p.normal.z, q.normal.z, r.normal.z), vertex.z);
  heights.add(three(-p.level, -q.level, -r.level));
  const Vec3 height = heights.rounded();
  const Vec3 normal_p = rounded(p.normal), normal_q = rounded(q.normal), normal_r = rounded(r.normal);
  const Vec3 qr = cross(normal_q, normal_r), rp = cross(normal_r, normal_p), pq = cross(normal_p, normal_q);
  const double volume = dot(normal_p, qr);
  // The sum is off by what the heights are and by the roundings of its own terms.
  const double largest = max_component(abs(height));
  noise_ = std::max(noise_, 4 * (lost_ + 0x1p-50 * largest / std::abs(volume)) / std::abs(volume));
  return (height.x * qr + height.y * rp + height.z * pq) / -volume;
}

/// From a vertex that doubles have placed to the body's own.
Vec3 WideCorners::beside_vertex(const Corner& corner, Vec3 vertex) const {
  const Shape& shape = corner.body == 0 ? a_->shape : b_->shape;
  const Box* box = std::get_if<Box>(&shape);
  const Vec3 local =
      box ? overlapper::corner(*box, corner.vertex) : std::get<Hull>(shape).data->vertices[corner.vertex];
  if (corner.body == 0) {
    const WideVector exactly = wide_difference(local, origin_);
    return rounded(exactly - wide(vertex));
  }
  const auto& [x, y, z] = translation_;
  WideSum sum;
  for (int i = 0; i < 3; ++i) sum.add_product(columns_[i], local[i]);
  sum.add(WideLanes{Quad{x.head, y.head, z.head}, Quad{x.tail, y.tail, z.tail}});
  sum.add(Quad{-vertex.x, -vertex.y, -vertex.z});
  return sum.rounded();
}

void WideCorners::place(std::span<const Corner> corners, const Mat3& axes, std::vector<Vec3>& vertices) {
  noise_ = lost_;
  const auto& [first, second, third] = axes;
  const Quad x{first.x, second.x, third.x}, y{first.y, second.y, third.y}, z{first.z, second.z, third.z};
  for (size_t i = 0; i < corners.size(); ++i) {
    const Corner& c = corners[i];
    const Vec3 vertex = vertices[i];
    const Vec3 beside = c.vertex < 0 ? beside_planes(c.facets, vertex) : beside_vertex(c, vertex);
    WideSum along;
    along.add_product(x, vertex.x);
    along.add_product(y, vertex.y);
    along.add_product(z, vertex.z);
    along.tail += x * beside.x + y * beside.y + z * beside.z;
    vertices[i] = along.rounded();
  }
}

}  // namespace overlapper
