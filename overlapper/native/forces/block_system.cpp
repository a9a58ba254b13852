#include "forces/block_system.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace overlapper {
namespace {

/// c -= a b, of r by m and m by n numbers.
void subtract_product(double* c, const double* a, const double* b, int r, int m, int n) {
  for (int i = 0; i < r; ++i)
    for (int k = 0; k < m; ++k) {
      const double factor = a[i * m + k];
      for (int j = 0; j < n; ++j) c[i * n + j] -= factor * b[k * n + j];
    }
}

/// Inverts a matrix in place by Gauss and Jordan's method with row exchanges. Unknowns without an equation stay 0.
void invert(double* m, int n) {
  std::vector<int> from(n);
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(m[i * n + k]) > std::abs(m[best * n + k])) best = i;
    from[k] = best;
    if (best != k) std::swap_ranges(m + k * n, m + (k + 1) * n, m + best * n);
    const double pivot = m[k * n + k];
    const double scale = pivot != 0 ? 1 / pivot : 0;
    m[k * n + k] = 1;
    for (int j = 0; j < n; ++j) m[k * n + j] *= scale;
    for (int i = 0; i < n; ++i) {
      if (i == k) continue;
      const double factor = m[i * n + k];
      if (factor == 0) continue;
      m[i * n + k] = 0;
      for (int j = 0; j < n; ++j) m[i * n + j] -= factor * m[k * n + j];
    }
  }
  for (int k = n - 1; k >= 0; --k)
    if (from[k] != k)
      for (int i = 0; i < n; ++i) std::swap(m[i * n + k], m[i * n + from[k]]);
}

}  // namespace

BlockSystem::BlockSystem(std::vector<int> sizes, std::span<const std::array<int, 2>> together)
    : sizes_(std::move(sizes)), first_(sizes_.size() + 1) {
  std::partial_sum(sizes_.begin(), sizes_.end(), first_.begin() + 1);
  order(together);
  size_t used = 0;
  const auto place = [&](int rows, int columns) { return std::exchange(used, used + size_t(rows) * columns); };
  diagonal_.resize(sizes_.size()), right_.resize(sizes_.size()), below_.resize(sizes_.size());
  for (size_t k = 0; k < sizes_.size(); ++k) {
    diagonal_[k] = place(sizes_[k], sizes_[k]);
    for (int other : later_[k]) {
      right_[k].push_back(place(sizes_[k], sizes_[other]));
      below_[k].push_back(place(sizes_[other], sizes_[k]));
    }
  }
  numbers_.resize(used);
}

/// Finds the order of elimination: always the block next that has the fewest unknowns beside it. Those then occur
/// together (minimum degree).
void BlockSystem::order(std::span<const std::array<int, 2>> together) {
  const int count = int(sizes_.size());
  later_.resize(count), rank_.assign(count, -1);
  for (const auto [a, b] : together) later_[a].push_back(b), later_[b].push_back(a);
  const auto tidy = [](std::vector<int>& list) {
    std::ranges::sort(list);
    list.erase(std::unique(list.begin(), list.end()), list.end());
  };
  for (std::vector<int>& each : later_) tidy(each);
  const auto degree = [&](int k) {
    int sum = 0;
    for (int other : later_[k]) sum += sizes_[other];
    return sum;
  };
  std::vector<int> degrees(count), left(count);
  for (int k = 0; k < count; ++k) degrees[k] = degree(k);
  std::iota(left.begin(), left.end(), 0);
  std::vector<int> merged;
  while (!left.empty()) {
    const auto least = std::ranges::min_element(left, {}, [&](int k) { return degrees[k]; });
    const int next = *least;
    left.erase(least);
    rank_[next] = int(order_.size());
    order_.push_back(next);
    const std::vector<int>& beside = later_[next];
    for (int k : beside) {
      merged.clear();
      std::ranges::set_union(later_[k], beside, std::back_inserter(merged));
      std::erase_if(merged, [&](int other) { return other == k || other == next; });
      later_[k] = merged;
      degrees[k] = degree(k);
    }
  }
}

void BlockSystem::reset() {
  std::ranges::fill(numbers_, 0.0);
  for (size_t k = 0; k < sizes_.size(); ++k)
    for (int i = 0; i < sizes_[k]; ++i) numbers_[diagonal_[k] + size_t(i) * sizes_[k] + i] = 1;
}

size_t BlockSystem::offset(int row, int column) const {
  if (row == column) return diagonal_[row];
  const bool right = rank_[row] < rank_[column];
  const int earlier = right ? row : column, other = right ? column : row;
  const auto at = std::ranges::lower_bound(later_[earlier], other) - later_[earlier].begin();
  return right ? right_[earlier][at] : below_[earlier][at];
}

double* BlockSystem::at(int row, int column) { return &numbers_[offset(row, column)]; }

void BlockSystem::solve(std::span<double> right) {
  std::vector<double> factor;
  for (int k : order_) {
    const int n = sizes_[k];
    double* inverse = &numbers_[diagonal_[k]];
    invert(inverse, n);
    for (size_t i = 0; i < later_[k].size(); ++i) {
      const int row = later_[k][i], m = sizes_[row];
      factor.assign(size_t(m) * n, 0.0);
      subtract_product(factor.data(), &numbers_[below_[k][i]], inverse, m, n, n);
      for (double& each : factor) each = -each;
      for (size_t j = 0; j < later_[k].size(); ++j) {
        const int column = later_[k][j];
        subtract_product(at(row, column), factor.data(), &numbers_[right_[k][j]], m, n, sizes_[column]);
      }
      subtract_product(&right[first_[row]], factor.data(), &right[first_[k]], m, n, 1);
    }
  }
  std::vector<double> own;
  for (auto k = order_.rbegin(); k != order_.rend(); ++k) {
    const int n = sizes_[*k];
    double* to = &right[first_[*k]];
    for (size_t j = 0; j < later_[*k].size(); ++j) {
      const int column = later_[*k][j];
      subtract_product(to, &numbers_[right_[*k][j]], &right[first_[column]], n, sizes_[column], 1);
    }
    own.assign(to, to + n);
    std::fill_n(to, n, 0.0);
    subtract_product(to, &numbers_[diagonal_[*k]], own.data(), n, n, 1);
    for (int i = 0; i < n; ++i) to[i] = -to[i];
  }
}

}  // namespace overlapper
