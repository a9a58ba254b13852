#include "methods/round/pieces/measure.h"

#include <algorithm>
#include <cfloat>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <vector>

#include "geometry/cancellation.h"
#include "geometry/scratch.h"
#include "methods/round/pieces/culling.h"
#include "methods/round/quadric/ball.h"
#include "methods/round/quadric/cylinder.h"
#include "methods/round/slicing/nodes.h"
#include "methods/round/slicing/quadrature.h"
#include "methods/round/slicing/stack.h"

namespace overlapper::pieces {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// The fraction of a volume that may stay open before rules are made finer.
constexpr double kClosed = 1e-12;
/// Of what else is measured, the fraction beside which one of many pieces may be open: what they leave open adds up.
constexpr double kShare = 0.02;
/// The fraction of a volume up to which the rounding of a polytope's corners does not matter.
constexpr double kSure = 5e-13;
/// The same where there are more walls than slices may have, and of all that is measured in closed form: of many
/// pieces, each would be sure enough.
constexpr double kSureOfMany = 5e-12, kSureOfAll = 8e-12;
/// The same as the first of second moments about the centroid.
constexpr double kSureOfMoments = 5e-11;
/// The fraction of a piece that may stay open where its centroid tells whether it lies outside.
constexpr double kTold = 1e-6;
/// Sums of area vectors are right to this fraction of the area.
constexpr double kSummation = 16 * DBL_EPSILON;

/// The sine between two walls up to which lines that doubles hold leave too much open of where they cross, and to how
/// many pairs of such what they bound is cut there: each makes two of a piece.
constexpr double kFolded = 1e-10;
constexpr size_t kMostFolds = 3;
/// Of the size, how far from each other planes may be that are counted from beside one of them.
constexpr double kOneSlab = 1e-6;

/// Whether slices are to have so many walls: of more, they take long, by the cube of their number.
bool sliceable(size_t walls) { return walls <= 28; }

/// Integrals in the axes of the world, about the point inside.
struct Totals : Moments {
  double error = 0, area = 0, area_error = 0;
  double first_area = 0;  ///< m²: of the first body's surface
  double border = 0;      ///< m²: the area of all that area vectors are the sums of
  double open = 0;        ///< m³: what may be missing of pieces whose area vectors do not sum to zero
  Moments sizes;          ///< of the terms of an ellipsoid's moments
  Vec3 pull, moment;
  Vec3 unbalanced;  ///< the sum of both bodies' area vectors: zero if no piece is missing

  void add(const Totals& piece) {
    Moments::operator+=(piece);
    error += piece.error, area += piece.area, border += piece.border, open += piece.open;
    first_area += piece.first_area;
    pull += piece.pull, moment += piece.moment, unbalanced += piece.unbalanced;
  }
};

/// Of coordinates (x, y, t).
Vec3 in_world(const slicing::Stack& stack, Vec3 v) { return v.x * stack.l + v.y * stack.m + v.z * stack.t; }

/// What a patch is seen in, in the coordinates that are measured in: u and v there, and what an area vector adds.
struct Seen {
  double u0 = 0, v0 = 0;
  Vec3 u, v, normal;

  Seen() = default;
  explicit Seen(const PatchSums& patch)
      : u0(-dot(patch.origin(), patch.u())),
        v0(-dot(patch.origin(), patch.v())),
        u(patch.u()),
        v(patch.v()),
        normal(patch.normal()) {}
};

class Measuring {
 public:
  /// False if it gives up.
  bool add(std::span<const Round> rounds, std::span<const Wall> walls) {
    if (rounds.size() == 2 && rounds[0].ball && rounds[1].ball) return add_balls(rounds, walls);
    rounds_.assign(rounds.begin(), rounds.end());
    walls_.clear();
    for (const Wall& wall : walls) {
      const int cuts = side_of(wall);
      if (cuts > 0) return true;
      if (cuts == 0 && !nicks(wall)) walls_.push_back(wall);
    }
    if (flat()) return true;
    drop_repeated();
    if (folded_)
      if (const std::optional<Fold> fold = find_fold()) return add_beside(*fold);
    drop_around();
    if (rounds_.size() == 1 && rounds_[0].ball && walls_.size() <= 1) {
      add_cap(rounds_[0], walls_.empty() ? nullptr : &walls_[0]);
      return true;
    }
    if (!around) return add_stack();
    // Axes of slices are chosen by what is near the point that coordinates count from.
    const Vec3 middle = around->middle();
    if (const auto rushing = slicing::rushing(rounds_, walls_, middle); !rushing.empty()) return add_slabs(rushing);
    if (!around->excludes({})) return add_stack();
    // Beside the point inside, a shallow piece has more digits about that than about the middle of what encloses it.
    return (norm(middle) <= around->reach(middle) && add_surely()) || add_about(middle);
  }

  /// Takes the walls of a polytope and finds out which of them are one; false if there is nothing between them.
  bool take(std::span<const Wall> walls) {
    walls_.assign(walls.begin(), walls.end());
    if (flat()) return false;
    find_repeated();
    return true;
  }

  /// The one of the walls taken that tells whose the surface in the plane of a wall is; of any other, itself.
  int telling(int wall) const {
    while (wall < static_cast<int>(instead_.size()) && instead_[wall] != kItself) wall = instead_[wall];
    return wall;
  }

  /// In closed form, what a polytope, whose faces tell which of the walls taken they are, and one round at most share.
  /// False, and nothing is added, if doubles are not sure of it to a fraction of the whole that matters.
  bool add_in_closed_form(const Round* round, const EnclosingPolytope& polytope) {
    if (!round) return add_polytope(polytope);
    return round->ball ? add_ball(*round, polytope) : add_cylinder(*round, polytope);
  }

  Totals totals;
  const quadric::Stretch* stretch = nullptr;  ///< of an ellipsoid: from the ball and the planes that are added
  double extent = 0;                          ///< m: no point of the common set is farther from the one inside
  const EnclosingPolytope* common = nullptr;  ///< what lies outside of that belongs to no piece
  const EnclosingPolytope* around = nullptr;  ///< a polytope that holds all of the next piece, if known
  bool closely = false;                       ///< looks at all of every interval
  double layer = 0;                           ///< m: planes no farther from each other are one
  double surface = 0;                         ///< m²: of the common set, where there are such layers
  PatchSums* patch = nullptr;                 ///< if wanted, of what belongs to `owner`
  Seen seen;                                  ///< of that
  int owner = 0;

 private:
  /// 1 if a wall leaves nothing of one of the rounds, -1 if it leaves all of one, beyond rounding.
  int side_of(const Wall& wall) const {
    int side = 0;
    for (const Round& r : rounds_) {
      const Vec3 n = rounded(wall.normal);
      const double at = dot(n, rounded(r.centre)) - wall.slack.head;
      double reach = r.radius;
      if (!r.ball) {
        const double along = dot(n, rounded(r.axis));
        // The borders of a piece are walls as well, and orthogonal to the axis: these must stay.
        if (1 - along * along < 1e-20) continue;
        reach = r.radius * std::sqrt(1 - along * along) + std::abs(along) * r.half_length;
      }
      const double margin = 1e-13 * (std::abs(at) + reach);
      if (at - reach > margin) return 1;
      if (at + reach < -margin) side = -1;
    }
    return side;
  }

  /// Whether a wall touches a ball, but for a disc that is nothing beside the whole: slices would see it come and go
  /// by rounding. What it cuts off counts as an error.
  bool nicks(const Wall& wall) {
    const auto cut_off = [&](const Round& r) {
      const Vec3 n = rounded(wall.normal), c = rounded(r.centre);
      const double rounding = 4 * DBL_EPSILON * (std::abs(wall.slack.head) + norm(c) + r.radius);
      const double height = std::max(0.0, dot(n, c) - wall.slack.head + r.radius) + rounding;
      const double disc = 2 * std::numbers::pi * r.radius * height;
      return disc * extent <= kSure * totals.volume ? disc * height : kInfinity;
    };
    double least = kInfinity;
    for (const Round& r : rounds_)
      if (r.ball) least = std::min(least, cut_off(r));
    if (!(least < kInfinity)) return false;
    totals.error += least;
    return true;
  }

