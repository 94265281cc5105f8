#include "core/extract/surface_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

namespace {

/// Listed blocks that are worked on in one go, so that progress shows.
constexpr std::uint32_t kMostBlocks = 1u << 17;
/// Blocks uploaded at a time from a volume that stays on the host.
constexpr std::uint32_t kWindowBlocks = 1u << 12;

OnHost window_for(const CompressedVolume &volume) {
  return {static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(volume.block_count(), 1, kWindowBlocks))};
}

/// All slots may be requested in one pass, whatever number of rays.
BlockCache::Limits cache_limits(const BlockGrid &grid, std::uint32_t num_slots, SlotType type) {
  return BlockCache::limits_for(grid, num_slots, ISO_MAX_CACHE_SLOTS, type);
}

Wavefront::Limits ray_limits(const SurfaceBlocks::Options &options) {
  return {.num_rays = options.num_rays, .with_pairs = false, .with_walks = false};
}

/// All buffers but those of the compressed volume that live as long as this and its owner.
ocl::BufferSizes own_sizes(const CompressedVolume &volume, const SurfaceBlocks::Options &options) {
  const BlockGrid grid = make_grid(volume.info);
  const std::uint64_t macrocells = num_macrocells(grid);
  return MacrocellBuffers::sizes({block_count(grid), macrocells})
      .add(Macrocells::sizes(macrocells, 1))
      .add(ActiveBlocks::sizes(macrocells))
      .add(Wavefront::sizes(ray_limits(options)))
      .add(options.beside);
}

/// The place of the stream: as asked for, or the device if that leaves a quarter of the budget.
DeviceStream make_stream(ocl::Device &device, const CompressedVolume &volume,
                         const SurfaceBlocks::Options &options) {
  check_volume_info(volume.info, "the volume");
  check_drawable(volume.info, "the volume");
  const std::uint64_t budget = options.memory_budget, own = own_sizes(volume, options).bytes(),
                      scratch = Macrocells::setup_scratch_bytes(volume.num_blocks());
  const StreamSplit split = split_stream(volume, device.capabilities().largest_allocation);
  const std::uint64_t whole = DeviceStream::sizes(volume, split, ByteTable::kNone).bytes(),
                      window =
                          DeviceStream::sizes(volume, window_for(volume), ByteTable::kNone).bytes();
  const bool fits = split.num_parts != 0 && whole + own + scratch <= budget / 4 * 3;
  const bool on_device =
      options.stream == StreamPlace::kDevice ||
      (options.stream == StreamPlace::kAuto && (fits || (split.num_parts != 0 && whole <= window)));
  const std::uint64_t least = (on_device ? whole : window) + own + scratch;
  if (least > budget) {
    throw Error(
        "a memory budget of {} bytes is too small: {} of them are needed before a surface "
        "is looked for",
        budget, least);
  }
  return on_device ? DeviceStream(device, volume)
                   : DeviceStream(device, volume, window_for(volume));
}

std::uint64_t stream_bytes(const CompressedVolume &volume, const DeviceStream &stream,
                           const ocl::Device &device) {
  if (stream.window)
    return DeviceStream::sizes(volume, window_for(volume), ByteTable::kNone).bytes();
  return DeviceStream::sizes(volume, split_stream(volume, device.capabilities().largest_allocation),
                             ByteTable::kNone)
      .bytes();
}

}  // namespace

std::uint64_t SurfaceBlocks::default_budget(const ocl::Device &device) {
  return device.capabilities().global_memory / 4 * 3;
}

SurfaceBlocks::SurfaceBlocks(ocl::Device &device, const CompressedVolume &volume,
                             const Options &options)
    : gradients_(options.gradients),
      grid_(make_grid(volume.info)),
      budget_(options.memory_budget),
      store_(device, volume, make_stream(device, volume, options),
             cache_limits(grid_, least_slots(), slot_type_for(volume)), ocl::kGroupSize),
      rays_(device, ray_limits(options)),
      listed_(device, num_macrocells(grid_)),
      request_(device, gradients_) {
  fixed_bytes_ = own_sizes(volume, options).bytes() + stream_bytes(volume, stream(), device);
}

