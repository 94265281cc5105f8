#include <cstdio>
#include <isowave/isowave.hpp>

int main(int argc, char **argv) try {
  if (argc != 4) throw isowave::Error("usage: example VOLUME ISOVALUE PICTURE.png");
  const float isovalue = std::stof(argv[2]);
  const auto volume = isowave::open_volume(argv[1]);
  isowave::Renderer renderer = isowave::make_renderer(volume);
  const isowave::Frame frame =
      renderer.render({.camera = renderer.camera(isovalue), .isovalue = isovalue});
  isowave::save_png(frame, argv[3]);
  std::printf("%u passes, %.1f ms\n", frame.statistics.passes, frame.statistics.total_ms);
} catch (const std::exception &error) {
  std::fprintf(stderr, "example: %s\n", error.what());
  return 1;
}