  /// Whether two planes are one within what is enclosed, their slacks that far from each other and the difference of
  /// their normals that long. Where one takes the other's place that is not, what lies between them counts as an error.
  bool coincide(double apart, double tilt) {
    if (apart <= 1e-24 * extent && tilt <= 1e-24) return true;
    const double gap = apart + tilt * extent;
    if (!(gap <= layer)) return false;
    totals.error += gap * surface;
    return true;
  }

  /// Calls `use(i, j)` with every two different walls whose normals may be opposite, for `side` -1, or equal, for 1:
  /// both ways round, and until it returns true. Such are equally long along a line that no body prefers; of many
  /// walls, by that, only those next to each other are looked at.
  template <class Use>
  bool any_two(double side, Use use) {
    constexpr Vec3 kAcross{0.3141, 0.5926, 0.7417};
    const double equal = std::max(1e-12, 2 * layer / extent);  // beyond the rounding of these lengths
    constexpr size_t kMany = 24;
    by_length_.clear();
    for (int i = 0; i < static_cast<int>(walls_.size()); ++i)
      by_length_.push_back({dot(kAcross, rounded(walls_[i].normal)), i});
    const bool many = walls_.size() > kMany;
    if (many) std::ranges::sort(by_length_);
    for (const auto& [length, i] : by_length_) {
      const double least = side * length - equal, most = side * length + equal;
      auto other = many ? std::ranges::lower_bound(by_length_, std::pair{least, -1}) : by_length_.begin();
      for (; other != by_length_.end() && !(many && other->first > most); ++other)
        if (other->first >= least && other->first <= most && other->second != i &&
            use(walls_[i], walls_[other->second]))
          return true;
    }
    return false;
  }

  /// Whether two walls face each other in one plane, so that there is nothing between them.
  bool flat() {
    return any_two(-1, [&](const Wall& a, const Wall& b) {
      return coincide(std::max(0.0, (a.slack + b.slack).head), norm(rounded(a.normal + b.normal)));
    });
  }

  /// Of walls in one plane, all but one are superseded: by a face rather than a cut, beyond which the next piece is
  /// flat, and of two faces by the inner one, or that of the first body.
  void find_repeated() {
    instead_.assign(walls_.size(), kItself);
    folded_ = false;
    any_two(1, [&](Wall& wall, const Wall& other) {
      if (wall.owner == kSuperseded || other.owner == kSuperseded) return false;
      const bool cut = wall.owner == slicing::kCut, other_is_cut = other.owner == slicing::kCut;
      const double outer = (wall.slack - other.slack).head, tilt = norm(rounded(other.normal - wall.normal));
      const bool first = std::abs(outer) > 1e-24 * extent ? outer > 0 : &other < &wall;
      if (!(cut == other_is_cut ? first : cut)) return false;
      if (coincide(std::abs(outer), tilt)) {
        wall.owner = kSuperseded;
        instead_[&wall - walls_.data()] = static_cast<int>(&other - walls_.data());
      } else {
        folded_ = folded_ || tilt < kFolded;
      }
      return false;
    });
  }

  /// Two walls of nearly one direction, and the cut on whose inner side the first of them is the nearer.
  struct Fold {
    size_t first, second;
    Wall nearer;
  };

  /// Drops walls of nearly one direction as another that is nearer all over, and finds two of which neither is; nothing
  /// where there are too many.
  std::optional<Fold> find_fold() {
    std::optional<Fold> found;
    size_t folds = 0;
    for (size_t i = 0; i < walls_.size(); ++i)
      for (size_t j = i + 1; j < walls_.size(); ++j) {
        const Wall &a = walls_[i], &b = walls_[j];
        const WideVector apart = b.normal - a.normal;
        const DoubleDouble tilt = norm(apart);
        if (!(tilt.head > 1e-24 && tilt.head < kFolded) || (a.owner == slicing::kCut && b.owner == slicing::kCut))
          continue;
        const Fold fold{i, j, {apart / tilt, (b.slack - a.slack) / tilt, slicing::kCut}};
        if (const int nearer = nearer_all_over(fold); nearer != 0) {
          walls_.erase(walls_.begin() + static_cast<std::ptrdiff_t>(nearer > 0 ? j : i));
          return find_fold();
        }
        if (!found) found = fold;
        ++folds;
      }
    return folds <= kMostFolds ? found : std::nullopt;
  }

  /// 1 if of all that the first of two walls leaves it is the nearer, -1 if nowhere, 0 if that is not sure.
  int nearer_all_over(const Fold& fold) const {
    const Vec3 g = rounded(fold.nearer.normal), n = rounded(walls_[fold.first].normal);
    const double slack = fold.nearer.slack.head;
    double most = extent, least = -extent;
    for (const Round& r : rounds_) {
      if (!r.ball) continue;
      // Of the cap that the wall leaves, the rim reaches farthest, but where the ball itself does.
      const Vec3 c = rounded(r.centre);
      const double level = (walls_[fold.first].slack - dot(walls_[fold.first].normal, r.centre)).head, up = dot(g, n);
      const double rim = std::sqrt(std::max(0.0, (r.radius - level) * (r.radius + level)));
      const double across = std::sqrt(std::max(0.0, 1 - up * up)), middle = dot(g, c);
      const auto reach = [&](double side) {
        return side * up * r.radius <= level ? r.radius : side * up * level + rim * across;
      };
      most = std::min(most, middle + reach(1)), least = std::max(least, middle - reach(-1));
    }
    const double margin = 1e-9 * (most - least) + 1e-13 * extent;
    return slack > most + margin ? 1 : slack < least - margin ? -1 : 0;
  }

  /// What two walls leave is what the one leaves where it is the nearer, and what the other leaves on the rest.
  bool add_beside(const Fold& fold) {
    const std::vector<Round> rounds = rounds_;
    const std::vector<Wall> walls = walls_;
    for (const bool first : {true, false}) {
      std::vector<Wall> with = walls;
      with[first ? fold.second : fold.first] =
          first ? fold.nearer : Wall{-fold.nearer.normal, -fold.nearer.slack, slicing::kCut};
      if (!add(rounds, with)) return false;
    }
    return true;
  }

  int owner_at(int wall) const { return wall == kNoWall ? kNobody : walls_[telling(wall)].owner; }

  /// One wall per plane: two lines that are one cross nowhere, or, by rounding, anywhere.
  void drop_repeated() {
    find_repeated();
    std::erase_if(walls_, [](const Wall& wall) { return wall.owner == kSuperseded; });
  }

  /// A cylinder that holds the other round leaves all of it, and where it touches that from outside along a line,
  /// slices would show nothing but rounding. What sticks out counts as an error.
  void drop_around() {
    if (rounds_.size() < 2) return;
    for (int i = 0; i < 2; ++i) {
      const Round &outer = rounds_[i], &inner = rounds_[1 - i];
      if (outer.ball) continue;
      WideVector between = inner.centre - outer.centre;
      between = between - dot(between, outer.axis) * outer.axis;
      const double tilt = inner.ball ? 0 : norm(rounded(cross(outer.axis, inner.axis)));
      if (tilt > 1e-24) continue;
      const double beyond = (norm(between) + DoubleDouble{inner.radius} - DoubleDouble{outer.radius}).head;
      if (beyond > 1e-14 * inner.radius) continue;
      const double length = inner.ball ? 2 * inner.radius : 2 * inner.half_length;
      totals.error += std::max(0.0, beyond) * 2 * std::numbers::pi * inner.radius * length;
      rounds_.erase(rounds_.begin() + i);
      return;
    }
  }

