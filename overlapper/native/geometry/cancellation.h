#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>

namespace overlapper {

/// Thrown at a cancellation point once nobody waits for the answer any more.
struct Cancelled {};

namespace cancellation {

/// Whether whoever waits on this thread for an answer still wants it. Set once, by what knows: without it, answers are
/// always wanted.
inline bool (*still_wanted)() = nullptr;

/// On a thread that helps another: what tells that the other's answer is not wanted any more.
inline constinit thread_local const std::atomic<bool>* given_up = nullptr;

inline constexpr int kPointsBetween = 64;  ///< which take a millisecond at most
inline constexpr std::chrono::milliseconds kPatience(50);
inline constinit thread_local int points_left = kPointsBetween;

/// Throws Cancelled if, every 50 ms, the answer turns out not to be wanted any more.
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

/// Where a computation may end early: in each loop that may go on for a tenth of a second and more. As what is asked
/// may be a signal handler that computes something itself, there are none where a thread_local of ours is in use, but
/// for what a Scratch has lent.
inline void cancellation_point() {
  if (--cancellation::points_left <= 0) cancellation::look_at_clock();
}

/// In a loop of which each round looks at so many elements.
inline void cancellation_point(size_t elements) {
  cancellation::points_left -= static_cast<int>(std::min<size_t>(elements / 256, cancellation::kPointsBetween));
  cancellation_point();
}

}  // namespace overlapper
