#include "methods/tracing/trace.h"

#include <limits>

#include "distance/portal.h"
#include "geometry/cancellation.h"
#include "geometry/constants.h"
#include "geometry/scratch.h"
#include "methods/tracing/seam.h"
#include "shapes/canonical_order.h"
#include "shapes/local_measures.h"
#include "shapes/planes_asked.h"
#include "shapes/relation.h"

namespace overlapper {
namespace {

/// The common polytope of two bodies under construction.
class Tracing {
 public:
  enum class Answer { kApart, kTraced, kUnknown };

  Answer run(const Placed& a, const Placed& b, const Pose& pose, double doubt) {
    meshes_[0].set(a.shape);
    meshes_[1].set(b.shape);
    const Portal portal = find_portal(meshes_[0], meshes_[1], pose, doubt);
    if (portal.answer == Portal::Answer::kApart) return Answer::kApart;
    const Vec3 normal = unit(portal.normal);
    if (portal.answer == Portal::Answer::kUnknown || !(norm2(normal) > 0)) return Answer::kUnknown;
    place(close_frame(a, b, middle_of_chord(portal.point, normal, pose)));
    return find_seam(normal) && complete() && closed() ? Answer::kTraced : Answer::kUnknown;
  }

  /// False if a plane is nearer to the middle than `least`.
  bool measure(double least, Measures& common, Pull& on_first) const;
  Region region(const Placed& a, Vec3 reference);

 private:
  struct Exit {
    CrossingFacets facets;
    double rate_first, rate_second;  ///< 1 / the length of the ray within each body
    bool leaves_first() const { return rate_first > rate_second; }
  };

  struct Outside {
    int body, edge;  ///< a half-edge from the common part to a vertex outside the other body
  };

  struct OwnedFacet {
    int body, facet;
  };

  void place(const CloseFrame& frame) {
    frame_ = frame;
    for (int body : {0, 1}) bodies_[body].set(meshes_[body], frame, body == 1);
    seam_.begin(bodies_[0], bodies_[1]);
  }

  Vec3 middle_of_chord(Vec3 point, Vec3 along, const Pose& pose) const;
  Exit exit(Vec3 direction, std::optional<CrossingFacets> near = {}) const;
  bool find_seam(Vec3 normal);
  CrossingFacets between(Vec3 first, Vec3 second) const;
  bool begin_inside(int body, int facet, Vec3 direction);

  bool complete();
  bool assemble();
  void clear();
  bool add_whole_line(int body, const Seam::Line& line);
  bool add_cut_facet(int body, int first_corner);
  bool spread(int body);
  bool add_whole_facet(int body, int half_edge);
  bool keep(int body, int half_edge);
  bool keep_vertex(int body, int vertex);
  void finish_facet(int body, int facet) {
    facets_.push_back({body, facet});
    ring_start_.push_back(static_cast<int>(ring_.size()));
  }
  bool closed() const {
    return static_cast<int>(vertices_.size() + facets_.size()) - static_cast<int>(ring_.size()) / 2 == 2;
  }

  /// m: bound of the distance of the common polytope's corners, relative to the middle, from the planes of the body's
  /// facets: rounding, and the flatness of both.
  double off_planes(int body) const {
    const double reach = std::sqrt(reach2_), kept = bodies_[body].corner_rounding() * reach;
    return std::max(kept, seam_.rounding(body)) + 2 * 0x1p-53 * std::max(reach, seam_.reach()) +
           bodies_[0].mesh().flat() + bodies_[1].mesh().flat();
  }
  Vec3 middle() const {
    Vec3 sum;
    for (Vec3 v : vertices_) sum += v;
    return sum / static_cast<double>(vertices_.size());
  }

  std::array<Mesh, 2> meshes_;
  mutable std::array<CloseBody, 2> bodies_;
  CloseFrame frame_;
  Seam seam_;