  /// A ball that one plane cuts, or none: in closed form, about the point of the cap that is farthest from the plane.
  void add_cap(const Round& ball, const Wall* wall) {
    const double r = ball.radius;
    const WideVector normal = wall ? wall->normal : wide(Vec3{0, 0, 1});
    const double height =
        wall ? (DoubleDouble{r} + wall->slack - dot(normal, ball.centre)).head : 2 * r;  // without cancellation
    const Vec3 n = rounded(normal), tip = rounded(ball.centre - DoubleDouble{r} * normal);
    const double h2 = height * height, h3 = h2 * height, pi = std::numbers::pi;
    const double volume = pi * h2 * (r - height / 3), first = pi * h3 * (2 * r / 3 - height / 4);
    if (outside(tip + first / volume * n)) return;
    const double along = pi * h3 * height * (r / 2 - height / 5);
    const double across = pi / 4 * h3 * (4 * r * r / 3 - r * height + h2 / 5);
    const double disc = wall ? pi * height * (2 * r - height) : 0;
    totals.volume += volume;
    totals.error += 32 * DBL_EPSILON * volume;
    const auto own = [&](int body, double area) {
      if (body != slicing::kCut) totals.area += area;
      if (body == 0) totals.first_area += area;
    };
    if (stretch) {
      const quadric::Stretch::Cap cap = stretch->cap(n, height);
      own(ball.owner, cap.area), totals.area_error += cap.error;
    } else {
      own(ball.owner, 2 * pi * r * height);
    }
    if (wall) own(wall->owner, stretch ? stretch->area(disc * n) : disc);
    totals.border += 2 * pi * r * height + disc;
    totals.first += volume * tip + first * n;
    // What a shallow cap is along its axis is far less than across.
    const auto square = [&](double p, double u, double v, double w) {
      return volume * p * p + 2 * first * p * u + along * u * u + across * (v * v + w * w);
    };
    const auto product = [&](double p, double q, double u, double v) {
      return volume * p * q + first * (p * v + q * u) + (along - across) * u * v;
    };
    totals.squares += {square(tip.x, n.x, n.y, n.z), square(tip.y, n.y, n.z, n.x), square(tip.z, n.z, n.x, n.y)};
    totals.products +=
        {product(tip.y, tip.z, n.y, n.z), product(tip.z, tip.x, n.z, n.x), product(tip.x, tip.y, n.x, n.y)};
    if (stretch) {
      const Vec3 p = abs(tip), u = abs(n), diagonal = scaled(u, u);
      const Vec3 other{diagonal.y + diagonal.z, diagonal.z + diagonal.x, diagonal.x + diagonal.y};
      Moments sizes{volume, first * u + volume * p, {}, {}};
      sizes.squares = volume * scaled(p, p) + 2 * first * scaled(p, u) + along * diagonal + across * other;
      const auto size = [&](double a, double b, double v, double w) {
        return volume * a * b + first * (a * w + b * v) + (along + across) * v * w;
      };
      sizes.products = {size(p.y, p.z, u.y, u.z), size(p.z, p.x, u.z, u.x), size(p.x, p.y, u.x, u.y)};
      totals.sizes += sizes;
    }
    // The force on the ball acts along a line through its centre and the tip.
    const Vec3 force = disc * n, moment = stretch ? stretch->moment(tip + height * n, force) : cross(tip, force);
    const auto act = [&](int body, double side) {
      if (body == 0) totals.pull += side * force, totals.moment += side * moment;
      if (body != slicing::kCut) totals.unbalanced += side * force;
    };
    act(ball.owner, -1);
    if (wall) act(wall->owner, 1);
    if (patch && wall && (ball.owner == owner || wall->owner == owner))
      add_disc_to_patch(tip + height * n, n, ball.owner == owner ? -disc : disc, disc / pi);
  }

  /// A disc of that area, negative where it is seen from behind, and of a radius of which that is the square.
  void add_disc_to_patch(Vec3 centre, Vec3 normal, double area, double square) {
    const double w = area * dot(normal, seen.normal), quarter = square / 4;
    const double u = seen.u0 + dot(centre, seen.u), v = seen.v0 + dot(centre, seen.v);
    const auto second = [&](Vec3 p, Vec3 q) { return quarter * (dot(p, q) - dot(p, normal) * dot(q, normal)); };
    patch->add(w, w * u, w * v, w * (u * u + second(seen.u, seen.u)), w * (u * v + second(seen.u, seen.v)),
               w * (v * v + second(seen.v, seen.v)));
  }

  /// What the patch is seen in, in coordinates of the stack.
  slicing::View view_of(const slicing::Stack& stack) const {
    slicing::View view;
    view.owner = owner;
    view.rest = stack.ball >= 0 && stack.quadric[stack.ball].owner == owner;
    view.u0 = seen.u0 + dot(offset_, seen.u), view.v0 = seen.v0 + dot(offset_, seen.v);
    view.u = {dot(stack.l, seen.u), dot(stack.m, seen.u), dot(stack.t, seen.u)};
    view.v = {dot(stack.l, seen.v), dot(stack.m, seen.v), dot(stack.t, seen.v)};
    const double side = view.rest ? -1 : 1;
    view.normal = side * Vec3{dot(stack.l, seen.normal), dot(stack.m, seen.normal), dot(stack.n, seen.normal)};
    return view;
  }

  /// What rounding has done to the volume of what corners bound that cuts have made.
  static double rounding_of(const EnclosingPolytope& polytope, double border) {
    return 16 * DBL_EPSILON * polytope.extent() * border;
  }

  /// No tetrahedron is negative, but by rounding.
  bool add_polytope(const EnclosingPolytope& polytope) {
    Totals piece;
    std::optional<PatchSums> with_piece;
    if (patch) with_piece = *patch;
    const Vec3 apex = polytope.corners[0].at;
    double cancelled = 0;  // of products that areas are the differences of, times heights
    bool closed = true;
    polytope.for_faces([&](const EnclosingPolytope::Face& face, std::span<const int> ring) {
      const int of_wall = owner_at(face.wall);
      if (of_wall == kNobody) {
        closed = false;
        return;
      }
      // Across a needle, the height is small, while its triangles are as long as it: along it, the other way round.
      const double height = face.slack - dot(face.normal, apex);
      double area = 0;
      Vec3 first;
      for (size_t i = 2; i < ring.size(); ++i) {
        const Vec3 a = polytope.corners[ring[0]].at, b = polytope.corners[ring[i - 1]].at;
        const Vec3 c = polytope.corners[ring[i]].at;
        const double triangle = 0.5 * dot(face.normal, cross(b - a, c - a)), tetrahedron = height / 3 * triangle;
        area += triangle, first += triangle / 3 * (a + b + c);
        cancelled += std::abs(height) * std::sqrt(norm2(b - a) * norm2(c - a));
        if (with_piece && of_wall == owner) with_piece->add_triangle(a, b, c, triangle * face.normal);
        const Vec3 sum = apex + a + b + c;
        piece.volume += tetrahedron;
        piece.first += tetrahedron / 4 * sum;
        for (const Vec3 p : {apex, a, b, c, sum}) {
          piece.squares += tetrahedron / 20 * scaled(p, p);
          piece.products += tetrahedron / 20 * Vec3{p.y * p.z, p.z * p.x, p.x * p.y};
        }
      }
      const Vec3 force = area * face.normal;
      piece.border += area;
      if (of_wall != slicing::kCut) piece.area += area, piece.unbalanced += force;
      if (of_wall == 0) piece.pull += force, piece.moment += cross(first, face.normal), piece.first_area += area;
    });
    piece.error = rounding_of(polytope, piece.border) + DBL_EPSILON * cancelled;
    if (!closed || !sure(piece, polytope.faces.size())) return false;
    totals.add(piece);
    if (patch) *patch = *with_piece;
    return true;
  }

  /// Of what so many faces bound, the fraction of a volume up to which rounding does not matter.
  static double limit(size_t faces) { return sliceable(faces) ? kSure : kSureOfMany; }
  bool sure(const Totals& piece, size_t faces) const {
    const double volume = totals.volume + piece.volume;
    return piece.error <= limit(faces) * volume && totals.error + piece.error <= kSureOfAll * volume;
  }

  bool add_cylinder(const Round& cylinder, const EnclosingPolytope& polytope) {
    const Vec3 axis = rounded(cylinder.axis), across = any_orthogonal(axis);
    const Mat3 turn{across, cross(axis, across), axis};
    const Vec3 centre = rounded(slicing::foot(cylinder));
    rings_.clear(), owners_.clear();
    for (const EnclosingPolytope::Corner& corner : polytope.corners) rings_.add_corner(turn * (corner.at - centre));
    polytope.for_faces([&](const EnclosingPolytope::Face& face, std::span<const int> ring) {
      rings_.add_face({turn * face.normal, face.slack - dot(face.normal, centre)}, ring);
      owners_.push_back(owner_at(face.wall));
    });
    const auto part = quadric::measure_cylinder(rings_, cylinder.radius);
    if (!part || !(part->volume >= 0)) return false;
    Totals piece;
    static_cast<Moments&>(piece) = *part, piece.error = part->error;
    if (!add_part(cylinder.owner, part->curved, part->whole_area, rings_.planes(), part->sections, turn, centre,
                  polytope, piece))
      return false;
    if (patch) add_to_patch(cylinder, *part, turn, centre);
    return true;
  }

