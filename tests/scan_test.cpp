// core/scan: prefix sums and compaction against std::exclusive_scan and a plain loop.

#include "core/paper/scan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr uint kSentinel = 0xDEADBEEFu;

uint tile_of(uint group_size) {
  return group_size * ISO_SCAN_ITEMS;
}

enum class MaskKind { kZeros, kOnes, kRandom, kSparse, kOtherThanOne };
constexpr MaskKind kMaskKinds[] = {MaskKind::kZeros, MaskKind::kOnes, MaskKind::kRandom,
                                   MaskKind::kSparse, MaskKind::kOtherThanOne};

std::vector<uint> make_mask(MaskKind kind, uint count, uint seed) {
  Random random(seed);
  std::vector<uint> mask(count);
  for (uint &entry : mask) {
    const uint bits = random();
    switch (kind) {
      case MaskKind::kZeros:
        entry = 0;
        break;
      case MaskKind::kOnes:
        entry = 1;
        break;
      case MaskKind::kRandom:
        entry = bits & 1;
        break;
      case MaskKind::kSparse:
        entry = bits % 100 == 0;
        break;
      case MaskKind::kOtherThanOne:
        entry = bits & 2 ? bits & 0xFFFFFFFEu : 0;
        break;
    }
  }
  return mask;
}

class ScanOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Scans ceil(n / divisor) random entries and compares with std::exclusive_scan.
  void expect_scan(ExclusiveScan &scan, uint n, uint divisor, uint seed) {
    SCOPED_TRACE(fmt::format("n {}, divisor {}, seed {}", n, divisor, seed));
    const uint count = (n + divisor - 1) / divisor;
    Random random(seed);
    std::vector<uint> values(count + 1);
    for (uint &value : values) value = random();  // sums wrap
    values.back() = kSentinel;
    ocl::Buffer<uint> buffer(device_, "values", std::span<const uint>(values));
    PassCounts start = distinct_counts();
    start.pair_count = n;
    CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));

    scan(buffer, counts, ISO_COUNT_FIELD(pair_count), divisor, ISO_COUNT_FIELD(visible_count));

    std::vector<uint> expected(values);
    std::exclusive_scan(values.begin(), values.end() - 1, expected.begin(), 0u);
    EXPECT_EQ(first_difference(buffer.read(), expected), kNoDifference);
    start.visible_count = std::accumulate(values.begin(), values.end() - 1, 0u);
    expect_counts(counts, start);
  }

  void expect_compaction(Compaction &compaction, MaskKind kind, uint count, uint seed) {
    SCOPED_TRACE(
        fmt::format("count {}, mask kind {}, seed {}", count, static_cast<int>(kind), seed));
    const std::vector<uint> mask = make_mask(kind, count, seed);
    std::vector<uint> values(count), expected;
    Random random(seed + 1);
    std::ranges::generate(values, std::ref(random));
    for (uint i = 0; i < count; ++i) {
      if (mask[i] != 0) expected.push_back(values[i]);
    }
    const ocl::Buffer<uint> d_mask(device_, "mask", std::span<const uint>(mask)),
        d_values(device_, "values", std::span<const uint>(values));
    ocl::Buffer<uint> out(device_, "out", count + 1);
    out.fill(kSentinel);
    PassCounts start = distinct_counts();
    start.active_count = count;
    CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));

    compaction(d_mask, d_values, counts, ISO_COUNT_FIELD(active_count), out,
               ISO_COUNT_FIELD(granted_count));

    start.granted_count = static_cast<uint>(expected.size());
    expected.resize(count + 1, kSentinel);
    EXPECT_EQ(first_difference(out.read(), expected), kNoDifference);
    expect_counts(counts, start);
  }

  ocl::Device device_{GetParam()};
};

TEST_P(ScanOnDevice, SmallScans) {
  ExclusiveScan scan(device_, 8);
  uint seed = 100;
  for (const uint count : awkward_counts(tile_of(8))) expect_scan(scan, count, 1, ++seed);
}

TEST_P(ScanOnDevice, ScansAtAwkwardCounts) {
  for (const uint group_size : kGroupSizes) {
    SCOPED_TRACE(fmt::format("group size {}", group_size));
    ExclusiveScan scan(device_, group_size);
    uint seed = 200;
    std::vector<uint> counts = awkward_counts(tile_of(group_size));
    for (const uint other_tile : {tile_of(8), tile_of(64), tile_of(256)})
      counts.push_back(other_tile + 1);
    counts.push_back(
        500009);  // one group: llvmpipe's 65,535 turns (Device::max_resident_groups) suffice
    for (const uint count : counts) expect_scan(scan, count, 1, ++seed);
  }
}

TEST_P(ScanOnDevice, SmallScansOfTables) {
  ExclusiveScan scan(device_, 8);
  uint seed = 300;
  for (const uint n : {0u, 1u, 6u, 7u, 8u, 35u, 1000u}) expect_scan(scan, n, 7, ++seed);
}

TEST_P(ScanOnDevice, ScansOfTables) {
  ExclusiveScan scan(device_, 64);
  uint seed = 350;
  for (const uint n : {0u, 1u, 63u, 64u, 65u, 320u}) expect_scan(scan, n, 64, ++seed);
  expect_scan(scan, 1000000, 1024, 400);
  expect_scan(scan, 1000000, 3, 401);
}

TEST_P(ScanOnDevice, TotalMayBeLeftOut) {
  ExclusiveScan scan(device_, 64);
  const std::vector<uint> values{3, 4, 5};
  ocl::Buffer<uint> buffer(device_, "values", std::span<const uint>(values));
  PassCounts start = distinct_counts();
  start.pair_count = 3;
  CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));
  scan(buffer, counts, ISO_COUNT_FIELD(pair_count));
  EXPECT_EQ(buffer.read(), (std::vector<uint>{0, 3, 7}));
  expect_counts(counts, start);
}

TEST_P(ScanOnDevice, SmallCompactions) {
  constexpr uint kMaxCount = 300;
  Compaction compaction(device_, kMaxCount, 8);
  uint seed = 500;
  for (const uint count : {0u, 1u, 63u, 64u, 65u, kMaxCount}) {
    expect_compaction(compaction, MaskKind::kOtherThanOne, count, ++seed);
  }
}

TEST_P(ScanOnDevice, CompactsAtAwkwardCounts) {
  for (const uint group_size : kGroupSizes) {
    SCOPED_TRACE(fmt::format("group size {}", group_size));
    const std::vector<uint> counts = awkward_counts(tile_of(group_size));
    Compaction compaction(device_, *std::ranges::max_element(counts),
                          group_size);  // mostly larger than count
    uint seed = 600;
    for (const uint count : counts) {
      Compaction exact(device_, count, group_size);
      for (const MaskKind kind : kMaskKinds) {
        expect_compaction(compaction, kind, count, ++seed);
        expect_compaction(exact, kind, count, ++seed);
      }
    }
  }
}

TEST_P(ScanOnDevice, CompactsAMillion) {
  constexpr uint kCount = 1000003;  // more tiles than groups, and more tile sums than one tile
  for (const uint group_size : kGroupSizes) {
    SCOPED_TRACE(fmt::format("group size {}", group_size));
    Compaction compaction(device_, kCount, group_size);
    for (const MaskKind kind : kMaskKinds) expect_compaction(compaction, kind, kCount, 700);
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, ScanOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
