#include "core/render/block_store.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <utility>

#include "core/base/error.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/stated_errors.hpp"

namespace isowave::core {

namespace {

/// Caches with fewer slots may run out of slots within one pass, unless they are made for the
/// blocks that a frame needs (MemoryPlan::can_grow()), or for all blocks.
constexpr std::uint32_t kSmallCache = 1u << 16;
/// A frame repeats the one before if it decodes at most this part of the slots.
constexpr std::uint32_t kFewBlocksPart = 32;
/// Slots are scarce if less than this part of them is free. It is half of what is freed at a time
/// (ISO_SPARE_PART), so that most passes free none.
constexpr std::uint32_t kScarcePart = 16;

/// If a frame has freed more slots than these of blocks that it had requested, the blocks that are
/// left do not help the next frame: a ray waits once for each of its blocks that is gone. On a GPU,
/// such passes cost more than decoding all blocks anew. H100, 512^3, blocks kept: frames that come
/// again take 1.2 ms with 90,000 slots, 1.4 with 85,000 and 1.9 with 70,000; cold frames 1.3. If a
/// CPU decodes blocks, or they must be uploaded first, more are worth keeping. PoCL, 80,000 and
/// 65,536 slots: 123 and 138 ms; cold 154 and 146.
std::uint32_t most_recycled(std::uint32_t num_slots, ocl::DeviceType type, StreamPlace stream) {
  return num_slots / (type == ocl::DeviceType::kCpu || stream == StreamPlace::kHost ? 2 : 8);
}

std::vector<Level> make_levels(ocl::Device &device, const CompressedVolume &volume,
                               const RendererOptions &options, const MemoryPlan &plan) {
  if (volume.info.brick != BrickOf{}) device.draw_bricks();
  if (options.with_bounds && volume.info.brick != BrickOf{} && !volume.no_data.empty())
    throw Error(
        "{} voxels have no data: bounds of a frame's error beside them are found by one process "
        "alone, draw the volume with one",
        volume.no_data.num_voxels());
  const std::vector<const CompressedVolume *> volumes = levels_of(volume, options.with_levels);
  const std::vector<FrameParams> grids = make_level_grids(level_infos(volume, options.with_levels));
  const bool has_levels = volumes.size() > 1;
  const auto buffers = std::make_shared<MacrocellBuffers>(device, plan.limits.macrocells);
  if (buffers->no_data) buffers->no_data->write(joined_no_data(volumes));
  std::vector<DeviceStream> streams;
  std::vector<Macrocells> macrocells;  // of all levels before any decoder, see plan.setup_bytes
  // Bounds need the range of values (value_offset()), which a file may get wrong.
  const bool checks_range = options.with_bounds && volume.errors_are_stated;
  std::array<float, 2> extremes{};
  const ByteTable bytes = options.with_labels   ? ByteTable::kGroups
                          : options.with_bounds ? ByteTable::kBounds
                                                : ByteTable::kNone;
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    streams.push_back(plan.stream == StreamPlace::kHost
                          ? DeviceStream(device, *volumes[i], OnHost{plan.window_blocks}, bytes)
                          : DeviceStream(device, *volumes[i], options.largest_stream_part, bytes));
    macrocells.emplace_back(device, grids[i], streams.back(), buffers,
                            i == 0 ? options.range_thresholds : std::vector<float>(),
                            i == 0 && checks_range ? &extremes : nullptr);
  }
  if (checks_range) check_value_range(volume, extremes);
  std::vector<Level> levels;
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    const CompressedVolume &level = *volumes[i];
    ZfpDecode decode(device, plan.limits.cache.max_requests(), streams[i].defines(), has_levels,
                     plan.limits.cache.slot_type);
    levels.push_back({level.info, level.precision, LevelError(level, i == 0), std::move(streams[i]),
                      std::move(macrocells[i]), std::move(decode)});
  }
  return levels;
}

std::vector<Level> make_level(ocl::Device &device, const CompressedVolume &volume,
                              DeviceStream stream, const BlockCache::Limits &limits) {
  Macrocells macrocells(device, make_grid_params(volume.info), stream);
  ZfpDecode decode(device, limits.max_requests(), stream.defines(), false, limits.slot_type);
  std::vector<Level> levels;
  levels.push_back({volume.info, volume.precision, LevelError(volume, true), std::move(stream),
                    std::move(macrocells), std::move(decode)});
  return levels;
}

}  // namespace

std::vector<VolumeInfo> infos_of(const std::vector<Level> &levels) {
  std::vector<VolumeInfo> infos;
  infos.reserve(levels.size());
  for (const Level &level : levels) infos.push_back(level.info);
  return infos;
}

BlockStore::BlockStore(ocl::Device &of, const CompressedVolume &volume, DeviceStream stream,
                       const BlockCache::Limits &limits, std::uint32_t group_size)
    : device(of),
      levels(make_level(of, volume, std::move(stream), limits)),
      cache(of, limits, group_size) {}

