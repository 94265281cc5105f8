#pragma once
// `.zfp` files with other trailers, whose checksums are right. Made from the description of the
// format, not from its writer.

#include <zlib.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace isowave::core::test {

inline std::uint32_t crc_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      ::crc32_z(0, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()));
}

/// A trailer whose checksums are right, for what stands before it.
inline std::string with_trailer(const std::string &before, const std::string &text,
                                std::uint32_t version) {
  const std::array<std::uint32_t, 3> numbers{version, static_cast<std::uint32_t>(text.size()),
                                             crc_of(before)};
  std::string end =
      text + std::string(reinterpret_cast<const char *>(numbers.data()), sizeof(numbers));
  const std::uint32_t crc = crc_of(end);
  return before + end + std::string(reinterpret_cast<const char *>(&crc), sizeof(crc)) +
         "ISOWAVE\n";
}

/// A file that has a trailer, cut before and behind its JSON text.
struct TrailerFile {
  explicit TrailerFile(const std::string &bytes) {
    constexpr std::size_t kFooterBytes = 24;
    std::uint32_t json_bytes = 0;
    std::memcpy(&version, &bytes[bytes.size() - kFooterBytes], 4);
    std::memcpy(&json_bytes, &bytes[bytes.size() - kFooterBytes + 4], 4);
    before = bytes.substr(0, bytes.size() - kFooterBytes - json_bytes);
    text = bytes.substr(before.size(), json_bytes);
  }
  std::string bytes() const { return with_trailer(before, text, version); }

  std::uint32_t version = 0;
  std::string before, text;
};

}  // namespace isowave::core::test
