#pragma once
// Draws isosurfaces of one compressed volume on one device: the main loop of the program.
//
// camera -> rays -> [ pass of a pipeline ]* -> hits -> picture
//
// core/render/pipeline.hpp has the pipelines.

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/render/memory_plan.hpp"
#include "core/render/pass_readback.hpp"
#include "core/render/pipeline.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/stages/shade.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

struct RendererOptions {
  ImageSize size;
  PipelineKind pipeline = PipelineKind::kAuto;
  std::uint64_t memory_budget = 0;  ///< bound on all device memory [bytes]; 0: 3/4 of the device's
  std::uint32_t cache_slots = 0;    ///< decoded blocks kept, at least 8; 0: as many as the budget
                                    ///< allows, or kAmpleCacheSlots where there is none
  std::uint32_t max_speculation =
      64;  ///< blocks a ray looks ahead at most, 1..64; 1 turns speculation off
  bool per_ray_speculation = true;  ///< each ray by what it has missed, not all alike
  Solver solver = kDefaultSolver;   ///< root finder in a cell
  std::uint32_t group_size = 64;    ///< work-items per work-group, a power of two in 8..256
  /// How a pass's pairs are gathered by block.
  Grouping grouping = kDefaultGrouping;
  ClosestHit closest =
      kDefaultClosestHit;  ///< how a ray's closest result is found (pipeline `blocks`)
  StreamPlace stream = StreamPlace::kAuto;  ///< where the compressed volume is
  /// Bytes of one of its at most four buffers; 0: what the device allows.
  std::uint64_t largest_stream_part = 0;
  /// Blocks uploaded at a time from a volume on the host, at least 8; 0: by the size of cache and
  /// blocks.
  std::uint32_t window_blocks = 0;
  /// Distance in pixels up to which voxels of a coarser level of detail may be apart, see
  /// make_level_frames(); 0: the finest level draws all.
  double voxel_pixels = 0;
  bool with_bounds = false;        ///< draw_bound() will be called
  bool with_kept_picture = false;  ///< keep_picture() will be called
  bool with_shading =
      true;  ///< shade() will be called: else its kernel is not built before that is
};

/// What one pass did: the counts of the device, and what follows from them.
struct PassStats {
  PassCounts counts{};
  double n_spec = 0;  ///< blocks that the pass's rays were to look ahead at, mean over the rays; 0
                      ///< where none looked
  /// Distinct blocks that rays were intersected in; not counted in pipeline `rays`, which does not
  /// gather rays by block.
  std::optional<std::uint32_t> visible_blocks{};
  double utilization_percent = 0;  ///< ray-block pairs that were intersected, of all rays
  double completed_percent = 0;    ///< rays that have ended, of all
  std::map<std::string, double>
      stage_ms;  ///< by stage; empty unless the device was opened with profiling
};

struct FrameStats {
  std::vector<PassStats> passes;
  std::size_t first_level = 0, last_level = 0;  ///< of detail, that drew; 0: the finest
  double total_ms = 0;  ///< wall clock, from camera to finished hit buffer on the device
  std::uint64_t rays_hit = 0;
  std::uint64_t uploaded_blocks = 0;  ///< from a compressed volume on the host ...
  std::uint64_t uploaded_bytes = 0;   ///< ... and their bytes
  bool cancelled =
      false;  ///< on_pass said so while rays were left; the hit buffer holds the picture so far
};

/// Called after each pass, the last included; hits() and shade() show the picture so far. Return
/// false to stop. With a callback, or with profiling, the host waits after each pass; without, it
/// stays a pass ahead.
using OnPass = std::function<bool(const PassStats &)>;

/// Slots (325 MiB with their share of the tables) that no budget was asked for are enough: a cold
/// 720p frame of a 1024^3 volume touches about 400,000 blocks.
inline constexpr std::uint32_t kAmpleCacheSlots = 1u << 20;

class Renderer {
 public:
  /// Uploads the volume, builds its macrocell ranges and every buffer of the frame, and has the
  /// kernels compiled; nothing is allocated or compiled later. Throws Error when options are out of
  /// range or memory does not suffice. `device` must outlive the renderer; `volume` need not,
  /// unless it stays on the host (memory_plan().stream).
  Renderer(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options);