std::uint32_t SurfaceBlocks::find(float isovalue) {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  open(isovalue);
  return listed_.count(frame(), store_.levels[0].macrocells.masks());
}

void SurfaceBlocks::open(float isovalue) {
  const Level &level = store_.levels[0];
  FrameParams frame = make_grid_params(level.info);
  frame.surface.isovalue = isovalue;
  store_.open(rays_, {frame}, {{level.stream.layout, level.range_error}}, FieldBound::kNone,
              RaySource::kGiven);
}

std::uint64_t SurfaceBlocks::count_bytes() const {
  return RequestSurface::count_sizes(num_macrocells(grid_)).bytes();
}

std::uint64_t SurfaceBlocks::cache_bytes(std::uint32_t num_slots) const {
  const BlockCache::Limits limits = cache_limits(grid_, num_slots, store_.cache.slot_type);
  return BlockCache::sizes(limits).bytes() +
         ZfpDecode::sizes(limits.max_requests(), stream().window != nullptr, false).bytes();
}

bool SurfaceBlocks::can_have(std::uint32_t num_slots) const {
  return num_slots <= ISO_MAX_CACHE_SLOTS && slot_bytes(store_.cache.slot_type) * num_slots <=
                                                 store_.device.capabilities().largest_allocation;
}

std::uint32_t SurfaceBlocks::most_slots(std::uint32_t wanted, std::uint64_t beside) const {
  const auto fits = [&](std::uint32_t slots) {
    return can_have(slots) && beside + cache_bytes(slots) <= budget_;
  };
  if (wanted <= least_slots() || fits(wanted)) return std::max(wanted, least_slots());
  std::uint32_t fitting = least_slots(), too_many = wanted;
  while (too_many - fitting > 1) {
    const std::uint32_t middle = fitting + (too_many - fitting) / 2;
    (fits(middle) ? fitting : too_many) = middle;
  }
  return fitting;
}

void SurfaceBlocks::open_cache(std::uint32_t num_slots) {
  if (num_slots != this->num_slots()) resize_cache(num_slots);
  open(frame().surface.isovalue);
}

void SurfaceBlocks::clear_cache() {
  store_.clear();
  num_cached_ = 0;
}

void SurfaceBlocks::resize_cache(std::uint32_t num_slots) {
  store_.resize(cache_limits(grid_, num_slots, store_.cache.slot_type), rays_);
  num_cached_ = 0;
}

bool SurfaceBlocks::bring(const ocl::Buffer<uint> &block_ids, std::uint32_t begin,
                          std::uint32_t end) {
  rays_.frame = frame();
  store_.begin_host_pass(rays_);
  request_(block_ids, begin, end, store_.cache, rays_);
  const std::uint32_t num_requested = rays_.counts.read().front().requested_count;
  if (num_requested == 0) return true;
  store_.provide(rays_.counts, {}, rays_);
  const PassCounts counts = rays_.counts.read().front();
  num_cached_ = num_slots() - counts.free_count;
  num_decoded_ += counts.decoded_count;
  return counts.decoded_count == num_requested;
}

BatchSize::BatchSize(std::uint32_t num_slots, std::uint64_t num_needed)
    : size_(std::max(num_slots >= num_needed ? kMostBlocks : std::min(kMostBlocks, num_slots / 2),
                     1u)) {}

void BatchSize::served() {
  size_ = std::min(kMostBlocks, size_ + size_ / 8);
}

void BatchSize::refused(std::uint32_t size) {
  if (size == 1) throw std::logic_error("a cache too small for one block of a surface");
  size_ = size / 2;
}

}  // namespace isowave::core
