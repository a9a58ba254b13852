#pragma once

#include <optional>
#include <span>

#include "methods/round/closed_forms/revolved.h"

namespace overlapper::closed_forms {

/// The only plane that cuts off anything that the other planes leave.
struct OnlyCut {
  const Plane* plane = nullptr;
  double layers = 0;  ///< number of layers of rounding that the other planes may cut off
};

/// No value if there are two such planes.
std::optional<OnlyCut> only_cut(const Revolved& body, std::span<const Plane> planes, double rounding);

}  // namespace overlapper::closed_forms
