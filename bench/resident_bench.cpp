// The floor of frames: the whole volume decoded, a frame in one launch: resident.cl.

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"
#include "core/paper/resident.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 256;

struct ResidentInput {
  ResidentInput(ocl::Device &device, std::int64_t width)
      : setup(mixing_layer_setup(kEdge, image_of_width(width), 1)),
        resident(device, mixing_layer(kEdge), setup.size) {
    resident.render(setup.camera, setup.isovalue);
    const std::vector<HitRecord> hits = resident.hits(),
                                 expected = render_scalar(
                                     make_frame_params(mixing_layer(kEdge).info, setup.camera,
                                                       setup.size, setup.isovalue),
                                     decode_with_libzfp(mixing_layer(kEdge)));
    check(same_bits(std::span(hits), std::span(expected)), "picture");
  }

  FrameSetup setup;
  Resident resident;
};

void draw_frame(benchmark::State &state) {
  auto &in = input<ResidentInput>(state.range(0));
  const auto pixels = static_cast<double>(in.setup.size.num_pixels());
  measure(
      state, {pixels, pixels * sizeof(HitRecord)}, [] {},
      [&] { in.resident.render(in.setup.camera, in.setup.isovalue); });
}

const bool kRegistered = [] {
  stage_benchmark("resident", draw_frame)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
