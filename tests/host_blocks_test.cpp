// Blocks that rays on the host decode: which ones, once each for all threads, in how much memory.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <cstring>
#include <set>
#include <thread>

#include "core/base/error.hpp"
#include "core/host/host_blocks.hpp"
#include "core/platform/memory.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/block_grid.h"
#include "kernels_cl/portable/cell_intersect.h"
#include "reference/random.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;

/// Like HostBlocks::select(), from the decoded voxels: has a block a cell whose corners are on both
/// sides?
bool is_active(const TestVolume &volume, const glm::uvec3 &block, float isovalue) {
  const glm::uvec3 begin = 4u * block, end = glm::min(begin + 4u, volume.info().dims - 1u);
  for (std::uint32_t z = begin.z; z < end.z; ++z) {
    for (std::uint32_t y = begin.y; y < end.y; ++y) {
      for (std::uint32_t x = begin.x; x < end.x; ++x) {
        int inside = 0;
        for (std::uint32_t c = 0; c < 8; ++c)
          inside += volume.voxel(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)) >= isovalue;
        if (inside != 0 && inside != 8) return true;
      }
    }
  }
  return false;
}

template <class Body>
void for_each_block(const glm::uvec3 &blocks, Body body) {
  for (std::uint32_t z = 0; z < blocks.z; ++z) {
    for (std::uint32_t y = 0; y < blocks.y; ++y) {
      for (std::uint32_t x = 0; x < blocks.x; ++x)
        body(glm::uvec3(x, y, z), x + std::size_t{blocks.x} * (y + std::size_t{blocks.y} * z));
    }
  }
}

/// The blocks of a block's dual grid, as far as they are in the volume.
void add_dual_grid(std::set<std::size_t> &blocks, const glm::uvec3 &block, const glm::uvec3 &size) {
  for (std::uint32_t c = 0; c < 8; ++c) {
    const glm::uvec3 at = block + glm::uvec3(c & 1, c >> 1 & 1, c >> 2);
    if (glm::all(glm::lessThan(at, size)))
      blocks.insert(at.x + std::size_t{size.x} * (at.y + std::size_t{size.y} * at.z));
  }
}

FrameParams frame_of(const TestVolume &volume, const Camera &camera, ImageSize size,
                     const HostBlocks &blocks) {
  FrameParams frame = make_frame_params(volume.info(), camera, size, blocks.surface().isovalue);
  frame.surface = blocks.surface();
  return frame;
}

TEST(HostBlocks, ActiveAreTheBlocksWithCellsThatChange) {
  for (const glm::uvec3 dims :
       {glm::uvec3(2, 2, 2), {4, 4, 4}, {5, 5, 5}, {17, 21, 5}, {37, 38, 39}, {70, 9, 18}}) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    for (const bool is_whole : {false, true}) {
      const TestVolume volume(dims, is_whole ? test::plateau_field() : test::gyroid_field(23), 16);
      HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
      const glm::uvec3 size = volume.compressed.num_blocks(), macrocells = (size + 3u) / 4u;
      for (const float isovalue : {is_whole ? volume.voxels[volume.voxels.size() / 2] : 0.2f, 0.9f,
                                   1e30f, -INFINITY, INFINITY}) {
        blocks.select(isovalue);
        glm::ivec3 begin(INT_MAX), end(0);
        for_each_block(size, [&](const glm::uvec3 &block, std::size_t) {
          const glm::uvec3 macrocell = block / 4u, in = block % 4u;
          const ulong mask =
              blocks.field()
                  .masks[macrocell.x + macrocells.x * (macrocell.y + macrocells.y * macrocell.z)];
          const bool active = is_active(volume, block, isovalue);
          EXPECT_EQ(mask >> (in.x + 4 * in.y + 16 * in.z) & 1, active);
          if (!active) return;
          begin = glm::min(begin, glm::ivec3(block));
          end = glm::max(end, glm::ivec3(block) + 1);
        });
        const Surface &surface = blocks.surface();
        EXPECT_EQ(glm::ivec3(surface.active_end_x, surface.active_end_y, surface.active_end_z),
                  end);
        if (end != glm::ivec3(0)) {
          EXPECT_EQ(
              glm::ivec3(surface.active_begin_x, surface.active_begin_y, surface.active_begin_z),
              begin);
        }
      }
    }
  }
}

