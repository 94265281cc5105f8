#pragma once
// Draws isosurfaces of one compressed volume on one device: the main loop of the program.
//
// A frame is a row of waves: camera rays, hits that get smooth normals, rounds of ambient rays.
// run() has the only loop over passes. Waves: ray_waves.hpp, core/paper.

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/frame/labels.hpp"
#include "core/frame/renderer.hpp"
#include "core/render/block_store.hpp"
#include "core/render/field_wave.hpp"
#include "core/render/memory_plan.hpp"
#include "core/render/passes.hpp"
#include "core/render/ray_waves.hpp"
#include "core/render/renderer_options.hpp"
#include "core/stages/ambient.hpp"
#include "core/stages/bounce.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/stages/layers.hpp"
#include "core/stages/shade.hpp"
#include "core/stages/smooth_normals.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

class DeviceRenderer : public Renderer {
 public:
  /// Uploads the volume, builds its macrocell ranges and every buffer of the frame, and compiles
  /// the kernels. Nothing is allocated or compiled later, except a larger cache.
  ///
  /// device   must outlive the renderer
  /// volume   must outlive the renderer if it stays on the host (memory_plan().stream)
  /// options  limits of all requests
  /// Throws   Error: options out of range, not enough device memory or budget
  /// Waits    yes
  DeviceRenderer(ocl::Device &device, const CompressedVolume &volume,
                 const RendererOptions &options);

  /// Draws one frame. Decoded blocks stay in the cache for the next frame, of any isovalue, unless
  /// that frame asks for other values (voxel_error, bound), or this frame needed many more blocks
  /// than there are slots.
  ///
  /// Returns  counts and times [ms] of the passes
  /// Throws   Error: a request that is out of range or that the renderer was not made for; a file
  ///          that blocks are read from has become shorter. Further frames can be drawn.
  /// Waits    yes
  FrameStats render(const FrameRequest &request) override;

  /// The abilities of a renderer with such options.
  static Abilities abilities_of(const RendererOptions &options);
  Abilities abilities() const override;
  std::vector<VolumeInfo> levels() const override;

  /// The box around the blocks that isosurfaces may be in; none if they are in no block.
  ///
  /// Throws  Error: an isovalue is NaN; a renderer of labels
  /// Waits   yes
  std::optional<BlockBox> surface_box(std::span<const float> isovalues);

  /// The same of the surface of labels, of a renderer with Abilities::labels.
  std::optional<BlockBox> label_box(std::span<const std::uint16_t> labels);

  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override;
  Camera label_camera(std::span<const std::uint16_t> labels, std::optional<ImageSize> size = {},
                      const Viewpoint &from = {}) override;
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;

  std::vector<HitRecord> hits() override;
  bool has_field_values() const override { return has_field_values_; }
  std::optional<std::array<float, 2>> field_range() override;
  /// Replaces the last frame's hits, which fetch() shows.
  ///
  /// hits    [size.ray_rows()][size.ray_columns()]
  /// Throws  Error: no frame was drawn
  /// Waits   yes
  void set_hits(std::span<const HitRecord> hits);
  /// [height * width] Values of the field at the hits of the last frame, NaN where there is none.
  ///
  /// Throws  Error: no frame was drawn with FrameRequest::field_values
  /// Waits   yes
  std::vector<float> field_values();
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;
  /// The picture of the hit buffer, RGBA in words, red in bits 0..7; A is 0 if no ray of a pixel
  /// hits.
  HostArray<std::uint32_t> shade_packed(const Appearance &appearance);
  /// Counts of open ambient rays of the last frame's hits, for its finished rounds, and bounced
  /// light.
  ///
  /// Throws  Error: no frame was drawn
  /// Waits   yes
  OpenCounts open() const;

  // For bricks, whose pictures are put together (core/bricks). A brick's own frames have no ambient
  // rays, since these go on in other bricks.

