// HostRenderer's cameras, and rays of any origin.

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/host/host_renderer.hpp"

namespace isowave::core {

namespace {

/// Rays that a thread takes at a time.
constexpr std::uint32_t kRunRays = 1024;

}  // namespace

std::vector<HitRecord> HostRenderer::cast_rays(std::span<const WorldRay> rays, float isovalue,
                                               Normals normals) {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  const std::vector<IndexRay> index_rays = make_index_rays(info_, rays);
  FrameParams frame = make_grid_params(info_);
  frame.view.t_scale = 1;
  HostBlocks &blocks = levels_.open_finest(isovalue);
  frame.surface = blocks.surface();
  std::vector<HitRecord> hits(rays.size(), no_hit());
  const HostField field = blocks.field();
  blocks.run((rays.size() + kRunRays - 1) / kRunRays, [&](std::uint64_t run, bool) {
    const std::size_t begin = run * kRunRays;
    host_loops().cast(frame, field, index_rays.data() + begin,
                      static_cast<uint>(std::min<std::size_t>(kRunRays, rays.size() - begin)),
                      normals == Normals::kSmooth, hits.data() + begin);
  });
  return hits;
}

Camera HostRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size,
                            const Viewpoint &from) {
  const ImageSize of_picture = size.value_or(abilities().largest);
  check_image_size(of_picture);
  std::optional<BlockBox> box;
  for (const float isovalue : isovalues) {
    if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
    const std::optional<BlockBox> blocks = levels_.finest().rounded_box(isovalue);
    if (!blocks) continue;
    if (!box) box = blocks;
    box->begin = glm::min(box->begin, blocks->begin);
    box->end = glm::max(box->end, blocks->end);
  }
  return surface_camera(info_, box, of_picture, from);
}

}  // namespace isowave::core
