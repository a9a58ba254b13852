#include <algorithm>
#include <array>

#include "geometry/scratch.h"
#include "methods/round/pieces/piece.h"
#include "methods/round/quadric/ball.h"
#include "methods/round/quadric/cylinder.h"

namespace overlapper::pieces {
namespace {

/// Negligible rounding, relative to the volume, for more walls than suit slices.
constexpr double kSureOfMany = 5e-12;
/// Negligible rounding of all pieces in closed form together, relative to the volume: the errors of many pieces add up.
constexpr double kSureOfAll = 8e-12;
/// Negligible rounding of second moments about the centroid, relative to these.
constexpr double kSureOfMoments = 5e-11;

using Face = EnclosingPolytope::Face;

/// A polytope with settled corners.
struct Settled {
  const EnclosingPolytope& polytope;
  double misplaced;  ///< m: distance of corners from their faces, beyond rounding

  /// The error of the volume of a part by the places of corners.
  double error(double border) const { return off() * border; }
  /// m: error of the places of corners, seen from a point so far from the inner point.
  double off(double from = 0) const { return 16 * DBL_EPSILON * (polytope.extent() + from) + misplaced; }
};

/// Negligible rounding, relative to the volume, for a piece with so many faces.
double limit(size_t faces, const PieceSetting& setting) { return sliceable(faces) ? setting.sure : kSureOfMany; }

bool sure(const Totals& piece, size_t faces, const PieceSetting& setting, const Totals& totals) {
  const double volume = totals.volume + piece.volume;
  return piece.error <= limit(faces, setting) * volume && totals.error + piece.error <= kSureOfAll * volume;
}

/// Sums over a polytope as tetrahedra between an apex and the triangles of its faces.
struct PolytopeSums {
  Totals piece;
  std::optional<PatchSums> patch;
  double cancelled = 0;  ///< sizes of the products whose difference is an area, times heights
};

/// The area of a face, and ∫ x dA over it.
struct FaceArea {
  double area = 0;
  Vec3 first;
};

/// Only rounding makes a tetrahedron negative. In a needle, a face with a small height has triangles as long as the
/// needle. A face with a large height has small triangles.
FaceArea add_tetrahedra(const EnclosingPolytope& polytope, const Face& face, std::span<const int> ring, Vec3 apex,
                        PatchSums* patch, PolytopeSums& sums) {
  const double height = face.slack - dot(face.normal, apex);
  FaceArea of_face;
  for (size_t i = 2; i < ring.size(); ++i) {
    const Vec3 a = polytope.corners[ring[0]].at, b = polytope.corners[ring[i - 1]].at;
    const Vec3 c = polytope.corners[ring[i]].at;
    const double triangle = 0.5 * dot(face.normal, cross(b - a, c - a)), tetrahedron = height / 3 * triangle;
    of_face.area += triangle, of_face.first += triangle / 3 * (a + b + c);
    sums.cancelled += std::abs(height) * std::sqrt(norm2(b - a) * norm2(c - a));
    if (patch) patch->add_triangle(a, b, c, triangle * face.normal);
    const Vec3 sum = apex + a + b + c;
    sums.piece.volume += tetrahedron;
    sums.piece.first += tetrahedron / 4 * sum;
    for (const Vec3 p : {apex, a, b, c, sum}) {
      sums.piece.squares += tetrahedron / 20 * scaled(p, p);
      sums.piece.products += tetrahedron / 20 * Vec3{p.y * p.z, p.z * p.x, p.x * p.y};
    }
  }
  return of_face;
}

bool add_polytope(const Settled& settled, const DistinctWalls& distinct, const PieceSetting& setting, Sums& sums) {
  const EnclosingPolytope& polytope = settled.polytope;
  PolytopeSums of_piece{{}, sums.patch};
  Totals& piece = of_piece.piece;
  const Vec3 apex = polytope.corners[0].at;
  bool closed = true;
  polytope.for_faces([&](const Face& face, std::span<const int> ring) {
    const int owner = distinct.owner_at(face.wall);
    if (owner == DistinctWalls::kNobody) {
      closed = false;
      return;
    }
    PatchSums* patch = of_piece.patch && owner == setting.view.owner ? &*of_piece.patch : nullptr;
    const auto [area, first] = add_tetrahedra(polytope, face, ring, apex, patch, of_piece);
    const Vec3 force = area * face.normal;
    piece.border += std::abs(area);
    piece.add_area(owner, area);
    if (owner != slicing::kCut) piece.unbalanced += force;
    if (owner == 0) piece.pull += force, piece.moment += cross(first, face.normal);
  });
  piece.error = settled.error(piece.border) + DBL_EPSILON * of_piece.cancelled;
  if (!closed || !sure(piece, polytope.faces.size(), setting, sums.totals)) return false;
  sums.totals.add(piece);
  sums.patch = of_piece.patch;
  return true;
}

/// The common part of a round and a polytope, about a centre, in the axes after `turn`.
struct RoundPart {
  int owner;  ///< of the round
  Pull curved;
  double whole_area;
  std::span<const Plane> planes;
  std::span<const int> owners;  ///< of the planes
  std::span<const quadric::Section> sections;
  Mat3 turn;
  Vec3 centre;
};

/// Adds forces and areas of the curved part and of the sections. False if a section has no owner.
bool add_surface(const RoundPart& part, Totals& piece) {
  piece.area = piece.border = part.whole_area;
  const auto turned = [&](Vec3 v) { return apply_transposed(part.turn, v); };
  const auto act = [&](int body, const Pull& local) {
    const Vec3 force = turned(local.force);
    if (body == 0) piece.pull += force, piece.moment += turned(local.moment) + cross(part.centre, force);
    if (body != slicing::kCut) piece.unbalanced += force;
  };
  act(part.owner, part.curved);
  double of_planes = 0, of_first = 0;
  for (size_t f = 0; f < part.owners.size(); ++f) {
    const quadric::Section& section = part.sections[f];
    const int owner = part.owners[f];
    if (section.area == 0) continue;
    if (owner == DistinctWalls::kNobody) return false;
    act(owner, {section.area * part.planes[f].normal, cross(section.first, part.planes[f].normal)});
    if (owner == slicing::kCut) piece.area -= section.area;
    if (owner == 0) of_first += section.area;
    of_planes += section.area;
  }
  piece.first_area = of_first + (part.owner == 0 ? part.whole_area - of_planes : 0);
  return true;
}

/// Adds part of a round. `piece` has its volume, moments and error in the part's own coordinates.
bool add_round_part(const RoundPart& part, const Settled& settled, const PieceSetting& setting, Totals& piece,
                    Totals& totals) {
  const bool nothing = std::ranges::none_of(part.sections, [](const quadric::Section& s) { return s.area != 0; });
  if (!(piece.volume > 0)) return piece.volume == 0 && nothing;
  if (!add_surface(part, piece)) return false;
  piece.error += settled.error(piece.border);
  const Moments about_centre = piece.along({part.turn.row0, part.turn.row1, part.turn.row2});
  const Vec3 mean = piece.first / piece.volume;
  static_cast<Moments&>(piece) = about_centre.seen_from(part.centre);
  // Second moments lose more digits the farther the part is from the centre, relative to the width of all pieces.
  const Vec3 s = totals.squares + piece.squares, first = totals.first + piece.first;
  const double about_mean = s.x + s.y + s.z - norm2(first) / (totals.volume + piece.volume);
  if (!(piece.error * norm2(mean) <= kSureOfMoments * about_mean)) return false;
  if (!sure(piece, part.planes.size(), setting, totals)) return false;
  totals.add(piece);
  return true;
}

/// The surface of a part of a round is closed. The other surfaces, seen from behind, therefore have the same
/// integrals as its curved part.
void add_to_patch(const RoundPart& part, const PatchView& view, PatchSums& patch) {
  const bool rest = part.owner == view.owner;
  quadric::SectionView of_part = view.about(part.centre, part.turn);
  if (rest) of_part.normal = -of_part.normal;
  for (size_t f = 0; f < part.owners.size(); ++f) {
    const quadric::Section& s = part.sections[f];
    if (s.area == 0 || (part.owners[f] == view.owner) == rest) continue;
    of_part.add(s, part.planes[f].normal, patch);
  }
}

struct CylinderScratch {
  quadric::Rings rings;
  std::vector<int> owners;
};

bool add_cylinder(const Round& cylinder, const Settled& settled, const DistinctWalls& distinct,
                  const PieceSetting& setting, Sums& sums) {
  const EnclosingPolytope& polytope = settled.polytope;
  const Scratch<CylinderScratch> scratch;
  quadric::Rings& rings = scratch->rings;
  std::vector<int>& owners = scratch->owners;
  const Vec3 axis = rounded(cylinder.axis), across = any_orthogonal(axis);
  const Mat3 turn{across, cross(axis, across), axis};
  const Vec3 centre = rounded(slicing::foot(cylinder));
  rings.clear(), owners.clear();
  for (const EnclosingPolytope::Corner& corner : polytope.corners) rings.add_corner(turn * (corner.at - centre));
  polytope.for_faces([&](const Face& face, std::span<const int> ring) {
    rings.add_face({turn * face.normal, face.slack - dot(face.normal, centre)}, ring);
    owners.push_back(distinct.owner_at(face.wall));
  });
  const auto found = quadric::measure_cylinder(rings, cylinder.radius, settled.off(norm(centre)));
  if (!found || !(found->volume >= 0)) return false;
  Totals piece;
  static_cast<Moments&>(piece) = *found, piece.error = found->error;
  const RoundPart part{cylinder.owner, found->curved, found->whole_area, rings.planes(), owners, found->sections,
                       turn,           centre};
  if (!add_round_part(part, settled, setting, piece, sums.totals)) return false;
  if (sums.patch) add_to_patch(part, setting.view, *sums.patch);
  return true;
}

/// A polytope about the centre of a ball.
struct AboutBall {
  std::vector<Vec3> corners;
  std::vector<Plane> planes;
  std::vector<Edge> edges;
  std::vector<int> owners;
  double misplaced = 0;  ///< m: distance of corners from their planes
  std::vector<std::array<int, 3>> number;
  std::vector<int> left;

