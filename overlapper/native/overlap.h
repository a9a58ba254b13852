#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "common_point.h"
#include "region.h"
#include "shape.h"
#include "surface.h"

namespace overlapper {

enum class Status { kSeparated, kTouching, kOverlapping };
enum class Method { kAuto, kPaper };

/// The common set of two or more placed shapes. Only the status is found on construction; each quantity when first
/// asked for, then kept. Safe to share between threads.
class Overlap {
 public:
  /// Throws std::invalid_argument if the common set is unbounded. `tolerance` is the fraction by which the polytope may
  /// have to shrink, about its inner point, to fit into smooth shapes; polyhedra are exact whatever it is.
  Overlap(std::vector<Placed> bodies, double tolerance, Method method);

  const std::vector<Placed>& bodies() const { return bodies_; }
  double tolerance() const { return tolerance_; }
  Method method() const { return method_; }
  Status status() const { return status_; }
  bool pair() const { return bodies_.size() == 2; }

  /// m³; 0 unless overlapping.
  double volume() const;

  /// The true volume is within volume() ± volume_error(). For a set that only touches, what it may still hold. The
  /// article gives no bound, and what its method loses may be a whole overlap: for kPaper it is the difference from
  /// what kAuto finds, plus the error of that.
  double volume_error() const;

  /// Only for overlapping bodies.
  const Region& region() const;
  const Quantities& quantities() const;
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
  double touching_volume() const;
  void settle_in_wide_arithmetic();
  Region owned_as_given(Region region) const;

  std::vector<Placed> bodies_;
  std::vector<int> order_;        ///< in which the bodies are computed with
  std::vector<Placed> relative_;  ///< in that order, about the reference
  double tolerance_;
  Method method_;
  Vec3 reference_;
  std::vector<double> reach_;  ///< per relative body: how large the numbers are that describe it
  Status status_ = Status::kSeparated;
  DeepestBall ball_;

  struct Lazy {
    std::mutex mutex;
    std::vector<OwnedPlane> planes;  ///< of all bodies, until the region is built
    std::optional<Region> region;
    std::optional<Quantities> quantities;
    std::optional<Surface> surface;
    std::optional<Contact> contact;
    std::optional<double> error_of_paper;
  };
  std::shared_ptr<Lazy> lazy_ = std::make_shared<Lazy>();
};

}  // namespace overlapper
