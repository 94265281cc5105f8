#pragma once
// A .zfp file of ours taken apart, so that a mutation reaches what checksums and compression guard
// (core/zfp/README.md, core/zfp/zfp_file.hpp). Made from the description of the format, not from
// its reader.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isowave::core::fuzz {

struct ZfpParts {
  std::string stream;         ///< header, payload and padding
  std::string index, bounds;  ///< unpacked
  std::vector<ZfpParts> levels;
  std::string text;  ///< JSON
  std::uint32_t version = 0;
};

/// Nothing where the file has no trailer, or parts of other lengths than it says.
std::optional<ZfpParts> take_apart(std::string_view file);

/// The file with right checksums. fix_lengths: also with right lengths of its parts, if its text is
/// JSON.
std::string put_together(const ZfpParts &parts, bool fix_lengths);

}  // namespace isowave::core::fuzz
