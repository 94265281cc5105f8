#pragma once
// A volume's blocks cut into bricks by planes: a k-d tree, which also says in which order an eye
// sees them.

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <string_view>
#include <vector>

#include "core/volume/block_box.hpp"

namespace isowave::core {

/// Blocks of a box. 64 bits: only a brick's blocks must have ids of 32.
std::uint64_t num_blocks(const BlockBox &box);

/// How much work a box is, never less than any box within it: its blocks, or those that an isovalue
/// touches.
using BoxWork = std::function<std::uint64_t(const BlockBox &box)>;

class Cuts {
 public:
  /// Cuts the longest side of what is left to cut, again and again, where both parts have as much
  /// work for each of their bricks, as near as planes between blocks allow.
  ///
  /// blocks  of the volume, along each axis
  /// count   of bricks, each of at least one unit
  /// unit    blocks along an edge of the cubes that are not cut: where levels of detail are to be
  ///         cut at the same planes, 2^(levels - 1)
  /// Throws  Error: no brick, or more than units
  Cuts(const glm::ivec3 &blocks, std::uint32_t count, const BoxWork &work = num_blocks,
       int unit = 1);
  /// So many bricks along each axis, as equal as can be; x counts fastest.
  ///
  /// Throws  Error: none along an axis, or more than units
  Cuts(const glm::ivec3 &blocks, const glm::uvec3 &bricks, int unit = 1);

  /// Each block is in one.
  const std::vector<BlockBox> &bricks() const { return bricks_; }

  /// The place of each brick [as bricks()] in an order in which no brick is hidden by a later one:
  /// a ray from that eye visits bricks by ascending place. So what the first brick of it finds is
  /// the ray's hit.
  ///
  /// eye  in the index space of the volume [voxels], as the rays have it
  std::vector<std::uint32_t> order_from(const glm::vec3 &eye) const;

 private:
  /// A brick, or two parts, below the plane and above.
  struct Node {
    std::uint32_t brick = 0;
    int axis = -1;  ///< -1: a brick
    int plane = 0;  ///< [blocks]
    std::uint32_t below = 0, above = 0;
  };

  std::uint32_t cut(const BlockBox &box, std::uint32_t count, const BoxWork &work);
  std::uint32_t cut_grid(const BlockBox &box, const glm::uvec3 &first, const glm::uvec3 &bricks,
                         const glm::uvec3 &all);
  std::uint32_t add_brick(const BlockBox &box);
  void scale(int unit, const glm::ivec3 &blocks);
  void visit(std::uint32_t node, const glm::vec3 &eye, std::uint32_t &place,
             std::vector<std::uint32_t> &places) const;

  std::vector<Node> nodes_;
  std::vector<BlockBox> bricks_;
  std::uint32_t root_ = 0;
};

/// "2x2x1". Throws Error.
glm::uvec3 parse_bricks(std::string_view text);

}  // namespace isowave::core
