// MetaImage volumes, .mha and .mhd: inputs of header_and_data.hpp.

#include <algorithm>

#include "tests/fuzz/header_and_data.hpp"

using namespace isowave::core;

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  return fuzz::read_header_and_data(
      fuzz::text_of(data, size), "volume.mha", "volume.mhd", [](std::string_view text) {
        const std::size_t last_key = text.find("ElementDataFile");
        return last_key == text.npos ? text.size()
                                     : std::min(text.find('\n', last_key), text.size() - 1) + 1;
      });
}
