// What a brick's renderer does for the light rays of whole frames (core/bricks).

#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "core/render/picture_so_far.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/clip.h"

namespace isowave::core {

std::vector<HitRecord> DeviceRenderer::placed_hits() {
  return placed(hits(), blocks_.drawing.first);
}

/// placed_hit()s, whose levels of detail count on from first_level.
std::vector<HitRecord> DeviceRenderer::placed(std::vector<HitRecord> hits,
                                              std::size_t first_level) const {
  for (HitRecord &hit : hits) {
    if (hit.t != std::numeric_limits<float>::infinity()) hit = placed(hit, first_level);
  }
  return hits;
}

HitRecord DeviceRenderer::placed(HitRecord hit, std::size_t first_level) const {
  const std::vector<FrameParams> &frames = *blocks_.level_frames;
  const bool has_level_ids = frames.size() > 1 || frames.front().place.begin_z != 0;
  std::size_t level = 0;
  while (has_level_ids && level_block_of(&frames[level], hit.block_id) == ISO_INVALID_ID) ++level;
  if (has_level_ids) hit.block_id = level_block_of(&frames[level], hit.block_id);
  return placed_hit(&frames[level], static_cast<uint>(first_level + level), hit);
}

HitRecord DeviceRenderer::placed(const HitRecord &hit) const {
  return placed(hit, blocks_.drawing.first);
}

std::vector<RayHit> DeviceRenderer::first_layer_so_far(const FrameRequest &request) {
  check_has_picture();
  const PictureSoFar shown(*this);
  return layers_->read(rays_, true, request.field_values || !request.slices.planes.empty());
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

/// Opens a round of light rays of a brick. Rays of the frame are those of the camera again.
class DeviceRenderer::BrickRound {
 public:
  BrickRound(DeviceRenderer &of, const FrameRequest &request, LaterPasses &stats)
      : frame{never_stops_, 1}, of_(of), stats_(stats) {
    of_.rays_.frame = of_.blocks_.level_frames->front();
    const std::size_t level = of_.blocks_.drawing.first;
    const LightRays light_rays = light_rays_of(request);
    of_.ambient_->begin(of_.blocks_.levels[level].info, level, light_rays);
    if (light_rays.bounces) of_.bounce_->begin(of_.blocks_.levels[level].info, level, light_rays);
  }
  ~BrickRound() { of_.rays_.frame = of_.blocks_.levels[0].frame; }  // for shading
  BrickRound(const BrickRound &) = delete;
  BrickRound &operator=(const BrickRound &) = delete;

  /// After the round's passes.
  void close() {
    of_.blocks_.close(frame.stats.ambient.recycled_blocks, true);
    stats_ += frame.stats.ambient;
  }

 private:
  OnPass never_stops_;

 public:
  Frame frame;

 private:
  DeviceRenderer &of_;
  LaterPasses &stats_;
};

std::vector<std::uint64_t> DeviceRenderer::blocked_rays(const FrameRequest &request,
                                                        std::uint32_t round, LaterPasses &stats,
                                                        bool goes_on) {
  BrickRound at_work(*this, request, stats);
  if (request.surfaces.empty()) {
    cast_round(round, at_work.frame, goes_on);
    ambient_->block(rays_);
  } else {
    cast_layer_round(round, request, clip_of(request), isovalues_of_layers(request.surfaces),
                     goes_on ? RoundEnd::kBlocksLight : RoundEnd::kBlocks, at_work.frame);
  }
  const std::vector<GivenRay> left = light_rays();
  std::vector<std::uint64_t> blocked((left.size() + 63) / 64);
  for (std::size_t ray = 0; ray < left.size(); ++ray)
    blocked[ray / 64] |= std::uint64_t{!is_given(left[ray])} << ray % 64;
  at_work.close();
  return blocked;
}

std::vector<HitRecord> DeviceRenderer::met_hits(const FrameRequest &request, std::uint32_t round,
                                                LaterPasses &stats) {
  BrickRound at_work(*this, request, stats);
  std::vector<HitRecord> met(size_.num_rays());
  if (!request.surfaces.empty()) {
    layers_->forget(rays_, bounce_->nearest);
    cast_layer_round(round, request, clip_of(request), isovalues_of_layers(request.surfaces),
                     RoundEnd::kNearest, at_work.frame);
    bounce_->nearest.read(met);
    at_work.close();
    for (HitRecord &hit : met) {
      if (hit.t != std::numeric_limits<float>::infinity())
        hit = with_surface(placed(hit, 0), surface_of(hit));
    }
    return met;
  }
  cast_round(round, at_work.frame);
  rays_.given_hits.read(met);
  const std::vector<GivenRay> rays = light_rays();
  const float voxel = std::ldexp(1.0f, static_cast<int>(blocks_.drawing.first));
  for (std::size_t ray = 0; ray < met.size(); ++ray) {
    if (!is_given(rays[ray])) met[ray] = no_hit();
    if (met[ray].t == std::numeric_limits<float>::infinity()) continue;
    const float in_first = std::ldexp(1.0f, static_cast<int>(level_of_given(rays[ray])));
    if (is_clipped(&rays_.clip_params(), rays[ray], voxel * in_first,
                   met[ray].t / (rays_.frame.view.t_scale * in_first)))
      met[ray] = no_hit();
  }
  at_work.close();
  return placed(std::move(met), 0);
}

ClipParams DeviceRenderer::clip_of(const FrameRequest &request) const {
  const Level &finest = blocks_.levels[0];
  return make_clip_params(finest.info, finest.frame.view, request.camera, request.clip);
}

std::vector<GivenRay> DeviceRenderer::light_rays() const {
  std::vector<GivenRay> rays(size_.num_rays());
  rays_.given.read(rays);
  return rays;
}

void DeviceRenderer::set_light_rays(std::span<const GivenRay> rays) {
  rays_.given.write(rays);
}

void DeviceRenderer::set_open(const OpenCounts &open) {
  check_has_picture();
  check_has_given();
  rays_.open_counts.write(open.counts);
  rays_.num_ambient = open.num_ambient;
  rays_.num_shadow = open.num_shadow;
  rays_.num_bounced = open.num_bounced;
  if (open.num_bounced != 0) rays_.bounced.write(open.bounced);
}

void DeviceRenderer::filter_bounced(const FrameRequest &request) {
  rays_.frame = blocks_.level_frames->front();
  const std::size_t level = blocks_.drawing.first;
  bounce_->begin(blocks_.levels[level].info, level, light_rays_of(request));
  bounce_->filter(rays_, request.surfaces.empty() ? 1 : ISO_LAYER_SUMS);
  rays_.frame = blocks_.levels[0].frame;  // for shading
}

void DeviceRenderer::set_field_values(std::span<const float> values) {
  check_has_picture();
  rays_.field_values.write(values);
}

}  // namespace isowave::core
