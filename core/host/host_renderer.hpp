#pragma once
// Draws isosurfaces of a compressed volume on the host, without OpenCL: pictures with the bits of a
// device's, for as long as there is none, or its kernels are being compiled.
//
// Value ranges of all blocks are made once. Rays skip what the isovalue cannot be in, macrocells of
// 4^3 blocks, blocks, and cells whose corners are on one side; and decode the blocks that they come
// to, which stay decoded for further frames.

#include <cstdint>
#include <span>
#include <vector>

#include "core/frame/appearance.hpp"
#include "core/frame/frame_request.hpp"
#include "core/host/host_blocks.hpp"
#include "core/view/given_rays.hpp"

namespace isowave::core {

struct HostRendererOptions {
  /// Bytes of value ranges and decoded blocks; 0: a quarter of the host's memory. The same bits
  /// with any; slower where a frame's blocks do not fit, which go and are decoded anew then.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor
};

/// Not thread-safe.
class HostRenderer {
 public:
  /// Reads all of the finest level, for its value ranges.
  ///
  /// volume  must outlive the renderer
  /// Throws  Error: the limit does not suffice; a file that the volume is in cannot be read
  explicit HostRenderer(const CompressedVolume &volume, const HostRendererOptions &options = {});
  explicit HostRenderer(CompressedVolume &&, const HostRendererOptions & = {}) = delete;

  /// Draws one frame: the hits that core::Renderer finds, bit for bit. on_pass is called after each
  /// band of rows, from the top, by the calling thread.
  ///
  /// request  without levels of detail, voxel_error and bound; a size
  /// Throws   Error: others; what make_frame_params() throws; a file cannot be read: then there are
  ///          no hits()
  FrameStats render(const FrameRequest &request);

  /// The first hit of each ray. t counts in lengths of its direction. Leaves the last frame as it
  /// is.
  ///
  /// Throws  Error: the isovalue is NaN; a ray is not finite, has no direction, or begins more than
  ///         1e7 voxels away from the volume's origin; a file cannot be read
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue, Normals normals);

  /// Throws  Error: a request that render() refuses
  static void check(const FrameRequest &request);

  /// The view that core::Renderer::camera() takes of this isovalue, for a picture of that size.
  ///
  /// Throws  Error: NaN
  Camera camera(float isovalue, ImageSize size) const;

  /// The hits of the last frame [size.ray_rows()][size.ray_columns()], row 0 at the top; of rows
  /// that were not drawn, none.
  const std::vector<HitRecord> &hits() const { return hits_; }
  /// How open they are.
  const OpenCounts &open() const { return open_; }
  /// The picture of hits(), RGB.
  Image8 shade(const Appearance &appearance = {}) const;

  /// Forgets decoded blocks. Their memory is kept for others.
  void clear_cache() { blocks_.forget(); }
  std::uint64_t num_decoded_blocks() const { return blocks_.num_decoded(); }  ///< from the start
  /// At present: value ranges and decoded blocks. Pictures come on top.
  std::uint64_t memory_bytes() const { return blocks_.bytes(); }

 private:
  void draw_bands(const FrameRequest &request, FrameStats &stats);
  void add_ambient(const FrameRequest &request, FrameStats &stats);
  template <class Draw, class After>
  bool for_bands(const OnPass &on_pass, bool more_follows, Draw draw, After after);

  VolumeInfo info_;
  std::uint32_t num_threads_;
  HostBlocks blocks_;
  FrameParams frame_{};
  std::uint32_t samples_ = 1;
  Normals normals_ = Normals::kSmooth;
  std::vector<HitRecord> hits_;
  OpenCounts open_;
};

}  // namespace isowave::core
