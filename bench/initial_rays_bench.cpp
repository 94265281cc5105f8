// Camera -> rays and the first wavefront: initial_rays.cl.

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 128;

struct InitialRaysInput : FrameRig {
  InitialRaysInput(ocl::Device &device, std::int64_t width)
      : FrameRig(device, mixing_layer(kEdge),
                 mixing_layer_setup(kEdge, image_of_width(width), 64)) {
    start();
    std::vector<uint> expected;  // the rays that have a first block
    const std::vector<uint> first_blocks = rays.ray_block_ids.read();
    for (uint pixel = 0; pixel < first_blocks.size(); ++pixel) {
      if (first_blocks[pixel] != ISO_INVALID_ID) expected.push_back(pixel);
    }
    num_active = read_counts().next_active_count;
    std::vector<uint> active(num_active);
    rays.next_active_ray_ids.read(active);
    check(active == expected, "first wavefront");
    // Seen from 0.8 diagonals, 20 degrees up, the cube covers about a third of a 16:9 picture.
    check(num_active > first_blocks.size() / 4 && num_active < first_blocks.size() / 2,
          "rays that meet the volume");
  }

  uint num_active = 0;
};

void make_rays(benchmark::State &state) {
  auto &in = input<InitialRaysInput>(state.range(0));
  const auto pixels = static_cast<double>(in.rays.num_rays);
  const double bytes = pixels * (sizeof(HitRecord) + sizeof(uint)) + in.num_active * sizeof(uint);
  measure(
      state, {pixels, bytes}, [] {}, [&] { in.start(); });
  state.counters["active_rays"] = in.num_active;
}

const bool kRegistered = [] {
  stage_benchmark("initial_rays", make_rays)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
