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

Camera surface_camera(ocl::Device &device, const CompressedVolume &volume,
                      std::span<const float> isovalues, ImageSize size) {
  constexpr std::uint32_t kWindowBlocks = 4096;
  const DeviceStream stream(device, volume, OnHost{kWindowBlocks});
  Macrocells macrocells(device, make_grid_params(volume.info), stream);
  return surface_camera(volume.info, surface_box(macrocells, volume.info, isovalues), size);
}

}  // namespace isowave::core
