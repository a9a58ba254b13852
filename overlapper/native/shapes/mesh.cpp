#include "shapes/mesh.h"

#include <cassert>

namespace overlapper {

void Mesh::set(const Shape& shape) {
  assert(has_graph(shape));
  ask_flat(shape, [&](const auto& s) { s.give(*this); });
}

}  // namespace overlapper
