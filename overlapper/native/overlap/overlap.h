#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "distance/gjk.h"
#include "distance/least_translation.h"
#include "methods/clipping/clip.h"
#include "methods/dual/deepest_ball.h"
#include "methods/dual/region.h"
#include "methods/dual/wide_ball.h"
#include "overlap/once.h"
#include "overlap/surface.h"
#include "shapes/shape.h"

namespace overlapper {

enum class Method { kAuto, kPaper };

/// The contact() of a pair that overlaps beyond doubt, of which clip() has found a measure.
Penetration penetration_of_clipped(const Placed& a, const Placed& b);

/// The gradient() of such a pair.
std::array<std::array<double, 6>, 2> gradient_of_clipped(const ClippedPair& clipped, Vec3 position_a, Vec3 position_b);

/// The common set of two or more placed shapes. Only the status is found on construction; each quantity when first
/// asked for, then kept. Safe to share between threads, none of which waits for another.
class Overlap {
 public:
  /// Throws std::invalid_argument if the common set is unbounded. `tolerance` is the fraction by which the polytope may
  /// have to shrink, about its inner point, to fit into smooth shapes; polyhedra are exact whatever it is.
  Overlap(std::vector<Placed> bodies, double tolerance, Method method);
  Overlap(const Placed& a, const Placed& b, double tolerance, Method method);
  /// By kAuto, for whoever has asked clip() already; the tolerance is as it must be.
  Overlap(const Placed& a, const Placed& b, double tolerance, const std::optional<ClippedPair>& clipped);
  Overlap(Overlap&& other) noexcept;

  std::span<const Placed> bodies() const { return bodies_.empty() ? std::span<const Placed>(two_) : bodies_; }
  double tolerance() const { return tolerance_; }
  Method method() const { return method_; }
  Status status() const { return status_; }
  bool pair() const { return bodies_.empty(); }
  bool clipped() const { return measured_by_clipping_; }  ///< so that its measures are quickly had again

  /// m³; 0 unless overlapping.
  double volume() const;

  /// The true volume is within volume() ± volume_error(). For a set that only touches, what it may still hold. The
  /// article gives no bound, and what its method loses may be a whole overlap: for kPaper it is the difference from
  /// what kAuto finds, plus the error of that.
  double volume_error() const;

  double area() const;         ///< m², of the surface; 0 unless overlapping
  Vec3 centroid() const;       ///< only for overlapping bodies
  bool widened() const;        ///< double arithmetic was not enough
  int facets_touched() const;  ///< how many planes took part in building the polytope

  /// Only for overlapping bodies.
  const Region& region() const;
  const Quantities& quantities() const;
  /// Inertia tensor about the centroid, unit density; by the polytope where the other quantities have closed forms.
  Mat3 inertia() const;
  const Surface& surface() const;

  /// Per body: d volume / d translation, then / d rotation vector about the body's position; zeros unless overlapping.
  std::vector<std::array<double, 6>> gradient() const;

  /// Only for pairs.
  struct Contact {
    double distance = 0;  ///< 0 unless separated
    double depth = 0;     ///< 0 unless overlapping
    Vec3 normal;          ///< unit, from b to a
    Vec3 witness_a, witness_b;
    Plane separating;  ///< a where dot(normal, x) >= offset, b on the other side; meaningless if overlapping
  };
  const Contact& contact() const;

 private:
  bool traced() const { return clipped_ && clipped_->traced; }

  /// The bodies in the order in which they are computed with, about a reference near them.
  struct Arrangement {
    std::vector<int> order;
    std::vector<Placed> relative;
    Vec3 reference;
  };

  /// What looking for the deepest ball in the common set finds.
  struct Search {
    Status status = Status::kSeparated;
    std::vector<double> reach;       ///< per relative body: how large the numbers are that describe it
    std::vector<OwnedPlane> planes;  ///< of all bodies
    DeepestBall ball{};
    std::optional<WideBall> wide_ball;  ///< where it had to be looked for in double-double
  };

  struct Lazy {
    Once<Arrangement> arrangement;
    Once<Search> search;
    Once<Region> region;
    Once<Quantities> quantities;
    Once<Surface> surface;
    Once<Contact> contact;
    Once<double> error_of_paper;
  };

  const Lazy& lazy() const;
  const Arrangement& arrangement() const;
  const Search& search() const;
  Arrangement arranged() const;
  Search searched() const;
  void settle_in_wide_arithmetic(Search& search) const;
  double largest_reach() const;
  std::vector<WideBody> wide_bodies() const;
  Distance wide_distance(double reach) const;
  Penetration parting(std::vector<Vec3> normals) const;
  Region grown_about(const WideBall& ball, double reach) const;
  Region grown() const;
  Quantities measured() const;
  Contact in_contact() const;
  double touching_volume(const DeepestBall& ball) const;
  Region owned_as_given(Region region) const;

  void start();
  void settle();

  std::array<Placed, 2> two_;
  std::vector<Placed> bodies_;  ///< if there are more than two
  double tolerance_;
  Method method_;
  Status status_ = Status::kSeparated;
  std::optional<ClippedPair> clipped_;  ///< if clipping has decided
  std::vector<Pull> pulls_;             ///< of more than two bodies, if it has
  bool measured_by_clipping_ = false;   ///< and its figures are as good as any
  Once<Lazy> lazy_;
};

}  // namespace overlapper
