#pragma once

#include <atomic>
#include <memory>

namespace overlapper {

/// A value that is computed when first asked for, and kept. Threads that ask at the same time compute it each for
/// itself, and the first to be done hands its value to all: there is no lock that a process forked meanwhile would
/// inherit closed.
template <class T>
class Once {
 public:
  Once() = default;
  Once(Once&& other) noexcept : value_(other.value_.exchange(nullptr)) {}
  ~Once() { delete value_.load(); }

  template <class Compute>
  const T& get(Compute compute) const {
    const T* kept = value_.load(std::memory_order_acquire);
    if (kept) return *kept;
    auto computed = std::make_unique<const T>(compute());
    if (value_.compare_exchange_strong(kept, computed.get(), std::memory_order_acq_rel)) return *computed.release();
    return *kept;
  }

 private:
  mutable std::atomic<const T*> value_{nullptr};
};

}  // namespace overlapper
