#pragma once
// The blocks of a volume on a device: compressed, by level of detail, and decoded, in a cache. The
// store remembers the blocks that the last pass requested, so that the next pass finds them
// decoded, even if it belongs to another wave. It also remembers the slots that a frame lacked, so
// that the cache grows before the next frame.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/ocl/in_flight.hpp"
#include "core/render/memory_plan.hpp"
#include "core/render/renderer_options.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/wavefront.hpp"
#include "core/stages/zfp_decode.hpp"
#include "core/zfp/level_bounds.hpp"

namespace isowave::core {

/// The volume on the device, or one of its levels of detail.
struct Level {
  VolumeInfo info;
  BlockPrecision precision;  ///< precision of its blocks
  LevelError error;          ///< error of its field against the volume's
  DeviceStream stream;
  Macrocells macrocells;
  ZfpDecode decode;
  FrameParams frame{};     ///< its part of the frame at work
  double range_error = 0;  ///< largest error of voxels of fewer bit planes
};

std::vector<VolumeInfo> infos_of(const std::vector<Level> &levels);

/// Levels of detail: from `first` to below `end`.
struct LevelRange {
  std::size_t first = 0, end = 1;
};

/// The values that voxels of a level are decoded to.
struct DecodedValues {
  StreamLayout layout;
  double range_error;  ///< largest error of voxels of fewer bit planes
};

struct Uploads {
  std::uint64_t blocks = 0, bytes = 0;
};

class BlockStore {
 public:
  /// A store of only the finest level, with as many slots as the limits say.
  ///
  /// volume  the volume of `stream`, which is on the device or on its way there
  /// Waits   yes
  BlockStore(ocl::Device &of, const CompressedVolume &volume, DeviceStream stream,
             const BlockCache::Limits &limits, std::uint32_t group_size);

  /// Uploads the volume, if it goes to the device, and computes the value ranges of its blocks.
  ///
  /// Throws  Error: not enough memory on the device; a file states wrong ranges of values
  /// Waits   yes
  BlockStore(ocl::Device &of, const CompressedVolume &volume, const RendererOptions &options,
             MemoryPlan made_by);

  /// Opens a frame: grows the cache if the frame before lacked slots, and sets levels, their active
  /// blocks and the values of decoded blocks for this frame. Sets rays.frame and rays.level_frames.
  ///
  /// frames  constants of all levels
  /// values  decoded values of all levels; if others are cached, the cache is cleared
  /// source  rays of the frame's first wave
  /// Throws  Error: the device has no memory for a cache of any size
  /// Waits   if the cache grows
  void open(Wavefront &rays, std::vector<FrameParams> frames,
            const std::vector<DecodedValues> &values, FieldBound bound, RaySource source);

  /// Goes on with other decoded values within the frame at work: if others are cached, the cache is
  /// cleared. Does not wait.
  void go_on_with(const std::vector<DecodedValues> &values);

  /// Goes on with another surface of the frame at work, at all levels of detail that draw it.
  ///
  /// selection  its selection of active blocks (MacrocellBuffers), 0: that of open()
  /// group      of labels, its group
  /// Waits      at the first call for an isovalue
  void show_surface(Wavefront &rays, std::size_t selection, float isovalue, uint group);

  /// Puts labels into groups, between frames: makes the ranges of blocks anew, and empties the
  /// cache.
  ///
  /// table  [ISO_NUM_LABELS], see label_table()
  /// Waits  yes
  void set_groups(std::span<const std::uint8_t> table);

