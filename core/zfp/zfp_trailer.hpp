#pragma once
// The end of a `.zfp` file: JSON text and footer. README.md of this folder describes them.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

inline constexpr std::uint32_t kVersion = 1, kIndexedVersion = 2, kPyramidVersion = 4,
                               kNoDataVersion = 5;
inline constexpr std::uint32_t kBoundlessPyramidVersion =
    3;  ///< before levels had bounds: is read, not written
inline constexpr std::array<char, 8> kZfpFooterMagic{'I', 'S', 'O', 'W', 'A', 'V', 'E', '\n'};

/// The file's last bytes.
struct ZfpFooter {
  std::uint32_t version, json_bytes, stream_crc, json_crc;
  std::array<char, 8> magic;
};
static_assert(sizeof(ZfpFooter) == 24);

std::uint32_t update_crc(std::uint32_t crc, std::span<const std::byte> bytes);
/// The checksum of two parts together, from the checksum of each and the bytes of the second.
std::uint32_t combine_crcs(std::uint32_t first, std::uint32_t second, std::uint64_t second_bytes);
/// The checksum of the JSON text and of the footer's numbers before json_crc.
std::uint32_t json_crc(std::string_view text, const ZfpFooter &footer);

/// The parts of a file, from the JSON text.
struct ZfpLayout {
  std::uint64_t index_bytes = 0, bounds_bytes = 0, no_data_bytes = 0;
  std::vector<std::uint64_t> level_bytes{};  ///< of the coarser levels' files
  /// Whether the errors are those against the source. In older files they leave out the cast to
  /// float32.
  bool counts_casts = true;
};

std::string zfp_trailer_text(const CompressedVolume &volume, const ZfpLayout &layout);

/// Sets what the text says of the volume, whose kind and dims the stream's header has said. Throws
/// Error, which does not name the file: no JSON, a field that is missing or of another kind, a
/// number that no such volume has.
ZfpLayout apply_zfp_trailer(const std::string &text, CompressedVolume &volume);

}  // namespace isowave::core
