// Hit buffer -> positions in the world: hit_positions.cl.

#include "core/stages/hit_positions.hpp"

#include <array>
#include <cstring>
#include <random>
#include <vector>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/base/error.hpp"
#include "core/frame/frame_arrays.hpp"

namespace isowave::core::bench {
namespace {

struct PositionsInput {
  PositionsInput(ocl::Device &device, std::int64_t width)
      : size(image_of_width(width)),
        map(make_hit_map({&mixing_layer(128).info, 1})),
        hits(device, "hits", size.num_rays()),
        positions(device, "positions", size.num_rays() * sizeof(Position)),
        stage(device) {
    if (!HitPositions::suits(device)) throw Error("the device has no doubles");
    std::mt19937 random(1);
    std::uniform_real_distribution<float> in_cell(0, 1);
    std::vector<HitRecord> records(size.num_rays());
    for (HitRecord &hit : records) {
      hit.block_id = static_cast<uint>(random() % (32 * 32 * 32));
      hit.cell = static_cast<uint>(random() % 64);
      hit.x = in_cell(random);
      hit.y = in_cell(random);
      hit.z = in_cell(random);
    }
    hits.write(records);
    run();
    std::vector<std::byte> bytes = positions.read();
    bool is_right = true;
    for (std::size_t i = 0; i < records.size(); ++i) {
      Position expected;
      hit_position(&map, records[i], expected.data());
      is_right &= std::memcmp(&bytes[i * sizeof(Position)], expected.data(), sizeof(Position)) == 0;
    }
    check(is_right, "positions");
  }
  void run() { stage(map, 0, static_cast<uint>(hits.size()), hits, positions); }

  using Position = std::array<double, 3>;
  ImageSize size;
  HitMap map;
  ocl::Buffer<HitRecord> hits;
  ocl::Buffer<std::byte> positions;
  HitPositions stage;
};

void positions_of_hits(benchmark::State &state) {
  auto &in = input<PositionsInput>(state.range(0));
  const auto rays = static_cast<double>(in.size.num_rays());
  measure(
      state, {rays, rays * (sizeof(HitRecord) + sizeof(PositionsInput::Position))}, [] {},
      [&] { in.run(); });
}

const bool kRegistered = [] {
  stage_benchmark("hit_positions", positions_of_hits)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
