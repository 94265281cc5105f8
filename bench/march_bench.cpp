// Pipeline rays: start_rays, march and request_ahead of march.cl, each by itself: the first launch
// of each in a frame, where march finds all blocks cached, and request_ahead none.

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"
#include "core/stages/march.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 256;
constexpr std::uint32_t kSpeculation = 64;

struct MarchInput : FrameRig {
  MarchInput(ocl::Device &device, std::int64_t width)
      : FrameRig(device, mixing_layer(kEdge),
                 mixing_layer_setup(kEdge, image_of_width(width), kSpeculation)),
        march(device, rays.num_rays, kGroupSize, kDefaultSolver) {
    start_frame();
    num_started = read_counts().next_active_count;
    rays.open_pass();
    march(macrocells, cache, rays);
    check(read_counts().hit_count == 0 && read_counts().next_active_count == num_started,
          "waiting rays");
    march.request_ahead(macrocells, cache, rays);
    num_requests = read_counts().requested_count;
    check(num_requests > 0, "requests");
    std::uint64_t num_hits = 0;
    while (read_counts().next_active_count != 0) {
      rays.open_pass();
      cache.evict(rays.previous_counts, rays);
      cache.assign(rays.previous_counts, rays);
      zfp_decode({stream, rays.frame}, {stream, rays.frame}, rays.counts, cache);
      march(macrocells, cache, rays);
      march.request_ahead(macrocells, cache, rays);
      num_hits += read_counts().hit_count;
    }
    start_first_pass();
    march(macrocells, cache, rays);
    check(num_hits > 0 && read_counts().hit_count == num_hits, "hits of the frame drawn again");
  }

  void start_frame() {
    rays.forget_rays();
    march.start_rays(macrocells, rays);
  }
  void start_first_pass() {
    start_frame();
    rays.open_pass();
  }
  /// Nothing cached, nothing asked for, every ray waits.
  void start_waiting() {
    cache.clear();
    cache.requested_bits.fill(0);
    start_first_pass();
    march(macrocells, cache, rays);
  }

  March march;
  uint num_started = 0, num_requests = 0;
};

void start_rays(benchmark::State &state) {
  auto &in = input<MarchInput>(state.range(0));
  const auto pixels = static_cast<double>(in.rays.num_rays);
  measure(
      state, {pixels, pixels * sizeof(HitRecord) + 2.0 * sizeof(uint) * in.num_started},
      [&] { in.rays.forget_rays(); }, [&] { in.march.start_rays(in.macrocells, in.rays); });
  state.counters["active_rays"] = in.num_started;
}

void march_cached(benchmark::State &state) {
  auto &in = input<MarchInput>(state.range(0));
  measure(
      state, {double(in.num_started), (sizeof(HitRecord) + 2.0 * sizeof(uint)) * in.num_started},
      [&] { in.start_first_pass(); }, [&] { in.march(in.macrocells, in.cache, in.rays); });
}

void request_all(benchmark::State &state) {
  auto &in = input<MarchInput>(state.range(0));
  measure(
      state,
      {double(in.num_started),
       2.0 * sizeof(uint) * in.num_started + sizeof(uint) * in.num_requests},
      [&] { in.start_waiting(); },
      [&] { in.march.request_ahead(in.macrocells, in.cache, in.rays); });
  state.counters["requests"] = in.num_requests;
}

const bool kRegistered = [] {
  const auto over_widths = [](const char *name, void (*body)(benchmark::State &)) {
    stage_benchmark(name, body)->ArgName("width")->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  };
  // One that leaves the cache empty comes last: the next would draw nothing.
  over_widths("march/start_rays", start_rays);
  over_widths("march/cached", march_cached);
  over_widths("march/request", request_all);
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
