// Reads a volume, compresses, draws and extracts it on the host, for tests/host_only_test.sh and
// tests/cross_test.sh.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <isowave/host.hpp>
#include <string>

namespace {

template <class T>
void append(std::ofstream &file, const T &value) {
  file.write(reinterpret_cast<const char *>(&value), sizeof(value));
}

/// All fields, without what a compiler puts between them.
void append_hit(std::ofstream &file, const isowave::Hit &hit) {
  append(file, hit.t);
  append(file, hit.level);
  append(file, hit.cell);
  append(file, hit.position);
  append(file, hit.gradient);
  append(file, hit.surface);
  append(file, hit.cap);
}

}  // namespace

int main(int argc, char **argv) try {
  if (argc != 4 && argc != 5)
    throw isowave::Error("usage: host_only VOLUME ISOVALUE FOLDER [VIEWS]");
  const double isovalue = std::stod(argv[2]);
  const std::filesystem::path folder = argv[3];
  const auto volume = isowave::open_volume(argv[1]);
  volume->save(folder / "volume.zfp");

  isowave::Renderer renderer = isowave::make_host_renderer(volume);
  const isowave::ImageSize size{320, 180};
  std::vector<isowave::Camera> cameras{renderer.camera(isovalue, size)};
  if (argc == 5)
    cameras = renderer.turntable({{.isovalue = isovalue}},
                                 static_cast<std::uint32_t>(std::stoul(argv[4])), size);
  std::ofstream depth(folder / "depth", std::ios::binary), hits(folder / "hits", std::ios::binary);
  for (std::size_t view = 0; view < cameras.size(); ++view) {
    const isowave::Frame frame = renderer.render({.camera = cameras[view],
                                                  .isovalue = isovalue,
                                                  .size = size,
                                                  .want_depth = true,
                                                  .want_hits = true});
    isowave::save_png(frame,
                      folder / ("picture" + (view == 0 ? "" : std::to_string(view)) + ".png"));
    for (const float t : frame.depth) append(depth, t);
    for (const isowave::Hit &hit : frame.hits) append_hit(hits, hit);
  }
  isowave::extract_to_file(volume, isovalue, folder / "mesh.ply");
} catch (const std::exception &error) {
  std::fprintf(stderr, "host_only: %s\n", error.what());
  return 1;
}
