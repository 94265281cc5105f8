// Making the voxels of synthetic volumes: noise_field.cl.

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/base/error.hpp"
#include "core/io/raw_reader.hpp"
#include "core/sources/noise_on_device.hpp"

namespace isowave::core::bench {
namespace {

/// Four layers of a volume of this edge.
struct NoiseInput {
  NoiseInput(ocl::Device &device, std::int64_t field, std::int64_t edge)
      : dims(static_cast<std::uint32_t>(edge)),
        voxels(std::size_t{4} * dims.x * dims.y),
        noise(device, *make_noise_field(static_cast<Field>(field), dims, 1), dims,
              VoxelType::kUint8) {
    run();
    std::vector<float> expected(voxels.size()), made(voxels.size());
    open_generated({.field = static_cast<Field>(field), .dims = dims, .type = VoxelType::kUint8})
        ->read_layers(0, 4, expected);
    convert_to_float(VoxelType::kUint8, voxels, made);
    check(made == expected, "voxels");
  }
  void run() { noise.evaluate(0, 4, voxels); }

  glm::uvec3 dims;
  std::vector<std::byte> voxels;
  NoiseOnDevice noise;
};

void noise_field(benchmark::State &state) {
  auto &in = input<NoiseInput>(state.range(0), state.range(1));
  const auto voxels = static_cast<double>(in.voxels.size());
  measure(
      state, {voxels, voxels}, [] {}, [&] { in.run(); });
}

const bool kRegistered = [] {
  stage_benchmark("noise_field", noise_field)
      ->ArgNames({"field", "edge"})
      ->ArgsProduct({{static_cast<int>(Field::kMixingLayer), static_cast<int>(Field::kNoisyScan)},
                     {256, 1024}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
