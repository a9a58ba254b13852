#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>

namespace overlapper {

/// Thrown at a cancellation point once no caller waits for the answer.
struct Cancelled {};

namespace cancellation {

/// Whether the caller that waits on this thread still wants its answer. The bindings set this once. Without it, answers
/// are always wanted.
inline bool (*still_wanted)() = nullptr;

/// On a helper thread: a flag that is true once the answer of the other thread is no longer wanted.
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

/// A place where a computation may end early. There is one in each loop that may take a tenth of a second or more. The
/// question may run a signal handler that computes something itself. No cancellation point is therefore at a place
/// where a thread_local of the core is in use, except for the memory of a Scratch.
inline void cancellation_point() {
  if (--cancellation::points_left <= 0) cancellation::look_at_clock();
}

/// The same in a loop that looks at so many elements in each round.
inline void cancellation_point(size_t elements) {
  cancellation::points_left -= static_cast<int>(std::min<size_t>(elements / 256, cancellation::kPointsBetween));
  cancellation_point();
}

}  // namespace overlapper
