#pragma once
// The parts of a mesh that hang together.

#include <cstdint>

#include "core/mesh/mesh.hpp"

namespace isowave::core {

/// Keeps the parts with the largest areas, and takes the other vertices and triangles out. Parts
/// hang together by common vertices. If areas are equal, the part with the lowest vertex stays.
///
/// count  1 or more
void keep_largest(Mesh &mesh, std::uint64_t count);

}  // namespace isowave::core
