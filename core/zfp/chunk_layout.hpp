#pragma once
// Where things are in a file of chunks (block_chunks.hpp), for its writer and its reader.

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/zfp/zfp_trailer.hpp"

namespace isowave::core {

inline constexpr std::uint32_t kChunkEdge = 4;  ///< blocks along the edge of a macrocell
inline constexpr std::uint64_t kChunkCrcBytes = sizeof(std::uint32_t);

/// The file's first bytes. The JSON text follows, and a deflated table for each level: for each of
/// its chunks uint16 low, then uint16 high for each, then uint32 bytes for each.
struct ChunksHead {
  std::array<char, 8> magic;
  std::uint32_t version, json_bytes, crc;  ///< crc: of JSON and tables
};
static_assert(sizeof(ChunksHead) == 20);
inline constexpr std::array<char, 8> kChunksMagic{'I', 'S', 'O', 'C', 'H', 'N', 'K', '\n'};
inline constexpr std::uint32_t kChunksVersion = 1;
inline constexpr std::uint64_t kChunkRowBytes = 8;  ///< of the table, for each chunk

inline std::uint64_t bytes_of_bits(std::uint64_t bits) {
  return (bits + 7) / 8;
}

/// Bytes of a chunk before its payload: uint16 length of each block [bits], if they have lengths of
/// their own; uint64 voxels without data of each, if the volume has some.
inline std::uint64_t chunk_head_bytes(std::uint64_t num_blocks, bool is_indexed, bool has_gaps) {
  return num_blocks *
         ((is_indexed ? sizeof(std::uint16_t) : 0) + (has_gaps ? sizeof(std::uint64_t) : 0));
}

inline glm::uvec3 macrocells_of(const glm::uvec3 &blocks) {
  return (blocks + kChunkEdge - 1u) / kChunkEdge;
}

inline glm::uvec3 place_in(const glm::uvec3 &size, std::uint32_t number) {
  return {number % size.x, number / size.x % size.y, number / size.x / size.y};
}

/// Appends the macrocells of a box [begin, begin + size) that are below `end`, eighth by eighth, so
/// that neighbours are near each other in the file. size: a power of two.
inline void add_in_file_order(const glm::uvec3 &begin, std::uint32_t size, const glm::uvec3 &end,
                              std::vector<std::uint32_t> &order) {
  if (!glm::all(glm::lessThan(begin, end))) return;
  if (size == 1) {
    order.push_back(begin.x + end.x * (begin.y + end.y * begin.z));
    return;
  }
  for (std::uint32_t corner = 0; corner < 8; ++corner)
    add_in_file_order(begin + size / 2 * glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2),
                      size / 2, end, order);
}

/// [place in the file] macrocell.
inline std::vector<std::uint32_t> file_order(const glm::uvec3 &macrocells) {
  std::vector<std::uint32_t> order;
  order.reserve(std::size_t{macrocells.x} * macrocells.y * macrocells.z);
  add_in_file_order(glm::uvec3(0),
                    std::bit_ceil(std::max({macrocells.x, macrocells.y, macrocells.z})), macrocells,
                    order);
  return order;
}

/// The checksum of a chunk that begins there: one from elsewhere has another.
inline std::uint32_t chunk_crc(std::uint32_t file_id, std::uint64_t begin,
                               std::span<const std::byte> content) {
  const std::array<std::uint64_t, 2> place{file_id, begin};
  return update_crc(update_crc(0, std::as_bytes(std::span(place))), content);
}

/// The upper half of a float32 that is not above, or not below, a value; and back.
inline std::uint16_t half_below(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t half = bits >> 16;
  return static_cast<std::uint16_t>(std::bit_cast<float>(half << 16) > value ? half + 1 : half);
}
inline std::uint16_t half_above(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t half = bits >> 16;
  return static_cast<std::uint16_t>(std::bit_cast<float>(half << 16) < value ? half + 1 : half);
}
inline float from_half(std::uint16_t half) {
  return std::bit_cast<float>(std::uint32_t{half} << 16);
}

}  // namespace isowave::core
