#pragma once
// Measurements of `isowave bench paper` for one volume: frames of the ray pipelines and of
// Block-Compressed Marching Cubes, at the same isovalues, from the same cameras, on the same
// device.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/render/device_renderer.hpp"
#include "core/view/camera.hpp"

namespace isowave::core::tools {

/// The protocol of one volume: each isovalue is drawn from each camera, in this order.
struct PaperRun {
  const CompressedVolume &volume;
  std::vector<float> isovalues;
  std::vector<Camera> cameras;
  ImageSize size;
};

/// Parts of the protocol for what takes longer than a frame is worth.
struct PaperParts {
  std::uint32_t cold = 10;      ///< isovalues whose first view is drawn from an empty cache, too
  std::uint32_t progress = 10;  ///< isovalues whose first view is timed pass by pass
};

/// How far rays look ahead.
enum class LookAhead {
  kDefault,  ///< `blocks`: global, the paper's; `rays`: each ray by its own
  kOff,
  kScanned  ///< `blocks`: what rays leave goes to others
};

/// One way to draw with rays.
struct RayMethod {
  PipelinePtr pipeline = rays_pipeline();
  LookAhead look_ahead = LookAhead::kDefault;
  std::uint32_t cache_slots = 0;  ///< 0: the renderer's default
};

/// Measurements of frames, as JSON (bench_paper.cpp describes it).
///
/// Throws  Error
nlohmann::ordered_json measure_rays(const ocl::DeviceInfo &device, const PaperRun &run,
                                    const RayMethod &method, const PaperParts &parts);

/// Passes and decoded blocks of cold frames, by the most blocks that rays look ahead at: the cost
/// of looking ahead.
///
/// Throws  Error
nlohmann::ordered_json measure_limits(const ocl::DeviceInfo &device, const PaperRun &run,
                                      const RayMethod &method,
                                      const std::vector<std::uint32_t> &limits);

/// The same of triangles. memory_budget: 0: cache and mesh grow.
///
/// Returns  {"refused": MESSAGE} beside what was asked for where the device's memory, or the
///          budget, does not suffice
nlohmann::ordered_json measure_bcmc(const ocl::DeviceInfo &device, const PaperRun &run,
                                    std::uint64_t memory_budget, const PaperParts &parts);

/// Pixels for which the default rays and the triangles agree, of the run's first isovalue and view:
/// both have no hit, or hits within the diagonal of a voxel. {"percent": P, "hits_percent": H};
/// null if the mesh is too large for the device.
///
/// pictures  names of files for both pictures: NAME_rays.png, NAME_bcmc.png; empty: none
nlohmann::ordered_json compare_methods(const ocl::DeviceInfo &device, const PaperRun &run,
                                       const std::string &pictures);

}  // namespace isowave::core::tools