  /// The centre may be a corner of the polytope, where faces that go through it meet.
  bool add_ball(const Round& ball, const EnclosingPolytope& polytope) {
    if (patch) return false;
    const Vec3 centre = rounded(ball.centre);
    const double nothing = 16 * DBL_EPSILON * (polytope.extent() + norm(centre));
    corners_.clear(), planes_.clear(), edges_.clear(), owners_.clear();
    polytope.number_faces(number_, left_);
    for (const int f : left_) {
      const EnclosingPolytope::Face& face = polytope.faces[f];
      const double offset = face.slack - dot(face.normal, centre);
      planes_.push_back({face.normal, std::abs(offset) <= nothing ? 0 : offset});
      owners_.push_back(owner_at(face.wall));
    }
    double misplaced = 0;  // by how much corners miss their planes: all edges of a corner end where that is
    for (size_t i = 0; i < polytope.corners.size(); ++i) {
      const EnclosingPolytope::Corner& corner = polytope.corners[i];
      int through = 0;
      for (int k = 0; k < 3; ++k) {
        const int left = number_[i][k];
        through += planes_[left].offset == 0;
        if (corner.beside[k] > static_cast<int>(i))
          edges_.push_back({static_cast<int>(i), corner.beside[k], left, number_[i][(k + 2) % 3]});
      }
      const Vec3 at = corner.at - centre;
      corners_.push_back(through == 3 && norm(at) <= 1e3 * nothing ? Vec3{} : at);
      for (const int left : number_[i]) {
        const auto& [normal, offset] = planes_[left];
        const DoubleDouble off = dot(wide(normal), wide(corners_.back())) - DoubleDouble{offset};
        misplaced = std::max(misplaced, std::abs(off.head));
      }
    }
    const auto part = quadric::measure_ball({corners_, planes_, edges_, planes_.size(), misplaced}, {}, ball.radius);
    if (!part || part->sections.empty()) return true;  // nothing
    // What is convex has less surface than what is convex around it, but for a wrong turn.
    if (!(part->volume >= 0 && part->area <= (1 + 1e-9) * polytope.surface())) return false;
    Totals piece;
    static_cast<Moments&>(piece) = *part, piece.error = part->error + nothing * part->area;
    // Of a small ball, a direction that is wrong matters to the area before it does to the volume.
    if (!(piece.error <= limit(planes_.size()) * ball.radius * (totals.area + part->area))) return false;
    return add_part(ball.owner, {-part->flat, {}}, part->area, planes_, part->sections, {}, centre, polytope, piece);
  }

  /// Of part of a round, what is the same for all: `piece` has its volume and the integrals over that about a centre,
  /// in axes that `turn` turns to. Area vectors and the integrals of sections are about the same.
  bool add_part(int round_owner, const Pull& curved, double whole_area, std::span<const Plane> planes,
                std::span<const quadric::Section> sections, const Mat3& turn, Vec3 centre,
                const EnclosingPolytope& polytope, Totals& piece) {
    piece.area = piece.border = whole_area;
    const auto turned = [&](Vec3 v) { return apply_transposed(turn, v); };
    const auto act = [&](int body, const Pull& local) {
      const Vec3 force = turned(local.force);
      if (body == 0) piece.pull += force, piece.moment += turned(local.moment) + cross(centre, force);
      if (body != slicing::kCut) piece.unbalanced += force;
    };
    const bool nothing = std::ranges::none_of(sections, [](const quadric::Section& s) { return s.area != 0; });
    if (!(piece.volume > 0)) return piece.volume == 0 && nothing;
    act(round_owner, curved);
    double of_planes = 0, of_first = 0;
    for (size_t f = 0; f < owners_.size(); ++f) {
      const quadric::Section& section = sections[f];
      if (section.area == 0) continue;
      if (owners_[f] == kNobody) return false;
      act(owners_[f], {section.area * planes[f].normal, cross(section.first, planes[f].normal)});
      if (owners_[f] == slicing::kCut) piece.area -= section.area;
      if (owners_[f] == 0) of_first += section.area;
      of_planes += section.area;
    }
    piece.first_area = of_first + (round_owner == 0 ? whole_area - of_planes : 0);
    piece.error += rounding_of(polytope, piece.border);
    const Moments about_centre = piece.along({turn.row0, turn.row1, turn.row2});
    const Vec3 mean = piece.first / piece.volume;
    static_cast<Moments&>(piece) = about_centre.seen_from(centre);
    // Second moments lose as much more as the part is farther from the centre than all, up to here, is wide.
    const Vec3 s = totals.squares + piece.squares, first = totals.first + piece.first;
    const double about_mean = s.x + s.y + s.z - norm2(first) / (totals.volume + piece.volume);
    if (!(piece.error * norm2(mean) <= kSureOfMoments * about_mean)) return false;
    if (!sure(piece, planes.size())) return false;
    totals.add(piece);
    return true;
  }

  /// The surface of a part of a cylinder is closed: from behind, the others show what its curved part does.
  void add_to_patch(const Round& cylinder, const quadric::CylinderPart& part, const Mat3& turn, Vec3 centre) {
    const bool rest = cylinder.owner == owner;
    const Vec3 u = turn * seen.u, v = turn * seen.v, normal = (rest ? -1.0 : 1.0) * (turn * seen.normal);
    const double u0 = seen.u0 + dot(centre, seen.u), v0 = seen.v0 + dot(centre, seen.v);
    for (size_t f = 0; f < owners_.size(); ++f) {
      const quadric::Section& s = part.sections[f];
      if (s.area == 0 || (owners_[f] == owner) == rest) continue;
      const double w = dot(rings_.planes()[f].normal, normal), a = s.area, fu = dot(s.first, u), fv = dot(s.first, v);
      const auto second = [&](Vec3 p, Vec3 q) {
        return dot(s.squares, scaled(p, q)) + s.products.x * (p.y * q.z + p.z * q.y) +
               s.products.y * (p.z * q.x + p.x * q.z) + s.products.z * (p.x * q.y + p.y * q.x);
      };
      patch->add(w * a, w * (u0 * a + fu), w * (v0 * a + fv), w * (u0 * (u0 * a + 2 * fu) + second(u, u)),
                 w * (u0 * (v0 * a + fv) + v0 * fu + second(u, v)), w * (v0 * (v0 * a + 2 * fv) + second(v, v)));
    }
  }

  /// Where the radical plane parts two balls, the common set is the part of either ball beyond it.
  bool add_balls(std::span<const Round> rounds, std::span<const Wall> walls) {
    const Round &a = rounds[0], &b = rounds[1];
    const WideVector between = a.centre - b.centre;
    const DoubleDouble distance = norm(between);
    const auto power = [](const Round& r) {
      const DoubleDouble d = norm(r.centre), radius{r.radius};
      return (d - radius) * (d + radius);
    };
    std::vector<Wall>& with = with_radical_;
    if (!(distance.head > std::abs(a.radius - b.radius))) {
      with.assign(walls.begin(), walls.end());
      return add(std::span(a.radius < b.radius ? &a : &b, 1), with);
    }
    const DoubleDouble slack = (power(a) - power(b)) / (DoubleDouble{2} * distance);
    const WideVector normal = unit(between);
    with.assign(walls.begin(), walls.end());
    with.push_back({normal, slack, slicing::kCut});
    if (!add(std::span(&a, 1), with)) return false;
    with.back() = {-normal, -slack, slicing::kCut};
    return add(std::span(&b, 1), with);
  }

  /// Whether that is the centroid of something that shares nothing with what encloses the common set: pieces whose
  /// walls leave something there are convex, and reach no farther.
  bool outside(Vec3 centroid) const { return common && common->excludes(centroid + offset_); }

