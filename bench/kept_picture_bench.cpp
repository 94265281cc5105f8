// A smaller picture in place of a larger one: kept_picture.cl. Everywhere, and for the rays without
// a hit, which are half of them.

#include "core/stages/kept_picture.hpp"

#include <cmath>
#include <vector>

#include "bench/harness.hpp"
#include "core/view/frame.hpp"

namespace isowave::core::bench {
namespace {

struct KeptPictureInput {
  KeptPictureInput(ocl::Device &device, std::int64_t width)
      : size(image_of_width(width)),
        half(image_of_width(width / 2)),
        rays(device, {.num_rays = size.num_rays(), .with_pairs = false}),
        kept(device, half.num_rays()),
        drawn(size.num_rays(), hit_at(2)) {
    for (std::size_t i = 0; i < drawn.size(); i += 2) drawn[i] = no_hit();
    rays.hits.write(std::vector<HitRecord>(half.num_rays(), hit_at(1)));
    kept.keep(rays, half);
    rays.frame.view.width = size.width;
    rays.frame.view.height = size.height;
    for (const bool everywhere : {true, false}) {
      reset();
      kept.show(rays, everywhere);
      const std::vector<HitRecord> shown = rays.hits.read();
      for (std::size_t i = 0; i < shown.size(); ++i)
        check(shown[i].t == (everywhere || i % 2 == 0 ? 1.0f : 2.0f), "hit of the picture shown");
    }
  }
  static HitRecord hit_at(float t) {
    HitRecord hit{};
    hit.t = t;
    return hit;
  }
  void reset() { rays.hits.write(drawn); }

  ImageSize size, half;
  Wavefront rays;
  KeptPicture kept;
  std::vector<HitRecord> drawn;
};

void show_kept(benchmark::State &state) {
  auto &in = input<KeptPictureInput>(state.range(0));
  const bool everywhere = state.range(1) != 0;
  const auto pixels = static_cast<double>(in.size.num_rays()),
             kept = static_cast<double>(in.half.num_rays());
  const double hits = everywhere ? kept + pixels : kept + 1.5 * pixels;
  measure(
      state, {pixels, hits * sizeof(HitRecord)}, [&] { in.reset(); },
      [&] { in.kept.show(in.rays, everywhere); });
}

const bool kRegistered = [] {
  stage_benchmark("kept_picture", show_kept)
      ->ArgNames({"width", "everywhere"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {0, 1}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