BlockStore::BlockStore(ocl::Device &of, const CompressedVolume &volume,
                       const RendererOptions &options, MemoryPlan made_by)
    : device(of),
      plan(std::move(made_by)),
      levels(make_levels(of, volume, options, plan)),  // before the cache, see plan.setup_bytes
      cache(of, plan.limits.cache, options.group_size, levels.size() > 1) {
  schedule_ = {.max_spec_count = options.max_speculation,
               .per_ray_speculation = options.per_ray_speculation,
               .cache_slots = cache.num_slots,
               .scanned_pairs = 0};
  wanted_slots_ = plan.cache_slots;
  note_empty();
  is_small_ = plan.cache_slots < kSmallCache && !plan.can_grow() &&
              plan.cache_slots < plan.limits.cache.num_blocks;
  level_frames->reserve(levels.size());  // they never move while they are written
}

void BlockStore::open(Wavefront &rays, std::vector<FrameParams> frames,
                      const std::vector<DecodedValues> &values, FieldBound bound,
                      RaySource source) {
  grow(rays);
  const Surface surface = frames.front().surface;
  levels[0].macrocells.use(static_cast<std::size_t>(bound));
  decode_as(values);
  const auto first = std::ranges::find_if(frames, draws);
  const auto end = std::find_if_not(first, frames.end(), draws);
  drawing = {static_cast<std::size_t>(first - frames.begin()),
             static_cast<std::size_t>(end - frames.begin())};
  const bool has_bands = end - first > 1;
  whole_screen_ = first->screen;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Level &level = levels[i];
    FrameParams &frame = frames[i];
    frame.schedule = schedule_;
    frame.schedule.cache_slots = cache.num_slots;
    // A ray may begin outside the box: at a border between bands, or at a cap.
    if (draws(frame))
      select(level, frame, !has_bands && source == RaySource::kCamera && !rays.is_clipped());
    level.frame = frame;
  }
  level_frames->assign(first, end);
  rays.frame = level_frames->front();
  rays.num_level_frames = static_cast<std::uint32_t>(level_frames->size());
  if (levels.size() > 1) rays.level_frames.write_async(*level_frames);
  classify(rays, surface);
}

/// Finds the active blocks of a level's frame.
///
/// has_box  all rays that may hit meet the box around them
void BlockStore::select(Level &level, FrameParams &frame, bool has_box) {
  const auto stage = device.timer().stage("macrocells");
  level.macrocells.select(frame, level.range_error, &level.stream);
  frame.surface = level.macrocells.surface(frame);
  if (has_box) frame.screen = make_screen_box(frame);
}

void BlockStore::classify(Wavefront &rays, const Surface &surface) {
  const bool has_groups = levels[0].stream.has_groups();
  const std::pair of(surface.isovalue, has_groups ? surface.isovalue_index : 0);
  has_drawn_surface = cached_surface_ == of;
  if (cached_surface_.value_or(of) != of) {
    const auto stage = device.timer().stage("macrocells");
    cache.classify(rays);
  }
  cached_surface_ = of;
}

void BlockStore::set_groups(std::span<const std::uint8_t> table) {
  levels[0].stream.set_groups(table);
  levels[0].macrocells.choose_labels(make_grid_params(levels[0].info), levels[0].stream);
  clear();
}

void BlockStore::show_surface(Wavefront &rays, std::size_t selection, float isovalue, uint group) {
  levels[0].macrocells.use(selection);  // at all levels
  const bool has_box = drawing.end - drawing.first == 1 && !rays.is_clipped();
  level_frames->clear();
  for (std::size_t i = drawing.first; i < drawing.end; ++i) {
    Level &level = levels[i];
    FrameParams frame = level.frame;
    frame.surface.isovalue = isovalue;
    frame.surface.isovalue_index = group;
    if (i == drawing.first) frame.screen = whole_screen_;
    select(level, frame, has_box);
    level.frame = frame;
    level_frames->push_back(frame);
  }
  rays.frame = level_frames->front();
  if (levels.size() > 1) rays.level_frames.write_async(*level_frames);
  classify(rays, rays.frame.surface);
}

/// Has blocks decoded to these values, and forgets those of others.
void BlockStore::decode_as(const std::vector<DecodedValues> &values) {
  bool changes = false;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    Level &level = levels[i];
    if (std::memcmp(&values[i].layout, &level.stream.layout, sizeof(StreamLayout)) == 0) continue;
    changes = true;
    level.stream.layout = values[i].layout;
    level.range_error = values[i].range_error;
  }
  if (changes) clear();
}

void BlockStore::go_on_with(const std::vector<DecodedValues> &values) {
  const std::optional surface = cached_surface_;
  decode_as(values);
  cached_surface_ = surface;  // that of the blocks that come next
}

