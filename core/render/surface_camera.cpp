#include "core/render/surface_camera.hpp"

#include <cmath>
#include <optional>

#include "core/base/error.hpp"

namespace isowave::core {

std::optional<BlockBox> surface_box(Macrocells &macrocells, const VolumeInfo &info,
                                    std::span<const float> isovalues) {
  FrameParams frame = make_grid_params(info);
  std::optional<BlockBox> box;
  for (const float isovalue : isovalues) {
    if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
    frame.surface.isovalue = isovalue;
    macrocells.select(frame);
    const std::optional<BlockBox> blocks = macrocells.active_blocks(frame);
    if (!blocks) continue;
    if (!box) box = blocks;
    box->begin = glm::min(box->begin, blocks->begin);
    box->end = glm::max(box->end, blocks->end);
  }
  return box;
}

Camera surface_camera(const VolumeInfo &info, const std::optional<BlockBox> &box, ImageSize size) {
  const glm::dvec3 last(info.dims - 1u);
  const glm::dvec3 begin = box ? 4.0 * glm::dvec3(box->begin) : glm::dvec3(0);
  const glm::dvec3 end = box ? glm::min(4.0 * glm::dvec3(box->end), last) : last;
  return camera_of_box(info, begin, end, double(size.width) / size.height);
}

Camera surface_camera(ocl::Device &device, const CompressedVolume &volume,
                      std::span<const float> isovalues, ImageSize size) {
  constexpr std::uint32_t kWindowBlocks = 4096;
  const DeviceStream stream(device, volume, OnHost{kWindowBlocks});
  Macrocells macrocells(device, make_grid_params(volume.info), stream);
  return surface_camera(volume.info, surface_box(macrocells, volume.info, isovalues), size);
}

}  // namespace isowave::core
