// What a brick's renderer does for the light rays of whole frames (core/bricks).

#include <limits>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core {

std::vector<HitRecord> DeviceRenderer::placed_hits() {
  std::vector<HitRecord> hits = this->hits();
  const bool has_level_ids =
      blocks_.level_frames->size() > 1 || blocks_.level_frames->front().place.begin_z != 0;
  for (HitRecord &hit : hits) {
    if (hit.t == std::numeric_limits<float>::infinity()) continue;
    std::size_t level = 0;
    while (has_level_ids &&
           level_block_of(&(*blocks_.level_frames)[level], hit.block_id) == ISO_INVALID_ID)
      ++level;
    const FrameParams &frame = (*blocks_.level_frames)[level];
    if (has_level_ids) hit.block_id = level_block_of(&frame, hit.block_id);
    hit = placed_hit(&frame, static_cast<uint>(blocks_.drawing.first + level), hit);
  }
  return hits;
}

HitRecord DeviceRenderer::placed(const HitRecord &hit) const {
  return placed_hit(&blocks_.level_frames->front(), 0, hit);
}

void DeviceRenderer::begin_ambient(const FrameRequest &request, std::vector<HitRecord> placed,
                                   LevelRange levels) {
  check_has_picture();
  check_has_given();
  if (!is_brick()) throw Error("only a brick's frames leave their ambient rays to others");
  for (HitRecord &hit : placed) hit.cell -= static_cast<uint>(levels.first);
  set_hits(placed);
  // A ray stays in the level that has its hit, which this brick need not have drawn.
  const FirstSurface first = first_surface(request);
  std::vector<FrameParams> frames =
      make_level_frames(DeviceRenderer::levels(), request.camera, size_, first.isovalue, 0);
  for (std::size_t level = 0; level < frames.size(); ++level) {
    const bool may_have_rays = level >= levels.first && level < levels.end;
    const View &view = frames[level].view;
    frames[level].screen = {0, 0, view.width, view.height};  // hits are other bricks', too
    frames[level].band = {.begin_t = 0,
                          .end_t = may_have_rays ? std::numeric_limits<float>::infinity() : 0};
  }
  frames.front().surface.isovalue_index = first.number;
  layers_screen_ = frames.front().screen;
  open_frame(std::move(frames), decoded_values(request), FieldBound::kNone, RaySource::kGiven);
}

std::vector<std::uint64_t> DeviceRenderer::blocked_rays(const FrameRequest &request,
                                                        std::uint32_t round, LaterPasses &stats) {
  rays_.frame = blocks_.level_frames->front();
  const VolumeInfo &info = blocks_.levels[blocks_.drawing.first].info;
  ambient_->begin(info, blocks_.drawing.first, light_rays_of(request));
  const OnPass never_stops;
  Frame frame{never_stops, 1};
  if (request.surfaces.empty()) {
    cast_round(round, frame);
    ambient_->block(rays_);
  } else {
    const ClipParams clip =
        make_clip_params(blocks_.levels[0].info, rays_.frame.view, request.camera, request.clip);
    cast_layer_round(round, request, clip, isovalues_of_layers(request.surfaces), frame);
  }
  const LaterPasses &passes = frame.stats.ambient;
  rays_.frame = blocks_.levels[0].frame;  // for shading
  std::vector<GivenRay> left(size_.num_rays());
  rays_.given.read(left);
  std::vector<std::uint64_t> blocked((left.size() + 63) / 64);
  for (std::size_t ray = 0; ray < left.size(); ++ray)
    blocked[ray / 64] |= std::uint64_t{!is_given(left[ray])} << ray % 64;
  blocks_.close(passes.recycled_blocks, true);
  stats += passes;
  return blocked;
}

void DeviceRenderer::set_open(const OpenCounts &open) {
  check_has_picture();
  check_has_given();
  rays_.open_counts.write(open.counts);
  rays_.num_ambient = open.num_ambient;
  rays_.num_shadow = open.num_shadow;
}

void DeviceRenderer::set_field_values(std::span<const float> values) {
  check_has_picture();
  rays_.field_values.write(values);
}

}  // namespace isowave::core
