#pragma once
// A list that the processes of a team have in pieces, deflated to one stretch of a file.

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/team.hpp"
#include "core/zfp/shared_file.hpp"

namespace isowave::core {

/// Bytes of a list that one rank has.
struct Stretch {
  std::uint32_t rank;
  std::uint64_t begin, end;  ///< in the list
};

/// Writes a deflated list that consists of stretches. Rank 0 receives them piece by piece. All
/// ranks make the same call.
///
/// own      this rank's stretches, in the order of the list
/// Returns  at rank 0, the size as written [bytes]
/// Throws   Error at all ranks
std::uint64_t write_deflated(Team &team, SectionWriter &out, std::span<const Stretch> stretches,
                             std::span<const std::span<const std::byte>> own,
                             std::size_t piece_size);

}  // namespace isowave::core