  /// Where the surface does not close, slices across other axes hide less of where surfaces pass or touch each other.
  bool add_stack() {
    std::optional<slicing::Stack> stack = slicing::stack_of(rounds_, walls_, extent, 0);
    if (!stack) return false;
    best_.integrals = {};
    double open = kInfinity;
    // Where, closely, more changes than can be told, the middle of every interval says more.
    bool told = look_at(*stack, closely) || (closely && look_at(*stack, false));
    if (told && intervals_.empty()) return true;
    if (told) {
      // Of few nodes, the terms of a stretched area tell too little.
      keep_better(*stack, !stretch, 0, open);
      if (!closed(open, 0.1) && move_near(*stack)) return true;
      keep_best(*stack, open);
    }
    for (int other = 1; other < slicing::kAxes && !closed(open, 2); ++other) {
      std::optional<slicing::Stack> across = slicing::stack_of(rounds_, walls_, extent, other);
      if (!across) break;
      if (!look_at(*across, true) || intervals_.empty()) continue;
      told = true;
      const double before = open;
      keep_best(*across, open);
      if (open < before) stack = across;
    }
    if (!told) return false;
    // Slices of which nothing is sure may be those of another piece.
    const double volume = best_.integrals.volume;
    if (open <= kTold * volume && outside(in_world(*stack, best_.integrals.first) / volume)) return true;
    totals.open += open;
    if (sound(*stack, best_.integrals)) add_sum(*stack, best_);
    else totals.open += std::abs(volume);
    return true;
  }

  /// Whether that is no farther away than anything may be. If not, it is rounding.
  bool sound(const slicing::Stack& stack, const slicing::Integrals& s) const {
    const double far = 8 * extent * (1 + std::abs(stack.shear.x) + std::abs(stack.shear.y)),
                 volume = std::abs(s.volume);
    return norm(s.first) <= far * volume && std::abs(s.squares.x + s.squares.y + s.squares.z) <= far * far * volume;
  }

  /// Makes a stack ready and finds its intervals; false if they cannot be told.
  bool look_at(slicing::Stack& stack, bool all) {
    stack.stretch = stretch;
    if (around) {
      const auto [least, most] = around->range(stack.n);
      const double here = dot(offset_, stack.n), margin = 1e-9 * (most - least) + 1e-13 * extent;
      stack.low = std::max(stack.low, least - here - margin);
      stack.high = std::min(stack.high, most - here + margin);
    }
    if (patch) view_ = view_of(stack), stack.view = &view_;
    return find_intervals(stack, all);
  }

  bool closed(double open, double part = 1) const {
    return open <= part * kClosed * (share_of(totals.volume) + best_.integrals.volume);
  }
  /// What counts of all else where a piece may be open or inexact beside that.
  double share_of(double size) const { return around ? kShare * size : size; }

  /// Returns by what factor less is open than before.
  double keep_better(const slicing::Stack& stack, bool few, double strictness, double& open) {
    const double less = integrate(stack, few, strictness), ratio = less / open;
    if (less < open) open = less, std::swap(best_, sum_);
    return ratio;
  }

  void keep_best(const slicing::Stack& stack, double& open) {
    if (!closed(open) && !stretch) keep_better(stack, false, 0, open);
    // The rules end where the volume is exact. Where areas are not yet, the surface does not close.
    if (!closed(open) && !find_intervals(stack, true)) return;
    for (double strictness = 1; strictness < 1e9 && !closed(open); strictness *= 1e3)
      if (!(keep_better(stack, false, strictness, open) < 0.5) && strictness > 1e3) break;
  }

  /// Coordinates count from a point inside of both bodies. A piece that is small beside its way from there, or as
  /// thin along one of the axes, is measured again from a point of its own; true if so.
  bool move_near(const slicing::Stack& stack) {
    const slicing::Integrals& s = best_.integrals;
    const Vec3 mean = s.first / s.volume, offset = in_world(stack, mean);
    const Vec3 away = scaled(mean, mean), spread = s.squares / s.volume - away;
    const bool far = away.x > 25 * spread.x || away.y > 25 * spread.y || away.z > 25 * spread.z;
    if (moved_ || !far || !(norm(offset) <= extent)) return false;
    moved_ = true;
    const bool done = add_about(offset);
    moved_ = false;
    return done;
  }

  /// Counts from a point `step` away.
  bool add_about(Vec3 step) {
    if (step == Vec3{}) return add_stack();
    for (Round& r : rounds_) r.centre = r.centre - wide(step);
    for (Wall& wall : walls_) wall.slack = wall.slack - dot(wall.normal, wide(step));
    const Vec3 offset = offset_;
    const double usual = extent;
    offset_ += step, extent += norm(step);
    const bool done = add_stack();
    offset_ = offset, extent = usual;
    return done;
  }

  /// Between planes whose lines rush across slices, these are cut, and counted from beside one of them on either side.
  bool add_slabs(std::span<const slicing::Rushing> rushing) {
    const WideVector across = unit(cross(rounds_[0].axis, rounds_[1].axis));
    const std::vector<Round> rounds = rounds_;
    const std::vector<Wall> walls = walls_;
    std::optional<Wall> lower;
    for (size_t first = 0, last; first < rushing.size(); first = last + 1) {
      const auto level = [&](size_t i) { return rushing[i].level; };
      last = first;
      while (last + 1 < rushing.size() && level(last + 1) - level(last) <= kOneSlab * extent) ++last;
      rounds_ = rounds, walls_ = walls;
      if (lower) walls_.push_back(*lower);
      if (last + 1 < rushing.size()) {
        const DoubleDouble middle{level(last) + (level(last + 1) - level(last)) / 2};
        walls_.push_back({across, middle, slicing::kCut});
        lower = {-across, -middle, slicing::kCut};
      }
      if (!add_about(rushing[first].beside)) return false;
    }
    return true;
  }

  /// False, and nothing is added, if slices about the present point are not sure to a fraction of the whole that
  /// matters.
  bool add_surely() {
    const Totals before = totals;
    const std::optional<PatchSums> patch_before = patch ? std::optional(*patch) : std::nullopt;
    const std::vector<Round> rounds = rounds_;
    const std::vector<Wall> walls = walls_;
    if (add_stack() && totals.error + totals.open <= before.error + before.open + kSure * totals.volume) return true;
    totals = before, rounds_ = rounds, walls_ = walls;
    if (patch) *patch = *patch_before;
    return false;
  }

  /// Fills sum_ and returns how much may be missing.
  double integrate(const slicing::Stack& stack, bool few, double strictness) {
    slicing::Sum& sum = sum_;
    sum.integrals = {}, sum.about = sum.error = sum.area_error = 0, sum.rules = 0, sum.samples.clear();
    const double volume = share_of(totals.volume), area = share_of(totals.area);
    const bool sound = slicing::integrate(stack, intervals_, volume, area, few, strictness, sum);
    const slicing::Interval &lowest = intervals_.front(), &highest = intervals_.back();
    if (stack.low_plane && lowest.low == stack.low)
      slicing::add_face(*stack.low_plane, stack, lowest.outline, lowest.low, sum.integrals);
    else if (drawn_low_ >= 0 && !few) add_tip(stack, -1, drawn_low_, lowest.outline, lowest.low);
    if (stack.high_plane && highest.high == stack.high)
      slicing::add_face(*stack.high_plane, stack, highest.outline, highest.high, sum.integrals);
    else if (drawn_high_ >= 0 && !few) add_tip(stack, 1, drawn_high_, highest.outline, highest.high);
    // A piece for which that does not hold is worth its size as an error. It may be rounding alone.
    if (!sound || !(sum.integrals.volume > 0) || !slicing::within_chords(lowest.low, highest.high, sum))
      return 8 * std::abs(sum.about) + std::abs(sum.integrals.volume);
    return open_part(stack, sum.integrals);
  }

