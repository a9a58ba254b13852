#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>

namespace overlapper {

/// Thrown at a cancellation point once nobody waits for the answer any more.
struct Cancelled {};

namespace cancellation {

/// Answers whether the caller that waits on this thread still wants its answer. The bindings set this once; without it,
/// answers are always wanted.
inline bool (*still_wanted)() = nullptr;

/// On a thread that helps another: a flag that is true once the other's answer is not wanted any more.
inline constinit thread_local const std::atomic<bool>* given_up = nullptr;

inline constexpr int kPointsBetween = 64;  ///< which take a millisecond at most
inline constexpr std::chrono::milliseconds kPatience(50);
inline constinit thread_local int points_left = kPointsBetween;

/// Asks once in kPatience whether the answer is still wanted, and throws Cancelled if it is not.
inline void look_at_clock() {
  using Clock = std::chrono::steady_clock;
  thread_local Clock::time_point due;
  points_left = kPointsBetween;
  if (given_up) {
    if (given_up->load(std::memory_order_relaxed)) throw Cancelled{};
    return;
  }
  if (!still_wanted || Clock::now() < due) return;
  const bool wanted = still_wanted();
  due = Clock::now() + kPatience;
  if (!wanted) throw Cancelled{};
}

}  // namespace cancellation

/// A place where a computation may end early: one in each loop that may take a tenth of a second and more. The question
/// may run a signal handler that computes something itself. So no place is where a thread_local of the core is in use,
/// but for the memory that a Scratch has lent.
inline void cancellation_point() {
  if (--cancellation::points_left <= 0) cancellation::look_at_clock();
}

/// The same in a loop whose rounds look at so many elements each.
inline void cancellation_point(size_t elements) {
  cancellation::points_left -= static_cast<int>(std::min<size_t>(elements / 256, cancellation::kPointsBetween));
  cancellation_point();
}

}  // namespace overlapper
