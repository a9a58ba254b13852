#include "batch/pair_mask.h"

#include <algorithm>

namespace overlapper {
namespace {

std::int64_t code(std::int64_t a, std::int64_t b, std::int64_t count) {
  return std::min(a, b) * count + std::max(a, b);
}

bool contains(const std::vector<std::int64_t>& sorted, std::int64_t value) {
  return !sorted.empty() && std::ranges::binary_search(sorted, value);
}

}  // namespace

bool WeldRule::admits_unlisted(int a, int b) const {
  const Geom &p = geoms[a], &q = geoms[b];
  if (none || (p.surface && q.surface)) return false;
  if (!(p.type_mask & q.affinity) && !(q.type_mask & p.affinity)) return false;
  if (p.weld == q.weld || (p.fixed && q.fixed)) return false;
  // MuJoCo does not count the world as a parent.
  if (by_parent && p.weld != 0 && q.weld != 0 && (p.weld == q.parent || q.weld == p.parent)) return false;
  return !contains(excluded, code(p.body, q.body, 1 << 16));
}

bool WeldRule::lists(int a, int b) const {
  return !none && !(geoms[a].surface && geoms[b].surface) &&
         contains(listed, code(a, b, static_cast<std::int64_t>(geoms.size())));
}

}  // namespace overlapper
