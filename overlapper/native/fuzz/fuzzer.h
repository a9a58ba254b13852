#pragma once

// The frame of the libFuzzer harnesses. A harness includes this file and defines `run`. Raw bytes become placed shapes,
// mostly near-degenerate ones.

#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <span>
#include <stdexcept>

#include "shapes/shape.h"

namespace overlapper {
namespace {

/// Decodes bytes so that coincidences are likely: lattice points, copies off by an ulp, faces that just meet.
class Decoder {
 public:
  Decoder(const uint8_t* data, size_t size) : bytes_(data, size) {}

  int integer(int low, int high) { return bytes_.ConsumeIntegralInRange(low, high); }

  double power_of_two(int low, int high) { return std::ldexp(1.0, integer(low, high)); }

  double real() {
    const double whole = integer(-3, 3);
    switch (integer(0, 5)) {
      case 0: return whole / 4;
      case 1: return bytes_.ConsumeFloatingPointInRange(-1.0, 1.0);
      case 2: return whole + integer(-2, 2) * 0x1p-52;
      case 3: return whole * power_of_two(-40, 0);
      default: return whole;
    }
  }

  double positive() {
    const double value = std::abs(real());
    return value > 0 ? value : 1;
  }

  Vec3 vector() {
    const double x = real(), y = real(), z = real();
    return {x, y, z};
  }

  Vec3 direction() {
    const double x = integer(-2, 2), y = integer(-2, 2), z = integer(-2, 2);
    return unit(x == 0 && y == 0 && z == 0 ? Vec3{0, 0, 1} : Vec3{x, y, z});
  }

  Quaternion orientation() {
    if (integer(0, 1) == 0) return {};
    const Quaternion q{real(), real(), real(), real()};
    return q.x == 0 && q.y == 0 && q.z == 0 && q.w == 0 ? Quaternion{} : q;
  }

  /// Points, flattened by up to 2^-30. Some are copies, near copies or midpoints of earlier points.
  std::vector<Vec3> points() {
    std::vector<Vec3> points;
    const int count = integer(4, 20);
    while (static_cast<int>(points.size()) < count) {
      const int kind = points.empty() ? 0 : integer(0, 7);
      const auto earlier = [&] { return points[integer(0, static_cast<int>(points.size()) - 1)]; };
      if (kind == 7) points.push_back(0.5 * (earlier() + earlier()));
      else if (kind == 6) points.push_back(earlier() + power_of_two(-52, -1) * direction());
      else points.push_back(vector());
    }
    const Vec3 stretch{power_of_two(-30, 0), 1, 1};
    if (integer(0, 3) == 0)
      for (Vec3& p : points) p.x *= stretch.x;
    return points;
  }

  double drawn(double) { return positive(); }
  Vec3 drawn(Vec3) {
    const double x = positive(), y = positive(), z = positive();
    return {x, y, z};
  }
  /// A shape of a kind from positive fields, or from any fields if allowed.
  template <class S>
  S draw(const S*) {
    const auto draw_each = [&](const auto&... field) { return std::tuple{drawn(S().*field.member)...}; };
    return std::apply(S::make, std::apply(draw_each, S::fields()));
  }
  HalfSpace draw(const HalfSpace*) {
    const Vec3 normal = direction();
    return HalfSpace::make(normal, real());
  }
  Hull draw(const Hull*) { return make_hull(points()); }
  RoundedHull draw(const RoundedHull*) {
    const std::vector<Vec3> corners = points();
    return make_rounded_hull(corners, positive());
  }

  /// A shape of a kind after the ellipsoid, if there is one.
  template <size_t... I>
  std::optional<Shape> draw_more(std::index_sequence<I...>) {
    constexpr size_t kOurs = Shape(Ellipsoid()).index() + 1;
    if constexpr (std::variant_size_v<Shape> == kOurs) return std::nullopt;
    const size_t chosen = integer(kOurs, std::max(kOurs, std::variant_size_v<Shape> - 1));
    std::optional<Shape> found;
    ((I == chosen ? void(found = draw(static_cast<const std::variant_alternative_t<I, Shape>*>(nullptr))) : void()),
     ...);
    return found;
  }

