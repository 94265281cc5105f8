// A program whose kernels have one planted bug (mutants.cmake). Arguments: the pipelines that have
// it, blocks, rays or packets (rays in packets). Succeeds if the watertight test finds leaks in
// each of them.

#include <fmt/format.h>

#include <string_view>

#include "core/paper/blocks_pipeline.hpp"
#include "reference/watertight_device.hpp"

int main(int argc, char **argv) {
  using namespace isowave::core;
  ocl::Device device(ocl::choose_device());
  bool all_leak = argc > 1;
  for (int i = 1; i < argc; ++i) {
    const std::string_view name = argv[i];
    const PipelinePtr pipeline = name == "blocks" ? blocks_pipeline() : rays_pipeline();
    const RayPackets packets = name == "packets" ? RayPackets::kOn : RayPackets::kOff;
    std::uint64_t leaks = 0;
    for (const WatertightResult &result : run_watertight_on(
             device, pipeline, 100000, 20231, kDefaultSolver, RayBands::kOne, packets))
      leaks += result.leaks;
    fmt::print("pipeline {}: {} leaks\n", argv[i], leaks);
    all_leak = all_leak && leaks > 0;
  }
  return all_leak ? 0 : 1;
}
