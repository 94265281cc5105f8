#include "bench/scenes.hpp"

#include <cmath>
#include <map>
#include <span>
#include <tuple>

#include "core/sources/generate.hpp"
#include "core/zfp/zfp_accuracy.hpp"

namespace isowave::core::bench {

namespace {

/// f(x,y,z) = z - h(x,y) with h in [0.5, 2.5].
class WavySlabReader : public VolumeReader {
 public:
  explicit WavySlabReader(const glm::uvec3 &dims) { info_.dims = dims; }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    std::size_t voxel = 0;
    for (std::uint32_t z = z_begin; z < z_begin + num_layers; ++z) {
      for (std::uint32_t y = 0; y < info_.dims.y; ++y) {
        const float wave = std::cos(0.4f * static_cast<float>(y));
        for (std::uint32_t x = 0; x < info_.dims.x; ++x) {
          const float height = 1.5f + wave * std::sin(0.6f * static_cast<float>(x));
          out[voxel++] = static_cast<float>(z) - height;
        }
      }
    }
  }
};

}  // namespace

const CompressedVolume &mixing_layer(std::int64_t edge, std::int64_t rate, std::uint32_t levels) {
  static std::map<std::tuple<std::int64_t, std::int64_t, std::uint32_t>, CompressedVolume> volumes;
  CompressedVolume &volume = volumes[{edge, rate, levels}];
  if (volume.words.empty()) {
    GenerateOptions generate;
    generate.dims = glm::uvec3(static_cast<std::uint32_t>(edge));
    volume = compress(*open_generated(generate),
                      {.rate = static_cast<std::uint32_t>(rate), .levels = levels});
  }
  return volume;
}

const CompressedVolume &exact_mixing_layer(std::int64_t edge) {
  static std::map<std::int64_t, CompressedVolume> volumes;
  CompressedVolume &volume = volumes[edge];
  if (volume.words.empty()) {
    GenerateOptions generate;
    generate.dims = glm::uvec3(static_cast<std::uint32_t>(edge));
    generate.type = VoxelType::kUint8;
    const auto reader = open_generated(generate);
    CompressOptions options;
    options.precision = choose_precision(*reader, {.exact = true}, {});
    volume = compress(*reader, options);
  }
  return volume;
}

CompressedVolume wavy_slab(std::uint32_t blocks_x, std::uint32_t blocks_y) {
  WavySlabReader reader({4 * blocks_x, 4 * blocks_y, 5});
  CompressOptions options;
  options.rate = 4;
  return compress(reader, options);
}

/// Numbers of a Weyl sequence, mixed by multiplications [Steele et al. 2014, SplitMix].
std::uint32_t Random::below(std::uint64_t bound) {
  state_ += 0x9E3779B97F4A7C15u;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  z ^= z >> 31;
  return static_cast<std::uint32_t>((z >> 32) * bound >> 32);
}

void Random::shuffle(std::vector<std::uint32_t> &entries) {
  for (std::size_t i = entries.size(); i > 1; --i) std::swap(entries[i - 1], entries[below(i)]);
}

}  // namespace isowave::core::bench
