#pragma once

#include <exception>
#include <memory>
#include <utility>

namespace overlapper {

/// Memory that a thread uses again and again. A signal handler that computes something itself at a cancellation point
/// may ask for memory that is in use, and gets other memory. Contents that an exception left half done are dropped.
template <class T>
class Scratch {
 public:
  Scratch() : own_(kept() ? std::move(kept()) : std::make_unique<T>()) {}
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    if (std::uncaught_exceptions() == exceptions_) kept() = std::move(own_);
  }

  T& operator*() const { return *own_; }
  T* operator->() const { return own_.get(); }

 private:
  static std::unique_ptr<T>& kept() {
    thread_local std::unique_ptr<T> kept;
    return kept;
  }

  std::unique_ptr<T> own_;
  int exceptions_ = std::uncaught_exceptions();
};

}  // namespace overlapper
