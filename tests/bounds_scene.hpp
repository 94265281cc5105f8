#pragma once
// A volume before and after compression, with levels of detail and the bounds of their errors.

#include <filesystem>
#include <string>
#include <vector>

#include "core/io/open_volume.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core::test {

struct BoundsScene {
  BoundsScene(const glm::uvec3 &dims, const VoxelFunction &field, CompressOptions options)
      : source(sample(dims, field)) {
    ArrayReader reader(grid_info(dims, {1, 1.25, 0.75}), source);
    compress_from(reader, options);
  }
  BoundsScene(const std::string &file, const CompressOptions &options) {
    const auto reader = open_volume(std::filesystem::path(ISOWAVE_TEST_DATA) / file);
    source.resize(reader->info().num_voxels());
    reader->read_layers(0, reader->info().dims.z, source);
    ArrayReader array(reader->info(), source);
    compress_from(array, options);
  }
  void compress_from(VolumeReader &reader, CompressOptions options) {
    options.measure_error = true;
    options.levels = 0;
    volume = compress(reader, options);
  }

  std::vector<float> source;
  CompressedVolume volume;
};

}  // namespace isowave::core::test
