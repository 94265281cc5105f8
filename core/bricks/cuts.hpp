#pragma once
// A volume's blocks, cut into bricks by planes: a k-d tree, which also gives the order in which an
// eye sees the bricks.

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <string_view>
#include <vector>

#include "core/volume/block_box.hpp"

namespace isowave::core {

/// Number of blocks in a box, in 64 bits: only a brick's blocks must have ids of 32 bits.
std::uint64_t num_blocks(const BlockBox &box);

/// The work that a box makes, never less than that of any box within it: the number of its blocks,
/// or of those that an isovalue touches.
using BoxWork = std::function<std::uint64_t(const BlockBox &box)>;

class Cuts {
 public:
  /// Cuts boxes across their longest side until there are enough. All bricks have the same work, as
  /// nearly as planes between blocks allow.
  ///
  /// blocks  blocks of the volume, along each axis
  /// count   number of bricks, each of at least one unit
  /// unit    blocks along an edge of the cubes that are not cut: 2^(levels - 1) if levels of detail
  ///         are to be cut at the same planes
  /// Throws  Error: no brick, or more bricks than units
  Cuts(const glm::ivec3 &blocks, std::uint32_t count, const BoxWork &work = num_blocks,
       int unit = 1);
  /// Cuts so many bricks along each axis, as equal as possible; x counts fastest.
  ///
  /// Throws  Error: none along an axis, or more than units
  Cuts(const glm::ivec3 &blocks, const glm::uvec3 &bricks, int unit = 1);

  /// The bricks. Each block is in one of them.
  const std::vector<BlockBox> &bricks() const { return bricks_; }

  /// The place of each brick [as bricks()] in an order in which no brick is hidden by a later one.
  /// A ray from that eye visits bricks by ascending place, so the first brick with a hit has the
  /// ray's hit.
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

/// Reads a text such as "2x2x1". Throws Error.
glm::uvec3 parse_bricks(std::string_view text);

}  // namespace isowave::core
