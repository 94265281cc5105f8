// Rays that wait -> list of blocks to decode: request_ahead.cl. The first pass of a frame, where
// every ray waits and nothing is cached.

#include "bench/rays_rig.hpp"

namespace isowave::core::bench {
namespace {

struct RequestAheadInput : RaysRig {
  RequestAheadInput(ocl::Device &device, std::int64_t width) : RaysRig(device, width) {
    start_waiting();
    request_ahead(macrocells, cache, rays);
    check(read_counts().requested_count == num_requests, "requests of the frame begun again");
  }
};

void request_all(benchmark::State &state) {
  auto &in = input<RequestAheadInput>(state.range(0));
  measure(
      state,
      {double(in.num_started),
       2.0 * sizeof(uint) * in.num_started + sizeof(uint) * in.num_requests},
      [&] { in.start_waiting(); }, [&] { in.request_ahead(in.macrocells, in.cache, in.rays); });
  state.counters["requests"] = in.num_requests;
}

const bool kRegistered = [] {
  stage_benchmark("request_ahead", request_all)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