  /// Finds the intervals of a stack, and draws them out to where a plane or a quadric ends the stack, before which they
  /// end by no more than rounding: the face there, or what is as wide as the root of how thin it is, belongs to them.
  bool find_intervals(const slicing::Stack& stack, bool all) {
    drawn_low_ = drawn_high_ = -1;
    if (!slicing::find_intervals(stack, all, intervals_)) return false;
    if (intervals_.empty()) return true;
    double &low = intervals_.front().low, &high = intervals_.back().high;
    const double thin = 1e-13 * (stack.high - stack.low);
    const auto reaches = [&](double t, double end) { return std::abs(end - t) <= thin && holds_to(stack, t, end); };
    const auto ended_by = [](const std::optional<slicing::Line>& plane, double t) {
      return plane && plane->offset / plane->rate == t;
    };
    if (ended_by(stack.low_plane, stack.low) && reaches(low, stack.low)) low = stack.low;
    if (ended_by(stack.high_plane, stack.high) && reaches(high, stack.high)) high = stack.high;
    for (int i = 0; i < stack.quadrics; ++i) {
      const slicing::Quadric& q = stack.quadric[i];
      if (stack.low == q.low && reaches(low, stack.low)) low = stack.low, drawn_low_ = q.owner;
      if (stack.high == q.high && reaches(high, stack.high)) high = stack.high, drawn_high_ = q.owner;
    }
    return true;
  }

  /// Whether there is something between where intervals end and where a quadric does.
  static bool holds_to(const slicing::Stack& stack, double t, double end) {
    const double middle = t + (end - t) / 2;
    return t == end || !slicing::outline(slicing::Slice(stack, middle == end ? t : middle)).empty();
  }

  /// What slices that are drawn out to the end of a quadric leave there is a face as thin as rounding.
  void add_tip(const slicing::Stack& stack, int side, int of_owner, const slicing::Outline& outline, double t) {
    slicing::Line line;
    line.rate = side, line.offset = side * t, line.owner = of_owner;
    slicing::add_face(line, stack, outline, t, sum_.integrals);
  }

  /// What may be missing: by how much the volume differs from ∫ t N dA, and what area vectors, which sum to zero over
  /// a closed surface, leave times the size, beyond rounding. Those of lines and of arcs are other integrals over the
  /// same slices, less smooth than the volume.
  static double open_part(const slicing::Stack& stack, const slicing::Integrals& s) {
    const Vec3 left = s.pull[0] + s.pull[1] + s.pull[2];
    const auto part = [&](double sum, double square) {
      return std::max(0.0, std::abs(sum) - kSummation * s.border) * std::sqrt(std::max(0.0, square / s.volume));
    };
    return std::max(0.0, std::abs(s.across - s.volume) - kSummation * s.terms) + part(left.x, s.squares.x) +
           part(left.y, s.squares.y) + part(left.z + stack.shear.x * left.x + stack.shear.y * left.y, s.squares.z);
  }

  void add_sum(const slicing::Stack& stack, const slicing::Sum& sum) {
    const slicing::Integrals& s = sum.integrals;
    const auto turned = [&](Vec3 v) { return v.x * stack.l + v.y * stack.m + v.z * stack.n; };
    totals += s.along({stack.l, stack.m, stack.t}).seen_from(offset_);
    if (stretch)
      totals.sizes += Moments{s.volume, abs(s.first), s.squares, abs(s.products)}
                          .along({abs(stack.l), abs(stack.m), abs(stack.t)})
                          .seen_from(abs(offset_));
    totals.volume += s.correction;
    totals.error += sum.error + 8 * DBL_EPSILON * s.blur + 32 * DBL_EPSILON * s.volume;
    totals.area += s.area, totals.first_area += s.first_area, totals.area_error += sum.area_error;
    totals.border += s.border;
    const Vec3 pull = turned(s.pull[0]);
    totals.pull += pull;
    totals.moment += turned(s.moment[0]) + (stretch ? stretch->moment(offset_, pull) : cross(offset_, pull));
    totals.unbalanced += turned(s.pull[0] + s.pull[1]);
    if (patch) patch->add(s.seen[0], s.seen[1], s.seen[2], s.seen[3], s.seen[4], s.seen[5]);
  }

  static constexpr int kSuperseded = -1;  ///< the owner of a wall that is to go
  static constexpr int kItself = -1;      ///< for a wall that stays
  static constexpr int kNobody = -1;      ///< of a face that no wall makes

  std::vector<Round> rounds_;
  std::vector<Wall> walls_, with_radical_;
  std::vector<std::pair<double, int>> by_length_;  ///< walls, by what their normals are along a line
  std::vector<int> instead_;                       ///< per wall, the one that supersedes it
  bool folded_ = false;                            ///< whether there are two of nearly one direction
  quadric::Rings rings_;
  std::vector<Vec3> corners_;
  std::vector<Plane> planes_;
  std::vector<Edge> edges_;
  std::vector<std::array<int, 3>> number_;
  std::vector<int> left_;
  std::vector<int> owners_;  ///< of the faces of what is measured
  std::vector<slicing::Interval> intervals_;
  slicing::Sum sum_, best_;
  slicing::View view_;
  int drawn_low_ = -1, drawn_high_ = -1;  ///< the owners of quadrics to whose ends intervals are drawn out
  Vec3 offset_;                           ///< of the point that the pieces are about, from the point inside
  bool moved_ = false;                    ///< whether that is another
};

/// The fraction of a volume that may stay open before slices are looked at more closely, or others are.
constexpr double kMostOpen = 1e-11;
/// The fraction of a volume that may lie between planes that are taken for one, and where nothing else closes.
constexpr double kLayer = 1e-12, kWideLayer = 1e-9;
/// Beyond that fraction of a volume, something is wrong. Polytopes of tangent planes take seconds to be as good.
constexpr double kMostError = 1e-8;

/// What may be missing if the area vectors of the whole surface do not sum to zero: they, times the size along them.
double missing(const Totals& totals) {
  const Vec3 u = totals.unbalanced, s = totals.squares, p = totals.products;
  const double square =
      u.x * u.x * s.x + u.y * u.y * s.y + u.z * u.z * s.z + 2 * (u.y * u.z * p.x + u.z * u.x * p.y + u.x * u.y * p.z);
  const double rounding = kSummation * totals.border * std::sqrt((s.x + s.y + s.z) / totals.volume);
  return std::max(0.0, std::sqrt(std::max(0.0, square / totals.volume)) - rounding);
}

/// m²: of a surface whose area vectors, but for rounding, should sum to zero, at least as much is missing.
double astray(Vec3 unbalanced, double border) { return std::max(0.0, norm(unbalanced) - kSummation * border); }

/// What slices measure at once.
struct Part {
  EnclosingPolytope polytope;
  std::vector<Wall> walls;
};

/// Of a polytope whose faces tell which of the walls taken, or of cuts after these, they are: those that have a face
/// there, and those that tell of them.
void find_walls(const Measuring& measuring, std::span<const Wall> walls, Part& part) {
  thread_local std::vector<char> of_thread;
  std::vector<char>& has_face = of_thread;  // every use of what is a thread's own looks for it
  has_face.assign(walls.size(), false);
  for (const EnclosingPolytope::Corner& corner : part.polytope.corners)
    for (const int f : corner.face)
      if (const int w = part.polytope.faces[f].wall; w != kNoWall) has_face[w] = has_face[measuring.telling(w)] = true;
  part.walls.clear();
  for (size_t w = 0; w < walls.size(); ++w)
    if (has_face[w]) part.walls.push_back(walls[w]);
}

/// Cuts parts in two, through the middle and across the axis that leaves the fewest walls to either half, until slices
/// are to have those of each, or no cut leaves fewer. Cuts are added to the walls.
void cut_in_parts(const Measuring& measuring, std::vector<Wall>& walls, std::vector<Part>& parts) {
  for (size_t i = 0; i < parts.size();) {
    size_t fewest = parts[i].walls.size();
    std::array<Part, 2> best;
    const auto [lower, upper] = parts[i].polytope.bounds();
    const Vec3 middle = 0.5 * (lower + upper);
    for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
      if (sliceable(parts[i].walls.size())) break;
      cancellation_point();
      std::array<Part, 2> halves{parts[i], parts[i]};
      size_t most = 0;
      for (const int side : {0, 1}) {
        const Vec3 normal = side == 0 ? axis : -axis;
        const double slack = dot(normal, middle);
        walls.push_back({wide(normal), {slack}, slicing::kCut});
        halves[side].polytope.cut({normal, slack, static_cast<int>(walls.size()) - 1});
        find_walls(measuring, walls, halves[side]);
        most = std::max(most, halves[side].walls.size());
      }
      if (most < fewest) fewest = most, best = std::move(halves);
    }
    if (fewest == parts[i].walls.size()) {
      ++i;
      continue;
    }
    parts[i] = std::move(best[0]);
    parts.push_back(std::move(best[1]));
  }
}

