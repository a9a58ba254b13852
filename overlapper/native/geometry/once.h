#pragma once

#include <atomic>
#include <memory>

namespace overlapper {

/// A value that is computed on first use, and kept. Threads that ask at the same time each compute it, and all get the
/// value of the thread that finishes first. There is no lock, which a forked process could inherit closed.
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
