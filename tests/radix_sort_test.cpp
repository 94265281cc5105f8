// core/radix_sort against std::stable_sort. Values are the places of their keys before sorting, so
// that a swap of equal keys shows.

#include "core/paper/radix_sort.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "kernels_cl/portable/radix_sort.h"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

enum class KeyKind { kRandom, kFewDistinct, kAllEqual, kSorted, kReversed, kHotBlock };
constexpr KeyKind kKeyKinds[] = {KeyKind::kRandom, KeyKind::kFewDistinct, KeyKind::kAllEqual,
                                 KeyKind::kSorted, KeyKind::kReversed,    KeyKind::kHotBlock};

std::vector<uint> make_keys(KeyKind kind, uint count, uint key_bits, uint seed) {
  const uint largest = 0xFFFFFFFFu >> (32 - key_bits);
  Random random(seed);
  const uint few[3] = {random() & largest, random() & largest, largest};
  std::vector<uint> keys(count);
  for (uint &key : keys) {
    const uint bits = random();
    switch (kind) {
      case KeyKind::kRandom:
      case KeyKind::kSorted:
      case KeyKind::kReversed:
        key = bits & largest;
        break;
      case KeyKind::kFewDistinct:
        key = few[bits % 3];
        break;
      case KeyKind::kAllEqual:
        key = largest;
        break;
      case KeyKind::kHotBlock:
        key = bits % 10 != 0 ? few[0] : random() & largest;
        break;
    }
  }
  if (kind == KeyKind::kSorted) std::ranges::sort(keys);
  if (kind == KeyKind::kReversed) std::ranges::sort(keys, std::greater<>());
  return keys;
}

struct RankingOnDevice {
  ocl::DeviceInfo device;
  RadixRanking ranking;
};

void PrintTo(const RankingOnDevice &param, std::ostream *out) {
  *out << (param.ranking == RadixRanking::kSerial ? "serial" : "together") << " on "
       << param.device.name;
}

/// Either way of ranking on every device, whichever suits it.
std::vector<RankingOnDevice> rankings_under_test() {
  std::vector<RankingOnDevice> params;
  for (const ocl::DeviceInfo &device : devices_under_test()) {
    for (const RadixRanking ranking : {RadixRanking::kTogether, RadixRanking::kSerial})
      params.push_back({device, ranking});
  }
  return params;
}

/// "0_rusticl_together".
std::string ranking_test_name(const testing::TestParamInfo<RankingOnDevice> &info) {
  return device_test_name({info.param.device, info.index}) +
         (info.param.ranking == RadixRanking::kSerial ? "_serial" : "_together");
}

class RadixSortOnDevice : public testing::TestWithParam<RankingOnDevice> {
 protected:
  RadixSort make_sort(std::size_t max_count, uint group_size) {
    return RadixSort(device_, max_count, group_size, GetParam().ranking);
  }

  /// Sorts `count` of max_count pairs; those behind must not take part.
  void expect_sorted(RadixSort &sort, uint max_count, KeyKind kind, uint count, uint key_bits,
                     uint seed) {
    SCOPED_TRACE(fmt::format("count {} of {}, key bits {}, key kind {}, seed {}", count, max_count,
                             key_bits, static_cast<int>(kind), seed));
    std::vector<uint> keys = make_keys(kind, count, key_bits, seed), values(max_count);
    keys.resize(max_count, 0);  // smaller than the others: they would come first
    std::iota(values.begin(), values.end(), 0u);
    ocl::Buffer<uint> d_keys(device_, "keys", std::span<const uint>(keys)),
        d_values(device_, "values", std::span<const uint>(values));
    PassCounts start = distinct_counts();
    start.granted_count = count;
    CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));

    sort(d_keys, d_values, counts, ISO_COUNT_FIELD(granted_count), key_bits);

    values.resize(count);
    std::ranges::stable_sort(values, {}, [&](uint value) { return keys[value]; });
    std::vector<uint> expected_keys(count);
    std::ranges::transform(values, expected_keys.begin(), [&](uint value) { return keys[value]; });
    std::vector<uint> got_keys = d_keys.read(), got_values = d_values.read();
    got_keys.resize(count);
    got_values.resize(count);
    EXPECT_EQ(first_difference(got_keys, expected_keys), kNoDifference) << "in keys";
    EXPECT_EQ(first_difference(got_values, values), kNoDifference) << "in values";
    expect_counts(counts, start);
  }

  ocl::Device device_{GetParam().device};
};

