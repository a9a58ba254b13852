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

/// Replaces a matrix by its triangles L and U, with row exchanges: `from` has the row that each row is exchanged with.
/// The diagonal is that of U, inverted. An unknown without an equation has 0 there, and stays 0.
void factorise(double* m, int n, int* from) {
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(m[i * n + k]) > std::abs(m[best * n + k])) best = i;
    from[k] = best;
    if (best != k) std::swap_ranges(m + k * n, m + (k + 1) * n, m + best * n);
    const double* row = m + k * n;
    const double scale = m[k * n + k] = row[k] != 0 ? 1 / row[k] : 0;
    for (int i = k + 1; i < n; ++i) {
      double* to = m + i * n;
      if (to[k] == 0) continue;
      const double factor = to[k] *= scale;
      for (int j = k + 1; j < n; ++j) to[j] -= factor * row[j];
    }
  }
}

/// Replaces r rows x by x A⁻¹, where A was factorised.
void divide(double* x, int r, const double* m, int n, const int* from) {
  for (int i = 0; i < r; ++i, x += n) {
    for (int k = 0; k < n; ++k) {
      const double factor = x[k] *= m[k * n + k];
      for (int j = k + 1; j < n; ++j) x[j] -= factor * m[k * n + j];
    }
    for (int k = n - 1; k > 0; --k)
      for (int j = 0; j < k; ++j) x[j] -= x[k] * m[k * n + j];
    for (int k = n - 1; k >= 0; --k) std::swap(x[k], x[from[k]]);
  }
}

/// Replaces a column x by A⁻¹ x, where A was factorised.
void solve_for(double* x, const double* m, int n, const int* from) {
  for (int k = 0; k < n; ++k) {
    std::swap(x[k], x[from[k]]);
    for (int j = 0; j < k; ++j) x[k] -= m[k * n + j] * x[j];
  }
  for (int k = n - 1; k >= 0; --k) {
    for (int j = k + 1; j < n; ++j) x[k] -= m[k * n + j] * x[j];
    x[k] *= m[k * n + k];
  }
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
  std::vector<int> exchanged(right.size());
  for (int k : order_) {
    const int n = sizes_[k];
    const double* own = &numbers_[diagonal_[k]];
    int* from = &exchanged[first_[k]];
    factorise(&numbers_[diagonal_[k]], n, from);
    for (size_t i = 0; i < later_[k].size(); ++i) {
      const int row = later_[k][i], m = sizes_[row];
      double* factor = &numbers_[below_[k][i]];
      divide(factor, m, own, n, from);
      for (size_t j = 0; j < later_[k].size(); ++j) {
        const int column = later_[k][j];
        subtract_product(at(row, column), factor, &numbers_[right_[k][j]], m, n, sizes_[column]);
      }
      subtract_product(&right[first_[row]], factor, &right[first_[k]], m, n, 1);
    }
  }
  for (auto k = order_.rbegin(); k != order_.rend(); ++k) {
    const int n = sizes_[*k];
    double* to = &right[first_[*k]];
    for (size_t j = 0; j < later_[*k].size(); ++j) {
      const int column = later_[*k][j];
      subtract_product(to, &numbers_[right_[*k][j]], &right[first_[column]], n, sizes_[column], 1);
    }
    solve_for(to, &numbers_[diagonal_[*k]], n, &exchanged[first_[*k]]);
  }
}

}  // namespace overlapper
