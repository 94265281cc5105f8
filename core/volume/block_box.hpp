#pragma once

#include <glm/glm.hpp>

namespace isowave::core {

/// Blocks from `begin` to before `end`.
struct BlockBox {
  glm::ivec3 begin, end;
};

}  // namespace isowave::core
