// Scene files. Input: the text. One that is accepted reads the same when written again.

#include "isowave/scene.hpp"
#include "tests/fuzz/fuzz_target.hpp"

using namespace isowave::core;

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::string_view text = fuzz::text_of(data, size);
  std::string written;
  if (!fuzz::accepts([&] { written = isowave::scene_text(isowave::parse_scene(text)); })) return 0;
  fuzz::demand(isowave::scene_text(isowave::parse_scene(written)) == written,
               "the scene is not the one that was written");
  return 0;
}
