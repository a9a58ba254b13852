#pragma once

#include <concepts>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "geometry/once.h"
#include "shapes/facet_tree.h"
#include "shapes/hull.h"

namespace overlapper {

/// A closed convex solid, known only by asking. Directions need not be unit length.
template <class T>
concept ConvexOracle = requires(const T& shape, Vec3 point, Vec3 direction) {
  { shape.support(direction) } -> std::same_as<Vec3>;  // a farthest point, any of them
  {
    shape.ray_exit(point, direction)
  } -> std::same_as<Plane>;  // supporting plane through which the ray leaves; point strictly inside
  {
    shape.tightest(point)
  } -> std::same_as<Plane>;  // supporting plane with the least slack at the point, inside or out
};

struct Sphere {
  double radius;

  Vec3 support(Vec3 direction) const { return radius * unit(direction); }
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
};

struct Box {
  Vec3 half_extents;

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
};

/// A box's corners and sides by number: bit k of a corner's says on which side of axis k it is, and so does the last
/// bit of a side's, 2 k or 2 k + 1.
inline Vec3 corner(const Box& box, int i) {
  const Vec3 h = box.half_extents;
  return {i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z};
}
inline Plane side(const Box& box, int f) {
  const double sign = f & 1 ? 1 : -1;
  const int k = f / 2;
  return {{k == 0 ? sign : 0, k == 1 ? sign : 0, k == 2 ? sign : 0}, box.half_extents[k]};
}

/// Around local z; `length` lies between the centres of the caps.
struct Capsule {
  double radius, length;

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
};

/// Around local z.
struct Cylinder {
  double radius, length;

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
};

/// { x : dot(plane.normal, x) <= plane.offset }. Unbounded: its support is at infinity in all directions but one.
struct HalfSpace {
  Plane plane;
  Vec3 given_normal;  ///< as it came, of any length: dividing by that rounds, and wider arithmetic need not
  double given_offset;

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3, Vec3) const { return plane; }
  Plane tightest(Vec3) const { return plane; }
};

/// All points within `radius` of a polytope: its Minkowski sum with a ball.
struct RoundedHull {
  Hull core;
  double radius;
  std::shared_ptr<const Once<FacetTree>> parts = std::make_shared<Once<FacetTree>>();  ///< of the core

  Vec3 support(Vec3 direction) const { return core.support(direction) + radius * unit(direction); }
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
  /// The supporting plane whose normal is along `outward`.
  Plane supporting(Vec3 outward) const;

  double volume() const;  ///< m³, by Steiner's formula
  Vec3 centroid() const;  ///< about the core's origin
};

/// About the origin, its axes along x, y and z: a ball that has been stretched.
struct Ellipsoid {
  Vec3 half_axes;

  /// With equal axes, it answers as the sphere does.
  bool ball() const { return half_axes.x == half_axes.y && half_axes.y == half_axes.z; }

  Vec3 support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;
  /// The supporting plane whose normal is along `outward`.
  Plane supporting(Vec3 outward) const;
  /// The derivative of support() by the direction.
  Mat3 slope(Vec3 direction) const;
  /// The unit normals at the points of the surface that are the nearest ones of all around them, of which there are
  /// one or two: the nearest of all, and the one across the shortest axis.
  std::vector<Vec3> ways_out(Vec3 point) const;
};

using Shape = std::variant<Sphere, Box, Capsule, Cylinder, Hull, HalfSpace, RoundedHull, Ellipsoid>;

/// Each throws std::invalid_argument with one sentence that names the argument.
Sphere make_sphere(double radius);
Box make_box(Vec3 half_extents);
Capsule make_capsule(double radius, double length);
Cylinder make_cylinder(double radius, double length);
HalfSpace make_half_space(Vec3 normal, double offset);
RoundedHull make_rounded_hull(std::span<const Vec3> points, double radius);
Ellipsoid make_ellipsoid(Vec3 half_axes);
/// m³; infinite for a half-space.
double volume(const Shape& shape);
Vec3 centroid(const Shape& shape);
bool bounded(const Shape& shape);

/// True for shapes with infinitely many supporting planes along their boundary: sphere, capsule, cylinder,
/// rounded hull, ellipsoid.
bool smooth(const Shape& shape);

/// True for a cylinder, whose caps have round borders.
bool has_rims(const Shape& shape);

/// The shape, if it is an ellipsoid and no ball.
const Ellipsoid* stretched(const Shape& shape);

/// True for cylinders and stretched ellipsoids: what GJK and EPA find of a core that is curved, they approach, and know
/// the direction there to half of the digits.
bool has_curved_core(const Shape& shape);

/// All facet planes of a polytope; for a smooth shape a few of its tangent planes that already bound it. About the
/// shape's origin.
void append_planes(const Shape& shape, std::vector<Plane>& planes);

/// A smooth shape is its core (a point, a segment, a polytope) grown by a radius; every other shape is its own core, of
/// radius 0.
double core_radius(const Shape& shape);

/// The polytope that a hull is, or that a rounded hull is grown from; null for other shapes.
const HullData* polytope_of(const Shape& shape);

/// How far from its own origin a shape reaches; of a half-space, how far its plane is. For balls, capsules, cylinders,
/// rounded hulls and ellipsoids, the corner of the box around them.
double radius(const Shape& shape);

/// Facets of a box or a hull; 1 for a half-space.
int facets(const Shape& shape);

/// m: by how much planes of facets that are not quite flat miss their corners.
double flatness(const Shape& shape);

/// A shape and where it is. `pose` maps the shape's own coordinates (a hull's are about HullData::origin) to the world.
struct Placed {
  Shape shape;
  Vec3 position;
  Quaternion orientation;  ///< as it came, of any length: dividing by that rounds, and wider arithmetic need not
  Pose pose;

  Vec3 support(Vec3 direction) const;
  Vec3 core_support(Vec3 direction) const;
  Plane ray_exit(Vec3 origin, Vec3 direction) const;
  Plane tightest(Vec3 point) const;

  /// Throws std::invalid_argument, and stays where it is, unless the numbers are finite and the quaternion is not zero.
  void move_to(Vec3 new_position, Quaternion new_orientation);

  /// The same body with coordinates counted from `reference`: relative poses keep the digits that world ones lose.
  Placed seen_from(Vec3 reference) const;
};
static_assert(ConvexOracle<Placed> && ConvexOracle<Hull> && ConvexOracle<HalfSpace>);

Placed make_placed(Shape shape, Vec3 position, Quaternion orientation);

/// How large the numbers are that the points of a body are computed from, none of which is farther than `extent` from
/// where coordinates are counted from: so large, unless the body is a hull far from its own origin, for rotating and
/// adding that origin rounds, too.
double reach(const Placed& body, double extent);

struct Bounds {
  Vec3 lower, upper;
};
/// The box around a placed shape, from six supports; infinite for a half-space.
Bounds bounds(const Placed& placed);
/// m², of a box.
double surface(const Bounds& box);

/// True if none of the bodies is smooth.
bool polyhedral(std::span<const Placed> bodies);

}  // namespace overlapper
