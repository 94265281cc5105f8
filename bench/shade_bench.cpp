// Hit buffer -> picture, depth and normals on the host: shade.cl and the copy; the wall time holds
// the host's part as well.

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
  FrameArrays run(const WantedArrays &wanted = {.picture = true}) {
    return shade(wanted, appearance, {}, rays, nullptr, 1);
  }

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

/// bytes: of one ray's values.
void fetch(benchmark::State &state, const WantedArrays &wanted, double read_bytes, double bytes) {
  auto &in = input<ShadeInput>(state.range(0));
  const auto rays = static_cast<double>(in.rays.num_rays);
  measure(
      state, {rays, rays * (read_bytes + 2 * bytes)}, [] {},
      [&] { benchmark::DoNotOptimize(in.run(wanted)); });
}

void depth_of_hits(benchmark::State &state) {
  fetch(state, {.depth = true}, sizeof(float), sizeof(float));
}
void normals_of_hits(benchmark::State &state) {
  fetch(state, {.normals = true}, 4 * sizeof(float), 3 * sizeof(float));
}

const bool kRegistered = [] {
  stage_benchmark("shade", shade_hits)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  stage_benchmark("shade/depth", depth_of_hits)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  stage_benchmark("shade/normals", normals_of_hits)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
