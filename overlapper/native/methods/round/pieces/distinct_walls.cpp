#include "methods/round/pieces/distinct_walls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace overlapper::pieces {
namespace {

/// Below this sine between two walls, lines in doubles do not place their crossing well enough.
constexpr double kFolded = 1e-10;
/// Up to so many pairs of such walls, pieces are cut there: each pair makes two pieces of one.
constexpr size_t kMostFolds = 3;

/// Whether two planes count as one within the extent. `apart` is the difference of their slacks, `tilt` the length of
/// the difference of their normals. The volume between two different planes that count as one is an error.
bool coincide(double apart, double tilt, const PieceSetting& setting, double& error) {
  if (apart <= 1e-24 * setting.extent && tilt <= 1e-24) return true;
  const double gap = apart + tilt * setting.extent;
  if (!(gap <= setting.layer)) return false;
  error += gap * setting.surface;
  return true;
}

/// Calls use(i, j) for any two different walls whose normals may be opposite (`side` -1) or equal (`side` 1). Pairs
/// come in both orders, until a call returns true. Such normals have equal lengths along an arbitrary line. With many
/// walls, only neighbours in the order of that length are compared.
template <class Walls, class Use>
bool any_two(Walls&& walls, double side, const PieceSetting& setting, Use use) {
  constexpr Vec3 kAcross{0.3141, 0.5926, 0.7417};
  const double equal = std::max(1e-12, 2 * setting.layer / setting.extent);  // beyond the rounding of these lengths
  constexpr size_t kFew = 24;
  const size_t size = walls.size();
  const auto length_of = [&](size_t i) { return dot(kAcross, rounded(walls[i].normal)); };
  if (size <= kFew) {
    std::array<double, kFew> length;
    for (size_t i = 0; i < size; ++i) length[i] = length_of(i);
    for (size_t i = 0; i < size; ++i)
      for (size_t j = 0; j < size; ++j)
        if (std::abs(length[j] - side * length[i]) <= equal && i != j && use(walls[i], walls[j])) return true;
    return false;
  }
  std::vector<std::pair<double, size_t>> by_length;
  for (size_t i = 0; i < size; ++i) by_length.push_back({length_of(i), i});
  std::ranges::sort(by_length);
  for (const auto& [length, i] : by_length) {
    const double most = side * length + equal;
    auto other = std::ranges::lower_bound(by_length, std::pair{side * length - equal, size_t{0}});
    for (; other != by_length.end() && other->first <= most; ++other)
      if (other->second != i && use(walls[i], walls[other->second])) return true;
  }
  return false;
}

/// 1 if the first of two walls is nearer everywhere, -1 if nowhere, 0 if uncertain.
int nearer_all_over(const Fold& fold, std::span<const Wall> walls, std::span<const Round> rounds, double extent) {
  const Vec3 g = rounded(fold.nearer.normal), n = rounded(walls[fold.first].normal);
  const double slack = fold.nearer.slack.head;
  double most = extent, least = -extent;
  for (const Round& r : rounds) {
    if (!r.ball) continue;
    // The rim of the cap that the wall leaves reaches farthest, unless the ball itself does.
    const Vec3 c = rounded(r.centre);
    const double level = (walls[fold.first].slack - dot(walls[fold.first].normal, r.centre)).head, up = dot(g, n);
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

}  // namespace

bool is_flat(std::span<const Wall> walls, const PieceSetting& setting, double& error) {
  return any_two(walls, -1, setting, [&](const Wall& a, const Wall& b) {
    return coincide(std::max(0.0, (a.slack + b.slack).head), norm(rounded(a.normal + b.normal)), setting, error);
  });
}

void find_repeated(DistinctWalls& distinct, const PieceSetting& setting, double& error) {
  std::vector<Wall>& walls = distinct.walls;
  distinct.instead.assign(walls.size(), DistinctWalls::kItself);
  distinct.folded = false;
  any_two(walls, 1, setting, [&](Wall& wall, const Wall& other) {
    if (wall.owner == DistinctWalls::kSuperseded || other.owner == DistinctWalls::kSuperseded) return false;
    const bool cut = wall.owner == slicing::kCut, other_is_cut = other.owner == slicing::kCut;
    const double outer = (wall.slack - other.slack).head, tilt = norm(rounded(other.normal - wall.normal));
    const bool first = std::abs(outer) > 1e-24 * setting.extent ? outer > 0 : &other < &wall;
    if (!(cut == other_is_cut ? first : cut)) return false;
    if (coincide(std::abs(outer), tilt, setting, error)) {
      wall.owner = DistinctWalls::kSuperseded;
      distinct.instead[&wall - walls.data()] = static_cast<int>(&other - walls.data());
    } else {
      distinct.folded = distinct.folded || tilt < kFolded;
    }
    return false;
  });
}

std::optional<Fold> find_fold(std::vector<Wall>& walls, std::span<const Round> rounds, double extent) {
  std::optional<Fold> found;
  size_t folds = 0;
  for (size_t i = 0; i < walls.size(); ++i)
    for (size_t j = i + 1; j < walls.size(); ++j) {
      const Wall &a = walls[i], &b = walls[j];
      const WideVector apart = b.normal - a.normal;
      const DoubleDouble tilt = norm(apart);
      if (!(tilt.head > 1e-24 && tilt.head < kFolded) || (a.owner == slicing::kCut && b.owner == slicing::kCut))
        continue;
      const Fold fold{i, j, {apart / tilt, (b.slack - a.slack) / tilt, slicing::kCut}};
      if (const int nearer = nearer_all_over(fold, walls, rounds, extent); nearer != 0) {
        walls.erase(walls.begin() + static_cast<std::ptrdiff_t>(nearer > 0 ? j : i));
        return find_fold(walls, rounds, extent);
      }
      if (!found) found = fold;
      ++folds;
    }
  return folds <= kMostFolds ? found : std::nullopt;
}

}  // namespace overlapper::pieces