  /// Draws one frame and waits for it. Decoded blocks stay in the cache for the next frame,
  /// whatever its isovalue, unless this one needed many more than there are slots. Throws Error
  /// when a file that blocks are read from has become shorter; the next frame is drawn as if this
  /// had not been.
  FrameStats render(const Camera &camera, float isovalue, const OnPass &on_pass = {});

  /// How far the voxels of further frames may be from the volume's: 0, as at first, not at all;
  /// more, and fewer bit planes of each block are decoded (with_fewer_planes()), of coarser levels
  /// of detail fewer still (voxel_error_of()). Forgets the decoded blocks where that changes
  /// anything. Throws Error unless it is finite and at least 0.
  void set_voxel_error(double voxel_error);

  /// Whether it was made for levels of detail.
  bool has_levels() const { return state_.levels.size() > 1; }
  double voxel_error() const { return voxel_error_; }

  /// What further frames draw: the volume, as at first, or the field that is nowhere above, or
  /// nowhere below what the volume's voxels were before compression, trilinear between them:
  /// decoded values are lowered or raised by the bound of their error. Forgets the decoded blocks
  /// where that changes. Needs options().with_bounds. Throws Error where the error is not known.
  void draw_bound(FieldBound bound);

  /// Distance in pixels up to which voxels of a coarser level may be apart in further frames;
  /// options().voxel_pixels at first. Throws Error unless it is finite and at least 0, and 0
  /// where the renderer was made for the finest level.
  void set_voxel_pixels(double voxel_pixels);
  /// Picture of further frames, with no more rays than the renderer was made for: hits() and
  /// shade() are of that size.
  void set_size(ImageSize size);

  /// For pictures of one frame with more and more pixels (core/render/time_budget.hpp). Needs
  /// options().with_kept_picture. Puts the picture aside: of at most half the pixels that the
  /// renderer was made for, along each axis, rounded up (halved()).
  void keep_picture() { kept_.value().keep(state_.rays, options_.size); }
  /// Where the frame has no hit, it shows the kept picture's, as after rendering was cancelled. The
  /// frame must not go on. Waits.
  void fill_from_kept();
  /// The kept picture with more pixels, as set_size() says; what was drawn is gone. camera,
  /// isovalue: of the kept picture. Waits.
  void enlarge_kept(const Camera &camera, float isovalue);

  /// Forgets all decoded blocks, so that the next frame is a cold one: for measurements. No picture
  /// depends on it. Waits.
  void clear_cache();

  /// The hit buffer [size.ray_rows()][size.ray_columns()], row 0 at the top. Waits.
  std::vector<HitRecord> hits() const {
    std::vector<HitRecord> hits(options_.size.num_rays());
    state_.rays.hits.read(hits);
    return hits;
  }
  /// The picture of the hit buffer. Waits.
  Image8 shade(const Appearance &appearance = {});

  const RendererOptions &options() const { return options_; }  ///< with the defaults filled in
  const MemoryPlan &memory_plan() const { return plan_; }      ///< every buffer that was made
  const Macrocells &macrocells() const {
    return state_.levels[0].macrocells;
  }  ///< of the finest level
  double setup_ms() const {
    return setup_ms_;
  }  ///< upload, macrocell ranges; without Device::compile_ms()

 private:
  void compile_kernels();
  void begin_frame(const Camera &camera, float isovalue);
  void update_layouts();
  struct Uploads {
    std::uint64_t blocks = 0, bytes = 0;
  };
  Uploads uploads() const;
  PassStats stats_of(const PassCounts &counts);

  ocl::Device &device_;
  std::chrono::steady_clock::time_point setup_begin_;
  double compile_ms_before_;
  RendererOptions options_;
  MemoryPlan plan_;
  FrameState state_;
  std::vector<FrameParams> level_frames_;  ///< of the levels of detail that draw the frame at work
  std::array<float, 2> value_range_;       ///< of the volume before compression
  double voxel_error_ = 0;
  FieldBound bound_ = FieldBound::kNone;
  std::optional<float>
      cached_isovalue_;  ///< of the cache's bits of voxels inside; none: it is empty
  std::unique_ptr<Pipeline> pipeline_;
  Shade shade_;
  std::optional<KeptPicture> kept_;
  PassReadback readback_;
  double setup_ms_ = 0;
};

}  // namespace isowave::core
