// Hits -> values of a second volume: field_values.cl. All hits of a frame, all blocks cached, as in
// a frame that is drawn again; the field is the volume itself.

#include <array>

#include "bench/rays_rig.hpp"
#include "core/frame/field_values.hpp"
#include "core/stages/field_values.hpp"

namespace isowave::core::bench {
namespace {

struct FieldInput : RaysRig {
  FieldInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width), values(device, rays.num_rays, kGroupSize, cache.slot_type) {
    rays.field_values = {device, "field values", rays.num_rays};
    const std::array levels{blocks.levels[0].info};
    values.set_map(make_field_map(levels, levels[0]));
    begin();
    run();
    check(read_counts().next_active_count == 0, "all values of the hits");
  }
  void begin() { rays.open_pass(); }
  void run() { values(rays.frame, cache, rays, true); }

  FieldValues values;
};

void field_values(benchmark::State &state) {
  auto &in = input<FieldInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (sizeof(HitRecord) + 9 * sizeof(float))}, [&] { in.begin(); },
      [&] { in.run(); });
  state.counters["hits"] = hits;
}

const bool kRegistered = [] {
  stage_benchmark("field_values", field_values)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
