#include "reference/twin_renderer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/frame/field_values.hpp"
#include "core/host/host_renderer.hpp"
#include "core/view/detail.hpp"

namespace isowave::core {

Abilities TwinRenderer::abilities() const {
  Abilities abilities;
  abilities.largest = largest_;
  abilities.levels = true;
  abilities.fewer_planes = true;
  abilities.bounds = true;
  abilities.given_rays = abilities.bounce = true;
  abilities.clipping = true;
  abilities.field = abilities.field_labels = field_.has_value();
  if (solver_.kind == kDefaultSolver.kind) abilities.most_surfaces = ISO_MAX_SURFACES;
  abilities.solver = solver_;
  return abilities;
}

std::vector<VolumeInfo> TwinRenderer::levels() const {
  return level_infos(volume_, true);
}

FrameStats TwinRenderer::render(const FrameRequest &request) {
  check(request, abilities());
  size_ = size_of(request, abilities());
  const Decoded wanted{request.voxel_pixels, request.voxel_error, request.bound};
  if (!twin_ || wanted != decoded_) {
    twin_.emplace(volume_, request.voxel_pixels, request.voxel_error, request.bound);
    decoded_ = wanted;
  }
  const auto begin = std::chrono::steady_clock::now();
  frame_ = make_frame_params(volume_.info, request.camera, size_, request.isovalue);
  open_ = {};
  colors_.clear();
  FrameStats stats;
  const LightRays rays = light_rays_of(request);
  if (request.surfaces.empty()) {
    hits_ = twin_->render(request.camera, size_, request.isovalue, solver_, request.normals,
                          request.clip);
  } else {
    FrameRequest sized = request;
    sized.size = size_;
    LayeredFrame layered = twin_->render_layers(sized, field_ ? &*field_ : nullptr);
    hits_ = std::move(layered.first_hits);
    colors_ = std::move(layered.colors);
    stats.layers = layered.stats;
  }
  field_values_.clear();
  if (request.surfaces.empty() && request.field_values)
    field_values_ = field_->values(levels(), hits_, request);
  if (request.surfaces.empty() && rays.count() != 0)
    open_ =
        twin_->open(request.camera, size_, request.isovalue, hits_, rays, solver_, request.clip);
  stats.rays_hit = static_cast<std::uint64_t>(
      std::ranges::count_if(hits_, [](const HitRecord &hit) { return std::isfinite(hit.t); }));
  stats.total_ms = ms_since(begin);
  if (request.on_pass) {
    PassStats pass;
    pass.counts.hit_count = static_cast<uint>(stats.rays_hit);
    pass.completed_percent = 100;
    stats.passes.push_back(pass);
    request.on_pass(pass);
  }
  return stats;
}

std::vector<HitRecord> TwinRenderer::cast_rays(std::span<const WorldRay>, float, Normals) {
  throw Error("the scalar reference casts no rays of any origin: draw on a device or the host");
}

Camera TwinRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size,
                            const Viewpoint &from) {
  return HostRenderer(volume_).camera(isovalues, size.value_or(largest_), from);
}

FrameArrays TwinRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  check_arrays(wanted, size_);
  const std::vector<HitRecord> hits = this->hits();
  const Shading shading = shading_of(volume_.info, appearance);
  FrameArrays arrays;
  if (wanted.picture) {
    const Image8 image =
        colors_.empty() ? shade_scalar(frame_, shading, hits, size_.samples, open_, field_values_)
                        : shade_layers_scalar(frame_, shading.params, colors_, size_.samples);
    arrays.picture = memory_.array<std::uint8_t>(image.pixels.size());
    std::ranges::copy(image.pixels, arrays.picture.begin());
  }
  const HitMap map = make_hit_map(levels());
  add_hit_arrays(wanted, hits, shading.params, &map, memory_, arrays);
  if (wanted.field_values) {
    arrays.field_values = memory_.array<float>(field_values_.size());
    std::ranges::copy(field_values_, arrays.field_values.begin());
  }
  return arrays;
}

std::optional<std::array<float, 2>> TwinRenderer::field_range() {
  if (!colors_.empty() && field_) return field_->volume_range();
  return range_of_values(field_values_);
}

std::vector<HitRecord> TwinRenderer::hits() {
  if (hits_.empty()) throw Error("there is no picture: no frame has been drawn");
  return hits_;
}

}  // namespace isowave::core
