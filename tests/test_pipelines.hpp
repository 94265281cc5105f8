#pragma once
// Every way of drawing on every device, for the suites that must not tell them apart.

#include <string>
#include <vector>

#include "core/render/device_renderer.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {

struct PipelineOnDevice {
  ocl::DeviceInfo device;
  const char *name;
  PipelineKind pipeline;
  Grouping grouping;
  ClosestHit closest;
  bool per_ray_speculation;
  RayPackets packets = RayPackets::kAuto;

  RendererOptions with(RendererOptions options) const {
    options.pipeline = pipeline;
    options.grouping = grouping;
    options.closest = closest;
    options.per_ray_speculation = per_ray_speculation;
    options.packets = packets;
    return options;
  }
};

inline void PrintTo(const PipelineOnDevice &param, std::ostream *out) {
  *out << param.name << " on " << param.device.name;
}

/// On llvmpipe one of each pipeline. Rays go in packets where those suit, and one by one.
inline std::vector<PipelineOnDevice> pipelines_under_test() {
  std::vector<PipelineOnDevice> params;
  for (const ocl::DeviceInfo &device : devices_under_test()) {
    params.push_back(
        {device, "blocks", PipelineKind::kBlocks, Grouping::kRadix, ClosestHit::kScan, false});
    params.push_back(
        {device, "rays_per_ray", PipelineKind::kRays, kDefaultGrouping, kDefaultClosestHit, true});
    if (is_llvmpipe(device)) continue;
    params.push_back({device, "blocks_counting_atomic_min", PipelineKind::kBlocks,
                      Grouping::kCounting, ClosestHit::kAtomicMin, false});
    params.push_back({device, "blocks_per_ray", PipelineKind::kBlocks, Grouping::kCounting,
                      ClosestHit::kAtomicMin, true});
    params.push_back({device, "rays", PipelineKind::kRays, kDefaultGrouping, kDefaultClosestHit,
                      false, RayPackets::kOff});
  }
  return params;
}

/// "0_rusticl_blocks".
inline std::string pipeline_test_name(const testing::TestParamInfo<PipelineOnDevice> &info) {
  return device_test_name({info.param.device, info.index}) + "_" + info.param.name;
}

}  // namespace isowave::core
