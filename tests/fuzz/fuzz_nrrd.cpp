// NRRD volumes, .nrrd and .nhdr: inputs of header_and_data.hpp.

#include "tests/fuzz/header_and_data.hpp"

using namespace isowave::core;

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  return fuzz::read_header_and_data(fuzz::text_of(data, size), "volume.nrrd", "volume.nhdr",
                                    [](std::string_view text) {
                                      const std::size_t empty_line = text.find("\n\n");
                                      return empty_line == text.npos ? text.size() : empty_line + 2;
                                    });
}
