// Decoding listed blocks into cache slots: zfp_decode.cl, over rates and orders of the list.

#include <algorithm>
#include <utility>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/stages/zfp_decode.hpp"

namespace isowave::core::bench {
namespace {

/// A real stream of 128^3 voxels, eight times over: as many blocks as 256^3 voxels have.
constexpr std::int64_t kEdge = 128;
constexpr std::uint32_t kCopies = 8;
constexpr std::uint32_t kNumDecoded = 1u << 18;  // a GPU holds 2^17 at a time

CompressedVolume repeated_volume(std::int64_t rate) {
  CompressedVolume volume = mixing_layer(kEdge, rate);
  const std::vector<uint> payload(
      volume.words.begin(),
      volume.words.begin() + volume.block_count() * volume.bits_per_block / 32);
  const std::vector<uint> tail(volume.words.begin() + payload.size(), volume.words.end());
  volume.words.clear();
  for (std::uint32_t copy = 0; copy < kCopies; ++copy) {
    volume.words.insert(volume.words.end(), payload.begin(), payload.end());
  }
  volume.words.insert(volume.words.end(), tail.begin(), tail.end());
  return volume;
}

enum class Order { kSequential, kSorted, kRandom };

struct DecodeInput {
  DecodeInput(ocl::Device &device, std::int64_t rate, Order order)
      : stream(device, repeated_volume(rate)),
        decode(device, kNumDecoded),
        counts(device, "counts", 1),
        block_ids(device, "block ids", kNumDecoded),
        slots(device, "slots", kNumDecoded),
        inside(device, "voxels inside", kNumDecoded),
        values(device, "values", std::size_t{kNumDecoded} * ISO_BLOCK_VOXELS) {
    const CompressedVolume &volume = mixing_layer(kEdge, rate);
    const auto num_blocks = static_cast<uint>(kCopies * volume.block_count());
    Random random;
    std::vector<uint> all(num_blocks);
    for (uint i = 0; i < num_blocks; ++i) all[i] = i;
    if (order != Order::kSequential) random.shuffle(all);
    std::vector<uint> ids(all.begin(), all.begin() + kNumDecoded), slot_ids(kNumDecoded);
    if (order == Order::kSorted) std::sort(ids.begin(), ids.end());
    for (uint i = 0; i < kNumDecoded; ++i) slot_ids[i] = i;
    if (order == Order::kRandom) random.shuffle(slot_ids);
    block_ids.write(ids);
    slots.write(slot_ids);
    PassCounts start{};
    start.decoded_count = kNumDecoded;
    counts.write({&start, 1});
    run();
    verify(volume, ids, slot_ids);
  }
  void run() { decode(stream, frame, counts, block_ids, slots, values, inside); }

  /// Every block, bit for bit, against libzfp.
  void verify(const CompressedVolume &volume, const std::vector<uint> &ids,
              const std::vector<uint> &slot_ids) {
    const std::vector<float> expected = decode_with_libzfp(volume), got = values.read();
    constexpr std::size_t kBlocks = kEdge / 4;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const std::size_t id = ids[i] % volume.block_count();
      const std::size_t x = id % kBlocks, y = id / kBlocks % kBlocks, z = id / kBlocks / kBlocks;
      for (std::size_t row = 0; row < 16; ++row) {
        const std::size_t voxel = 4 * x + kEdge * (4 * y + row % 4 + kEdge * (4 * z + row / 4));
        const std::size_t value = slot_ids[i] * std::size_t{ISO_BLOCK_VOXELS} + 4 * row;
        check(same_bits<float>({&expected[voxel], 4}, {&got[value], 4}), "decoded values");
      }
    }
  }

  DeviceStream stream;
  ZfpDecode decode;
  CountsBuffer counts;
  ocl::Buffer<uint> block_ids, slots;
  FrameParams frame{};
  ocl::Buffer<ulong> inside;
  ocl::Buffer<float> values;
};

void decode_blocks(benchmark::State &state, Order order) {
  auto &in = input<DecodeInput>(state.range(0), order);
  const double block_bytes =
      in.stream.layout.bits_per_block / 8.0 + ISO_BLOCK_VOXELS * sizeof(float) + 8;
  measure(
      state, {kNumDecoded, kNumDecoded * block_bytes}, [] {}, [&] { in.run(); });
}

const bool kRegistered = [] {
  for (const auto &[order, name] : {std::pair(Order::kSequential, "sequential"),
                                    {Order::kSorted, "sorted"},
                                    {Order::kRandom, "random"}}) {
    stage_benchmark(fmt::format("zfp_decode/{}", name),
                    [order = order](benchmark::State &state) { decode_blocks(state, order); })
        ->ArgName("rate")
        ->ArgsProduct({{1, 2, 4, 8, 16}});
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