  /// render() of a frame of layers.
  ///
  /// layers  gets each layer's hits when the layer is whole, and those behind the last layer that
  ///         is drawn
  FrameStats render_layers(const FrameRequest &request, std::vector<std::vector<RayHit>> &layers);
  /// The hits so far of the first layer, within on_pass and before it is whole. Those on slices may
  /// have no values, and be unseen. Waits.
  ///
  /// request  that of the frame
  std::vector<RayHit> first_layer_so_far(const FrameRequest &request);
  /// Sets the colours of a frame of layers, [height * width], that pictures have instead of its
  /// own. Waits.
  void set_colors(std::span<const RayColor> colors);
  /// hits() as all bricks can read them, of any level of detail: see placed_hit().
  std::vector<HitRecord> placed_hits();
  /// The same of a hit of a frame of layers.
  HitRecord placed(const HitRecord &hit) const;
  /// What pictures with colours by a field need, at hits that set_hits() has replaced: their values
  /// [height * width]. Waits.
  void set_field_values(std::span<const float> values);
  /// Begins the rounds of light rays of the last frame, which was not cancelled; in frames of
  /// layers, those of a layer. Rays start at the placed hits of all bricks, which replace the
  /// brick's own.
  ///
  /// placed   no_hit() where no rays begin
  /// levels   levels of detail that draw the frame of the whole volume
  /// Throws   Error: no frame was drawn; the renderer is not a brick's, or was made without given
  ///          rays
  /// Waits    yes
  void begin_ambient(const FrameRequest &request, std::vector<HitRecord> placed, LevelRange levels);
  /// Casts a round of ambient or shadow rays through this brick.
  ///
  /// request  as for begin_ambient()
  /// round    0..light_rays_of(request).count() - 1
  /// goes_on  casts the rays that set_light_rays() has set
  /// Returns  bits [(rays + 63) / 64]: 1 if the ray meets a surface in this brick, or there is none
  /// Waits    yes
  std::vector<std::uint64_t> blocked_rays(const FrameRequest &request, std::uint32_t round,
                                          LaterPasses &stats, bool goes_on = false);
  /// The same of a frame of one surface, if its ambient rays bring light.
  ///
  /// Returns  what the rays meet in this brick: placed_hit()s, of levels that count from
  ///          begin_ambient()'s first one
  std::vector<HitRecord> met_hits(const FrameRequest &request, std::uint32_t round,
                                  LaterPasses &stats);
  /// The rays of the last round, [height * width]. Both wait.
  std::vector<GivenRay> light_rays() const;
  void set_light_rays(std::span<const GivenRay> rays);
  /// Sets the counts that pictures have instead of open(), with light that is not filtered. Waits.
  void set_open(const OpenCounts &open);
  /// Filters that light, at the placed hits of begin_ambient().
  void filter_bounced(const FrameRequest &request);

  /// These three throw Error without options().with_kept_picture.
  void keep_picture() override;
  void fill_from_kept() override;
  void enlarge_kept(const FrameRequest &request) override;

  void clear_cache() override;

  ImageSize size() const override { return size_; }
  std::uint64_t memory_bytes() const override { return blocks_.plan.total(); }
  const RendererOptions &options() const { return options_; }     ///< with the defaults filled in
  const MemoryPlan &memory_plan() const { return blocks_.plan; }  ///< every buffer that there is
  /// The macrocells of the finest level.
  const Macrocells &macrocells() const { return blocks_.levels[0].macrocells; }
  /// Time of upload and macrocell ranges, without Device::compile_ms().
  double setup_ms() const override { return setup_ms_; }

 private:
  /// The frame at work.
  struct Frame {
    const OnPass &on_pass;
    std::uint32_t waves_left;  ///< waves that follow the one at work
    FrameStats stats{};
    OnProgress on_progress{};
    std::uint32_t num_waves = 0;  ///< 0: as many as it takes

    /// percent  of the wave at work
    void tell(double percent) const;
  };

  /// The surface whose hits a frame finds first: the only one, or the innermost.
  struct FirstSurface {
    float isovalue;
    uint number;
    bool clipped;
  };
  static FirstSurface first_surface(const FrameRequest &request);

  /// Makes rays_.hits the picture so far, while waves of layers have other hits there.
  class PictureSoFar;
  class BrickRound;

