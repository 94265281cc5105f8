// Block ranges and coarse macrocells of a volume, once per volume; the bits of an isovalue:
// macrocells.cl.

#include <algorithm>
#include <cmath>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/zfp_decode.hpp"
#include "core/view/frame.hpp"

namespace isowave::core::bench {
namespace {

FrameParams volume_params(const CompressedVolume &volume, float isovalue) {
  return make_frame_params(volume.info, orbit_cameras(volume.info, 1).front(), {}, isovalue);
}

struct MacrocellsInput {
  MacrocellsInput(ocl::Device &device, std::int64_t edge, std::int64_t rate)
      : volume(mixing_layer(edge, rate)),
        params(volume_params(volume, kMixingLayerIsovalue)),
        stream(device, volume),
        macrocells(device, params, stream) {
    macrocells.select(params);
    params.surface = macrocells.surface(params);
    verify();
  }

  /// Ranges hold all values that libzfp decodes in a block's dual cells; the bits say what the
  /// ranges say.
  void verify() {
    const std::vector<float> voxels = decode_with_libzfp(volume);
    const std::vector<ushort> ranges = macrocells.ranges().read();
    const std::vector<uint> masks = macrocells.masks().read();
    const std::vector<float> &thresholds = macrocells.thresholds();
    const std::size_t n = volume.info.dims.x, blocks = n / 4, coarse = (blocks + 3) / 4;
    for (std::size_t id = 0; id < ranges.size(); ++id) {
      const std::size_t bx = id % blocks, by = id / blocks % blocks, bz = id / blocks / blocks;
      float low = voxels[4 * bx + n * (4 * by + n * 4 * bz)], high = low;
      for (std::size_t z = 4 * bz; z <= std::min(4 * bz + 4, n - 1); ++z) {
        for (std::size_t y = 4 * by; y <= std::min(4 * by + 4, n - 1); ++y) {
          const float *row = &voxels[n * (y + n * z)];
          const auto [least, most] =
              std::minmax_element(row + 4 * bx, row + std::min(4 * bx + 4, n - 1) + 1);
          low = std::min(low, *least);
          high = std::max(high, *most);
        }
      }
      const uint range_low = ranges[id] & 255u, range_high = ranges[id] >> 8u;
      check(thresholds[range_low] <= low && thresholds[range_high] >= high, "block range");
      const std::size_t cell = bx / 4 + coarse * (by / 4 + coarse * (bz / 4));
      const std::size_t bit = bx % 4 + 4 * (by % 4) + 16 * (bz % 4);
      const bool active =
          range_low < params.surface.isovalue_index && range_high >= params.surface.isovalue_index;
      check((masks[2 * cell + bit / 32] >> (bit % 32) & 1u) == active, "bit of a block");
    }
  }

  const CompressedVolume &volume;
  FrameParams params;
  DeviceStream stream;
  Macrocells macrocells;
};

/// Its buffers are made anew each time, as for a new volume.
void build_ranges(benchmark::State &state) {
  auto &in = input<MacrocellsInput>(state.range(0), state.range(1));
  const auto blocks = static_cast<double>(in.volume.block_count());
  const double bytes = blocks * (in.stream.layout.bits_per_block / 8.0 + sizeof(ushort));
  measure(
      state, {blocks, bytes}, [] {},
      [&] { const Macrocells built(Session::current().device(), in.params, in.stream); });
}

void select_isovalue(benchmark::State &state) {
  auto &in = input<MacrocellsInput>(state.range(0), state.range(1));
  const auto blocks = static_cast<double>(in.volume.block_count());
  measure(
      state, {blocks, blocks * (sizeof(ushort) + 1.0 / 8)}, [] {},
      [&] {
        in.params.surface.isovalue = std::nextafter(
            in.params.surface.isovalue, kMixingLayerIsovalue + 1.0f);  // or nothing is done
        in.macrocells.select(in.params);
        in.params.surface = in.macrocells.surface(in.params);
      });
}

const bool kRegistered = [] {
  stage_benchmark("macrocells/build", build_ranges)
      ->ArgNames({"edge", "rate"})
      ->ArgsProduct({{128, 256}, {4}})
      ->Args({128, 1})
      ->Args({128, 16});
  stage_benchmark("macrocells/select", select_isovalue)
      ->ArgNames({"edge", "rate"})
      ->ArgsProduct({{128, 256}, {4}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
