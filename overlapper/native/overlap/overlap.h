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

/// The common set of two or more placed shapes. Construction finds only the status. Each quantity is computed on first
/// use and kept. Threads may share it; no thread waits for another.
class Overlap {
 public:
  /// Throws std::invalid_argument if the common set is unbounded. `tolerance`: allowed error of the volume for smooth
  /// shapes, as a fraction of the volume. Polyhedra are exact and ignore it.
  Overlap(std::vector<Placed> bodies, double tolerance, Method method);
  Overlap(const Placed& a, const Placed& b, double tolerance, Method method);
  Overlap(const Overlap& other);  ///< both share all later results
  Overlap(Overlap&& other) noexcept;

  std::span<const Placed> bodies() const { return bodies_.empty() ? std::span<const Placed>(two_) : bodies_; }
  double tolerance() const { return tolerance_; }
  Method method() const { return method_; }
  Status status() const { return status_; }
  bool pair() const { return bodies_.empty(); }
  bool measured_at_once() const { return at_once_ && at_once_->measured; }  ///< fast to repeat

  /// The way that gave the measures, or the status of bodies that do not overlap.
  Way way() const;

  /// m³; 0 unless overlapping.
  double volume() const;

  /// m³: the true volume is within volume() ± volume_error(). For a set that only touches: upper bound of its volume.
  /// The article's method has no error bound and may miss a whole overlap. For kPaper this is the difference from
  /// kAuto, plus the error of kAuto.
  double volume_error() const;

  double area() const;         ///< m², of the surface; 0 unless overlapping
  Vec3 centroid() const;       ///< only for overlapping bodies
  bool widened() const;        ///< true if doubles were not accurate enough
  int facets_touched() const;  ///< number of planes in the measures

  /// The polytope of the common set. This and the next five are only for overlapping bodies.
  const Region& region() const;
  const Region& drawn() const;          ///< of the boundary: the finest if doubles do not place planes well enough
  const Region& finest_region() const;  ///< for error bounds
  const Measures& measures() const;
  /// Inertia tensor about the centroid, unit density; by slices if the measures have closed forms.
  Mat3 inertia() const;
  const Boundary& boundary() const;
  /// Only for a pair; without an area unless overlapping.
  const Patch& patch() const;
  /// The same, seen along a unit direction. It includes only the surfaces that are seen, without vertical walls if the
  /// direction is vertical.
  Patch patch_along(Vec3 direction) const { return patch_of_overlap(direction); }

  /// The derivatives of the volume, per body: d volume / d translation, then / d rotation vector about the body's
  /// position. Zeros unless overlapping.
  std::vector<std::array<double, 6>> gradient() const;

  /// Error bounds of all measures; for kPaper the difference from kAuto, plus the errors of kAuto.
  const Errors& errors() const;
  /// m: bound of the Hausdorff distance between the common set and the hull of the boundary's vertices.
  double vertices_error() const;

  /// False if the bodies overlap and the error of the volume may exceed the fraction `tolerance`.
  bool converged() const;

  /// The contact; only for a pair.
  const Contact& contact() const;
  const ContactErrors& contact_errors() const;

 private:
  bool by_volume_alone() const { return method_ == Method::kAuto && !measured_at_once() && volume_alone(); }
  bool traced() const { return at_once_ && at_once_->way == Way::kTracing; }

  struct Lazy {
    Once<Arrangement> arrangement;
    Once<Search> search;
    Once<Inside> inside;
    Once<Region> region;
    Once<std::optional<MeasuresAndInertia>> sliced, sliced_with_area;
    Once<std::optional<VolumeAlone>> volume_alone;
    Once<MeasuresAndInertia> in_full;
    Once<Boundary> boundary;
    Once<Patch> patch;
    Once<Contact> contact;
    Once<ContactErrors> contact_errors;
    Once<Region> finest_region;
    Once<Errors> errors;
    Once<double> vertices_error;
    Once<Overlap> judge_of_paper;
  };

  const std::shared_ptr<const Lazy>& shared_lazy() const;
  const Lazy& lazy() const { return *shared_lazy(); }
  const Arrangement& arrangement() const;
  const Search& search() const;
  const Inside& inside() const;
  const std::optional<MeasuresAndInertia>& sliced() const;
  const std::optional<MeasuresAndInertia>& sliced_with_area() const;
  const std::optional<VolumeAlone>& volume_alone() const;
  const MeasuresAndInertia& in_full() const;
  Region region_of_overlap() const;
  Patch patch_of_overlap(const std::optional<Vec3>& direction) const;
  OverlappingBodies overlapping_bodies() const;
  MeasuresAndInertia measured_in_full() const;
  Stated stated() const;
  const Overlap& judge_of_paper() const;
  Errors errors_of_paper() const;
  Errors errors_of_measures() const;
  double bound_of_vertices() const;

  void start();
  void start_as_in_paper();

  std::array<Placed, 2> two_;
  std::vector<Placed> bodies_;  ///< set if there are more than two
  double tolerance_;
  Method method_;
  Status status_ = Status::kSeparated;
  std::optional<Measures> at_once_;  ///< set if they decided the status
  Once<std::shared_ptr<const Lazy>> lazy_;
};

}  // namespace overlapper
