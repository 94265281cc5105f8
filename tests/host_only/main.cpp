// Reads a volume, compresses, draws and extracts it on the host, for tests/host_only_test.sh.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <isowave/host.hpp>

int main(int argc, char **argv) try {
  if (argc != 4) throw isowave::Error("usage: host_only VOLUME ISOVALUE FOLDER");
  const double isovalue = std::stod(argv[2]);
  const std::filesystem::path folder = argv[3];
  const auto volume = isowave::open_volume(argv[1]);
  volume->save(folder / "volume.zfp");

  isowave::Renderer renderer = isowave::make_host_renderer(volume);
  const isowave::ImageSize size{320, 180};
  const isowave::Frame frame = renderer.render({.camera = renderer.camera(isovalue, size),
                                                .isovalue = isovalue,
                                                .size = size,
                                                .want_depth = true});
  isowave::save_png(frame, folder / "picture.png");
  std::ofstream(folder / "depth", std::ios::binary)
      .write(reinterpret_cast<const char *>(frame.depth.data()),
             static_cast<std::streamsize>(frame.depth.size() * sizeof(float)));

  isowave::extract_to_file(volume, isovalue, folder / "mesh.ply");
} catch (const std::exception &error) {
  std::fprintf(stderr, "host_only: %s\n", error.what());
  return 1;
}