/// Threads that all start at the same tile of a small volume, again and again. The first thread
/// that comes to a block decodes it, once; all threads see it whole.
TEST(HostBlocks, ThreadsRaceForTheSameBlocks) {
  constexpr std::size_t kThreads = 8;
  constexpr int kTurns = 60;
  const glm::uvec3 dims(37, 34, 31);
  const TestVolume volume(dims, test::gyroid_field(12), 12);
  const ImageSize size{32, 24};
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
  std::vector<FrameParams> frames;
  std::vector<std::vector<HitRecord>> expected;
  for (const float isovalue : {0.2f, -0.3f}) {
    blocks.select(isovalue);
    frames.push_back(frame_of(volume, camera, size, blocks));
    expected.push_back(test::twin_hits(volume, camera, size, isovalue));
  }
  std::vector<std::vector<HitRecord>> hits(kThreads);
  std::uint64_t num_decoded = 0, most_decoded = 0;
  bool is_new = false;
  HostField field{};
  // By one thread, while the others wait.
  int turn = -1;
  const auto prepare = [&]() noexcept {
    std::uint64_t num_there = 0;
    for (std::size_t block = 0; block < volume.compressed.block_count(); ++block)
      num_there += blocks.is_decoded(block);
    if (is_new) {
      EXPECT_EQ(blocks.num_decoded() - num_decoded, num_there) << "each of them once";
    }
    most_decoded = std::max(most_decoded, num_there);
    num_decoded = blocks.num_decoded();
    ++turn;
    blocks.select(frames[turn % 2].surface.isovalue);
    is_new = turn % 3 != 2;
    if (is_new) blocks.forget();
    field = blocks.field();
  };
  std::barrier barrier(kThreads, prepare);
  std::atomic<int> num_wrong = 0;
  std::vector<std::jthread> threads;
  for (std::size_t thread = 0; thread < kThreads; ++thread) {
    threads.emplace_back([&, thread] {
      for (int i = 0; i < kTurns; ++i) {
        barrier.arrive_and_wait();
        std::vector<HitRecord> &mine = hits[thread];
        mine.assign(size.num_rays(), no_hit());
        // Half of the threads draw ray by ray.
        const auto trace = thread % 2 == 0 ? host_loops().trace : host_loops().trace_rays;
        trace(frames[i % 2], field, {0, 0, size.width, size.height}, true, mine.data());
        num_wrong +=
            std::memcmp(mine.data(), expected[i % 2].data(), mine.size() * sizeof(HitRecord)) != 0;
      }
    });
  }
  threads.clear();
  EXPECT_EQ(num_wrong, 0);
  EXPECT_GT(most_decoded, 100u);
}

/// Two threads that come to each block at the same moment: neither looks at it before it is made.
TEST(HostBlocks, ThreadsThatMeetAtABlockSeeItWhole) {
  const TestVolume volume({46, 42, 38}, test::noise_field(6), 16);
  const glm::uvec3 size = volume.compressed.num_blocks();
  const std::size_t num_blocks = volume.compressed.block_count();
  HostBlocks calm(volume.compressed, HostBlocks::kNoLimit, 0),
      raced(volume.compressed, HostBlocks::kNoLimit, 0);
  calm.select(0.4f);
  raced.select(0.4f);
  const HostField expected = calm.field();
  for (std::size_t block = 0; block < num_blocks; ++block) expected.open(block);
  std::atomic<int> num_wrong = 0;
  for (int turn = 0; turn < 5; ++turn) {
    raced.forget();
    const HostField field = raced.field();
    std::atomic<std::size_t> num_arrived = 0;
    std::vector<std::jthread> threads;
    for (int thread = 0; thread < 2; ++thread) {
      threads.emplace_back([&] {
        std::size_t num_met = 0;
        for_each_block(size, [&](const glm::uvec3 &at, std::size_t block) {
          ++num_arrived;
          ++num_met;
          for (int i = 0; num_arrived < 2 * num_met; ++i) {
            if (i % 1000 == 999) std::this_thread::yield();
          }
          field.open(block);
          // The block of the dual grid that is likely to be new.
          const glm::uvec3 end = glm::min(at + 1u, size - 1u);
          const std::size_t last = end.x + size.x * (end.y + std::size_t{size.y} * end.z);
          num_wrong += field.changing[block] != expected.changing[block] ||
                       std::memcmp(&field.values[64 * last], &expected.values[64 * last],
                                   64 * sizeof(float)) != 0;
        });
      });
    }
    threads.clear();
    EXPECT_EQ(num_wrong, 0);
    // Values of the turn before must not pass for those of the next.
    std::memset(&field.values[0], 0xFF, 64 * num_blocks * sizeof(float));
  }
}

