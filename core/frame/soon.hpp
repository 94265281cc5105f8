#pragma once
// A renderer that is not ready yet, as far as a caller must know.

#include <cstdint>

#include "core/frame/renderer.hpp"

namespace isowave::core {

/// What SoonRenderer is to code that does not make one. All may be called from any thread.
class Soon {
 public:
  virtual ~Soon() = default;
  /// Whether the renderer that takes long is made, or has failed.
  virtual bool ready() const = 0;
  /// Waits until ready().
  ///
  /// Throws  the error of making the renderer
  virtual void wait() const = 0;
  /// Requests a stop of the making, and does not wait.
  virtual void give_up() = 0;
  /// Abilities of the renderer that draws meanwhile.
  virtual const Abilities &meanwhile_abilities() const = 0;
  /// Memory of the renderer that took long, after its last call; 0 before it is ready.
  virtual std::uint64_t memory_bytes() const = 0;
};

}  // namespace isowave::core
