#pragma once
// Draws isosurfaces of a compressed volume on the host, without OpenCL: pictures with a device's
// bits, if there is no device, or while its kernels are being compiled.
//
// Value ranges of all blocks are made once. Rays skip macrocells of 4^3 blocks and blocks that
// cannot hold the isovalue, and cells whose corners are on one side. Rays decode the blocks that
// they come to, which stay decoded for further frames.

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/host/host_field.hpp"
#include "core/host/host_levels.hpp"

namespace isowave::core {

struct LightRays;

struct HostRendererOptions {
  /// Bound on value ranges and decoded blocks [bytes]; 0: a quarter of the host's memory. Frames
  /// have the same bits with any limit. If a frame's blocks do not fit, they are dropped and
  /// decoded anew, which is slower.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor
  /// A second volume for FrameRequest::field_values; null: none. Must outlive the renderer.
  const CompressedVolume *field = nullptr;
  ImageSize largest{};  ///< picture of a request without a size
};

class HostRenderer : public Renderer {
 public:
  /// Reads the whole finest level, for its value ranges.
  ///
  /// volume  must outlive the renderer
  /// Throws  Error: a limit that is too small; a file that the volume is in cannot be read
  explicit HostRenderer(const CompressedVolume &volume, const HostRendererOptions &options = {});
  explicit HostRenderer(CompressedVolume &&, const HostRendererOptions & = {}) = delete;

  /// Whether the memory limit, or without one the host's memory, is enough for the volume.
  static bool fits(const CompressedVolume &volume, std::uint64_t memory_limit);
  /// Abilities of a renderer of that volume.
  static Abilities abilities_of(const CompressedVolume &volume);
  Abilities abilities() const override { return abilities_; }
  std::vector<VolumeInfo> levels() const override { return levels_.infos(); }

  /// Draws one frame. on_pass is called after each band of rows, from the top, by the calling
  /// thread; rows that were not drawn have no hits.
  ///
  /// Throws  Error: also a file that cannot be read; there are no hits() then. Several surfaces for
  ///         which the memory limit is too small
  FrameStats render(const FrameRequest &request) override;
  /// From now on, frames draw the rows of pixels from `begin` to `end` alone, and so do pictures;
  /// what arrays have for other rows says nothing. So several renderers draw a picture together.
  /// Light does not bounce then, since that takes neighbours; a field's range is that of the rows.
  /// A sample of the rays is drawn whole.
  void set_rows(std::uint32_t begin, std::uint32_t end) { rows_ = {begin, end}; }
  /// For a volume in chunks: whether the next frame goes on with the last, which has the same
  /// request and rows, and waited for chunks (FrameStats::cancelled). Tiles that were finished
  /// stay, and do not count in its statistics. Not with FrameRequest::on_pass.
  void go_on(bool goes_on) { goes_on_ = goes_on; }
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override;

  Camera label_camera(std::span<const std::uint16_t> labels, std::optional<ImageSize> size = {},
                      const Viewpoint &from = {}) override;

  ImageSize size() const override { return size_; }
  std::vector<HitRecord> hits() override;
  bool has_field_values() const override { return !field_values_.empty(); }
  std::optional<std::array<float, 2>> field_range() override;
  /// [height * width] Values of the field, if the last frame had FrameRequest::field_values.
  const std::vector<float> &field_values() const { return field_values_; }
  /// Counts of open ambient rays of the last frame's hits.
  const OpenCounts &open() const { return open_; }
  /// [height * width] What rays have seen, if the last frame had FrameRequest::surfaces.
  const std::vector<RayColor> &colors() const { return colors_; }
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;

  void keep_picture() override;
  void fill_from_kept() override { show_kept(false); }
  void enlarge_kept(const FrameRequest &request) override;

  /// Forgets all decoded blocks, and keeps their memory for other blocks.
  void clear_cache() override;
  std::uint64_t num_decoded_blocks() const { return levels_.num_decoded(); }  ///< from the start
  /// Memory at present: value ranges and decoded blocks, without pictures.
  std::uint64_t memory_bytes() const override { return levels_.bytes(); }
  double setup_ms() const override { return setup_ms_; }

 private:
  /// The loops over a frame's rays, in their order.
  enum class Loop { kHits, kField, kLight };
  void check_has_picture() const;
  void show_kept(bool everywhere);
  template <class Draw>
  void draw_picture(const FrameParams &frame, ImageSize size, std::vector<RayColor> colors,
                    Draw draw);
  void draw_one(const FrameRequest &request, std::span<const FrameParams> frames, ImageSize size,
                FrameStats &stats);
  std::vector<LeveledSurface> open_surfaces(const FrameRequest &request,
                                            std::span<const FrameParams> frames,
                                            std::span<const std::uint32_t> order);
  LayerBlend blend_of(const FrameRequest &request, std::span<const FrameParams> frames,
                      std::span<const AmbientDirection> directions) const;
  void draw_surfaces(const FrameRequest &request, std::span<const FrameParams> frames,
                     ImageSize size, FrameStats &stats);
  std::uint64_t trace(std::span<const HostLevel> drawing, const RayTile &tile, bool is_alone,
                      bool is_smooth);
  template <class Draw>
  void draw_or_wait(Loop loop, std::uint64_t tile, Draw draw);
  bool has_guessed() const;
  template <class DrawTile>
  void draw_bands(const FrameRequest &request, DrawTile draw_tile, FrameStats &stats);
  void add_field_values(const FrameRequest &request, FrameStats &stats);
  void begin_light(const LightRays &light_rays);
  void add_ambient(const FrameRequest &request, std::span<const HostLevel> drawing,
                   FrameStats &stats);
  std::vector<GivenRay> places_of(const FrameParams &frame, const AmbientParams &params,
                                  std::span<const HitRecord> hits) const;
  void filter_bounced(const View &view, std::span<const GivenRay> places,
                      std::vector<float> &light) const;
  using LayerHits = std::vector<std::vector<LayerHit>>;  ///< [layer] of all rays
  void blend_bounced(const FrameParams &frame, const LayerBlend &by);
  template <class Draw, class After>
  bool for_bands(const FrameRequest &request, Loop loop, Draw draw, After after);
  /// The rows of rays that are drawn: from, to.
  std::array<std::uint32_t, 2> rows_of_rays() const;

  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();  ///< of making
  const CompressedVolume &volume_;
  VolumeInfo info_;
  Abilities abilities_;
  std::uint32_t num_threads_;
  std::uint64_t memory_limit_;  ///< 0: not given
  HostLevels levels_;
  double setup_ms_;
  FrameParams frame_{};  ///< of the finest level, for shading
  ImageSize size_;
  std::array<std::uint32_t, 2> rows_{0, ~0u};  ///< that are drawn: from, to
  std::vector<BlockChunks *> chunks_{};        ///< of all levels of detail that have some
  std::uint32_t guesses_ = 0;  ///< missing chunks that a tile may note before it waits
  bool goes_on_ = false;
  std::atomic<bool> any_waits_ = false;                ///< a tile of the frame, for chunks
  std::array<std::vector<std::uint8_t>, 3> finished_;  ///< [Loop][tile] of a volume in chunks
  LayerHits layers_;                                   ///< that are blended again; else empty
  std::vector<HitRecord> hits_;
  OpenCounts open_;
  std::vector<RayColor> colors_;          ///< of a frame of several or translucent surfaces
  std::optional<HostFieldValues> field_;  ///< HostRendererOptions::field
  std::vector<float> field_values_;
  std::vector<HitRecord> kept_;
  ImageSize kept_size_;
  HostMemory memory_;
};

}  // namespace isowave::core
