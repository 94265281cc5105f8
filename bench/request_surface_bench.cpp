// Requests of all blocks that a surface needs: request_surface.cl, all of them cached.

#include "bench/surface_rig.hpp"

namespace isowave::core::bench {
namespace {

void request_surface(benchmark::State &state, Gradients gradients) {
  auto &in = input<SurfaceRig>(state.range(0), gradients);
  const double asked = double(blocks_of_block(gradients)) * in.num_listed;
  measure(
      state, {double(in.num_listed), 20 * asked}, [&] { in.begin_pass(); }, [&] { in.ask(); });
  check(in.rays.counts.read()[0].requested_count == 0, "nothing is missing");
  state.counters["needed"] = in.num_needed;
}

const bool kRegistered = [] {
  for (const auto &[gradients, name] :
       {std::pair(Gradients::kNone, "positions"), {Gradients::kSmooth, "gradients"}}) {
    stage_benchmark(
        fmt::format("request_surface/{}", name),
        [gradients = gradients](benchmark::State &state) { request_surface(state, gradients); })
        ->ArgName("edge")
        ->ArgsProduct({{kSurfaceEdges.begin(), kSurfaceEdges.end()}});
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
