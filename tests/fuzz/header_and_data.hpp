#pragma once
// Inputs of volumes with a text header: how to pack the voxels, the header, and the voxels, in one
// file or in two.

#include <string>
#include <string_view>

#include "tests/fuzz/fuzz_target.hpp"

namespace isowave::core::fuzz {

/// What stands between header and voxels that lie in a file of their own. Headers call that
/// `data.raw`, or `data.raw.gz`.
inline constexpr std::string_view kNewFile = "\n--data.raw--\n";
/// In a header: the number of packed bytes.
inline constexpr std::string_view kPackedBytes = "@@";

/// Writes the file or files of an input and reads the volume. The input's first byte says how its
/// voxels are packed (pack_by()). end_of_header(text) is where voxels begin that stand in the
/// header's file.
template <class EndOfHeader>
int read_header_and_data(std::string_view input, const std::string &attached_name,
                         const std::string &detached_name, const EndOfHeader &end_of_header) {
  if (input.empty()) return -1;
  const char how = input[0];
  input.remove_prefix(1);
  const std::size_t cut = input.find(kNewFile);
  const bool detached = cut != input.npos;
  const std::size_t end = detached ? cut + 1 : end_of_header(input);
  std::string header(input.substr(0, end));
  const std::string data = pack_by(how, input.substr(detached ? cut + kNewFile.size() : end));
  if (const std::size_t at = header.find(kPackedBytes); at != header.npos)
    header.replace(at, kPackedBytes.size(), std::to_string(data.size()));
  if (detached) {
    put("data.raw", data);
    put("data.raw.gz", data);
    read_volume(put(detached_name, header));
  } else {
    read_volume(put(attached_name, header + data));
  }
  return 0;
}

}  // namespace isowave::core::fuzz
