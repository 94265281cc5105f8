// N_Spec and the counts that a pass opens with: speculation.cl. One work-item; what it takes is a
// launch.

#include <algorithm>

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 128;

struct SpeculationInput : FrameRig {
  explicit SpeculationInput(ocl::Device &device)
      : FrameRig(device, mixing_layer(kEdge),
                 mixing_layer_setup(kEdge, image_of_width(kWidths[0]), 64)) {
    start();
    const uint active = read_counts().next_active_count;
    begin_pass();
    check(read_counts().spec_count == std::min<std::uint64_t>(64, rays.num_rays / active),
          "N_Spec");
  }
};

void open_pass(benchmark::State &state) {
  auto &in = input<SpeculationInput>();
  measure(
      state, {1, 2 * sizeof(PassCounts)}, [] {}, [&] { in.begin_pass(); });
}

const bool kRegistered = [] {
  stage_benchmark("speculation", open_pass);
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