/// The blocks that a ray may come to before its hit: those that its way touches, a little wider or
/// narrower, and that have cells that change.
void add_touched(const TestVolume &volume, const std::vector<bool> &active, const glm::dvec3 &o,
                 const glm::dvec3 &d, double t_end, double wider, std::set<std::size_t> &touched) {
  const glm::uvec3 size = volume.compressed.num_blocks();
  for_each_block(size, [&](const glm::uvec3 &block, std::size_t id) {
    if (!active[id]) return;
    const glm::dvec3 low = glm::dvec3(4u * block) - wider,
                     high = glm::dvec3(glm::min(4u * block + 4u, volume.info().dims - 1u)) + wider;
    double enter = 0, exit = t_end + wider;
    for (int axis = 0; axis < 3; ++axis) {
      if (d[axis] == 0) {
        if (o[axis] < low[axis] || o[axis] > high[axis]) return;
        continue;
      }
      const double a = (low[axis] - o[axis]) / d[axis], b = (high[axis] - o[axis]) / d[axis];
      enter = std::max(enter, std::min(a, b));
      exit = std::min(exit, std::max(a, b));
    }
    if (enter < exit) add_dual_grid(touched, block, size);
  });
}

TEST(HostBlocks, OnlyBlocksThatRaysComeToAreDecoded) {
  const glm::uvec3 dims(61, 64, 58);
  const TestVolume volume(dims, test::gyroid_field(19), 12);
  const float isovalue = 0.3f;
  const glm::uvec3 size = volume.compressed.num_blocks();
  std::vector<bool> active;
  for_each_block(size, [&](const glm::uvec3 &block, std::size_t) {
    active.push_back(is_active(volume, block, isovalue));
  });
  const ImageSize picture{24, 16};
  for (const auto trace : {host_loops().trace, host_loops().trace_rays}) {
    HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
    blocks.select(isovalue);
    EXPECT_EQ(blocks.num_decoded(), 0u);
    for (const Camera &camera : orbit_cameras(volume.info(), 3)) {
      blocks.forget();
      const FrameParams frame = frame_of(volume, camera, picture, blocks);
      std::vector<HitRecord> hits(picture.num_rays(), no_hit());
      const std::uint64_t before = blocks.num_decoded();
      trace(frame, blocks.field(), {0, 0, picture.width, picture.height}, false, hits.data());
      EXPECT_GT(test::num_hits(hits), 100u);
      std::set<std::size_t> least, most;
      for (std::uint32_t ray_id = 0; ray_id < hits.size(); ++ray_id) {
        const Ray ray = make_ray(&frame, ray_id);
        const glm::dvec3 o(ray.x.o, ray.y.o, ray.z.o), d(ray.x.d, ray.y.d, ray.z.d);
        const double t = double{hits[ray_id].t} / double{frame.view.t_scale};
        add_touched(volume, active, o, d, t, -1e-3, least);
        add_touched(volume, active, o, d, t, 1e-3, most);
      }
      std::set<std::size_t> decoded;
      for (std::size_t block = 0; block < active.size(); ++block) {
        if (blocks.is_decoded(block)) decoded.insert(block);
      }
      EXPECT_EQ(blocks.num_decoded() - before, decoded.size());
      EXPECT_TRUE(std::ranges::includes(decoded, least));
      EXPECT_TRUE(std::ranges::includes(most, decoded));
      EXPECT_LT(most.size(), active.size() / 2) << "the test tells nothing";
      EXPECT_LT(most.size() - least.size(), 20u);

      // Smooth normals need the voxels around, too.
      std::vector<HitRecord> smooth(picture.num_rays(), no_hit());
      trace(frame, blocks.field(), {0, 0, picture.width, picture.height}, true, smooth.data());
      EXPECT_GT(blocks.num_decoded() - before, decoded.size());
      expect_same_hits(smooth, test::twin_hits(volume, camera, picture, isovalue), picture.width);
    }
  }
}

