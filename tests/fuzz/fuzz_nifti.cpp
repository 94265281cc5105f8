// NIfTI volumes. Input: how to pack what follows ('g': gzip; others: as it is), 'n' for the name
// volume.nii or another letter for volume.nii.gz, and the file's bytes.

#include "tests/fuzz/fuzz_target.hpp"

using namespace isowave::core;

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::string_view input = fuzz::text_of(data, size);
  if (input.size() < 2) return -1;
  fuzz::read_volume(fuzz::put(input[1] == 'n' ? "volume.nii" : "volume.nii.gz",
                              fuzz::pack_by(input[0], input.substr(2))));
  return 0;
}
