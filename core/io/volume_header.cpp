#include "core/io/volume_header.hpp"

#include <fmt/format.h>

#include <cmath>

#include "core/io/text_header.hpp"

namespace isowave {

void set_axis(VolumeInfo &info, int axis, double spacing, const glm::dvec3 &direction) {
  info.spacing[axis] = std::abs(spacing);
  info.direction[axis] =
      (spacing < 0 ? -direction : direction) + 0.0;  // no negative zeros in what people read
}

void set_data_file(VoxelLayout &voxels, const std::filesystem::path &header, const std::string &name) {
  voxels.file = header.parent_path() / name;
  voxels.what = fmt::format("{}: its data file {}", header.string(), quote(name));
  voxels.offset = 0;
}

}  // namespace isowave
