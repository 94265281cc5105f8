#pragma once
// Layers of several and translucent surfaces (kernels_cl/layers.cl, core/frame/surfaces.hpp).

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/frame/surfaces.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "kernels/layers.hpp"

namespace isowave::core {

/// A ray's hit in a layer.
struct RayHit {
  std::uint32_t ray = 0;
  HitRecord hit{};
  float value = 0;  ///< of the voxels on a slice, else of the field; see has_value_color()
};

class Layers {
 public:
  /// Limits that the lengths of its buffers follow from.
  struct Limits {
    std::uint64_t num_rays = 0;
    std::uint32_t max_surfaces = 0;  ///< 0: there are no layers
  };
  static ocl::BufferSizes sizes(const Limits &limits);

  /// levels: frames may have several levels of detail.
  Layers(ocl::Device &device, const Limits &limits, std::uint32_t group_size, bool levels = false);

  /// Launches the kernels that no wave launches, see Device::Compiling.
  void compile(Wavefront &rays);

  /// Before the waves of a frame.
  ///
  /// params  make_layer_params() of the surfaces
  /// finest  the frame of the finest level of detail, for shading
  /// Waits   yes
  void open(const std::vector<SurfaceStyle> &surfaces, const LayerParams &params,
            const Shading &light, const FrameParams &finest);

  /// The number of the surface at a place of innermost_first().
  std::uint32_t surface_at(std::size_t place) const { return order_[place]; }

  /// Exchanges rays.hits for the hits of a surface, `place` in innermost_first(), or back.
  void swap_hits(Wavefront &rays, std::size_t place) { std::swap(rays.hits, surface_hits_[place]); }
  /// Exchanges rays.hits, those of the first layer, for those of a further one, or back.
  void swap_layer(Wavefront &rays) { std::swap(rays.hits, further_hits_); }

  /// Makes rays.hits the layer of the nearest hits of the first num_surfaces in innermost_first(),
  /// and of the slices. rays.clip is what clips slices.
  ///
  /// is_first  the frame's first layer; otherwise of the rays that next_layer() has taken
  /// Waits     no
  void choose(Wavefront &rays, std::size_t num_surfaces, bool is_first);
  /// Makes hits [R] of a frame's rays no_hit(). Does not wait.
  void forget(const Wavefront &rays, ocl::Buffer<HitRecord> &hits);
  /// Forgets the colours. Does not wait.
  void clear(const Wavefront &rays);
  /// Blends rays.hits into the colours, and lists the rays that go on.
  ///
  /// how    ISO_BLENDS, ISO_PREVIEWS or ISO_COUNTS_ALONE
  /// In     rays.field_values of hits on slices; rays.open_counts, num_ambient, num_shadow,
  ///        bounced and num_bounced of the hits
  /// Waits  yes
  LayerCounts blend(Wavefront &rays, bool is_first, uint how = ISO_BLENDS);
  /// The hits of rays.hits, before blend().
  ///
  /// is_first     as for blend()
  /// with_values  reads rays.field_values, too
  /// Waits        yes
  std::vector<RayHit> read(const Wavefront &rays, bool is_first, bool with_values) const;
  /// Takes the rays that blend() has listed.
  void next_layer() {
    std::swap(listed_, next_listed_);
    std::swap(counts_, next_counts_);
  }
  /// Begins a wave of the rays that next_layer() has taken, of those with hits of a surface.
  ///
  /// layer  the hits that blend() has blended
  /// place  of the surface in innermost_first(); none: all surfaces
  /// In     rays.counts: next_active_count is 0
  /// Out    rays.next_active_ray_ids, ray_block_ids; counts.next_active_count
  /// Waits  no
  void begin(Wavefront &rays, const ocl::Buffer<HitRecord> &layer,
             std::optional<std::size_t> place = {});
  /// The layer that swap_layer() would make rays.hits.
  const ocl::Buffer<HitRecord> &further_hits() const { return further_hits_; }
  const ocl::Buffer<LayerParams> &params() const { return params_; }  ///< [1] of open()
  uint has_map() const { return light_.has_map; }

  ocl::Buffer<RayColor> colors;  ///< [R] the frame's layers so far

 private:
  Layers(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
         std::uint32_t group_size, bool levels);

  ocl::Range range_;
  std::vector<ocl::Buffer<HitRecord>> surface_hits_;  ///< [surface] by pixel, innermost first
  ocl::Buffer<HitRecord> further_hits_;
  ocl::Buffer<LayerParams> params_;
  ocl::Buffer<uint> color_map_;             ///< [ISO_MAP_COLORS]
  ocl::Buffer<uchar> passed_;               ///< [R] the slices that a ray has passed
  ocl::Buffer<uint> listed_, next_listed_;  ///< [rays of the counts] in no order
  ocl::Buffer<LayerCounts> counts_, next_counts_;
  std::vector<std::uint32_t> order_;
  ShadeParams light_{};
  FrameParams finest_{};
  LevelledKernel<kernels::layers_choose> choose_;
  ocl::Kernel<kernels::layers_forget> forget_;
  ocl::Kernel<kernels::layers_blend> blend_;
  ocl::Kernel<kernels::layers_begin> begin_;
};

}  // namespace isowave::core