struct Workspace {
  Pieces of_a, of_b;
  Measuring measuring;
  EnclosingPolytope around;
  Culling culling;
  Culling::Meeting meeting;
  EnclosingPolytope polytope;
  std::vector<Round> rounds;
  std::vector<std::array<int, 2>> near;  ///< pairs of pieces that may share something
  std::vector<std::array<int, 2>> rest;  ///< such as are not measured in closed form
  std::vector<Part> parts;               ///< of one of them
};

/// Makes a ball of radius 1 of the ellipsoid that a body is, and of all else what that makes of it, turned to the axes
/// of the ellipsoid.
void into_ball(const Placed& body, Pieces& pieces) {
  const WideMatrix rotation = wide_rotation(body.orientation);
  const Vec3 h = std::get<Ellipsoid>(body.shape).half_axes;
  for (Round& r : pieces.rounds) {
    const WideVector centre = apply_transposed(rotation, r.centre);
    r.centre = {centre.x / DoubleDouble{h.x}, centre.y / DoubleDouble{h.y}, centre.z / DoubleDouble{h.z}};
  }
  for (Wall& wall : pieces.walls) {
    const WideVector own = apply_transposed(rotation, wall.normal);
    const WideVector normal{DoubleDouble{h.x} * own.x, DoubleDouble{h.y} * own.y, DoubleDouble{h.z} * own.z};
    const DoubleDouble length = norm(normal);
    wall.normal = normal / length, wall.slack = wall.slack / length;
  }
}

/// Moves the surface of a body out, but not the cuts through it; false if that leaves nothing of something round.
bool grow(Pieces& pieces, double outwards) {
  for (Wall& wall : pieces.walls)
    if (wall.owner != slicing::kCut) wall.slack = wall.slack + DoubleDouble{outwards};
  for (Round& r : pieces.rounds) r.radius += outwards;
  return std::ranges::all_of(pieces.rounds, [](const Round& r) { return r.radius > 0; });
}

double least_radius(const Pieces& pieces) {
  double least = std::numeric_limits<double>::infinity();
  for (const Round& r : pieces.rounds) least = std::min(least, r.radius);
  return least;
}

/// How far rounding may move surfaces whose coordinates, about the point inside, reach as far as the common set. Of a
/// convex set of which that is the mean square of the distance from the point, no point is farther than five times its
/// root: of ∫ |x|² dV about the centroid, V R² is no more than 45 / 2.
double rounding_of_surfaces(double mean_square) { return 8 * DBL_EPSILON * 5 * std::sqrt(mean_square); }

double sum(Vec3 v) { return v.x + v.y + v.z; }

/// The same in a ball that is turned and stretched to the ellipsoid, and whose coordinates count from `origin` there.
Seen stretched(const Seen& seen, const Mat3& turn, const quadric::Stretch& stretch, Vec3 origin) {
  Seen result;
  result.u = scaled(stretch.half_axes, apply_transposed(turn, seen.u));
  result.v = scaled(stretch.half_axes, apply_transposed(turn, seen.v));
  result.normal = stretch.normal(apply_transposed(turn, seen.normal));
  result.u0 = seen.u0 + dot(origin, result.u), result.v0 = seen.v0 + dot(origin, result.v);
  return result;
}

struct StretchedWorkspace {
  Pieces of_flat, of_ellipsoid;
  Measuring measuring;
};

/// Of an ellipsoid and a body that planes bound: the ball that into_ball() makes is measured, and what is found is
/// stretched. Volumes grow by the determinant, area vectors are images by the matrix of cofactors.
std::optional<RoundMeasures> measure_stretched(const Placed& a, const Placed& b, Vec3 reference,
                                               const WideVector& inside, double outwards, int owner, PatchSums* patch) {
  const bool swapped = stretched(b.shape) == nullptr;
  const Placed &flat = swapped ? b : a, &ellipsoid = swapped ? a : b;
  if (smooth(flat.shape)) return std::nullopt;
  const Scratch<StretchedWorkspace> scratch;
  auto& [of_flat, of_ellipsoid, measuring] = *scratch;
  of_flat.clear(), of_ellipsoid.clear();
  cut(flat, ellipsoid, nullptr, 0, reference, inside, of_flat);
  cut(ellipsoid, flat, nullptr, 1, reference, inside, of_ellipsoid);
  if (outwards != 0) grow(of_flat, outwards);
  into_ball(ellipsoid, of_flat);
  into_ball(ellipsoid, of_ellipsoid);
  const Vec3 h = stretched(ellipsoid.shape)->half_axes;
  const Mat3& turn = ellipsoid.pose.rotation;
  const quadric::Stretch stretch(h);
  measuring.stretch = &stretch;
  measuring.owner = swapped ? 1 - owner : owner, measuring.patch = nullptr;
  std::span<Round> rounds = of_ellipsoid.rounds;
  Vec3 moved;  // in the ball
  Totals totals;
  double error = kInfinity;
  const std::optional<PatchSums> patch_before = patch ? std::optional(*patch) : std::nullopt;
  // About the centroid, other slices are taken, which may do where the first do not.
  for (int attempt = 0; attempt < 2 && !(error <= kMostOpen * totals.volume); ++attempt) {
    const Vec3 step = attempt > 0 ? totals.first / totals.volume : Vec3{};
    if (!(norm(step) <= 2)) break;
    for (Round& r : rounds) r.centre = r.centre - wide(step);
    for (Wall& wall : of_flat.walls) wall.slack = wall.slack - dot(wall.normal, wide(step));
    measuring.totals = {};
    measuring.extent = norm(rounded(rounds[0].centre)) + 1;
    std::optional<PatchSums> of_attempt;
    if (patch) {
      of_attempt = *patch_before;
      measuring.patch = &*of_attempt;
      measuring.seen = stretched(Seen(*patch), turn, stretch, step);
    }
    if (!measuring.add(rounds, of_flat.walls)) break;
    const Totals& found = measuring.totals;
    const double off = found.error + 2 * std::max(found.open, missing(found));
    if (!(found.volume > 0 && off < error)) break;
    totals = found, error = off, moved = step;
    if (patch) *patch = *of_attempt;
  }
  const double volume = totals.volume;
  if (!(volume > 0 && error <= kMostError * volume)) return std::nullopt;
  RoundMeasures result;
  result.volume = stretch.volume * volume;
  result.area = totals.area;
  result.first_area = swapped ? totals.area - totals.first_area : totals.first_area;
  result.area_error =
      totals.area_error + stretch.open() * totals.area + astray(stretch.normal(totals.unbalanced), totals.area);
  result.volume_error = stretch.volume * (error + 4 * DBL_EPSILON * volume) + of_flat.flatness * totals.area;
  const Vec3 about_which = rounded(inside) + turn * scaled(h, moved);
  result.centroid = about_which + turn * scaled(h, totals.first / volume);
  const Moments whole{result.volume, stretch.volume * scaled(h, totals.first),
                      stretch.volume * scaled(scaled(h, h), totals.squares),
                      stretch.volume * scaled(Vec3{h.y * h.z, h.z * h.x, h.x * h.y}, totals.products)};
  result.inertia = turn * whole.inertia_about_centroid() * transposed(turn);
  // Half axes may differ by as much as a cap is shallow, so that what rounding leaves of one term counts for all.
  const Moments& sizes = totals.sizes;
  const Vec3 mean = sizes.first / volume, f = sizes.first;
  const Vec3 squares = sizes.squares + scaled(f, mean);
  const Vec3 products = sizes.products + Vec3{f.y * mean.z, f.z * mean.x, f.x * mean.y};
  result.inertia_error = 64 * DBL_EPSILON * stretch.volume *
                         (dot(scaled(h, h), squares) + dot(Vec3{h.y * h.z, h.z * h.x, h.x * h.y}, products));
  result.rounding = rounding_of_surfaces(sum(whole.squares) / result.volume + norm2(scaled(h, moved)));
  const double side = swapped ? -1 : 1;
  const Pull pull{side * (turn * stretch.normal(totals.pull)), side * (turn * totals.moment)};
  result.pull = about(pull, about_which, {});
  result.facets_touched = static_cast<int>(of_flat.walls.size());
  return result;
}

