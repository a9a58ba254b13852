#pragma once

#include <array>
#include <compare>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "geometry/bounds.h"
#include "geometry/wide.h"
#include "shapes/tangents.h"

namespace overlapper {

class Cutter;
struct Ellipsoid;
struct HullData;
class WideBody;

/// The kind of a shape's core. Its support function says where the least way out may lie.
enum class CoreKind {
  kPolytope,  ///< a polytope, a segment or a point
  kRims,      ///< a cylinder
  kCurved     ///< anything else that is convex
};

/// A segment about the origin along z, grown by `radius`. With round ends it is a capsule; otherwise planes across its
/// ends bound it.
struct Revolution {
  double radius, half_length;
  bool round_ends;
};

/// A ridge of a polytope from vertex `from` to vertex `to`. Seen from outside, the facet `left` is on the left hand.
struct Edge {
  int from, to, left, right;
};

/// The facets and ridges of a polytope core, by the numbers of its corners. A segment has no facets beside it: -1.
struct CoreSurface {
  /// Three corners of a facet. For a facet across an axis: 1 for the far side of an axis, 0 for the near side, -1 for
  /// the axis of the facet.
  std::vector<std::array<int, 3>> facets;
  std::vector<Edge> ridges;
};

/// A number or a vector that defines a shape: an argument of its make(), and an attribute in Python.
template <class S, class T>
struct Field {
  const char* name;
  T S::* member;
  const char* about;
};
template <class S, class T>
Field(const char*, T S::*, const char*) -> Field<S, T>;

// ----------------------------------------------------------------------------------------------------------- choices
// Properties and behaviour that several shapes share. A shape inherits each property that is true for it. Nothing is
// assumed about a shape that does not declare it. ConvexShape, in convex_shape.h, lists the questions.

struct Bounded {
  static constexpr bool kBounded = true;
};

/// It has infinitely many supporting planes along its boundary.
struct Smooth {
  static constexpr bool kSmooth = true;
};

/// Planes bound it, and none of its parameters defines a curve.
struct Flat {
  static constexpr bool kSmooth = false;
};

struct CentredAtOrigin {
  static Vec3 centroid() { return {}; }
};

/// It has no hull data.
struct WithoutHullData {
  static const HullData* polytope() { return nullptr; }
};

/// No way cuts it into pieces.
struct NotCut {
  static void give_pieces(Cutter&) {}
};

/// It is not a polytope with rounded edges and vertices.
struct NotMitred {
  static bool give_mitred(Cutter&) { return false; }
};

/// All of it is one piece inside its facets.
template <class S>
struct CutByFacets {
  void give_pieces(auto& cutter) const {
    const S& shape = static_cast<const S&>(*this);
    cutter.begin();
    for (int f = 0; f < shape.facet_count(); ++f) cutter.face(*shape.unit_facet(f));
    cutter.end();
  }
  bool give_mitred(auto& cutter) const { return give_pieces(cutter), true; }
};

struct NotRevolved {
  static std::optional<Revolution> revolution() { return std::nullopt; }
};

struct NotStretched {
  static const Ellipsoid* stretched() { return nullptr; }
};

/// Its core is a polytope: the support point moves only by jumps.
struct PolytopeCore {
  static CoreKind core_kind() { return CoreKind::kPolytope; }
  static Mat3 core_slope(Vec3) { return {{}, {}, {}}; }
};

/// Its core is the origin.
struct PointCore : PolytopeCore {
  static Vec3 core_support(const Pose& pose, Vec3) { return pose.translation; }
  static WideVector wide_core_support(const WideVector&) { return {}; }
  static std::vector<Vec3> core_corners() { return {{}}; }
  static void append_core_surface(const std::vector<char>&, CoreSurface&) {}
};

/// Doubles cannot list corners of its core.
struct CurvedCore {
  static std::vector<Vec3> core_corners() { return {}; }
  static void append_core_surface(const std::vector<char>&, CoreSurface&) {}
};

/// It is its own core, with radius 0.
template <class S>
struct OwnCore {
  static double core_radius() { return 0; }
  Vec3 core_support(const Pose& pose, Vec3 direction) const {
    return pose * static_cast<const S&>(*this).support(apply_transposed(pose.rotation, direction));
  }
};

/// Six supports give the box around it.
template <class S>
struct BoundedBySupports {
  Bounds bounds(const Pose& pose) const {
    const auto reach = [&](int i, double side) {
      const Vec3 along = apply_transposed(pose.rotation, side * tangents::axis(i));
      return (pose * static_cast<const S&>(*this).support(along))[i];
    };
    return {{reach(0, -1), reach(1, -1), reach(2, -1)}, {reach(0, 1), reach(1, 1), reach(2, 1)}};
  }
};

/// No box around it is faster than bounds().
template <class S>
struct EnclosedByBounds {
  Bounds enclosing_box(const Pose& pose) const { return static_cast<const S&>(*this).bounds(pose); }
};

/// It reaches at most to the corner of the box around it.
template <class S>
struct ReachesToCornerOfBounds {
  double bounding_radius() const {
    const Bounds box = static_cast<const S&>(*this).bounds({});
    return norm(max(abs(box.lower), abs(box.upper)));
  }
};

/// Wider arithmetic begins with its tangent planes across the axes.
struct WidePlanesAcrossAxes {
  static void append_wide_planes(const WideBody& body, std::vector<WidePlane>& planes);
};

inline std::partial_ordering order_of(double a, double b) { return a <=> b; }
inline std::partial_ordering order_of(Vec3 a, Vec3 b) { return std::tie(a.x, a.y, a.z) <=> std::tie(b.x, b.y, b.z); }

/// Orders two shapes by the first field that differs.
template <class S>
struct OrderedByFields {
  std::partial_ordering order(const S& other) const {
    std::partial_ordering found = std::partial_ordering::equivalent;
    const auto differs = [&](const auto& field) {
      found = order_of(static_cast<const S&>(*this).*field.member, other.*field.member);
      return found != 0;
    };
    std::apply([&](const auto&... field) { (void)(differs(field) || ...); }, S::fields());
    return found;
  }
};

/// Appends the six planes of a box about the origin.
void append_box(Vec3 half_extents, std::vector<Plane>& planes);

}  // namespace overlapper
