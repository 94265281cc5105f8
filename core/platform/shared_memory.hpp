#pragma once
// Memory that processes of one system share.

#include <cstddef>
#include <string>

namespace isowave::core::platform {

/// Bytes that several processes see: one makes them, the others open them by their name. A name can
/// be taken away when all have opened it.
class SharedMemory {
 public:
  /// Makes the bytes, under a new name. data() is nullptr if the system has no room for them.
  static SharedMemory make(std::size_t bytes);
  /// Opens what another process made. data() is nullptr if that fails.
  static SharedMemory open(const std::string &name, std::size_t bytes);

  SharedMemory() = default;
  ~SharedMemory();
  SharedMemory(SharedMemory &&other) noexcept;
  SharedMemory &operator=(SharedMemory &&other) noexcept;
  SharedMemory(const SharedMemory &) = delete;
  SharedMemory &operator=(const SharedMemory &) = delete;

  void *data() const { return data_; }
  /// Short: at most 63 characters.
  const std::string &name() const { return name_; }
  /// Takes the name away. The bytes go with the last process that has them open.
  void remove_name();

 private:
  std::string name_;
  void *data_ = nullptr;
  std::size_t bytes_ = 0;
};

/// The same text at all processes of a system that was started once; "" if the system does not say.
std::string system_identity();

}  // namespace isowave::core::platform