std::optional<RoundMeasures> measured(const Placed& a, const Placed& b, Vec3 reference, const WideVector& inside,
                                      double outwards, int owner, PatchSums* patch) {
  const Scratch<Workspace> scratch;
  Pieces &of_a = scratch->of_a, &of_b = scratch->of_b;
  Measuring& measuring = scratch->measuring;
  EnclosingPolytope& around = scratch->around;
  Culling& culling = scratch->culling;
  std::vector<Round>& rounds = scratch->rounds;
  Culling::Meeting& meeting = scratch->meeting;
  std::vector<Wall>& walls = meeting.walls;
  of_a.clear(), of_b.clear();
  measuring.owner = owner, measuring.patch = patch;
  if (patch) measuring.seen = Seen(*patch);
  measuring.extent = std::min(extent(a, rounded(inside)), extent(b, rounded(inside)));
  // Of many pieces, few lie near the common set.
  const bool many = std::holds_alternative<RoundedHull>(a.shape) || std::holds_alternative<RoundedHull>(b.shape);
  if (many) enclose(a, b, rounded(inside), around);
  measuring.common = many ? &around : nullptr;
  measuring.around = many ? &scratch->polytope : nullptr;
  cut(a, b, measuring.common, 0, reference, inside, of_a);
  cut(b, a, measuring.common, 1, reference, inside, of_b);
  if (outwards != 0 && !grow(least_radius(of_a) > least_radius(of_b) ? of_a : of_b, outwards)) return std::nullopt;
  if (many) culling.look_at(of_a, of_b, around);
  // Fills in what pieces i of a and j of b may share; false if that is nothing.
  const auto meet = [&](int i, int j) {
    const Piece &p = of_a.pieces[i], &q = of_b.pieces[j];
    rounds.clear(), walls.clear();
    if (p.round >= 0) rounds.push_back(of_a.rounds[p.round]);
    if (q.round >= 0) rounds.push_back(of_b.rounds[q.round]);
    if (many) return culling.meet(i, j, meeting);
    walls.insert(walls.end(), of_a.walls.begin() + p.first_wall, of_a.walls.begin() + p.first_wall + p.walls);
    walls.insert(walls.end(), of_b.walls.begin() + q.first_wall, of_b.walls.begin() + q.first_wall + q.walls);
    return true;
  };
  // True if that is nothing, or measured.
  const auto in_closed_form = [&] {
    if (!many) return false;
    const EnclosingPolytope& polytope = scratch->polytope;
    if (!culling.share(meeting, scratch->polytope)) return true;
    if (!measuring.take(walls)) return true;
    // Where the surface of the whole is open, slices look at all of it, until what is but a layer is nothing.
    const Round* round = rounds.empty() ? nullptr : &rounds[0];
    const bool sliced = rounds.size() > 1 || (round && measuring.closely && measuring.layer == 0);
    if (!sliced && measuring.add_in_closed_form(round, polytope)) return true;
    return culling.outside(polytope, meeting);
  };
  // In parts of which slices are to have the walls; false if that gives up.
  const auto add_sliced = [&] {
    if (!many) return measuring.add(rounds, walls);
    std::vector<Part>& parts = scratch->parts;
    parts.resize(1);
    std::swap(parts[0].polytope, scratch->polytope);
    find_walls(measuring, walls, parts[0]);
    if (!sliceable(parts[0].walls.size())) cut_in_parts(measuring, walls, parts);
    for (Part& part : parts) {
      std::swap(scratch->polytope, part.polytope);
      if (!measuring.add(rounds, part.walls)) return false;
    }
    return true;
  };
  std::vector<std::array<int, 2>>&near = scratch->near, &rest = scratch->rest;
  near.clear();
  if (many) {
    culling.near(near);
  } else {
    for (int i = 0; i < static_cast<int>(of_a.pieces.size()); ++i)
      for (int j = 0; j < static_cast<int>(of_b.pieces.size()); ++j) near.push_back({i, j});
  }
  const auto add_pieces = [&] {
    measuring.totals = {};
    rest.clear();
    // Pieces without rounds first: others then need to be exact only to a fraction of what these hold.
    for (const int round_ones : {0, 1, 2})
      for (const auto& [i, j] : near) {
        cancellation_point();
        if ((of_a.pieces[i].round >= 0) + (of_b.pieces[j].round >= 0) != round_ones) continue;
        if (round_ones == 2 || (meet(i, j) && !in_closed_form())) rest.push_back({i, j});
      }
    // What was not sure to a fraction of the pieces before it may be to one of them all.
    for (const auto& [i, j] : rest)
      if (meet(i, j) && !in_closed_form() && !add_sliced()) return false;
    return measuring.totals.volume > 0;
  };
  const Totals& totals = measuring.totals;
  const auto open = [&] { return 2 * std::max(totals.open, missing(totals)); };
  const std::optional<PatchSums> patch_before = patch ? std::optional(*patch) : std::nullopt;
  measuring.closely = false, measuring.layer = 0;
  if (!add_pieces()) return std::nullopt;
  const auto off = [&] { return totals.error + open(); };
  const auto try_again = [&] {
    const Totals before = totals;
    const double off_before = off();
    const std::optional<PatchSums> with_before = patch ? std::optional(*patch) : std::nullopt;
    if (patch) *patch = *patch_before;
    if (add_pieces() && off() < off_before) return;
    measuring.totals = before;
    if (patch) *patch = *with_before;
  };
  // Where a surface that is open says so, something is hidden in an interval of which the middle alone was looked at.
  measuring.closely = true;
  if (!(open() <= kMostOpen * totals.volume)) try_again();
  // Or faces and cuts lie so near each other that rounding tells which of them is where. Then they are one.
  const auto try_layer = [&](double part) {
    measuring.layer = part * totals.volume / totals.area, measuring.surface = totals.area;
    try_again();
  };
  if (!(open() <= kMostOpen * totals.volume)) try_layer(kLayer);
  if (!(off() <= kMostError * totals.volume)) try_layer(kWideLayer);
  RoundMeasures result;
  result.volume = totals.volume;
  result.volume_error = totals.error + open();
  if (!(result.volume_error <= kMostError * result.volume)) return std::nullopt;
  result.volume_error += (of_a.flatness + of_b.flatness) * totals.area;
  result.area = totals.area, result.first_area = totals.first_area;
  result.area_error = totals.area_error + astray(totals.unbalanced, totals.border);
  result.rounding = rounding_of_surfaces(sum(totals.squares) / totals.volume);
  result.centroid = rounded(inside) + totals.first / totals.volume;
  result.inertia = totals.inertia_about_centroid();
  // Of a body inside the other, nothing but rounding is left of what sums to zero.
  const Vec3 pull = norm(totals.pull) <= kSummation * totals.border ? Vec3{} : totals.pull;
  result.pull = about(Pull{pull, totals.moment}, rounded(inside), {});
  for (const Pieces* pieces : {&of_a, &of_b})
    result.facets_touched += static_cast<int>(
        std::ranges::count_if(pieces->walls, [](const Wall& wall) { return wall.owner != slicing::kCut; }));
  return result;
}

}  // namespace

std::optional<RoundMeasures> measure_pieces(const SlicedPair& p) {
  return measured(p.a, p.b, p.reference, p.inside, p.outwards, p.owner, p.patch);
}

std::optional<RoundMeasures> measure_culled_pieces(const SlicedPair& p) {
  return measured(p.a, p.b, p.reference, p.inside, p.outwards, p.owner, p.patch);
}

std::optional<RoundMeasures> measure_stretched(const SlicedPair& p) {
  return measure_stretched(p.a, p.b, p.reference, p.inside, p.outwards, p.owner, p.patch);
}

}  // namespace overlapper::pieces