  /// Bytes that have run out decode to a box, the cheapest shape. Kinds after the ellipsoid take numbers that otherwise
  /// mean a hull.
  Shape shape() {
    constexpr int kOfHull = 7;
    const int number = integer(0, 26);
    if (number == 26) return draw(static_cast<const Ellipsoid*>(nullptr));
    if (number == 9 + kOfHull)
      if (auto more = draw_more(std::make_index_sequence<std::variant_size_v<Shape>>())) return std::move(*more);
    switch (number % 9) {
      case 0:
      case 1: return draw(static_cast<const Box*>(nullptr));
      case 2: return draw(static_cast<const Sphere*>(nullptr));
      case 3: return draw(static_cast<const Capsule*>(nullptr));
      case 4: return draw(static_cast<const Cylinder*>(nullptr));
      case 5: return draw(static_cast<const HalfSpace*>(nullptr));
      case 6: return draw(static_cast<const RoundedHull*>(nullptr));
      default: return draw(static_cast<const Hull*>(nullptr));
    }
  }

  Placed placed() {
    Shape chosen = shape();
    const Vec3 position = vector();
    return make_placed(std::move(chosen), position, orientation());
  }

  /// The body moved until its supporting plane against `direction` meets that of the other body, but for a nudge.
  Placed brought_to(const Placed& body, const Placed& other) {
    const Vec3 u = direction();
    const double nudge = integer(0, 2) == 0 ? 0 : integer(-2, 2) * power_of_two(-52, -1);
    const double step = dot(u, other.support(u)) - dot(u, body.support(-u)) + nudge;
    return make_placed(body.shape, body.position + step * u, body.orientation);
  }

  std::vector<Placed> bodies() {
    std::vector<Placed> bodies;
    const int count = 2 + std::max(0, integer(-4, 2));
    while (static_cast<int>(bodies.size()) < count) {
      const bool again = !bodies.empty() && integer(0, 7) == 0;
      Placed body = again ? make_placed(bodies.back().shape, vector(), orientation()) : placed();
      const bool both_bounded = !bodies.empty() && bounded(body.shape) && bounded(bodies[0].shape);
      if (both_bounded && integer(0, 1) == 0) body = brought_to(body, bodies[0]);
      bodies.push_back(std::move(body));
    }
    if (integer(0, 7) == 0) {
      const Vec3 away = power_of_two(0, 26) * direction();
      for (Placed& body : bodies) body = make_placed(body.shape, body.position + away, body.orientation);
    }
    if (integer(0, 7) == 0) {
      const double length = power_of_two(-500, 500);
      for (Placed& body : bodies) {
        const auto [x, y, z, w] = body.orientation;
        body = make_placed(body.shape, body.position, {length * x, length * y, length * z, length * w});
      }
    }
    return bodies;
  }

  double tolerance() { return 0.1 / power_of_two(0, 4); }

 private:
  FuzzedDataProvider bytes_;
};

inline void require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "violated: %s\n", what);
  std::abort();
}

/// Whether these bodies may be refused: half-spaces alone, whose common set may be unbounded, and rounded hulls, which
/// the article's method does not take.
inline bool may_be_refused(std::span<const Placed> bodies, bool by_the_article) {
  const auto rounded_hull = [](const Placed& body) { return std::holds_alternative<RoundedHull>(body.shape); };
  return std::ranges::none_of(bodies, [](const Placed& body) { return bounded(body.shape); }) ||
         (by_the_article && std::ranges::any_of(bodies, rounded_hull));
}

/// Decodes an input and checks what the core makes of it.
void run(Decoder& decoder);

}  // namespace
}  // namespace overlapper

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  overlapper::Decoder decoder(data, size);
  try {
    overlapper::run(decoder);
  } catch (const std::invalid_argument&) {
    // Flat hulls and sizes out of range are refused. Refusals of overlaps are checked where they are asked for.
  }
  return 0;
}
