#pragma once
// Host memory that commands of a device read or write while the host goes on.

#include <memory>
#include <utility>

#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// A value that outlives every command which reads or writes it. The destructor waits for all
/// commands. If the device fails to say that they are done, the value is never freed.
template <class T>
class InFlight {
 public:
  explicit InFlight(Device &device, T value = {})
      : device_(device), value_(std::make_unique<T>(std::move(value))) {}
  ~InFlight() {
    if (!device_.settle()) static_cast<void>(value_.release());
  }
  InFlight(const InFlight &) = delete;
  InFlight &operator=(const InFlight &) = delete;

  T &operator*() { return *value_; }
  const T &operator*() const { return *value_; }
  T *operator->() { return value_.get(); }
  const T *operator->() const { return value_.get(); }

 private:
  Device &device_;
  std::unique_ptr<T> value_;
};

}  // namespace isowave::core::ocl
