#include "overlap/overlap.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <stdexcept>

#include "methods/clipping/clip.h"
#include "methods/paper.h"
#include "methods/round/closed_forms/closed_forms.h"
#include "methods/tracing/trace.h"

namespace overlapper {

Overlap::Overlap(std::vector<Placed> bodies, double tolerance, Method method) : tolerance_(tolerance), method_(method) {
  if (bodies.size() < 2) throw std::invalid_argument("shapes must be two or more");
  if (bodies.size() == 2) two_ = {std::move(bodies[0]), std::move(bodies[1])};
  else bodies_ = std::move(bodies);
  start();
}

Overlap::Overlap(const Placed& a, const Placed& b, double tolerance, Method method)
    : two_{a, b}, tolerance_(tolerance), method_(method) {
  start();
}

Overlap::Overlap(const Overlap& other)
    : two_(other.two_),
      bodies_(other.bodies_),
      tolerance_(other.tolerance_),
      method_(other.method_),
      status_(other.status_),
      at_once_(other.at_once_) {
  lazy_.get([&] { return other.shared_lazy(); });
}

Overlap::Overlap(Overlap&& other) noexcept
    : two_(std::move(other.two_)),
      bodies_(std::move(other.bodies_)),
      tolerance_(other.tolerance_),
      method_(other.method_),
      status_(other.status_),
      at_once_(std::move(other.at_once_)),
      lazy_(std::move(other.lazy_)) {}

void Overlap::start() {
  if (!(tolerance_ > 0 && tolerance_ < 1))
    throw std::invalid_argument("tolerance must be greater than 0 and less than 1");
  if (method_ == Method::kPaper) return start_as_in_paper();
  at_once_ = measure_at_once(bodies());
  // A set too thin for clipping may only touch.
  if (at_once_ && at_once_->status == Status::kOverlapping && !at_once_->measured && !traced()) at_once_.reset();
  status_ = at_once_ ? at_once_->status : search().status;
}

void Overlap::start_as_in_paper() {
  PaperResult result = intersect_as_in_paper(arrangement().relative, tolerance_);
  status_ = result.status;
  if (!result.region) return;
  for (Region::Facet& facet : result.region->facets) facet.owner = arrangement().order[facet.owner];
  result.region->reference = arrangement().reference;
  lazy().region.get([&] { return std::move(*result.region); });
}

const std::shared_ptr<const Overlap::Lazy>& Overlap::shared_lazy() const {
  return lazy_.get([] { return std::make_shared<const Lazy>(); });
}

const Arrangement& Overlap::arrangement() const {
  return lazy().arrangement.get([this] { return arranged(bodies()); });
}

const Search& Overlap::search() const {
  return lazy().search.get([this] { return overlapper::search(arrangement()); });
}

const Inside& Overlap::inside() const {
  if (search().inside) return *search().inside;
  return lazy().inside.get([this] { return look_inside(arrangement(), search()); });
}

const Region& Overlap::region() const {
  return lazy().region.get([this] { return region_of_overlap(); });
}

const std::optional<MeasuresAndInertia>& Overlap::sliced() const {
  return lazy().sliced.get([this] { return overlapper::sliced(overlapping_bodies(), false); });
}

const std::optional<MeasuresAndInertia>& Overlap::sliced_with_area() const {
  if (!sliced() || sliced()->measures.area_known) return sliced();
  return lazy().sliced_with_area.get([this] { return overlapper::sliced(overlapping_bodies(), true); });
}

const std::optional<VolumeAlone>& Overlap::volume_alone() const {
  static const std::optional<VolumeAlone> none;
  const auto rounded = [](const Placed& body) { return rounded_hull(body.shape); };
  const auto round_ends = [](const Placed& body) {
    const auto own = revolution(body.shape);
    return own && own->round_ends && own->half_length > 0;
  };
  const auto flat = [](const Placed& body) { return bounded(body.shape) && !smooth(body.shape); };
  if (!pair()) return none;
  const bool capsule = std::ranges::any_of(two_, round_ends) && std::ranges::any_of(two_, flat);
  if (!capsule && std::ranges::none_of(two_, rounded)) return none;
  return lazy().volume_alone.get([this] { return overlapper::volume_alone(overlapping_bodies()); });
}

const MeasuresAndInertia& Overlap::in_full() const {
  return lazy().in_full.get([this] { return measured_in_full(); });
}

const Region& Overlap::finest_region() const {
  return lazy().finest_region.get([this] { return overlapper::finest_region(overlapping_bodies()); });
}

const Region& Overlap::drawn() const {
  // Only the finest polytope has each triangle of a hull separately. The others have facets.
  constexpr double kRough = 1e-10;
  const auto rough = [](const Region::Facet& facet) { return !(facet.rounding <= kRough * facet.slack); };
  const bool of_paper = method_ == Method::kPaper;
  return !of_paper && std::ranges::any_of(region().facets, rough) ? finest_region() : region();
}

const Boundary& Overlap::boundary() const {
  return lazy().boundary.get([this] { return boundary_of(drawn(), static_cast<int>(bodies().size())); });
}

const Patch& Overlap::patch() const {
  assert(pair());
  return lazy().patch.get([this] { return patch_of_overlap({}); });
}

Patch Overlap::patch_of_overlap(const std::optional<Vec3>& direction) const {
  if (status_ != Status::kOverlapping) return PatchSums({}, {}).patch();
  std::optional<Patch> exact;
  if (way() == Way::kClipping || way() == Way::kWideClipping) exact = clipped_patch(two_[0], two_[1], direction);
  const Vec3 area = Vec3{} + seen_along(measures().pulls[1].force, direction);
  if (way() == Way::kClosedForm) exact = closed_forms::section_patch(two_[0], two_[1], centroid(), area);
  if (!exact && (way() == Way::kClosedForm || way() == Way::kSlicing))
    exact = sliced_patch(overlapping_bodies(), centroid(), area);
  Patch patch = exact ? *exact : patch_of(drawn(), centroid(), direction);
  patch.area = area;
  return patch;
}

Region Overlap::region_of_overlap() const {
  assert(status_ == Status::kOverlapping);
  const Arrangement& at = arrangement();
  if (traced()) {
    if (auto region = traced_region(two_[0], two_[1], at.reference)) {
      for (Region::Facet& facet : region->facets) facet.owner = at.order[facet.owner];
      return std::move(*region);
    }
  }
  return grown(at, inside(), search().reach, tolerance_);
}

OverlappingBodies Overlap::overlapping_bodies() const {
  return {arrangement(),
          bodies(),
          tolerance_,
          traced(),
          [this]() -> const Search& { return search(); },
          [this]() -> const Inside& { return inside(); },
          [this]() -> const Region& { return region(); },
          [this]() -> const std::optional<MeasuresAndInertia>& { return sliced(); },
          [this]() -> const std::optional<VolumeAlone>& { return volume_alone(); }};
}

MeasuresAndInertia Overlap::measured_in_full() const {
  if (method_ == Method::kPaper) {
    MeasuresAndInertia as_in_paper = measure(region(), bodies());
    as_in_paper.measures.way = Way::kPaper;
    return as_in_paper;
  }
  return measure_in_full(overlapping_bodies());
}

const Measures& Overlap::measures() const { return measured_at_once() ? *at_once_ : in_full().measures; }

Way Overlap::way() const {
  if (method_ == Method::kPaper) return Way::kPaper;
  if (status_ == Status::kOverlapping) return by_volume_alone() ? Way::kClosedForm : measures().way;
  return at_once_ ? at_once_->way : search().way;
}

double Overlap::volume() const {
  if (status_ != Status::kOverlapping) return 0;
  return by_volume_alone() ? volume_alone()->volume : measures().volume;
}

double Overlap::volume_error() const {
  if (method_ == Method::kPaper)
    return std::abs(volume() - judge_of_paper().volume()) + judge_of_paper().volume_error();
  switch (status_) {
    case Status::kSeparated: return 0;
    case Status::kTouching: return touching_volume(bodies(), inside().ball);
    case Status::kOverlapping: return by_volume_alone() ? volume_alone()->error : measures().volume_error;
  }
  return 0;
}

const Overlap& Overlap::judge_of_paper() const {
  return lazy().judge_of_paper.get(
      [this] { return Overlap({bodies().begin(), bodies().end()}, tolerance_, Method::kAuto); });
}

const Errors& Overlap::errors() const {
  return lazy().errors.get([this] {
    if (method_ == Method::kPaper) return errors_of_paper();
    switch (status_) {
      case Status::kSeparated: return Errors{0, 0, 0, 0, std::vector<std::array<double, 2>>(bodies().size())};
      case Status::kTouching: return errors_of_anything(volume_error(), bodies());
      case Status::kOverlapping: return errors_of_measures();
    }
    return Errors{};
  });
}

Stated Overlap::stated() const {
  if (status_ != Status::kOverlapping) return {0, {}, {{}, {}, {}}, gradient()};
  return {area(), centroid(), inertia(), gradient()};
}

Errors Overlap::errors_of_measures() const {
  if (!(volume_error() < volume())) return errors_of_anything(volume_error(), bodies());
  const bool integrated = way() == Way::kClosedForm || way() == Way::kSlicing;
  const auto& slices = integrated ? sliced_with_area() : std::optional<MeasuresAndInertia>();
  const auto spread = slices ? overlapper::spread(overlapping_bodies(), slices->measures, measures()) : std::nullopt;
  Errors errors = spread ? errors_of_slices(*slices, *spread, stated(), bodies())
                         : errors_beside(measured_with_errors(finest_region(), bodies()), stated());
  errors.volume = volume_error();
  return no_more_than_all(std::move(errors), bodies());
}

Errors Overlap::errors_of_paper() const {
  const Overlap& judge = judge_of_paper();
  const Errors of_judge = judge.errors();
  Errors errors = errors_beside({judge.stated(), of_judge}, stated());
  errors.volume = volume_error();
  if (status_ != Status::kOverlapping || judge.status() != Status::kOverlapping)
    errors.centroid = std::numeric_limits<double>::infinity();
  return no_more_than_all(std::move(errors), bodies());
}

double Overlap::vertices_error() const {
  return lazy().vertices_error.get([this] { return bound_of_vertices(); });
}

double Overlap::bound_of_vertices() const {
  const double most = least_diameter(bodies());
  if (method_ == Method::kPaper) {
    const Overlap& judge = judge_of_paper();
    if (status_ != Status::kOverlapping || judge.status() != Status::kOverlapping) return most;
    return std::min(most, judge.vertices_error() + farthest_apart(boundary().vertices, judge.boundary().vertices));
  }
  if (status_ == Status::kSeparated) return 0;
  const bool solid = status_ == Status::kOverlapping && volume_error() < volume();
  return solid ? error_of_vertices(drawn(), boundary(), bodies()) : most;
}

bool Overlap::converged() const { return status_ != Status::kOverlapping || volume_error() <= tolerance_ * volume(); }

double Overlap::area() const {
  if (status_ != Status::kOverlapping) return 0;
  if (measures().area_known) return measures().area;
  return sliced_with_area() ? sliced_with_area()->measures.area : measure(region(), bodies()).measures.area;
}

Vec3 Overlap::centroid() const { return measures().centroid; }

bool Overlap::widened() const { return overlapper::widened(way()); }

int Overlap::facets_touched() const {
  if (status_ != Status::kOverlapping) return 0;
  return at_once_ ? at_once_->facets_touched : in_full().measures.facets_touched;
}

Mat3 Overlap::inertia() const {
  if (in_full().inertia) return *in_full().inertia;
  if (sliced()) return *sliced()->inertia;
  const MeasuresAndInertia of_polytope = measure(region(), bodies());
  const double share = in_full().measures.volume / of_polytope.measures.volume;
  const Mat3& i = *of_polytope.inertia;
  return {share * i.row0, share * i.row1, share * i.row2};
}

std::vector<std::array<double, 6>> Overlap::gradient() const {
  std::vector<std::array<double, 6>> rows(bodies().size());
  if (status_ != Status::kOverlapping) return rows;
  const Measures& m = measures();
  for (size_t i = 0; i < rows.size(); ++i) rows[i] = gradient_row(pair() ? m.pulls[i] : m.pulls_of_group[i]);
  return rows;
}

const Contact& Overlap::contact() const {
  assert(pair());
  return lazy().contact.get([this] {
    if (measured_at_once()) {
      const Penetration way = penetration_in_order(two_[0], two_[1]);
      return Contact{0, way.depth, way.normal, {}, {}, {}};
    }
    const bool searched = method_ == Method::kAuto && !at_once_;
    const bool doubtful = searched && search().inside && search().inside->wide_ball;
    return contact_of(arrangement(), status_, method_ == Method::kPaper, doubtful);
  });
}

const ContactErrors& Overlap::contact_errors() const {
  assert(pair());
  return lazy().contact_errors.get([this] { return errors_of(contact(), two_[0], two_[1], status_); });
}

}  // namespace overlapper
