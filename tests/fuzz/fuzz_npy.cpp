// .npy images. Input: the file. One that is accepted reads the same when written again.

#include "core/io/npy.hpp"
#include "tests/fuzz/fuzz_target.hpp"

using namespace isowave::core;

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::filesystem::path path = fuzz::put("image.npy", fuzz::text_of(data, size));
  FloatImage image;
  if (!fuzz::accepts([&] { image = read_npy(path); })) return 0;
  fuzz::demand(image.pixels.size() == std::size_t(image.width) * image.height,
               "pixels are not width x height");
  write_npy(image, path);
  const FloatImage again = read_npy(path);
  fuzz::demand(again.width == image.width && again.height == image.height &&
                   fuzz::same_bits(again.pixels, image.pixels),
               "an image is not the one that was written");
  return 0;
}
