#include "core/io/volume_header.hpp"

#include <cmath>

#include "core/base/error.hpp"
#include "core/io/text_header.hpp"

namespace isowave::core {

void set_axis(VolumeInfo &info, int axis, double spacing, const glm::dvec3 &direction) {
  info.spacing[axis] = std::abs(spacing);
  info.direction[axis] =
      (spacing < 0 ? -direction : direction) + 0.0;  // no negative zeros in what people read
}

std::shared_ptr<const InputFile> open_data_file(const InputFile &header, const std::string &name) {
  const std::string what = fmt::format("{}: its data file {}", header.what(), quote(name));
  // Opening a name with a zero byte would open what is named before that.
  if (name.find('\0') != name.npos) throw Error("{}: no file can have this name", what);
  return std::make_shared<const InputFile>(header.path().parent_path() / name, what);
}

}  // namespace isowave::core