  void run(Wave &wave, Frame &frame, Wave *next = nullptr);
  void compile_kernels();
  void check_has_picture() const;
  void check_has_given() const;
  bool is_brick() const { return blocks_.levels[0].info.brick != BrickOf{}; }
  KeptPicture &kept();
  void begin_frame(const FrameRequest &request);
  void open_frame(std::vector<FrameParams> frames, const std::vector<DecodedValues> &values,
                  FieldBound bound, RaySource source);
  std::vector<FrameParams> frames_of_rays(std::uint32_t columns, std::uint32_t rows,
                                          float isovalue) const;
  std::vector<DecodedValues> decoded_values(const FrameRequest &request) const;
  PassStats stats_of(const PassCounts &counts, BlockStore &blocks);
  void light_surface(const LightRays &light_rays, Frame &frame);
  void cast_round(std::uint32_t round, Frame &frame, bool goes_on = false);
  std::vector<HitRecord> placed(std::vector<HitRecord> hits, std::size_t first_level) const;
  HitRecord placed(HitRecord hit, std::size_t first_level) const;
  void bounce_round(std::uint32_t round, Frame &frame);
  void count_last_round(std::uint32_t num_rounds, Frame &frame);
  void add_stage_times(LaterPasses &passes);
  void draw_surface(const FrameRequest &request, Frame &frame);
  void read_field(const FrameRequest &request, Frame &frame);
  void choose_labels(const std::vector<SurfaceStyle> &surfaces);
  void draw_layers(const FrameRequest &request, Frame &frame);
  void show_surface(const FrameRequest &request, const ClipParams &clip, std::size_t place,
                    float isovalue);
  std::size_t find_first_hits(const FrameRequest &request, const ClipParams &clip,
                              std::span<const float> isovalues, Frame &frame);
  void light_layer(const FrameRequest &request, const ClipParams &clip,
                   std::span<const float> isovalues, Frame &frame);
  /// What becomes of rays of a layer's hits that have met a surface.
  enum class RoundEnd {
    kBlocks,      ///< they are none, see Ambient::block()
    kNearest,     ///< the nearest hit is kept, see Bounce::take_nearest()
    kBlocksLight  ///< they are none, and the round's rays are those towards the light
  };
  ClipParams clip_of(const FrameRequest &request) const;
  void bounce_layer_round(std::uint32_t round, const FrameRequest &request, const ClipParams &clip,
                          std::span<const float> isovalues, Frame &frame);
  void cast_layer_round(std::uint32_t round, const FrameRequest &request, const ClipParams &clip,
                        std::span<const float> isovalues, RoundEnd end, Frame &frame);
  LayerCounts draw_layer(std::uint32_t layer, const FrameRequest &request, const ClipParams &clip,
                         std::span<const float> isovalues, Frame &frame);
  void find_hits_behind(const FrameRequest &request, const ClipParams &clip,
                        std::span<const float> isovalues, const LayerCounts &counts,
                        bool is_first_layer, Frame &frame);
  const ocl::Buffer<RayColor> *colors() const { return has_layers_ ? &layers_->colors : nullptr; }
  bool in_step(const OnPass &on_pass) const {
    return on_pass || device_.timer().source() != ocl::TimerSource::kOff;
  }

  ocl::Device &device_;
  std::chrono::steady_clock::time_point setup_begin_;
  double compile_ms_before_;
  RendererOptions options_;
  BlockStore blocks_;
  Wavefront rays_;
  std::array<float, 2> value_range_;  ///< values of the volume before compression
  ImageSize size_;                    ///< size of the frame at work, or of the last
  bool has_picture_ = false;          ///< the hit buffer has the frame's hits so far
  /// Camera and isovalue of the last frame.
  std::optional<std::pair<Camera, float>> last_view_;
  /// Whether a single pass was enough: for the last frame that showed a new view [0], and for the
  /// last that showed the same view again [1].
  std::array<bool, 2> took_one_pass_{};
  bool has_field_values_ = false;  ///< the frame at work, or the last one
  std::unique_ptr<Wave> camera_rays_;
  SmoothNormals smooth_normals_;
  SmoothNormalsWave normals_of_camera_, normals_of_given_;
  Shade shade_;
  HitMap hit_map_;
  std::optional<KeptPicture> kept_;
  std::optional<Layers> layers_;  ///< this and the next three: options_.max_surfaces
  std::optional<BehindWave> behind_;
  std::optional<LayerNormalsWave> layer_normals_;
  std::optional<SliceValuesWave> slice_values_;
  ScreenBox layers_screen_{};  ///< rays that may hit any surface of the frame
  std::vector<std::vector<RayHit>> *layer_hits_ = nullptr;  ///< of render_layers()
  bool has_layers_ = false;                                 ///< the frame at work, or the last one
  std::optional<std::size_t> finds_first_of_;   ///< the surface whose first hits are in rays_.hits
  std::optional<std::size_t> finds_behind_of_;  ///< the surface whose next hits are there
  LabelTable label_table_;  ///< of the last frame; empty: none yet, or a renderer without labels
  bool is_in_further_layer_ = false;    ///< whether the hits of a further layer are there
  std::optional<RaysWave> given_rays_;  ///< this and the next two: options_.with_given_rays
  std::optional<Ambient> ambient_;
  std::optional<AmbientRound> ambient_round_;
  std::optional<Bounce> bounce_;    ///< options_.with_bounce
  std::optional<FieldWave> field_;  ///< options_.field
  Passes passes_;
  double setup_ms_ = 0;
};

}  // namespace isowave::core
