#pragma once

#include <array>
#include <span>
#include <vector>

namespace overlapper {

/// A system of linear equations in blocks of unknowns. Few blocks occur together in an equation. Elimination of one
/// block after the other solves the system. Rows are exchanged within a block only. Blocks with few neighbours come
/// first, so that few more blocks fill.
class BlockSystem {
 public:
  /// `sizes` are those of the blocks, and `together` the pairs of different blocks that occur in one equation.
  BlockSystem(std::vector<int> sizes, std::span<const std::array<int, 2>> together);

  /// Makes the matrix the identity.
  void reset();

  /// The block of a row and a column by rows: the same twice, or a pair of those `together`.
  double* at(int row, int column);

  int first(int block) const { return first_[block]; }  ///< the index of its first unknown
  int unknowns() const { return first_.back(); }

  /// Replaces the right side by the solution, and the matrix by others.
  void solve(std::span<double> right);

 private:
  void order(std::span<const std::array<int, 2>> together);
  size_t offset(int row, int column) const;

  std::vector<int> sizes_, first_;
  std::vector<int> order_, rank_;                   ///< the blocks in the order of elimination, and the rank of each
  std::vector<std::vector<int>> later_;             ///< by block: those that occur with it when it is eliminated
  std::vector<std::vector<size_t>> right_, below_;  ///< by block: the places of the blocks in its row and its column
  std::vector<size_t> diagonal_;
  std::vector<double> numbers_;
};

}  // namespace overlapper