TEST(HostBlocks, AnotherIsovalueKeepsWhatIsDecoded) {
  const TestVolume volume({41, 38, 35}, test::gyroid_field(13), 12);
  const ImageSize size{24, 16};
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
  const auto draw = [&](float isovalue) {
    blocks.select(isovalue);
    std::vector<HitRecord> hits(size.num_rays(), no_hit());
    host_loops().trace(frame_of(volume, camera, size, blocks), blocks.field(),
                       {0, 0, size.width, size.height}, true, hits.data());
    expect_same_hits(hits, test::twin_hits(volume, camera, size, isovalue), size.width);
    return blocks.num_decoded();
  };
  const std::uint64_t first = draw(0.2f), second = draw(0.25f);
  EXPECT_GT(first, 100u);
  EXPECT_LT(second - first, first / 3);
  // More selections than there are numbers for them.
  const std::uint64_t last = draw(0.2f);
  for (int i = 0; i < 300; ++i) {
    blocks.select(0.2f + 0.05f * static_cast<float>(i % 2));
    if (i % 100 == 99) {
      EXPECT_EQ(draw(i % 200 == 99 ? 0.2f : 0.25f), last);
    }
  }
  for (int i = 0; i < 260; ++i) EXPECT_EQ(draw(i % 2 == 0 ? 0.2f : 0.25f), last);
}

/// Whatever the limit, work is done for each item once to its end, and bytes() keeps it.
TEST(HostBlocks, WorkIsDoneWithinAnyLimit) {
  const TestVolume volume({45, 42, 39}, test::noise_field(3), 12);
  const ImageSize size{32, 24};
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  const auto expected = test::twin_hits(volume, camera, size, 0.5f);
  const std::uint64_t least = HostBlocks::least_bytes(volume.info());
  ASSERT_EQ(least, HostBlocks::bytes(volume.info()) + 9 * platform::page_bytes());
  std::uint64_t num_alone = 0, last_decoded = ~std::uint64_t{0};
  for (const std::uint64_t pages : {0, 3, 12, 40, 1000}) {
    SCOPED_TRACE(fmt::format("{} pages more", pages));
    const std::uint64_t limit = least + pages * platform::page_bytes();
    HostBlocks blocks(volume.compressed, limit, 0);
    EXPECT_EQ(blocks.bytes(), HostBlocks::bytes(volume.info()));
    blocks.select(0.5f);
    const FrameParams frame = frame_of(volume, camera, size, blocks);
    std::vector<HitRecord> hits(size.num_rays(), no_hit());
    std::vector<std::atomic<int>> ends(size.height / 4);
    std::atomic<int> alone = 0;
    std::atomic<bool> is_over = false;
    const HostField field = blocks.field();
    blocks.run(ends.size(), [&](std::uint64_t item, bool is_alone) {
      const auto trace = is_alone ? host_loops().trace_rays : host_loops().trace;
      const auto y = static_cast<uint>(4 * item);
      trace(frame, field, {0, y, size.width, y + 4}, true, hits.data());
      // Two threads may ask for one page and count it twice for a moment.
      if (blocks.bytes() > limit + platform::page_bytes()) is_over = true;
      alone += is_alone;
      ++ends[item];
    });
    expect_same_hits(hits, expected, size.width);
    EXPECT_FALSE(is_over);
    EXPECT_LE(blocks.bytes(), limit);
    for (const std::atomic<int> &count : ends) EXPECT_EQ(count, 1);
    EXPECT_LE(blocks.num_decoded(), last_decoded);
    last_decoded = blocks.num_decoded();
    num_alone += static_cast<std::uint64_t>(alone.load());
    if (pages == 1000) {
      EXPECT_EQ(alone, 0);
    }
  }
  EXPECT_GT(num_alone, 0u) << "no limit was small enough";
  EXPECT_LE(last_decoded, volume.compressed.block_count());
}

