#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

namespace overlapper {

using IndexPair = std::array<int, 2>;

/// MuJoCo's rule about pairs of geoms that may collide: mj_collision in engine_collision_driver.c. Geoms have indices
/// from 0.
struct WeldRule {
  struct Geom {
    int type_mask, affinity;  ///< one geom's `type_mask` and the other's `affinity` must have a common bit
    int body, weld, parent;   ///< the body, the first body of its welded group, and the parent of that body
    bool fixed;               ///< no joint moves the group
    bool surface;             ///< a plane or a height field: two of them have no contacts
  };
  std::vector<Geom> geoms;
  std::vector<std::int64_t> excluded;  ///< pairs of bodies: 65536 times the lesser plus the greater, sorted
  std::vector<std::int64_t> listed;  ///< pairs of geoms that may collide in any case: lesser * count + greater, sorted
  bool by_parent = true;             ///< parent and child may not collide
  bool none = false;                 ///< no geoms may collide

  bool admits(int a, int b) const { return admits_unlisted(a, b) || lists(a, b); }
  /// Whether the pair may collide without being listed.
  bool admits_unlisted(int a, int b) const;
  /// Whether the pair is listed, and may collide.
  bool lists(int a, int b) const;
};

/// Which pairs may be measured. Shapes belong to groups. A table or a rule says for each pair of groups whether it may.
struct PairMask {
  std::vector<int> group;   ///< of each shape
  std::vector<char> table;  ///< row by row, as many rows and columns as groups; empty with a rule
  size_t groups = 0;
  std::shared_ptr<const WeldRule> rule;  ///< its geoms are the groups

  bool admits(const IndexPair& pair) const {
    const int a = group[pair[0]], b = group[pair[1]];
    return rule ? rule->admits(a, b) : table[groups * a + b] != 0;
  }
};

}  // namespace overlapper
