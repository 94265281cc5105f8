// Decoding listed blocks into cache slots: zfp_decode.cl, over rates and orders of the list.

#include <algorithm>
#include <cstring>
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
  /// Decodes the real stream, as often as there are copies.
  DecodeInput(ocl::Device &device, std::int64_t rate, Order order)
      : DecodeInput(device, repeated_volume(rate), kCopies, order, SlotType::kFloat32) {}
  /// Decodes blocks that have lengths of their own; the list has each several times.
  DecodeInput(ocl::Device &device, SlotType slot_type)
      : DecodeInput(device, exact_mixing_layer(kEdge), 1, Order::kSorted, slot_type) {}

  DecodeInput(ocl::Device &device, const CompressedVolume &volume, std::uint32_t copies,
              Order order, SlotType slot_type)
      : stream(device, volume),
        type(slot_type),
        decode(device, kNumDecoded, stream.defines(), false, type),
        counts(device, "counts", 1),
        block_ids(device, "block ids", kNumDecoded),
        slots(device, "slots", kNumDecoded),
        inside(device, "voxels inside", kNumDecoded),
        values(device, "values", kNumDecoded * slot_bytes(type)) {
    const auto num_blocks = static_cast<uint>(copies * volume.block_count());
    Random random;
    std::vector<uint> ids(kNumDecoded), slot_ids(kNumDecoded);
    for (uint i = 0; i < kNumDecoded; ++i) {
      ids[i] = i % num_blocks;
      slot_ids[i] = i;
    }
    if (order != Order::kSequential) random.shuffle(ids);
    if (order == Order::kSorted) std::sort(ids.begin(), ids.end());
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
    const std::vector<float> expected = decode_with_libzfp(volume);
    const std::vector<SlotValue> bytes = values.read();
    std::vector<float> got(std::size_t{kNumDecoded} * ISO_BLOCK_VOXELS);
    if (type == SlotType::kUint8) {
      std::ranges::transform(bytes, got.begin(), [](SlotValue value) { return float(value.byte); });
    } else {
      std::memcpy(got.data(), bytes.data(), bytes.size());
    }
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
  SlotType type;
  ZfpDecode decode;
  CountsBuffer counts;
  ocl::Buffer<uint> block_ids, slots;
  FrameParams frame{};
  ocl::Buffer<ulong> inside;
  ocl::Buffer<SlotValue> values;
};

void decode_blocks(benchmark::State &state, Order order) {
  auto &in = input<DecodeInput>(state.range(0), order);
  const double block_bytes =
      in.stream.layout.bits_per_block / 8.0 + ISO_BLOCK_VOXELS * sizeof(float) + 8;
  measure(
      state, {kNumDecoded, kNumDecoded * block_bytes}, [] {}, [&] { in.run(); });
}

void decode_whole_numbers(benchmark::State &state) {
  const SlotType type = state.range(0) == 8 ? SlotType::kUint8 : SlotType::kFloat32;
  auto &in = input<DecodeInput>(type);
  const CompressedVolume &volume = exact_mixing_layer(kEdge);
  const double stream_bytes = sizeof(uint) * double(volume.word_count());
  const double block_bytes =
      stream_bytes / double(volume.block_count()) + double(slot_bytes(type)) + 8;
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
  stage_benchmark("zfp_decode/whole_numbers", decode_whole_numbers)
      ->ArgName("slot_bits")
      ->Arg(32)
      ->Arg(8);
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
