// Hit buffer -> picture on the host: shade.cl and the read-back; the wall time holds the host's
// part as well.

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"
#include "core/stages/shade.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 128;

struct ShadeInput : FrameRig {
  ShadeInput(ocl::Device &device, std::int64_t width)
      : FrameRig(device, mixing_layer(kEdge), mixing_layer_setup(kEdge, image_of_width(width), 64)),
        appearance(make_shade_params(mixing_layer(kEdge).info, {})),
        shade(device, rays.num_rays) {
    start();
    while (run_pass().next_active_count != 0) {
    }
    check(std::ranges::equal(run().picture,
                             shade_scalar(params, appearance, rays.hits.read()).pixels),
          "shaded pixels");
  }
  FrameArrays run() { return shade({.picture = true}, appearance, {}, rays, 1); }

  ShadeParams appearance;
  Shade shade;
};

void shade_hits(benchmark::State &state) {
  auto &in = input<ShadeInput>(state.range(0));
  const auto pixels = static_cast<double>(in.rays.num_rays);
  measure(
      state, {pixels, pixels * (4 * sizeof(float) + 2 * 3)}, [] {},
      [&] { benchmark::DoNotOptimize(in.run()); });
}

const bool kRegistered = [] {
  stage_benchmark("shade", shade_hits)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
