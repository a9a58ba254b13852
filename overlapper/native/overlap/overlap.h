#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "geometry/measures.h"
#include "geometry/once.h"
#include "methods/choose.h"
#include "methods/dual/region.h"
#include "overlap/boundary.h"
#include "overlap/contact.h"
#include "overlap/errors.h"
#include "shapes/shape.h"

namespace overlapper {

enum class Method { kAuto, kPaper };

/// The common set of two or more placed shapes. Only the status is found on construction; each quantity when first
/// asked for, then kept. Safe to share between threads, none of which waits for another.
class Overlap {
 public:
  /// Throws std::invalid_argument if the common set is unbounded. `tolerance` is the fraction of the volume by
  /// which the polytope of smooth shapes may be off; polyhedra are exact whatever it is.
  Overlap(std::vector<Placed> bodies, double tolerance, Method method);
  Overlap(const Placed& a, const Placed& b, double tolerance, Method method);
  Overlap(const Overlap& other);  ///< what either computes from then on, both have
  Overlap(Overlap&& other) noexcept;

  std::span<const Placed> bodies() const { return bodies_.empty() ? std::span<const Placed>(two_) : bodies_; }
  double tolerance() const { return tolerance_; }
  Method method() const { return method_; }
  Status status() const { return status_; }
  bool pair() const { return bodies_.empty(); }
  bool measured_at_once() const { return at_once_ && at_once_->measured; }  ///< so that it is quickly had again

  /// The way the measures came, or the status of bodies that do not overlap.
  Way way() const;

  /// m³; 0 unless overlapping.
  double volume() const;

  /// The true volume is within volume() ± volume_error(). For a set that only touches, what it may still hold. The
  /// article gives no bound, and what its method loses may be a whole overlap: for kPaper it is the difference from
  /// what kAuto finds, plus the error of that.
  double volume_error() const;

  double area() const;         ///< m², of the surface; 0 unless overlapping
  Vec3 centroid() const;       ///< only for overlapping bodies
  bool widened() const;        ///< double arithmetic was not enough
  int facets_touched() const;  ///< how many planes took part in the measures

  /// The polytope of the common set; only for overlapping bodies, as are the next three.
  const Region& region() const;
  const Measures& measures() const;
  /// Inertia tensor about the centroid, unit density; by slices where the measures have closed forms.
  Mat3 inertia() const;
  const Boundary& boundary() const;
  /// Of a pair; without an area unless overlapping.
  const Patch& patch() const;

  /// The slopes of the volume, per body: d volume / d translation, then / d rotation vector about the body's position;
  /// zeros unless overlapping.
  std::vector<std::array<double, 6>> gradient() const;

  /// How far what is stated may be off; of kPaper, the difference from what kAuto finds, plus the error of that.
  const Errors& errors() const;

  /// False where the bodies overlap, and the volume may be off by more than the fraction `tolerance`.
  bool converged() const;

  /// The contact of a pair; not for more bodies.
  const Contact& contact() const;
  const ContactErrors& contact_errors() const;

 private:
  bool traced() const { return at_once_ && at_once_->way == Way::kTracing; }

  struct Lazy {
    Once<Arrangement> arrangement;
    Once<Search> search;
    Once<Inside> inside;
    Once<Region> region;
    Once<std::optional<MeasuresAndInertia>> sliced;
    Once<MeasuresAndInertia> in_full;
    Once<Boundary> boundary;
    Once<Patch> patch;
    Once<Contact> contact;
    Once<ContactErrors> contact_errors;
    Once<Region> finest_region;
    Once<Errors> errors;
    Once<Overlap> judge_of_paper;
  };

  const std::shared_ptr<const Lazy>& shared_lazy() const;
  const Lazy& lazy() const { return *shared_lazy(); }
  const Arrangement& arrangement() const;
  const Search& search() const;
  const Inside& inside() const;
  const std::optional<MeasuresAndInertia>& sliced() const;
  const MeasuresAndInertia& in_full() const;
  Region region_of_overlap() const;
  Patch patch_of_overlap() const;
  OverlappingBodies overlapping_bodies() const;
  MeasuresAndInertia measured_in_full() const;
  const Region& finest_region() const;
  const Region& drawn() const;  ///< for the boundary: the finest where doubles do not place planes well enough
  Stated stated() const;
  const Overlap& judge_of_paper() const;
  Errors errors_of_paper() const;
  Errors errors_of_measures() const;

  void start();
  void start_as_in_paper();

  std::array<Placed, 2> two_;
  std::vector<Placed> bodies_;  ///< if there are more than two
  double tolerance_;
  Method method_;
  Status status_ = Status::kSeparated;
  std::optional<Measures> at_once_;  ///< where that decided the status
  Once<std::shared_ptr<const Lazy>> lazy_;
};

}  // namespace overlapper
