#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "geometry/cancellation.h"

namespace overlapper {

/// A thread that joins in its destructor, like std::jthread, which not every library has.
struct WaitedFor : std::thread {
  using std::thread::thread;
  WaitedFor(WaitedFor&&) = default;
  ~WaitedFor() {
    if (joinable()) join();
  }
};

/// Calls `work(i, thread)` for every i below `count`, on the calling thread and on `threads` - 1 others. The threads
/// live for this call only, so a process may fork between calls. `work` returns false if it took so long that the clock
/// should be checked. On cancellation no further i begins, running ones stop at their next cancellation point, and the
/// result is false. The exception of the least i is rethrown: blocks begin in order, and every begun block is finished.
template <class Work>
bool for_each_in_parallel(size_t count, int threads, const Work& work) {
  constexpr size_t kBlock = 16;
  std::atomic<size_t> next{0};
  std::atomic<bool> stopped{false};
  std::mutex mutex;
  std::exception_ptr failure;
  size_t failed_at = count;

  const auto work_on = [&](int thread) {
    for (size_t begin = next.fetch_add(kBlock); begin < count; begin = next.fetch_add(kBlock)) {
      const size_t end = std::min(begin + kBlock, count);
      for (size_t i = begin; i < end && !stopped.load(std::memory_order_relaxed); ++i) try {
          if (!work(i, thread) || i + 1 == end) cancellation::look_at_clock();
        } catch (const Cancelled&) {
          stopped = true;
        } catch (...) {
          const std::scoped_lock lock(mutex);
          if (i < failed_at) failed_at = i, failure = std::current_exception();
          next = count;
          break;
        }
    }
  };

  int working = static_cast<int>(std::min<size_t>(threads, (count + kBlock - 1) / kBlock)) - 1;
  std::condition_variable done;
  std::vector<WaitedFor> others;
  const auto help = [&](int thread) {
    cancellation::given_up = &stopped;
    work_on(thread);
    const std::scoped_lock lock(mutex);
    if (--working == 0) done.notify_one();
  };
  for (int t = 1, wanted = working; t <= wanted; ++t) try {
      others.emplace_back(help, t);
    } catch (const std::system_error&) {
      // No more threads are available, so the present threads do the work.
      const std::scoped_lock lock(mutex);
      working -= wanted - t + 1;
      break;
    }
  work_on(0);
  for (std::unique_lock lock(mutex); working > 0;) {
    if (done.wait_for(lock, cancellation::kPatience, [&] { return working == 0; })) break;
    lock.unlock();
    try {
      cancellation::look_at_clock();
    } catch (const Cancelled&) {
      stopped = true;
    }
    lock.lock();
  }
  others.clear();
  if (failure) std::rethrow_exception(failure);
  return !stopped;
}

}  // namespace overlapper
