#pragma once
// Draws isosurfaces as triangles: Block-Compressed Marching Cubes (Usher and Pascucci, LDAV 2020),
// the rival that the ray pipelines are measured against, on the same stages, cache and hit buffer.
//
//   new isovalue  active blocks -> [ request -> cache -> decode ]* -> count -> prefix sum -> write
//   each frame    mesh -> rasterise -> hits -> picture
//
// Without a budget, cache and mesh grow to what the surface needs, as published. Within a budget
// that is too small for that, each frame goes through the surface in batches and keeps no mesh:
//
//   each frame    active blocks -> [ request -> cache -> decode -> count -> prefix sum
//                                    -> [ write -> rasterise ]* ]* -> hits -> picture

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/extract/surface_blocks.hpp"
#include "core/frame/renderer.hpp"
#include "core/paper/block_triangles.hpp"
#include "core/paper/rasterise.hpp"
#include "core/stages/prefix_sum.hpp"
#include "core/stages/shade.hpp"

namespace isowave::core {

struct MeshRendererOptions {
  ImageSize size{};                         ///< the largest picture
  std::uint64_t memory_budget = 0;          ///< bound on all device memory [bytes]; 0: it may grow
  StreamPlace stream = StreamPlace::kAuto;  ///< place of the compressed volume
};

/// Statistics of a frame of triangles, beside FrameStats.
struct MeshFrameStats {
  bool is_new_surface = false;      ///< the blocks of the isovalue were found in this frame
  bool is_kept = false;             ///< the mesh stays on the device, for the next frame
  std::uint64_t listed_blocks = 0;  ///< blocks whose cells the surface may pass
  std::uint64_t needed_blocks = 0;  ///< these and the neighbours that they need
  std::uint64_t cached_blocks = 0;  ///< blocks in the cache, also of other isovalues
  std::uint64_t decoded_blocks = 0;
  std::uint32_t cache_slots = 0;
  std::uint64_t num_triangles = 0;
  std::uint32_t num_parts = 0;     ///< parts that the mesh was drawn in
  std::uint64_t device_bytes = 0;  ///< bytes of all buffers
  double surface_ms = 0;           ///< time of making the mesh; 0 if it is not kept, or was there
  double draw_ms = 0;              ///< the rest of FrameStats::total_ms
};

/// Draws triangles. Hits have the same bits on every device and with every budget. They differ from
/// hits of the ray pipelines as triangles do from the trilinear surface. Gradients are the
/// triangles' normals, with any FrameRequest::normals; only their directions count.
class MeshRenderer : public Renderer {
 public:
  /// Uploads the volume and builds its macrocell ranges.
  ///
  /// device, volume  must outlive the renderer
  /// Throws  Error: options out of range, not enough device memory or budget
  /// Waits   yes
  MeshRenderer(ocl::Device &device, const CompressedVolume &volume,
               const MeshRendererOptions &options);

  Abilities abilities() const override;
  std::vector<VolumeInfo> levels() const override { return {volume_.info}; }

  /// Draws a frame in one pass, and then calls on_pass.
  ///
  /// Returns  statistics with rays_hit 0: see num_hits()
  /// Throws   Error: also a budget that is too small, or a surface that is too large for the device
  FrameStats render(const FrameRequest &request) override;
  /// Throws  Error: triangles are drawn only from a camera
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override;

  /// Statistics of the last frame; zeros if there was none.
  const MeshFrameStats &last_frame() const { return last_; }
  ImageSize size() const override { return size_; }
  std::vector<HitRecord> hits() override;
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;
  /// Counts the hits of the last frame, which render() does not do.
  std::uint64_t num_hits(const FrameStats &stats) override;

  /// Forgets the mesh, too. The memory stays.
  void clear_cache() override;
  std::uint64_t memory_bytes() const override { return bytes_in_use(); }

 private:
  /// The surface at hand, on the device.
  struct Lists {
    Lists(ocl::Device &device, std::uint64_t num_listed);
    static ocl::BufferSizes sizes(std::uint64_t num_listed);

    ocl::Buffer<uint> block_ids;  ///< [listed]
    ocl::Buffer<uint> offsets;    ///< [listed + 1] counts of triangles; then prefix sums
    PrefixSum sum;
  };

  void draw(const FrameParams &frame);
  void drop_all();
  void find_surface(float isovalue);
  void make_lists();
  void plan_within_budget();
  void bring_all();
  std::uint64_t count_all();
  void make_mesh(std::uint64_t num_triangles);
  void draw_batches();
  std::uint64_t list_bytes() const { return Lists::sizes(num_listed_).bytes(); }
  std::uint64_t mesh_bytes() const;
  std::uint64_t bytes_in_use() const;

  ocl::Device &device_;
  MeshRendererOptions options_;
  const CompressedVolume &volume_;
  SurfaceBlocks blocks_;
  BlockTriangles block_triangles_;
  Rasterise rasterise_;
  Shade shade_;
  std::optional<Lists> lists_;
  std::optional<ocl::Buffer<BlockVertex>> mesh_;  ///< of the surface, or of a part of it
  FrameParams frame_{};                           ///< of the picture
  ImageSize size_;
  std::optional<float> isovalue_;  ///< of the surface at hand; none: there is none
  std::uint32_t num_listed_ = 0;
  std::uint64_t num_needed_ = 0, num_triangles_ = 0;
  bool is_kept_ = false;  ///< mesh_ has all triangles
  std::uint32_t num_parts_ = 0;
  bool has_picture_ = false;
  MeshFrameStats last_;
};

}  // namespace isowave::core
