#pragma once
// Draws one brick of a volume, and with its team the picture of the whole: at rank 0, with the bits
// that one renderer of the whole would draw.

#include <functional>
#include <optional>
#include <vector>

#include "core/base/team.hpp"
#include "core/bricks/compose.hpp"
#include "core/bricks/cuts.hpp"
#include "core/bricks/team_volume.hpp"
#include "core/frame/renderer.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core {

/// Statistics of putting pictures together so far, at this rank.
struct CompositionStats {
  std::uint64_t reductions = 0, bytes = 0;  ///< words that this rank gave
  double ms = 0;                            ///< wall clock, with the wait for slower ranks
};

/// Draws the whole volume by the bricks of all ranks.
class TeamRenderer : public Renderer {
 public:
  /// volume  this rank's brick: see brick_volume.hpp
  /// cuts    as many bricks as ranks; each rank draws the brick of its number. Device, cuts and
  ///         team must outlive the renderer
  /// whole   grids of the whole volume's levels of detail, the finest first: those that the brick
  ///         has, and coarser ones that frames do without
  /// Throws  Error: as DeviceRenderer, at the rank that fails
  TeamRenderer(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options,
               const Cuts &cuts, std::vector<VolumeInfo> whole, Team &team);
  /// The same for a volume that the team has opened, which must outlive the renderer, too.
  ///
  /// options  with_levels and range_thresholds become the volume's
  TeamRenderer(ocl::Device &device, const TeamVolume &volume, RendererOptions options, Team &team);

  Abilities abilities() const override {
    Abilities abilities = renderer_.abilities();
    abilities.cells = false;
    return abilities;
  }
  Team &team() override { return team_; }
  std::vector<VolumeInfo> levels() const override { return whole_levels_; }

  /// Draws this rank's brick. Ambient rays go through the bricks of all ranks. Hits of several
  /// surfaces and of slices are blended on rank 0.
  ///
  /// request  All ranks have an on_pass, or none. It is called at all ranks after each pass of any
  ///          rank, and after each round of light rays of all; in frames of layers without light
  ///          rays, once more with the whole picture. All ranks may ask for the picture so far, or
  ///          none. The frame stops if it returns false at any rank.
  /// Returns  what the frame took; cancelled if any rank is unfinished
  /// Throws   Error at every rank, if one rank fails as DeviceRenderer::render() does, or its
  ///          on_pass throws; or if the whole would be drawn with coarser levels of detail than the
  ///          bricks have
  FrameStats render(const FrameRequest &request) override;
  /// Throws  Error: rays go on in other bricks
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override {
    return renderer_.cast_rays(rays, isovalue, normals);
  }
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override;
  Camera label_camera(std::span<const std::uint16_t> labels, std::optional<ImageSize> size = {},
                      const Viewpoint &from = {}) override;
  bool has_field_values() const override { return renderer_.has_field_values(); }
  std::optional<std::array<float, 2>> field_range() override;

  ImageSize size() const override { return renderer_.size(); }
  /// Puts together colours; with several rays a pixel, or colours by a field, it puts together
  /// hits, which rank 0 shades.
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;
  /// Hits without the ids of their blocks.
  std::vector<HitRecord> hits() override;
  /// Puts together the frame's depth, if nothing was put together yet.
  std::uint64_t num_hits(const FrameStats &stats) override;

  void keep_picture() override { renderer_.keep_picture(); }
  void fill_from_kept() override;
  void enlarge_kept(const FrameRequest &request) override;
  void clear_cache() override { renderer_.clear_cache(); }
  std::uint64_t memory_bytes() const override { return renderer_.memory_bytes(); }
  double setup_ms() const override { return renderer_.setup_ms(); }

  /// The renderer of this rank's brick.
  const DeviceRenderer &renderer() const { return renderer_; }
  const CompositionStats &composition() const { return composition_; }

 private:
  using DrawBrick = std::function<FrameStats(const FrameRequest &request)>;
  /// Layers of all bricks.
  struct Layered {
    std::vector<RayColor> colors;       ///< [ray] at rank 0
    std::vector<HitRecord> first_hits;  ///< [ray] this brick's
    std::uint64_t num_hits = 0;         ///< rays with a hit
    FrameParams frame{};
  };
  class Layering;
  class LayersOfBricks;
  class ShowsLayers;

  void check_levels(const FrameRequest &request) const;
  FrameStats draw_brick(const FrameRequest &request, const DrawBrick &draw);
  FrameStats draw_in_step(const FrameRequest &request, const DrawBrick &draw);
  bool show_round(const FrameRequest &request);
  void draw_layers(const FrameRequest &request, FrameStats &stats);
  HostArray<std::uint8_t> picture_so_far(const Appearance &appearance);
  void cast_round(const FrameRequest &request, std::uint32_t round,
                  std::span<const HitRecord> placed, OpenCounts &open, LaterPasses &stats);
  LevelRange drawn_levels(const FrameRequest &request) const;
  /// The light that a surface of a number sends on.
  using SentOn = std::function<BouncedLight(std::uint32_t surface)>;
  void bounce_round(const FrameRequest &request, std::uint32_t round, const SentOn &sent_on,
                    OpenCounts &open, LaterPasses &stats);
  std::vector<std::uint32_t> places_along(std::span<const GivenRay> rays) const;
  std::vector<HitRecord> compose_met(std::span<const HitRecord> own,
                                     std::span<const GivenRay> rays);
  std::vector<HitRecord> compose_nearest(const FrameRequest &request,
                                         std::span<const HitRecord> own,
                                         std::span<const GivenRay> rays);
  void add_ambient(const FrameRequest &request, FrameStats &stats);
  void reduce(std::size_t count, Reduction how, Receiver who, const MakeWords &make,
              const TakeWords &take);
  HostArray<std::uint8_t> compose_picture(const Appearance &appearance);
  /// picture [pixels][channels]: at rank 0 only.
  void compose_colors(std::span<const std::uint32_t> colors, std::size_t channels,
                      std::span<std::uint8_t> picture);
  /// Puts together a word of each ray.
  void compose(Receiver who, const MakeWords &make, const TakeWords &take);
  /// The hits that win among all bricks'.
  std::vector<HitRecord> compose_hits(std::span<const HitRecord> own,
                                      std::span<const HitField> fields,
                                      Receiver who = Receiver::kRank0);
  /// Whether the renderer has all that fetch() shows, since there are no other bricks.
  bool is_alone() const { return team_.size() == 1 && !layers_so_far_; }
  std::span<const HitRecord> own_hits();
  /// The field's values at the hits that win, at rank 0.
  const std::vector<float> &compose_values();
  void forget_hits();

  DeviceRenderer renderer_;
  VolumeInfo brick_;
  const Cuts &cuts_;
  std::vector<VolumeInfo> whole_levels_;
  std::size_t num_levels_;  ///< number of these that the brick has
  Team &team_;
  std::uint32_t place_ = 0;                   ///< place of the brick, seen from the frame's eye
  std::vector<HitRecord> own_hits_;           ///< empty: not read yet
  std::optional<std::vector<float>> values_;  ///< of compose_values(); none: not composed yet
  bool has_whole_ = false;                    ///< the renderer has the hits of all bricks already
  std::optional<std::uint64_t> num_hits_;     ///< hits in what was put together last
  /// Puts the layers so far together, at all ranks. Within on_pass of a frame of layers alone.
  std::function<const Layered &()> layers_so_far_;
  CompositionStats composition_;
  HostMemory memory_;
};

}  // namespace isowave::core
