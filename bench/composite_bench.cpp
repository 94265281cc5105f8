// The closest of each ray's results -> hits, and the next wavefront: composite.cl with its compaction.

#include <cmath>
#include <cstring>

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::bench {
namespace {

constexpr std::int64_t kEdge = 128;

struct CompositeInput : FrameRig {
  CompositeInput(ocl::Device &device, std::int64_t width, std::int64_t spec_count)
      : FrameRig(device, mixing_layer(kEdge),
                 mixing_layer_setup(kEdge, image_of_width(width), static_cast<std::uint32_t>(spec_count))) {
    start();
    thin_wavefront(params.max_spec_count);
    begin_pass();
    find_blocks();
    intersect(cache, group.groups(), rays);
    before.emplace(rays);
    run();
    verify();
  }
  void run() { composite(cache, rays, compaction); }

  /// What is hit so far has the twin's bits.
  void verify() {
    counts = read_counts();
    const std::vector<HitRecord> expected = render_scalar(params, decode_with_libzfp(mixing_layer(kEdge)));
    const std::vector<HitRecord> got = rays.hits.read();
    uint num_hits = 0;
    for (std::size_t pixel = 0; pixel < got.size(); ++pixel) {
      if (!std::isfinite(got[pixel].t)) continue;
      ++num_hits;
      check(std::memcmp(&got[pixel], &expected[pixel], sizeof(HitRecord)) == 0, "hit of a pixel");
    }
    check(num_hits == counts.hit_count && num_hits > 0, "number of hits");
  }

  std::optional<WavefrontSnapshot> before;
  PassCounts counts{};
};

void composite_pairs(benchmark::State &state) {
  auto &in = input<CompositeInput>(state.range(0), state.range(1));
  const double bytes = in.counts.pair_slot_count * (4.0 + sizeof(PairHit)) + 12.0 * in.counts.active_count +
                       in.counts.hit_count * (sizeof(HitRecord) + 32.0);
  measure(
      state, {double(in.counts.active_count), bytes}, [&] { in.before->restore(); }, [&] { in.run(); });
  state.counters["hits"] = in.counts.hit_count;
}

const bool registered = [] {
  stage_benchmark("composite", composite_pairs)
      ->ArgNames({"width", "n_spec"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {1, 8, 64}});
  return true;
}();

}  // namespace
}  // namespace isowave::bench
