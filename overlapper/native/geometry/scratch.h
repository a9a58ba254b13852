#pragma once

#include <exception>
#include <memory>
#include <utility>

namespace overlapper {

/// Memory that a thread uses again and again. At a cancellation point, a signal handler may compute something and ask
/// for memory that is in use. It gets other memory. After an exception, half-done contents are dropped.
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
