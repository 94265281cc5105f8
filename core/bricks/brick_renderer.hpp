#pragma once
// Draws one brick of a volume, and with the team that draws the others the picture of the whole:
// at rank 0, with the bits that one renderer of all would draw.

#include <optional>
#include <vector>

#include "core/base/team.hpp"
#include "core/bricks/compose.hpp"
#include "core/bricks/cuts.hpp"
#include "core/bricks/team_volume.hpp"
#include "core/render/renderer.hpp"
#include "core/render/time_budget.hpp"

namespace isowave::core {

/// What put pictures together so far, at this rank.
struct CompositionStats {
  std::uint64_t reductions = 0, bytes = 0;  ///< words that this rank gave
  double ms = 0;                            ///< wall clock, with the wait for slower ranks
};

/// All ranks make the same calls in the same order. Not thread-safe.
class BrickRenderer {
 public:
  /// cuts    as many bricks as ranks; each rank draws that of its number. As device and team, must
  ///         outlive the renderer
  /// volume  it: see brick_volume.hpp
  /// whole   grids of the whole volume's levels of detail, the finest first: those that the brick
  ///         has, and others that frames do without
  /// Throws  Error: as Renderer, at the rank that it is about
  BrickRenderer(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options,
                const Cuts &cuts, std::vector<VolumeInfo> whole, Team &team);
  /// The same of a volume that the team has opened, which must outlive the renderer, too.
  ///
  /// options  with_levels and range_thresholds become the volume's
  BrickRenderer(ocl::Device &device, const TeamVolume &volume, RendererOptions options, Team &team);

  /// Draws this rank's brick. Ambient rays go through those of all ranks.
  ///
  /// request  its on_pass, which all ranks have or none, is called at all of them after each pass
  ///          that any has, be this rank through or not: it may ask for the picture so far, and
  ///          must return the same at all
  /// Returns  what that took; cancelled: where any rank is not through
  /// Throws   Error at every rank: as Renderer::render(), and what on_pass throws, at one
  FrameStats render(const FrameRequest &request);
  /// Throws  Error: one renderer of the whole would draw with levels of detail that bricks do not
  ///         have, and this one with finer ones
  void check_levels(const FrameRequest &request) const;
  /// As TimedFrames::render(), by the clock of rank 0.
  TimedFrame render_within(const FrameRequest &request, double budget_ms);

  // Of the last frame, all bricks together. Rank 0 has the picture, the others nothing.

  /// Of one ray a pixel, colours are put together; of more, hits, which rank 0 shades.
  Image8 shade(const Appearance &appearance);
  /// Depths of the rays.
  std::vector<float> depth();
  /// Hits without the ids of their blocks.
  std::vector<HitRecord> hits();
  /// Rays that hit, of what was put together last.
  std::uint64_t num_hits() const { return num_hits_; }

  /// Of this rank's brick: see Renderer::surface_box().
  std::optional<BlockBox> surface_box(std::span<const float> isovalues) {
    return renderer_.surface_box(isovalues);
  }
  /// See Renderer::clear_cache().
  void clear_cache() { renderer_.clear_cache(); }
  const Renderer &renderer() const { return renderer_; }
  const std::vector<VolumeInfo> &whole_levels() const { return whole_levels_; }
  Team &team() const { return team_; }
  const CompositionStats &composition() const { return composition_; }

 private:
  FrameStats render_in_step(const FrameRequest &request);
  void add_ambient(const FrameRequest &request, FrameStats &stats);
  void reduce(std::size_t count, Reduction how, Receiver who, const MakeWords &make,
              const TakeWords &take);
  /// image: rank 0's, black.
  void compose_colors(std::span<const std::uint32_t> colors, Image8 &image);
  /// A word of each ray.
  void compose(Receiver who, const MakeWords &make, const TakeWords &take);
  /// Of bricks' hits, those that win.
  std::vector<HitRecord> compose_hits(std::span<const HitRecord> own,
                                      std::span<const HitField> fields,
                                      Receiver who = Receiver::kRank0);
  std::span<const HitRecord> own_hits();

  Renderer renderer_;
  const Cuts &cuts_;
  std::vector<VolumeInfo> whole_levels_;
  std::size_t num_levels_;  ///< of these, that the brick has
  Team &team_;
  std::uint32_t place_ = 0;          ///< of the brick, seen from the frame's eye
  std::vector<HitRecord> own_hits_;  ///< empty: not read yet
  bool has_whole_ = false;           ///< the renderer has the hits of all bricks already
  std::uint64_t num_hits_ = 0;
  CompositionStats composition_;
  std::optional<TimedFrames> timed_frames_;
};

}  // namespace isowave::core