  std::optional<Outside> outside_;
  std::optional<std::pair<int, int>> seed_;  ///< body and vertex inside the other, if no seam is known
  bool certain_ = true;
  double reach2_ = 0;  ///< the squared largest distance of a kept vertex from the common point
  int now_ = 0;
  struct Kept {
    int when, as;  ///< the run that kept it, and its number there
  };
  std::array<std::vector<Kept>, 2> kept_;  ///< per vertex
  std::array<std::vector<int>, 2> done_;   ///< per facet: the last run that added it
  std::array<std::vector<int>, 2> open_;   ///< half-edges between kept vertices, with facets to do
  std::vector<Vec3> vertices_;             ///< vertices of the seam first
  std::vector<int> ring_, ring_start_;
  std::vector<OwnedFacet> facets_;
};

// ------------------------------------------------------------------------------------------------------------ the seam

Vec3 Tracing::middle_of_chord(Vec3 point, Vec3 along, const Pose& pose) const {
  const Vec3 in_second = apply_transposed(pose.rotation, point - pose.translation),
             along_second = apply_transposed(pose.rotation, along);
  const auto length = [&](double sign) {
    double a, b;
    meshes_[0].graph().ray_exit(meshes_[0].data(), point, sign * along, a);
    meshes_[1].graph().ray_exit(meshes_[1].data(), in_second, sign * along_second, b);
    planes_asked += 2;
    return 1 / std::max(a, b);
  };
  const double forwards = length(1), backwards = length(-1);
  const Vec3 middle = point + (forwards - backwards) / 2 * along;
  return finite(middle) ? middle : point;
}

Tracing::Exit Tracing::exit(Vec3 direction, std::optional<CrossingFacets> near) const {
  Exit e{};
  const auto leave = [&](int i, int from, int& facet, double& rate) {
    const CloseBody& body = bodies_[i];
    const Vec3 origin = body.own_point({}), along = body.own_direction(direction);
    facet = near ? body.graph().ray_exit(body.data(), origin, along, rate, from)
                 : body.graph().ray_exit(body.data(), origin, along, rate);
  };
  leave(0, near ? near->first : 0, e.facets.first, e.rate_first);
  leave(1, near ? near->second : 0, e.facets.second, e.rate_second);
  return e;
}

/// Facets that cross between two directions: in the first direction the ray leaves the first body sooner, in the second
/// the second body. 1 / the length of the ray is a convex function of the direction, linear on a facet. Newton's method
/// within brackets finds where the two are equal.
CrossingFacets Tracing::between(Vec3 first, Vec3 second) const {
  double low = 0, high = 1, at = 0.5;
  bool newton = false;
  std::optional<CrossingFacets> last;
  for (int round = 0; round < 64; ++round) {
    const Vec3 direction = unit(first + at * (second - first));
    const Exit e = exit(direction, last);
    if (newton && e.facets.first == last->first && e.facets.second == last->second) break;
    last = e.facets;
    (e.leaves_first() ? low : high) = at;
    const CloseBody::Side &f = bodies_[0].side(e.facets.first), &g = bodies_[1].side(e.facets.second);
    const double slack_f = dot(f.normal, f.through), slack_g = dot(g.normal, g.through);
    const auto excess = [&](Vec3 d) { return dot(f.normal, d) * slack_g - dot(g.normal, d) * slack_f; };
    const double at_first = excess(first), at_second = excess(second), root = at_first / (at_first - at_second);
    newton = root > low && root < high;
    at = newton ? root : (low + high) / 2;
  }
  return *last;
}

/// Finds a first line of the seam. If one body seems to lie inside the other, finds a vertex of the inner body.
bool Tracing::find_seam(Vec3 normal) {
  seed_.reset();
  const Vec3 side = any_orthogonal(normal), other_side = cross(normal, side);
  const std::array<Vec3, 6> directions{normal, -normal, side, -side, other_side, -other_side};
  std::array<bool, 6> leaves_first{};
  Exit e{};
  for (size_t i = 0; i < directions.size(); ++i) {
    e = exit(directions[i]);
    leaves_first[i] = e.leaves_first();
    // Compares only with directions along other axes: opposite directions have no middle.
    for (size_t j = 0; j < (i & ~size_t{1}); ++j)
      if (leaves_first[j] != leaves_first[i])
        return seam_.follow(leaves_first[i] ? between(directions[i], directions[j])
                                            : between(directions[j], directions[i]));
  }
  const int body = e.leaves_first() ? 0 : 1;
  return begin_inside(body, body == 0 ? e.facets.first : e.facets.second, directions.back());
}

/// Begins from a body that lies inside the other where the ray leaves through the facet. Elsewhere the body may be
/// outside.
bool Tracing::begin_inside(int body, int facet, Vec3 direction) {
  const int vertex = bodies_[body].data().ring[bodies_[body].data().ring_start[facet]];
  const Vec3 at = bodies_[body].corner(vertex).at;
  const int inside = bodies_[1 - body].holds(at);
  if (inside < 0) return seam_.follow(body == 0 ? between(direction, at) : between(at, direction));
  seed_ = {body, vertex};
  return inside > 0;
}

// ---------------------------------------------------------------------------------------------------------- kept parts

/// Builds the common polytope. Asks the other body about every kept vertex. A vertex outside shows an unknown line of
/// the seam, and the construction starts again.
bool Tracing::complete() {
  for (int round = 0; round < 64; ++round) {
    outside_.reset();
    if (assemble()) return true;
    if (!certain_ || !seam_.certain() || !outside_) return false;
    const auto [body, edge] = *outside_;
    CloseBody &self = bodies_[body], &other = bodies_[1 - body];
    const int entry = seam_.entry(body, edge);
    const Vec3 from = entry >= 0 ? seam_.corners()[entry].at : self.corner(self.begin(edge)).at;
    const Vec3 along = unit(self.corner(self.end(edge)).at - from);
    if (!(norm2(along) > 0)) return false;
    double rate;
    const int facet = other.graph().ray_exit(other.data(), other.own_point(from), other.own_direction(along), rate);
    const int own = self.facet(edge);
    if (!seam_.follow(body == 0 ? CrossingFacets{own, facet} : CrossingFacets{facet, own})) return false;
  }
  return false;
}

void Tracing::clear() {
  vertices_.clear();
  ring_.clear();
  ring_start_.assign(1, 0);
  facets_.clear();
  certain_ = true;
  reach2_ = 0;
  if (++now_ == std::numeric_limits<int>::max()) {
    kept_ = {};
    done_ = {};
    now_ = 1;
  }
  for (int body : {0, 1}) {
    const size_t vertices = bodies_[body].data().vertices.size(), facets = bodies_[body].data().planes.size();
    open_[body].clear();
    if (kept_[body].size() < vertices) kept_[body].resize(vertices, {0, 0});
    if (done_[body].size() < facets) done_[body].resize(facets, 0);
  }
}

bool Tracing::assemble() {
  clear();
  for (const SeamCorner& corner : seam_.corners()) vertices_.push_back(corner.at);
  for (const Seam::Line& line : seam_.lines())
    for (int body : {0, 1})
      if (!line.crosses_edges_of[body] && !add_whole_line(body, line)) return false;
  for (int i = 0; i < static_cast<int>(seam_.corners().size()); ++i) {
    const SeamCorner& corner = seam_.corners()[i];
    const CloseBody& body = bodies_[corner.body];
    if (done_[corner.body][body.facet(body.twin(corner.edge))] == now_) continue;
    if (!add_cut_facet(corner.body, i)) return false;
  }
  if (seam_.corners().empty()) {
    const auto [body, vertex] = *seed_;
    if (!keep_vertex(body, vertex)) return false;
    open_[body].push_back(bodies_[body].graph().leaving[vertex]);
  }
  return spread(0) && spread(1);
}

/// Adds the piece of a facet that a line of the seam cuts out; all of the line lies within the facet.
bool Tracing::add_whole_line(int body, const Seam::Line& line) {
  const std::vector<SeamCorner>& corners = seam_.corners();
  const CrossingFacets& facets = corners[line.first_corner].ahead;
  const int facet = body == 0 ? facets.first : facets.second;
  int c = line.first_corner;
  do {
    ring_.push_back(c);
    c = body == 0 ? corners[c].next : corners[c].previous;
  } while (c != line.first_corner);
  done_[body][facet] = now_;
  finish_facet(body, facet);
  return true;
}

/// Adds the kept part of the facet where the seam goes on from a corner on its border. The ring follows the seam to the
/// border, and the border to the next entry of the seam.
bool Tracing::add_cut_facet(int body, int first_corner) {
  const std::vector<SeamCorner>& corners = seam_.corners();
  const CloseBody& self = bodies_[body];
  const int facet = self.facet(self.twin(corners[first_corner].edge));
  done_[body][facet] = now_;
  int c = first_corner;
  do {
    do {
      ring_.push_back(c);
      c = body == 0 ? corners[c].next : corners[c].previous;
    } while (corners[c].body != body);
    ring_.push_back(c);
    const int begin = corners[c].edge;
    int h = begin;
    while ((c = seam_.entry(body, self.twin(h))) < 0) {
      cancellation_point();
      if (!keep(body, h)) return false;
      if (h != begin) open_[body].push_back(self.twin(h));
      h = self.graph().next[h];
      if (h == begin) return false;
    }
  } while (c != first_corner);
  finish_facet(body, facet);
  return true;
}

/// Continues from facet to facet over kept edges.
bool Tracing::spread(int body) {
  std::vector<int>& open = open_[body];
  while (!open.empty()) {
    const int half_edge = open.back();
    open.pop_back();
    if (done_[body][bodies_[body].facet(half_edge)] != now_ && !add_whole_facet(body, half_edge)) return false;
  }
  return true;
}

bool Tracing::add_whole_facet(int body, int half_edge) {
  cancellation_point();
  const CloseBody& self = bodies_[body];
  const int facet = self.facet(half_edge);
  done_[body][facet] = now_;
  int h = half_edge;
  do {
    if (!keep(body, h)) return false;
    if (done_[body][self.graph().beside[h]] != now_) open_[body].push_back(self.twin(h));
    h = self.graph().next[h];
  } while (h != half_edge);
  finish_facet(body, facet);
  return true;
}

/// Adds the end of a half-edge to the ring.
bool Tracing::keep(int body, int half_edge) {
  const int vertex = bodies_[body].end(half_edge);
  const Kept& kept = kept_[body][vertex];
  if (kept.when != now_ && !keep_vertex(body, vertex)) {
    if (certain_) outside_ = {body, half_edge};
    return false;
  }
  ring_.push_back(kept.as);
  return true;
}

bool Tracing::keep_vertex(int body, int vertex) {
  const Vec3 at = bodies_[body].placed(vertex);
  const int inside = bodies_[1 - body].holds(at);
  certain_ &= inside != 0;
  if (inside <= 0) return false;
  kept_[body][vertex] = {now_, static_cast<int>(vertices_.size())};
  vertices_.push_back(at);
  reach2_ = std::max(reach2_, norm2(at));
  return true;
}

// ------------------------------------------------------------------------------------------------------------ measures

double extent(Vec3 v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }

/// Sums over blocks of facets, which are then added up. Most of n terms are then rounded far less than n times.
struct BlockSums {
  static constexpr int kBlock = 64;  ///< facets
  double six_volumes = 0, area = 0;
  double uncancelled = 0;  ///< upper bound of six times the volumes, without cancellation of terms
  double moved = 0;        ///< volume change by the rounding of planes
  Vec3 moment;