  /// Lengths up to `nothing` are rounding. The centre may be a corner of the polytope, on several of its faces. All
  /// edges at a corner end at the same place.
  void become(const EnclosingPolytope& polytope, const DistinctWalls& distinct, Vec3 centre, double nothing) {
    corners.clear(), planes.clear(), edges.clear(), owners.clear(), misplaced = 0;
    polytope.number_faces(number, left);
    for (const int f : left) {
      const Face& face = polytope.faces[f];
      const double offset = face.slack - dot(face.normal, centre);
      planes.push_back({face.normal, std::abs(offset) <= nothing ? 0 : offset});
      owners.push_back(distinct.owner_at(face.wall));
    }
    for (int i = 0; i < static_cast<int>(polytope.corners.size()); ++i)
      add_corner(i, polytope.corners[i], centre, nothing);
  }

 private:
  void add_corner(int i, const EnclosingPolytope::Corner& corner, Vec3 centre, double nothing) {
    int through = 0;
    for (int k = 0; k < 3; ++k) {
      const int face = number[i][k];
      through += planes[face].offset == 0;
      if (corner.beside[k] > i) edges.push_back({i, corner.beside[k], face, number[i][(k + 2) % 3]});
    }
    const Vec3 at = corner.at - centre;
    corners.push_back(through == 3 && norm(at) <= 1e3 * nothing ? Vec3{} : at);
    for (const int face : number[i]) {
      const auto& [normal, offset] = planes[face];
      const DoubleDouble off = dot(wide(normal), wide(corners.back())) - DoubleDouble{offset};
      misplaced = std::max(misplaced, std::abs(off.head));
    }
  }
};

/// True also if the common part is empty.
bool add_ball(const Round& ball, const Settled& settled, const DistinctWalls& distinct, const PieceSetting& setting,
              Sums& sums) {
  const EnclosingPolytope& polytope = settled.polytope;
  const Scratch<AboutBall> about;
  const Vec3 centre = rounded(ball.centre);
  const double nothing = 16 * DBL_EPSILON * (polytope.extent() + norm(centre));
  about->become(polytope, distinct, centre, nothing);
  const size_t faces = about->planes.size();
  const auto found = quadric::measure_ball({about->corners, about->planes, about->edges, faces, about->misplaced}, {},
                                           ball.radius, sums.patch.has_value());
  if (!found || found->sections.empty()) return true;
  // The surface of a convex set is smaller than the surface of a convex set around it, unless a turn is wrong.
  if (!(found->volume >= 0 && found->area <= (1 + 1e-9) * polytope.surface())) return false;
  Totals piece;
  static_cast<Moments&>(piece) = *found, piece.error = found->error + nothing * found->area;
  // A wrong direction changes the area of a small ball before it changes the volume.
  if (!(piece.error <= limit(faces, setting) * ball.radius * (sums.totals.area + found->area))) return false;
  const RoundPart part{ball.owner,    {-found->flat, {}}, found->area, about->planes,
                       about->owners, found->sections,    {},          centre};
  if (!add_round_part(part, settled, setting, piece, sums.totals)) return false;
  if (sums.patch) add_to_patch(part, setting.view, *sums.patch);
  return true;
}

}  // namespace

bool add_in_polytope(const Round* round, EnclosingPolytope& polytope, const DistinctWalls& distinct,
                     const PieceSetting& setting, Sums& sums) {
  const Settled settled{polytope, polytope.settle()};
  if (!round) return add_polytope(settled, distinct, setting, sums);
  if (round->ball) return add_ball(*round, settled, distinct, setting, sums);
  return add_cylinder(*round, settled, distinct, setting, sums);
}

}  // namespace overlapper::pieces
