#include "isowave/extract.hpp"

#include <mutex>

#include "core/api/device_implementation.hpp"
#include "core/api/guarded.hpp"
#include "core/api/mesh_parts.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/extract/extractor.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

using core::guarded;

core::SimplifiedMesh extract_to(const std::shared_ptr<Device> &device,
                                const std::shared_ptr<const Volume> &volume, double isovalue,
                                const ExtractOptions &options, core::MeshSink &sink) {
  if (!device || !volume) throw core::Error("extracting needs a device and a volume");
  const core::CompressedVolume &level = level_to_extract(*volume, options);
  const std::lock_guard lock(device->implementation().mutex);
  const std::function<void()> before_kernel = [&options] {
    if (options.progress) options.progress("extracting", 0);
  };
  const KernelWatch watch(device->implementation().device, before_kernel);
  const float drawn = core::drawn_isovalue(volume->implementation().volume, isovalue);
  const auto places = static_cast<core::VertexPlaces>(options.vertices);
  return core::give_changed(level, drawn, places, changes_of(options), sink,
                            [&](core::MeshSink &to) {
                              core::Extractor extractor(device->implementation().device, level,
                                                        {.with_normals = options.with_normals,
                                                         .vertices = places,
                                                         .memory_budget = options.memory_budget,
                                                         .cache_slots = options.cache_blocks});
                              extractor.extract(drawn, to, progress_of(options, "extracting"));
                            });
}

}  // namespace

Mesh extract(const std::shared_ptr<Device> &device, const std::shared_ptr<const Volume> &volume,
             double isovalue, const ExtractOptions &options) {
  return guarded("extracting a surface", [&] {
    return extracted(
        [&](core::MeshSink &sink) { return extract_to(device, volume, isovalue, options, sink); });
  });
}

std::string extract_to_file(const std::shared_ptr<Device> &device,
                            const std::shared_ptr<const Volume> &volume, double isovalue,
                            const std::filesystem::path &path, const ExtractOptions &options) {
  return guarded("extracting a surface", [&] {
    return extracted_to_file(path, options, [&](core::MeshSink &sink) {
      return extract_to(device, volume, isovalue, options, sink);
    });
  });
}

}  // namespace isowave