void BlockStore::begin_host_pass(Wavefront &rays) {
  PassCounts counts{};
  counts.ray_count = 1;
  counts.pass = counts.frame_pass = counts.last_frame_pass = rays.counts.read().front().pass + 1;
  rays.counts.write({&counts, 1});
}

void BlockStore::provide(const CountsBuffer &asked, LevelRange of, Wavefront &rays) {
  {
    const auto stage = device.timer().stage("cache");
    if (slots_are_scarce_) cache.evict(asked, rays);
    cache.assign(asked, rays);
  }
  const auto stage = device.timer().stage("decode");
  try {
    for (std::size_t i = of.first; i < of.end; ++i) {
      Level &level = levels[i];
      // Two in one launch: it takes as long as one block, mostly.
      if (i + 1 < of.end && level.decode.can_join(levels[i + 1].stream)) ++i;
      level.decode({level.stream, level.frame}, {levels[i].stream, levels[i].frame}, rays.counts,
                   cache);
    }
  } catch (...) {  // blocks have slots, but no values, and the next pass is not opened
    clear();
    rays.reset_counts();
    forget_requests();
    if (on_reset) on_reset();
    throw;
  }
}

void BlockStore::note(const PassCounts &counts) {
  // A launch that is not needed costs more than a pass that finds slots missing now and then. The
  // counts are a pass old: that pass's requests have taken slots since, and the pass after it may
  // have requested as many.
  const std::uint64_t spoken_for = 2 * std::uint64_t{counts.requested_count};
  slots_are_scarce_ =
      is_small_ ||
      counts.free_count < std::max<std::uint64_t>(cache.num_slots / kScarcePart, spoken_for);
  const std::uint64_t slots_given = std::uint64_t{counts.free_count} + counts.decoded_count;
  filling_.decoded += counts.decoded_count;
  filling_.evicted += slots_given - std::min<std::uint64_t>(slots_given, filling_.free_slots);
  filling_.free_slots = counts.free_count;
}

void BlockStore::note_empty() {
  filling_ = {.free_slots = cache.num_slots};
}

/// Blocks that the second frame in an empty cache has freed; 0 after other frames. They are the
/// first frame's, and the next frame would see many of them again.
std::uint64_t BlockStore::lacked_by_second_frame() {
  const auto [decoded, evicted] =
      std::pair(std::exchange(filling_.decoded, 0), std::exchange(filling_.evicted, 0));
  if (decoded <= cache.num_slots / kFewBlocksPart) return 0;
  return ++filling_.num_frames == 2 ? evicted : 0;
}

void BlockStore::close(std::uint64_t recycled, bool goes_on) {
  if (!goes_on && recycled > most_recycled(cache.num_slots, device.info().type, plan.stream))
    clear();
  const std::uint64_t lacked = goes_on ? 0 : lacked_by_second_frame();
  wanted_slots_ = std::max(wanted_slots_, grown_cache_slots(plan, std::max(recycled, lacked)));
}

/// Makes an empty cache of wanted_slots_, between frames. The old cache is freed first, so that the
/// plan is kept. If the device has not enough memory, the cache keeps its size, or becomes smaller,
/// and never grows again. Pictures do not depend on it.
void BlockStore::grow(Wavefront &rays) {
  if (wanted_slots_ == plan.cache_slots) return;
  const std::uint32_t before = plan.cache_slots;
  for (std::uint32_t slots = wanted_slots_;;) {
    try {
      MemoryPlan grown = resized(plan, slots);
      resize(grown.limits.cache, rays);
      plan = std::move(grown);
      break;
    } catch (const Error &) {
      if (slots == kMinCacheSlots) throw;
      slots = slots > before ? before : std::max(slots / 2, kMinCacheSlots);
    }
  }
  if (plan.cache_slots != wanted_slots_) {
    plan.most_slots = plan.cache_slots;
    is_small_ |= plan.cache_slots < std::min(before, kSmallCache);
  }
  wanted_slots_ = plan.cache_slots;
}

void BlockStore::clear() {
  cache.clear();
  note_empty();
  cached_surface_.reset();
}

void BlockStore::resize(const BlockCache::Limits &limits, Wavefront &rays) {
  cache.resize(limits);
  for (Level &level : levels) level.decode.resize(limits.max_requests());
  if (on_resize) on_resize(limits.num_slots);
  note_empty();
  rays.reset_counts();
  slots_are_scarce_ = true;
  cached_surface_.reset();
  forget_requests();
  if (on_reset) on_reset();
}

Uploads BlockStore::uploads() const {
  Uploads sum;
  for (const Level &level : levels) {
    if (const StreamWindow *window = level.stream.window.get()) {
      sum.blocks += window->uploaded_blocks();
      sum.bytes += window->uploaded_bytes();
    }
  }
  return sum;
}

}  // namespace isowave::core
