#pragma once
// Every way of drawing on every device, for the suites that must not tell them apart.

#include <string>
#include <vector>

#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {

struct PipelineOnDevice {
  ocl::DeviceInfo device;
  const char *name;
  PipelinePtr pipeline;
  bool per_ray_speculation;
  RayPackets packets = RayPackets::kAuto;

  bool is_blocks() const { return blocks_options(*pipeline) != nullptr; }
  RendererOptions with(RendererOptions options) const {
    options.pipeline = pipeline;
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
    params.push_back({device, "blocks",
                      blocks_pipeline({.grouping = Grouping::kRadix, .closest = ClosestHit::kScan}),
                      false});
    params.push_back({device, "rays_per_ray", rays_pipeline(), true});
    if (is_llvmpipe(device)) continue;
    const PipelinePtr counting =
        blocks_pipeline({.grouping = Grouping::kCounting, .closest = ClosestHit::kAtomicMin});
    params.push_back({device, "blocks_counting_atomic_min", counting, false});
    params.push_back({device, "blocks_per_ray", counting, true});
    params.push_back({device, "rays", rays_pipeline(), false, RayPackets::kOff});
  }
  return params;
}

/// "0_rusticl_blocks".
inline std::string pipeline_test_name(const testing::TestParamInfo<PipelineOnDevice> &info) {
  return device_test_name({info.param.device, info.index}) + "_" + info.param.name;
}

}  // namespace isowave::core