TEST(HostBlocks, AnErrorOfTheWorkEndsIt) {
  const TestVolume volume({20, 20, 20}, test::gyroid_field(9), 8);
  HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
  EXPECT_THAT([&] { blocks.run(5, [](std::uint64_t, bool) { throw Error("my own"); }); },
              testing::ThrowsMessage<Error>("my own"));
}

/// Value ranges of parts of blocks, whole ones and those at the volume's end; without the voxels
/// that have no data.
TEST(HostLoops, RangesOfParts) {
  const glm::uvec3 dims(9, 10, 11);
  const TestVolume volume(dims, test::noise_field(8), 12);
  const CompressedVolume &compressed = volume.compressed;
  const auto check = [&](const HostLoops &loops, std::uint64_t no_data) {
    for_each_block(compressed.num_blocks(), [&](const glm::uvec3 &block, std::size_t id) {
      const glm::uvec3 begin = 4u * block, size = glm::min(dims - begin, 4u);
      BlockRange parts[8];
      loops.ranges({compressed.words.data(), compressed.block_begin(id), compressed.block_bits(id),
                    compressed.precision.min_exponent, 1, 0, size.x, size.y, size.z, no_data},
                   parts);
      for (std::uint32_t part = 0; part < 8; ++part) {
        const glm::uvec3 end((part & 1) != 0 ? 1 : size.x, (part & 2) != 0 ? 1 : size.y,
                             (part & 4) != 0 ? 1 : size.z);
        float low = INFINITY, high = -INFINITY;
        for_each_block(end, [&](const glm::uvec3 &at, std::size_t) {
          if ((no_data >> (at.x + 4 * at.y + 16 * at.z) & 1u) != 0) return;
          const glm::uvec3 voxel = begin + at;
          low = std::min(low, volume.voxel(voxel.x, voxel.y, voxel.z));
          high = std::max(high, volume.voxel(voxel.x, voxel.y, voxel.z));
        });
        EXPECT_EQ(parts[part].min, low) << id << ", part " << part << ", no data " << no_data;
        EXPECT_EQ(parts[part].max, high) << id << ", part " << part << ", no data " << no_data;
      }
    });
  };
  for (const HostLoops &loops : all_host_loops()) {
    for (const std::uint64_t no_data : {0ull, 1ull, 0x1111ull, 0x8000'0421'1234'000Full, ~0ull})
      check(loops, no_data);
  }
}

TEST(ReservedMemory, IsZerosUntilWrittenToAndAfterItsRelease) {
  const std::uint64_t page = platform::page_bytes(), num_bytes = (1ull << 36) + 5;
  ReservedMemory memory(num_bytes);  // more than the machine has
  auto *bytes = static_cast<unsigned char *>(memory.data());
  for (const std::uint64_t at : {std::uint64_t{0}, 7 * page - 1, num_bytes - 1}) {
    EXPECT_EQ(bytes[at], 0);
    bytes[at] = 200;
    EXPECT_EQ(bytes[at], 200);
  }
  memory.release();
  for (const std::uint64_t at : {std::uint64_t{0}, 7 * page - 1, num_bytes - 1})
    EXPECT_EQ(bytes[at], 0);
  ReservedMemory(0).release();
  EXPECT_THAT([] { ReservedMemory(1ull << 62); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("MiB of address space")));
}

}  // namespace
}  // namespace isowave::core
