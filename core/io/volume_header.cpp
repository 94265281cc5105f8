#include "core/io/volume_header.hpp"

#include <cmath>

#include "core/error.hpp"
#include "core/io/text_header.hpp"

namespace isowave {

void set_axis(VolumeInfo &info, int axis, double spacing, const glm::dvec3 &direction) {
  info.spacing[axis] = std::abs(spacing);
  info.direction[axis] =
      (spacing < 0 ? -direction : direction) + 0.0;  // no negative zeros in what people read
}

void set_data_file(VoxelLayout &voxels, const std::filesystem::path &header, const std::string &name) {
  if (name.find('\0') != name.npos) {  // opening it would open what is named before that
    throw Error("{}: its data file {}: no file can have this name", header.string(), quote(name));
  }
  voxels.file = header.parent_path() / name;
  voxels.what = fmt::format("{}: its data file {}", header.string(), quote(name));
  voxels.offset = 0;
}

}  // namespace isowave
