// Encoding voxels as zfp blocks: zfp_encode.cl, over rates.

#include <vector>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/sources/generate.hpp"
#include "core/stages/zfp_encode.hpp"

namespace isowave::core::bench {
namespace {

/// As much as compress() hands to a device at once.
const glm::uvec3 kDims(256, 256, 64);
constexpr std::uint32_t kNumBlocks = 64 * 64 * 16;
static_assert(std::uint64_t{kNumBlocks} * ISO_BLOCK_VOXELS == LayerEncoder::kPieceVoxels);

struct EncodeInput {
  EncodeInput(ocl::Device &device, std::int64_t rate)
      : bits_per_block(static_cast<std::uint32_t>(64 * rate)),
        encode(device),
        voxels(device, "voxels", std::size_t{kNumBlocks} * ISO_BLOCK_VOXELS),
        words(device, "words", std::size_t{kNumBlocks} * (bits_per_block / 32) + 1),
        errors(device, "errors", ZfpEncode::kErrorsPerBlock * kNumBlocks) {
    GenerateOptions generate;
    generate.dims = kDims;
    const std::unique_ptr<VolumeReader> reader = open_generated(generate);
    std::vector<float> layers(voxels.size());
    reader->read_layers(0, kDims.z, layers);
    voxels.write(layers);
    CompressOptions options;
    options.rate = static_cast<std::uint32_t>(rate);
    const CompressedVolume expected = compress(*reader, options);
    run();
    const std::vector<uint> got = words.read();
    check(same_bits<uint>(std::span(expected.words).first(got.size()), got), "encoded words");
  }
  void run() { encode(voxels, kDims, bits_per_block, words); }
  void measure_errors() { encode.measure_errors(voxels, kDims, bits_per_block, words, errors); }
  double bytes() const {
    return kNumBlocks * (bits_per_block / 8.0 + ISO_BLOCK_VOXELS * sizeof(float));
  }

  std::uint32_t bits_per_block;
  ZfpEncode encode;
  ocl::Buffer<float> voxels;
  ocl::Buffer<uint> words;
  ocl::Buffer<float> errors;
};

void encode_blocks(benchmark::State &state) {
  auto &in = input<EncodeInput>(state.range(0));
  measure(
      state, {kNumBlocks, in.bytes()}, [] {}, [&] { in.run(); });
}

void measure_errors(benchmark::State &state) {
  auto &in = input<EncodeInput>(state.range(0));
  measure(
      state, {kNumBlocks, in.bytes()}, [] {}, [&] { in.measure_errors(); });
}

const bool kRegistered = [] {
  stage_benchmark("zfp_encode", encode_blocks)->ArgName("rate")->ArgsProduct({{1, 2, 4, 8, 16}});
  stage_benchmark("zfp_encode/errors", measure_errors)
      ->ArgName("rate")
      ->ArgsProduct({{1, 2, 4, 8, 16}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
