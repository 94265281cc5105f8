#pragma once
// The measurement: isowave and its peers draw the same views in turns.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/gpu_peer/compare.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core::bench {

/// Voxels of a volume in host memory.
struct VoxelsInMemory {
  VolumeInfo info;
  std::vector<float> values;
};

/// What all sides draw.
struct Views {
  std::vector<Camera> cameras;
  ImageSize size;
  float isovalue = 0;
  float other_isovalue = 0;  ///< is drawn before a new isovalue is timed
  std::uint32_t rounds = 1;
};

/// Isowave with one way to compress. The device is its own, so that its peak is the renderer's.
class IsowaveSide {
 public:
  /// rate  bits per voxel; none: without loss
  IsowaveSide(const ocl::DeviceInfo &device, const VoxelsInMemory &voxels, ImageSize size,
              std::optional<std::uint32_t> rate);

  const std::string &name() const { return name_; }
  /// The peak of its device's ledger.
  GridCosts costs() const;
  DeviceRenderer &renderer() { return *renderer_; }
  ocl::Device &device() { return *device_; }

 private:
  std::string name_;
  CompressedVolume volume_;
  std::unique_ptr<ocl::Device> device_;  ///< before the renderer, which it must outlive
  std::unique_ptr<DeviceRenderer> renderer_;
  GridCosts costs_;
};

/// What was measured of a side. Kinds of times, hits where they are not called pictures:
///
///   new           hits of a new isovalue; of isowave, with nothing decoded
///   new_isovalue  the part of it in which a peer finds what rays skip
///   cold, next, warm, cold_picture, ...  isowave's frames, by the wall clock
///   kernel, hits, picture                a peer's, by CUDA's events, the others by the wall clock
struct SideResult {
  std::string name;
  bool is_isowave = false;
  GridCosts costs;
  std::map<std::string, std::vector<double>> ms;  ///< kind -> every view of every round
  HitDifference difference;                       ///< from the first side of isowave
  double picture_difference = 0;                  ///< share_of_other_bytes(), the largest of views
};

/// isowave  at least one; hits are compared with those of the first
std::vector<SideResult> draw_in_turns(std::vector<std::unique_ptr<IsowaveSide>> &isowave,
                                      std::vector<NamedSide> &peers, const VolumeInfo &info,
                                      const Views &views);

}  // namespace isowave::core::bench
