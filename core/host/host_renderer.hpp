#pragma once
// Draws isosurfaces of a compressed volume on the host, without OpenCL: pictures with a device's
// bits, if there is no device, or while its kernels are being compiled.
//
// Value ranges of all blocks are made once. Rays skip macrocells of 4^3 blocks and blocks that
// cannot hold the isovalue, and cells whose corners are on one side. Rays decode the blocks that
// they come to, which stay decoded for further frames.

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/host/host_levels.hpp"

namespace isowave::core {

struct HostRendererOptions {
  /// Bound on value ranges and decoded blocks [bytes]; 0: a quarter of the host's memory. Frames
  /// have the same bits with any limit. If a frame's blocks do not fit, they are dropped and
  /// decoded anew, which is slower.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor
  ImageSize largest{};            ///< picture of a request without a size
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
  /// Throws  Error: also a file that cannot be read; there are no hits() then
  FrameStats render(const FrameRequest &request) override;
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {}) override;

  ImageSize size() const override { return size_; }
  std::vector<HitRecord> hits() override;
  /// Counts of open ambient rays of the last frame's hits.
  const OpenCounts &open() const { return open_; }
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;

  void keep_picture() override;
  void fill_from_kept() override { show_kept(false); }
  void enlarge_kept(const FrameRequest &request) override;

  /// Forgets all decoded blocks, and keeps their memory for other blocks.
  void clear_cache() override { levels_.forget(); }
  std::uint64_t num_decoded_blocks() const { return levels_.num_decoded(); }  ///< from the start
  /// Memory at present: value ranges and decoded blocks, without pictures.
  std::uint64_t memory_bytes() const override { return levels_.bytes(); }
  double setup_ms() const override { return setup_ms_; }

 private:
  void check_has_picture() const;
  void show_kept(bool everywhere);
  void draw_bands(const FrameRequest &request, std::span<const HostLevel> drawing,
                  FrameStats &stats);
  void add_ambient(const FrameRequest &request, std::span<const HostLevel> drawing,
                   FrameStats &stats);
  template <class Draw, class After>
  bool for_bands(const OnPass &on_pass, bool more_follows, Draw draw, After after);

  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();  ///< of making
  VolumeInfo info_;
  Abilities abilities_;
  std::uint32_t num_threads_;
  HostLevels levels_;
  double setup_ms_;
  FrameParams frame_{};  ///< of the finest level, for shading
  ImageSize size_;
  std::vector<HitRecord> hits_;
  OpenCounts open_;
  std::vector<HitRecord> kept_;
  ImageSize kept_size_;
  HostMemory memory_;
};

}  // namespace isowave::core
