#include "core/render/field_wave.hpp"

#include <limits>
#include <utility>

#include "core/frame/field_values.hpp"

namespace isowave::core {

namespace {

/// The level that values are of.
constexpr LevelRange kFinest{0, 1};

std::optional<BlockStore> make_own(ocl::Device &device, const CompressedVolume &field,
                                   const FieldPlan &plan, std::uint32_t group_size) {
  if (plan.shares_blocks) return std::nullopt;
  DeviceStream stream = plan.stream == StreamPlace::kHost
                            ? DeviceStream(device, field, OnHost{plan.window_blocks})
                            : DeviceStream(device, field, plan.largest_stream_part);
  return std::optional<BlockStore>(std::in_place, device, field, std::move(stream), plan.cache,
                                   group_size);
}

}  // namespace

FieldWave::FieldWave(const CompressedVolume &field, bool is_own, BlockStore &drawn,
                     std::span<const VolumeInfo> levels, const FieldPlan &plan,
                     std::uint32_t group_size, Wavefront &rays)
    : range_(known_range(field)),
      is_own_(is_own),
      own_(make_own(drawn.device, field, plan, group_size)),
      blocks_(own_ ? *own_ : drawn),
      grid_(make_grid_params(field.info)),
      map_(make_field_map(levels, field.info)),
      values_(drawn.device, rays.num_rays, group_size, blocks_.cache.slot_type, plan.num_labels),
      rays_(rays) {
  values_.set_map(map_);
}

void FieldWave::begin_frame(const FrameRequest &request) {
  const FieldReading reading = reading_of(request, map_, is_own_);
  values_.set_map(reading.map, reading.label_table);
  layers_ = nullptr;
  if (request.field_values) rays_.field_values.fill(no_value());
  if (!own_ || !own_->has_requests()) return;
  own_->cache.requested_bits.fill(0);
  own_->forget_requests();
  rays_.forget_rays();
}

void FieldWave::begin() {
  begins_ = layers_ == nullptr;
  if (begins_) return;
  const auto stage = blocks_.device.timer().stage("field");
  if (blocks_.has_requests()) rays_.forget_rays();
  layers_->begin(rays_, rays_.hits);
}

void FieldWave::enqueue_pass() {
  rays_.open_pass();
  const FrameParams of_volume = rays_.frame;
  const std::uint32_t num_levels = std::exchange(rays_.num_level_frames, 1);
  FrameParams frame = of_volume;
  frame.grid = grid_.grid;
  frame.place = grid_.place;
  frame.brick = grid_.brick;
  frame.schedule.cache_slots = blocks_.cache.num_slots;
  if (own_) {
    frame.surface = grid_.surface;
    own_->levels[0].frame = frame;
  }
  rays_.frame = frame;
  // Stages of the cache read the grid of rays_.frame.
  struct PutBack {
    Wavefront &rays;
    const FrameParams &frame;
    std::uint32_t num_levels;
    ~PutBack() {
      rays.frame = frame;
      rays.num_level_frames = num_levels;
    }
  } const put_back{rays_, of_volume, num_levels};
  if (!begins_) blocks_.provide(rays_);
  const auto stage = blocks_.device.timer().stage("field");
  values_(frame, blocks_.cache, rays_, begins_);
  begins_ = false;
  blocks_.expect_requests(kFinest);
}

}  // namespace isowave::core
