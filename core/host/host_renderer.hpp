#pragma once
// Draws isosurfaces of a compressed volume on the host, without OpenCL: pictures with the bits of a
// device's, for as long as there is none, or its kernels are being compiled.
//
// Value ranges of all blocks are made once. Rays skip what the isovalue cannot be in, macrocells of
// 4^3 blocks, blocks, and cells whose corners are on one side; and decode the blocks that they come
// to, which stay decoded for further frames.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/host/host_blocks.hpp"

namespace isowave::core {

struct HostRendererOptions {
  /// Bytes of value ranges and decoded blocks; 0: a quarter of the host's memory. The same bits
  /// with any; slower where a frame's blocks do not fit, which go and are decoded anew then.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor
};

class HostRenderer : public Renderer {
 public:
  /// Reads all of the finest level, for its value ranges.
  ///
  /// volume  must outlive the renderer
  /// Throws  Error: the limit does not suffice; a file that the volume is in cannot be read
  explicit HostRenderer(const CompressedVolume &volume, const HostRendererOptions &options = {});
  explicit HostRenderer(CompressedVolume &&, const HostRendererOptions & = {}) = delete;

  static Abilities all_abilities();
  Abilities abilities() const override { return all_abilities(); }
  std::vector<VolumeInfo> levels() const override { return {info_}; }

  /// Draws one frame. on_pass is called after each band of rows, from the top, by the calling
  /// thread; rows that were not drawn have no hits.
  ///
  /// Throws  Error: a file cannot be read, too: then there are no hits()
  FrameStats render(const FrameRequest &request) override;
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {}) override;

  ImageSize size() const override { return size_; }
  std::vector<HitRecord> hits() override;
  std::vector<float> depth() override;
  /// How open the hits of the last frame are.
  const OpenCounts &open() const { return open_; }
  Image8 shade(const Appearance &appearance = {}) override;

  /// The memory of decoded blocks is kept for others.
  void clear_cache() override { blocks_.forget(); }
  std::uint64_t num_decoded_blocks() const { return blocks_.num_decoded(); }  ///< from the start
  /// At present: value ranges and decoded blocks. Pictures come on top.
  std::uint64_t memory_bytes() const override { return blocks_.bytes(); }

 private:
  void check_has_picture() const;
  void draw_bands(const FrameRequest &request, FrameStats &stats);
  void add_ambient(const FrameRequest &request, FrameStats &stats);
  template <class Draw, class After>
  bool for_bands(const OnPass &on_pass, bool more_follows, Draw draw, After after);

  VolumeInfo info_;
  std::uint32_t num_threads_;
  HostBlocks blocks_;
  FrameParams frame_{};
  ImageSize size_;
  Normals normals_ = Normals::kSmooth;
  std::vector<HitRecord> hits_;
  OpenCounts open_;
};

}  // namespace isowave::core
