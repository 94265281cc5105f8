// The closest of each ray's results -> hits, and the next wavefront: composite.cl with its
// compaction.

#include <cmath>

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 128;

struct CompositeInput : FrameRig {
  CompositeInput(ocl::Device &device, std::int64_t width, std::int64_t spec_count, ClosestHit how)
      : FrameRig(device, mixing_layer(kEdge),
                 mixing_layer_setup(kEdge, image_of_width(width),
                                    static_cast<std::uint32_t>(spec_count))),
        closest(how),
        composite(device, rays.num_rays, how) {
    start();
    thin_wavefront(params.schedule.max_spec_count);
    begin_pass();
    find_blocks();
    intersect(cache, group.groups(), rays);
    before.emplace(rays);
    bytes_of_pairs = closest == ClosestHit::kScan
                         ? double(count_pairs_looked_at()) * (4.0 + sizeof(PairHit))
                         : 4.0 * read_counts().active_count;
    run();
    verify();
  }
  void run() { composite(cache, rays, compaction); }

  /// A ray's pairs up to the one that decides: its first hit, or where it has no more blocks.
  std::size_t count_pairs_looked_at() const {
    const PassCounts pass = read_counts();
    std::vector<uint> block_ids(pass.pair_slot_count);
    std::vector<PairHit> results(pass.pair_slot_count);
    rays.pair_block_ids.read(block_ids);
    rays.pair_hits.read(results);
    std::size_t count = 0;
    for (std::size_t ray = 0; ray < pass.window_count; ++ray) {
      std::size_t pair = ray * pass.spec_count;
      const std::size_t end = pair + pass.spec_count;
      while (pair < end && block_ids[pair] != ISO_INVALID_ID && results[pair].cell == ISO_NO_HIT)
        ++pair;
      count += std::min(pair + 1, end) - ray * pass.spec_count;
    }
    return count;
  }

  /// The hits so far have the twin's bits.
  void verify() {
    counts = read_counts();
    const std::vector<HitRecord> expected =
        render_scalar(params, decode_with_libzfp(mixing_layer(kEdge)));
    const std::vector<HitRecord> got = rays.hits.read();
    uint num_hits = 0;
    for (std::size_t pixel = 0; pixel < got.size(); ++pixel) {
      if (!std::isfinite(got[pixel].t)) continue;
      ++num_hits;
      check(same_bits<HitRecord>({&got[pixel], 1}, {&expected[pixel], 1}), "hit of a pixel");
    }
    check(num_hits == counts.hit_count && num_hits > 0, "number of hits");
  }

  std::optional<WavefrontSnapshot> before;
  PassCounts counts{};
  ClosestHit closest;
  Composite composite;  ///< in place of the rig's
  double bytes_of_pairs = 0;
};

void composite_pairs(benchmark::State &state, ClosestHit closest) {
  auto &in = input<CompositeInput>(state.range(0), state.range(1), closest);
  const double bytes = in.bytes_of_pairs + 12.0 * in.counts.active_count +
                       in.counts.hit_count * (sizeof(HitRecord) + 32.0);
  measure(
      state, {double(in.counts.active_count), bytes}, [&] { in.before->restore(); },
      [&] { in.run(); });
  state.counters["hits"] = in.counts.hit_count;
}

const bool kRegistered = [] {
  for (const ClosestHit closest : {ClosestHit::kScan, ClosestHit::kAtomicMin}) {
    stage_benchmark(fmt::format("composite/{}", to_string(closest)),
                    [=](benchmark::State &state) { composite_pairs(state, closest); })
        ->ArgNames({"width", "n_spec"})
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {1, 8, 64}});
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
