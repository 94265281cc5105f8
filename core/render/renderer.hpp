#pragma once
// Draws isosurfaces of one compressed volume on one device: the main loop of the program.
//
// camera -> rays -> [ pass of a pipeline ]* -> hits -> picture
//
// core/render/pipeline.hpp has the pipelines.

#include <chrono>
#include <optional>
#include <vector>

#include "core/render/frame_request.hpp"
#include "core/render/pass_readback.hpp"
#include "core/render/renderer_setup.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/stages/shade.hpp"

namespace isowave {

class Renderer {
 public:
  /// Uploads the volume, builds its macrocell ranges and every buffer of the frame, and has the
  /// kernels compiled; nothing is allocated or compiled later. Waits.
  /// device: outlives the renderer.
  /// volume: need not, unless it stays on the host (memory_plan().stream).
  /// errors: Error when options are out of range or memory does not suffice.
  Renderer(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options);

  /// Draws one frame and waits for it. Decoded blocks stay in the cache for the next frame,
  /// whatever its camera, size and isovalue, unless this one needed many more than there are slots
  /// or the next decodes them otherwise (voxel_error, bound).
  /// errors: Error as check() says, before anything changes; Error when a file that blocks are read
  /// from has become shorter; what on_pass throws. The next frame is drawn as if this had not been.
  FrameStats render(const FrameRequest &request);

  /// errors: Error where the renderer cannot draw the request: more rays than it was made for,
  /// levels of detail or bounds that it was made without, a volume whose error is not known for its
  /// bounds, numbers out of range. Does not wait.
  void check(const FrameRequest &request) const { plan_of(request); }

  /// Of hits() and shade(): the size of the request rendered last; 0x0 where there is none.
  ImageSize size() const { return drawn_; }
  /// The hit buffer of the request rendered last [size.ray_rows()][size.ray_columns()], row 0 at
  /// the top. Waits.
  /// errors: Error where nothing was rendered.
  std::vector<HitRecord> hits() const;
  /// The picture of the hit buffer. Waits.
  /// errors: Error where nothing was rendered.
  Image8 shade(const Appearance &appearance = {});

  /// For pictures of one frame with more and more pixels (core/render/time_budget.hpp). Needs
  /// options().with_kept_picture. Puts the picture aside: of at most half the rays of
  /// options().max_size along each axis, rounded up (halved()). Does not wait.
  /// errors: Error where the renderer was made without it, or nothing was rendered.
  void keep_picture();
  /// Where the frame has no hit, it shows the kept picture's, as after rendering was cancelled. The
  /// frame must not go on. Waits.
  void fill_from_kept();
  /// The kept picture with as many pixels as the request's; what was drawn is gone. Waits.
  /// request: camera and isovalue of the kept picture.
  void enlarge_kept(const FrameRequest &request);

  /// Forgets all decoded blocks, so that the next frame is a cold one: for measurements. No picture
  /// depends on it. Waits.
  void clear_cache();

  const RendererOptions &options() const { return options_; }  ///< with the defaults filled in
  const MemoryPlan &memory_plan() const { return plan_; }      ///< every buffer that was made
  const Macrocells &macrocells() const {
    return state_.levels[0].macrocells;
  }  ///< of the finest level
  double setup_ms() const {
    return setup_ms_;
  }  ///< upload, macrocell ranges; without Device::compile_ms()

 private:
  /// What a request comes to.
  struct Plan {
    std::vector<FrameParams> levels;      ///< of detail, drawn or not
    std::vector<LevelDecoding> decoding;  ///< of each
  };
  struct Uploads {
    std::uint64_t blocks = 0, bytes = 0;
  };

  Plan plan_of(const FrameRequest &request) const;
  void begin_frame(const FrameRequest &request, Plan plan);
  void prepare_cache(FieldBound bound, std::vector<LevelDecoding> decoding);
  void end_frame(const FrameStats &stats);
  PassStats stats_of(const PassCounts &counts);
  Uploads uploads() const;
  ImageSize drawn() const;
  KeptPicture &kept();
  void compile_kernels();

  ocl::Device &device_;
  std::chrono::steady_clock::time_point setup_begin_;
  double compile_ms_before_;
  RendererOptions options_;
  MemoryPlan plan_;
  FrameState state_;
  std::vector<FrameParams> level_frames_;  ///< of the levels of detail that draw the frame at work
  std::array<float, 2> value_range_;       ///< of the volume before compression
  ImageSize drawn_{0, 0};                  ///< of the hit buffer; 0x0: no picture
  std::vector<LevelDecoding> cached_decoding_;  ///< of the cache's blocks; [levels]
  std::optional<float>
      cached_isovalue_;  ///< of the cache's bits of voxels inside; none: it is empty
  std::unique_ptr<Pipeline> pipeline_;
  Shade shade_;
  std::optional<KeptPicture> kept_;
  PassReadback readback_;
  double setup_ms_ = 0;
};

}  // namespace isowave