TEST_P(RadixSortOnDevice, SmallSorts) {
  constexpr uint kMaxCount = 300;  // tiles of 128
  RadixSort sort = make_sort(kMaxCount, 8);
  uint seed = 100;
  for (const uint count : {0u, 1u, 129u}) {
    expect_sorted(sort, kMaxCount, KeyKind::kRandom, count, 5, ++seed);
  }
  expect_sorted(sort, kMaxCount, KeyKind::kHotBlock, kMaxCount, 17, ++seed);
}

/// Several rounds to a tile, the last of them cut short.
TEST_P(RadixSortOnDevice, SmallSortsOfManyRounds) {
  constexpr uint kMaxCount = 64 * ISO_RADIX_ITEMS + 5 * ISO_RADIX_ROUND / 2 + 3;
  RadixSort sort = make_sort(kMaxCount, 64);
  expect_sorted(sort, kMaxCount, KeyKind::kRandom, kMaxCount, 7, 110);
  expect_sorted(sort, kMaxCount, KeyKind::kHotBlock, kMaxCount - 40, 3, 111);
}

TEST_P(RadixSortOnDevice, SortsAtAwkwardCounts) {
  for (const uint group_size : kGroupSizes) {
    SCOPED_TRACE(fmt::format("group size {}", group_size));
    const std::vector<uint> counts = awkward_counts(group_size * ISO_RADIX_ITEMS);
    const uint max_count = *std::ranges::max_element(counts);
    RadixSort sort = make_sort(max_count, group_size);
    uint seed = 200;
    for (const uint count : counts) {
      RadixSort exact = make_sort(count, group_size);
      for (const uint key_bits : {1u, ISO_RADIX_BITS, ISO_RADIX_BITS + 1, 18u, 27u, 32u}) {
        expect_sorted(sort, max_count, KeyKind::kRandom, count, key_bits, ++seed);
        expect_sorted(exact, count, KeyKind::kFewDistinct, count, key_bits, ++seed);
      }
    }
  }
}

TEST_P(RadixSortOnDevice, SortsEveryNumberOfKeyBits) {
  constexpr uint kCount = 1500;
  RadixSort sort = make_sort(kCount, 64);
  for (uint key_bits = 1; key_bits <= 32; ++key_bits) {
    expect_sorted(sort, kCount, KeyKind::kRandom, kCount, key_bits, 300 + key_bits);
  }
}

TEST_P(RadixSortOnDevice, SortsEveryDistribution) {
  for (const uint group_size : kGroupSizes) {
    SCOPED_TRACE(fmt::format("group size {}", group_size));
    constexpr uint kMaxCount = 50001;
    RadixSort sort = make_sort(kMaxCount, group_size);
    for (const KeyKind kind : kKeyKinds) {
      expect_sorted(sort, kMaxCount, kind, kMaxCount, 18, 400);
      expect_sorted(sort, kMaxCount, kind, kMaxCount / 3, 18, 401);
    }
  }
}

/// Every pass has the digits that the pass before left, with no pair between: all keys but a few
/// are of two digits.
TEST_P(RadixSortOnDevice, SortsWhereMostDigitsHaveNoPairs) {
  constexpr uint kCount = 9000;
  RadixSort sort = make_sort(kCount, 64);
  for (const uint key_bits : {2u, 18u, 27u, 32u}) {
    expect_sorted(sort, kCount, KeyKind::kFewDistinct, kCount, key_bits, 450 + key_bits);
    expect_sorted(sort, kCount, KeyKind::kAllEqual, kCount, key_bits, 460 + key_bits);
  }
}

TEST_P(RadixSortOnDevice, SortsAMillion) {
  constexpr uint kCount = 1000003;
  RadixSort sort = make_sort(kCount, 64);
  expect_sorted(sort, kCount, KeyKind::kRandom, kCount, 18, 500);
}

TEST_P(RadixSortOnDevice, BadArgumentsAreRefused) {
  RadixSort sort = make_sort(100, 64);
  ocl::Buffer<uint> enough(device_, "enough", 100), also_enough(device_, "also enough", 100),
      short_one(device_, "short one", 99);
  CountsBuffer counts(device_, "counts", 1);
  const uint field = ISO_COUNT_FIELD(granted_count);
  EXPECT_THROW(sort(enough, also_enough, counts, field, 0), std::invalid_argument);
  EXPECT_THROW(sort(enough, also_enough, counts, field, 33), std::invalid_argument);
  EXPECT_THROW(sort(enough, short_one, counts, field, 8), std::invalid_argument);
  try {
    sort(short_one, enough, counts, field, 8);
    FAIL() << "a short buffer was accepted";
  } catch (const std::invalid_argument &error) {
    EXPECT_STREQ(error.what(), "RadixSort: 100 pairs do not fit 'short one' of 99 entries");
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, RadixSortOnDevice, testing::ValuesIn(rankings_under_test()),
                         ranking_test_name);

}  // namespace
}  // namespace isowave::core
