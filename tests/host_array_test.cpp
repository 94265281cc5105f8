// Memory of arrays that renderers hand out.

#include "core/base/host_array.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <thread>
#include <vector>

namespace isowave::core {
namespace {

TEST(HostArray, HasOneOwner) {
  HostMemory memory;
  HostArray<float> values = memory.array<float>(3);
  std::ranges::copy(std::vector{1.0f, 2.0f, 3.0f}, values.begin());
  HostArray<float> moved = std::move(values);
  EXPECT_TRUE(values.empty());  // NOLINT(bugprone-use-after-move)
  EXPECT_EQ(moved.size(), 3u);
  EXPECT_EQ(moved.bytes(), 12u);
  EXPECT_EQ(moved.copy(), (std::vector{1.0f, 2.0f, 3.0f}));
  values = std::move(moved);
  EXPECT_EQ(values[2], 3.0f);
  EXPECT_EQ(memory.array<float>(0).size(), 0u);
}

TEST(HostArray, MemoryServesTheNextArrayOnlyWhenItsOwnIsGone) {
  HostMemory memory;
  const std::byte *first = nullptr;
  {
    const auto array = memory.array<std::byte>(10'000);
    first = array.data();
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first) % 4096, 0u);
    EXPECT_NE(memory.array<std::byte>(10'000).data(), first);
  }
  // A smaller array takes it, too, but none of less than half its size, and no larger one.
  const auto small = memory.array<std::byte>(8'000);
  const auto tiny = memory.array<std::byte>(1'000), large = memory.array<std::byte>(100'000);
  const std::set<const std::byte *> all{small.data(), tiny.data(), large.data()};
  EXPECT_EQ(all.size(), 3u);
  EXPECT_FALSE(tiny.data() == first || large.data() == first);
}

TEST(HostArray, OutlivesItsMemory) {
  HostArray<int> array;
  {
    HostMemory memory;
    array = memory.array<int>(100'000);
  }
  std::ranges::fill(array, 7);
  std::thread([moved = std::move(array)]() mutable { moved[99'999] = 8; }).join();
}

/// Memory is pinned as long as HostMemory knows it, and at most kMostPieces of them.
TEST(HostArray, MemoryIsPinnedWhileItIsThere) {
  std::set<const void *> pinned;
  const auto pin = [&](std::span<std::byte> piece) -> std::shared_ptr<void> {
    pinned.insert(piece.data());
    return {piece.data(), [&](void *memory) {
              *static_cast<std::byte *>(memory) = std::byte{1};  // still there
              pinned.erase(memory);
            }};
  };
  std::vector<HostArray<std::byte>> arrays;
  {
    HostMemory memory(pin);
    for (std::size_t i = 0; i < HostMemory::kMostPieces + 3; ++i) {
      arrays.push_back(memory.array<std::byte>(5'000));
      std::ranges::fill(arrays.back(), static_cast<std::byte>(i));
    }
    EXPECT_EQ(pinned.size(), HostMemory::kMostPieces);
    EXPECT_FALSE(pinned.contains(arrays.front().data()));
    EXPECT_TRUE(pinned.contains(arrays.back().data()));
    arrays.erase(arrays.begin() + 3);  // the oldest that is pinned
    const auto again = memory.array<std::byte>(5'000);
    EXPECT_EQ(pinned.size(), HostMemory::kMostPieces);
    EXPECT_TRUE(pinned.contains(again.data()));
    // Memory that no array has goes before memory in use.
    const std::byte *const unused = again.data();
    arrays.push_back(memory.array<std::byte>(5'000));
    EXPECT_NE(arrays.back().data(), unused);
  }
  EXPECT_TRUE(pinned.empty());
  for (std::size_t i = 4; i + 2 < arrays.size(); ++i)
    EXPECT_EQ(arrays[i][4'999], static_cast<std::byte>(i + 1)) << "of another array";
}

}  // namespace
}  // namespace isowave::core