  /// Begins a pass: gives slots and values to the blocks that the pass before requested.
  ///
  /// rays    after Wavefront::open_pass()
  /// Throws  Error: a file that blocks are read from has become shorter. The cache is empty then.
  /// Waits   if the stream stays on the host: see ZfpDecode
  void provide(Wavefront &rays) {
    if (asked_) provide(rays.previous_counts, *asked_, rays);
  }
  /// Begins a pass whose requests the host makes. Each such pass is a frame of its own: slots are
  /// freed in the order in which such passes have used them.
  ///
  /// Out    rays.counts
  /// Waits  yes
  void begin_host_pass(Wavefront &rays);
  /// Provides the blocks of the requests that `asked` counts, for those levels.
  void provide(const CountsBuffer &asked, LevelRange of, Wavefront &rays);

  /// Call it after a pass that may have requested blocks was enqueued.
  void expect_requests() { asked_ = drawing; }
  /// The same after a pass that has requested blocks of those levels.
  void expect_requests(LevelRange of) { asked_ = of; }
  /// Call it if no ray is left that waits for a block.
  void forget_requests() { asked_.reset(); }
  /// Whether there may be requests that were not provided.
  bool has_requests() const { return asked_.has_value(); }

  /// Takes note of a pass's counts, which say if the next passes may run out of slots.
  void note(const PassCounts &counts);
  /// Closes a frame, or a part of one.
  ///
  /// recycled     slots that the frame has freed of blocks that it had requested itself: if they
  ///              are many, the cache grows at the next open(); it also grows if two frames after
  ///              each other have no room, since freeing takes a GPU long
  /// goes_on      whether the next frame goes on with these blocks. If not, and the blocks that are
  ///              left would slow the next frame down, the cache is emptied.
  /// Waits        no
  void close(std::uint64_t recycled, bool goes_on);

  /// Empties the cache.
  ///
  /// Waits  no
  void clear();
  /// As BlockCache::resize(), with what depends on it. No ray of the frame before is left.
  void resize(const BlockCache::Limits &limits, Wavefront &rays);
  /// Called when the number of slots has changed. It may throw Error.
  std::function<void(std::uint32_t num_slots)> on_resize;
  /// Called when the clock of the passes was set back: slots of another cache have later stamps.
  std::function<void()> on_reset;
  /// Uploads since the store was made, if the volume stays on the host.
  Uploads uploads() const;

  ocl::Device &device;
  MemoryPlan plan;  ///< the renderer's plan, with the slots that the cache has now
  std::vector<Level> levels;
  BlockCache cache;
  LevelRange drawing{};  ///< the frame at work
  /// Parameters of the levels that draw the frame at work.
  ocl::InFlight<std::vector<FrameParams>> level_frames{device};
  /// The frame at work draws the surface of the last one, so that most blocks may be cached.
  bool has_drawn_surface = false;
  bool counts_touched = false;  ///< passes count the blocks that they touch, see BlockCache

 private:
  void grow(Wavefront &rays);
  void select(Level &level, FrameParams &frame, bool has_box);
  void classify(Wavefront &rays, const Surface &surface);
  void decode_as(const std::vector<DecodedValues> &values);

  /// How the cache filled since it was empty.
  struct Filling {
    std::uint32_t free_slots = 0;  ///< after the last pass that was noted
    std::uint64_t evicted = 0;     ///< blocks freed by the frame at work ...
    std::uint64_t decoded = 0;     ///< ... and decoded by it
    std::uint32_t num_frames = 0;  ///< frames that decoded more than a few blocks
  };
  std::uint64_t lacked_by_second_frame();
  void note_empty();

  Filling filling_{};
  std::uint32_t wanted_slots_ = 0;   ///< slots from the next frame on
  bool is_small_ = false;            ///< slots may run out within one pass
  bool slots_are_scarce_ = true;     ///< free slots may not suffice for the next passes
  Schedule schedule_{};              ///< every frame's, except cache_slots
  ScreenBox whole_screen_{};         ///< of the frame at work: of all rays that meet the volume
  std::optional<LevelRange> asked_;  ///< levels whose blocks the last pass may have asked for
  /// Isovalue and group of the cache's bits of voxels inside.
  std::optional<std::pair<float, uint>> cached_surface_;
};

}  // namespace isowave::core