  void add(const BlockSums& other) {
    six_volumes += other.six_volumes;
    area += other.area;
    uncancelled += other.uncancelled;
    moved += other.moved;
    moment += other.moment;
  }
};

bool Tracing::measure(double least, Measures& common, Pull& on_first) const {
  const Vec3 origin = middle();
  const std::array<double, 2> off{off_planes(0), off_planes(1)};
  BlockSums total, block;
  double least_slack = kInfinity;
  size_t in_block = 0, most_in_block = 0;
  for (size_t f = 0; f < facets_.size(); ++f) {
    cancellation_point();
    const int* ring = &ring_[ring_start_[f]];
    const size_t corners = ring_start_[f + 1] - ring_start_[f];
    most_in_block = std::max(most_in_block, in_block += corners - 2);
    const Vec3 a = vertices_[ring[0]] - origin;
    Vec3 twice_area, b = vertices_[ring[1]] - origin;
    double cone = 0, spanned = 0;
    for (size_t i = 2; i < corners; ++i) {
      const Vec3 c = vertices_[ring[i]] - origin, ab = b - a, ac = c - a, normal = cross(ab, ac);
      const double tetrahedron = dot(a, normal);
      cone += tetrahedron;
      spanned += extent(ab) * extent(ac);
      block.moment += tetrahedron * (a + b + c);
      twice_area += normal;
      b = c;
    }
    const double area = std::sqrt(norm2(twice_area)) / 2;
    block.area += area;
    block.moved += area * off[facets_[f].body];
    // The cone's volume gives a lower bound of its plane's distance. The plane itself is computed only if this may be
    // the least.
    const double uncancelled = extent(a) * spanned;
    if (!(cone / 2 - 8 * 0x1p-53 * uncancelled > area * least_slack)) {
      const CloseBody::Side& side = bodies_[facets_[f].body].side(facets_[f].facet);
      least_slack = std::min(least_slack, dot(side.normal, side.through - origin));
    }
    block.uncancelled += uncancelled;
    block.six_volumes += cone;
    if (f % BlockSums::kBlock == BlockSums::kBlock - 1) {
      total.add(block);
      block = {};
      in_block = 0;
    }
  }
  total.add(block);
  if (!(least_slack > least)) return false;

  common.status = Status::kOverlapping;
  common.way = Way::kTracing;
  common.volume = total.six_volumes / 6;
  common.area = total.area;
  const Vec3 centroid = total.moment / (4 * total.six_volumes);
  common.facets_touched = static_cast<int>(facets_.size());
  for (const SeamCorner& corner : seam_.corners()) {
    const Pull of_edge = pull_along_border(corner.at - origin, seam_.corners()[corner.next].at - origin);
    on_first.force += of_edge.force;
    on_first.moment += of_edge.moment;
  }
  on_first.moment = on_first.moment - cross(centroid, on_first.force);
  common.centroid = frame_.origin + (origin + centroid);
  // As for a region, the error is the volume that all planes add when moved by their rounding, including growth on the
  // way. The roundings of products and of sums come on top.
  const double most = std::max(off[0], off[1]);
  const double terms = static_cast<double>(most_in_block + facets_.size() / BlockSums::kBlock + 1);
  const double summed = 8 * 0x1p-53 * total.uncancelled / 6 + terms * 0x1p-53 * common.volume;
  common.volume_error = total.moved * growth(most, least_slack) / 3 + summed;
  common.measured = common.volume_error <= kEnough * common.volume;
  return true;
}

/// The lower triangular matrix l of a symmetric positive definite matrix m, with m = l lᵀ.
Mat3 cholesky(const Mat3& m, double least) {
  const auto root = [&](double x) { return std::sqrt(std::max(x, least)); };
  Mat3 l{{}, {}, {}};
  l.row0.x = root(m.row0.x);
  l.row1.x = m.row1.x / l.row0.x;
  l.row1.y = root(m.row1.y - l.row1.x * l.row1.x);
  l.row2.x = m.row2.x / l.row0.x;
  l.row2.y = (m.row2.y - l.row2.x * l.row1.x) / l.row1.y;
  l.row2.z = root(m.row2.z - l.row2.x * l.row2.x - l.row2.y * l.row2.y);
  return l;
}

/// The region in a frame about the middle of its vertices. In the axes of this frame, the vertices spread evenly.
Region Tracing::region(const Placed& a, Vec3 reference) {
  const Vec3 origin = middle();
  Mat3 spread{{}, {}, {}};
  for (Vec3 v : vertices_) {
    const Vec3 d = v - origin;
    spread.row0 += d.x * d;
    spread.row1 += d.y * d;
    spread.row2 += d.z * d;
  }
  const double n = static_cast<double>(vertices_.size()), sum = (spread.row0.x + spread.row1.y + spread.row2.z) / n;
  for (Vec3* row : {&spread.row0, &spread.row1, &spread.row2}) *row = *row / n;
  const Mat3 l = cholesky(spread, 0x1p-90 * sum);

  Region region;
  region.reference = reference;
  region.frame.origin = (a.pose.translation - reference) + a.pose.rotation * (frame_.origin + origin);
  region.frame.axes = a.pose.rotation * l;
  for (Vec3 v : vertices_) {
    const Vec3 d = v - origin;
    const double x = d.x / l.row0.x, y = (d.y - l.row1.x * x) / l.row1.y;
    region.polytope.vertices.push_back({x, y, (d.z - l.row2.x * x - l.row2.y * y) / l.row2.z});
  }
  region.polytope.ring = ring_;
  region.polytope.ring_start = ring_start_;
  for (size_t f = 0; f < facets_.size(); ++f) {
    cancellation_point();
    const CloseBody::Side& side = bodies_[facets_[f].body].side(facets_[f].facet);
    const double slack = dot(side.normal, side.through - origin);
    region.polytope.dual.push_back(apply_transposed(l, side.normal) / slack);
    region.polytope.plane.push_back(static_cast<int>(f));
    region.facets.push_back({a.pose.rotation * side.normal, slack, off_planes(facets_[f].body), facets_[f].body});
  }
  region.inner.assign(vertices_.size(), 1);
  region.facets_touched = static_cast<int>(facets_.size());
  return region;
}

}  // namespace

std::optional<Measures> trace(const Placed& a, const Placed& b) {
  const bool swapped = comes_before(b, a);
  const Placed &first = swapped ? b : a, &second = swapped ? a : b;
  const Relation at = relation(first, second);
  if (at.apart) return Measures{};
  const Scratch<Tracing> tracing;
  const Tracing::Answer answer = tracing->run(first, second, at.pose, at.doubt);
  if (answer == Tracing::Answer::kApart) return Measures{};
  if (answer == Tracing::Answer::kUnknown) return std::nullopt;
  std::optional<Measures> common(std::in_place);
  Pull on_first{};
  if (tracing->measure(at.doubt, *common, on_first)) say_in_world(*common, on_first, a, b, swapped);
  else common.reset();
  return common;
}

std::optional<Region> traced_region(const Placed& a, const Placed& b, Vec3 reference) {
  const bool swapped = comes_before(b, a);
  const Placed &first = swapped ? b : a, &second = swapped ? a : b;
  const Relation at = relation(first, second);
  const Scratch<Tracing> tracing;
  if (tracing->run(first, second, at.pose, at.doubt) != Tracing::Answer::kTraced) return std::nullopt;
  return tracing->region(first, reference);
}

}  // namespace overlapper
