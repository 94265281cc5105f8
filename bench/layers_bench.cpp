// Layers of translucent surfaces: layers.cl. Each of two surfaces has hits on half of the
// rays. All rays go on.

#include "core/stages/layers.hpp"

#include <utility>
#include <vector>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/stages/shade.hpp"

namespace isowave::core::bench {
namespace {

struct LayersInput {
  LayersInput(ocl::Device &device, std::int64_t width)
      : size(image_of_width(width)),
        rays(device, {.num_rays = size.num_rays(), .with_pairs = false}),
        layers(device, {.num_rays = size.num_rays(), .max_surfaces = 2}, kGroupSize),
        shade(device, size.num_rays()) {
    const CompressedVolume &volume = mixing_layer(128);
    const Camera camera = orbit_cameras(volume.info, 1)[0];
    rays.frame = make_frame_params(volume.info, camera, size, 128);
    light = make_shade_params(volume.info, {});
    const std::vector<SurfaceStyle> surfaces{{.isovalue = 1, .opacity = 0.3f},
                                             {.isovalue = 2, .opacity = 0.3f}};
    layers.open(surfaces, make_layer_params(surfaces, {}, volume.info, rays.frame.view, camera),
                light, rays.frame);
    for (std::size_t place = 0; place < 2; ++place) {
      std::vector<HitRecord> hits(size.num_rays(), no_hit());
      for (std::size_t i = place; i < hits.size(); i += 2) {
        hits[i] = {};
        hits[i].t = 1;
        hits[i].grad_z = 1;
      }
      layers.swap_hits(rays, place);
      rays.hits.write(hits);
      layers.swap_hits(rays, place);
    }
    layers.clear(rays);
    choose();
    const LayerCounts counts = blend();
    check(counts.hits == size.num_rays() && counts.going_on[0] + counts.going_on[1] == counts.hits,
          "hits of the layer");
    layers.clear(rays);
    layers.next_layer();
    begin();
    check(rays.counts.read().front().next_active_count == size.num_rays() / 2, "rays that go on");
    check(shade_rays().picture.size() == 3 * size.num_pixels(), "pixels");
  }
  void choose() { layers.choose(rays, 2, true); }
  LayerCounts blend() { return layers.blend(rays, true); }
  void reset() { rays.reset_counts(); }
  void begin() { layers.begin(rays, rays.hits, 0); }
  FrameArrays shade_rays() { return shade({.picture = true}, light, {}, rays, &layers.colors, 1); }
  double num_rays() const { return static_cast<double>(size.num_rays()); }

  ImageSize size;
  Wavefront rays;
  Layers layers;
  Shade shade;
  ShadeParams light{};
};

void choose_layer(benchmark::State &state) {
  auto &in = input<LayersInput>(state.range(0));
  // Each hit is taken once, and its distance read once more.
  const double bytes = 2 * sizeof(HitRecord) + 3 * sizeof(float);
  measure(
      state, {in.num_rays(), in.num_rays() * bytes}, [] {}, [&] { in.choose(); });
}

void forget_layer(benchmark::State &state) {
  auto &in = input<LayersInput>(state.range(0));
  measure(
      state, {in.num_rays(), in.num_rays() * sizeof(HitRecord)}, [] {},
      [&] { in.layers.forget(in.rays, in.rays.hits); });
}

void blend_layer(benchmark::State &state) {
  auto &in = input<LayersInput>(state.range(0));
  measure(
      state, {in.num_rays(), in.num_rays() * (sizeof(HitRecord) + 2 * sizeof(RayColor))},
      [&] { in.layers.clear(in.rays); }, [&] { in.blend(); });
}

void list_rays(benchmark::State &state) {
  auto &in = input<LayersInput>(state.range(0));
  measure(
      state, {in.num_rays(), in.num_rays() * (2 * sizeof(float) + 3 * sizeof(uint))},
      [&] { in.reset(); }, [&] { in.begin(); });
}

void shade_layers(benchmark::State &state) {
  auto &in = input<LayersInput>(state.range(0));
  measure(
      state, {in.num_rays(), in.num_rays() * (sizeof(RayColor) + 2 * 3)}, [] {},
      [&] { benchmark::DoNotOptimize(in.shade_rays()); });
}

using Case = std::pair<const char *, void (*)(benchmark::State &)>;

const bool kRegistered = [] {
  for (const auto &[name, function] :
       {Case{"layers/choose", choose_layer}, Case{"layers/blend", blend_layer},
        Case{"layers/begin", list_rays}, Case{"layers/shade", shade_layers},
        Case{"layers/forget", forget_layer}})
    stage_benchmark(name, function)
        ->ArgName("width")
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
