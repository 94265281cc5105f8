// What a brick's renderer does for the light rays of whole frames (core/bricks).

#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "kernels_cl/portable/clip.h"

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

void DeviceRenderer::begin_ambient(const FrameRequest &request, std::vector<HitRecord> placed,
                                   LevelRange levels) {
  check_has_picture();
  check_has_given();
  if (!is_brick()) throw Error("only a brick's frames leave their ambient rays to others");
  for (HitRecord &hit : placed) hit.cell -= static_cast<uint>(levels.first);
  set_hits(placed);
  // A ray stays in the level that has its hit, which this brick need not have drawn.
  std::vector<FrameParams> frames =
      make_level_frames(DeviceRenderer::levels(), request.camera, size_, request.isovalue, 0);
  for (std::size_t level = 0; level < frames.size(); ++level) {
    const bool may_have_rays = level >= levels.first && level < levels.end;
    const View &view = frames[level].view;
    frames[level].screen = {0, 0, view.width, view.height};  // hits are other bricks', too
    frames[level].band = {.begin_t = 0,
                          .end_t = may_have_rays ? std::numeric_limits<float>::infinity() : 0};
  }
  open_frame(std::move(frames), decoded_values(request), FieldBound::kNone, RaySource::kGiven);
}

std::vector<std::uint64_t> DeviceRenderer::blocked_rays(std::uint32_t round,
                                                        const LightRays &light_rays,
                                                        LaterPasses &stats) {
  rays_.frame = blocks_.level_frames->front();
  ambient_->begin(blocks_.levels[blocks_.drawing.first].info, blocks_.drawing.first, light_rays);
  const OnPass never_stops;
  Frame frame{never_stops, 1};
  cast_round(round, frame);
  const LaterPasses &passes = frame.stats.ambient;
  rays_.frame = blocks_.levels[0].frame;  // for shading
  std::vector<HitRecord> met(size_.num_rays());
  rays_.given_hits.read(met);
  const bool is_shadow = round >= light_rays.num_ambient;
  std::vector<GivenRay> given(rays_.is_clipped() || is_shadow ? met.size() : 0);
  if (!given.empty()) rays_.given.read(given);
  std::vector<std::uint64_t> blocked((met.size() + 63) / 64);
  for (std::size_t ray = 0; ray < met.size(); ++ray) {
    bool meets = met[ray].t != std::numeric_limits<float>::infinity();
    if (meets && rays_.is_clipped()) {
      const float in_first = std::ldexp(1.0f, static_cast<int>(given[ray].level)),
                  voxel = std::ldexp(in_first, static_cast<int>(blocks_.drawing.first));
      const float t_scale = blocks_.level_frames->front().view.t_scale * in_first;
      meets = !is_clipped(&rays_.clip_params(), given[ray], voxel, met[ray].t / t_scale);
    }
    if (is_shadow) meets |= !is_given(given[ray]);
    blocked[ray / 64] |= std::uint64_t{meets} << ray % 64;
  }
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

}  // namespace isowave::core
