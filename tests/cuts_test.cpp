// Cuts of a volume into bricks, and the order in which an eye sees them.

#include "core/bricks/cuts.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/base/error.hpp"
#include "kernels_cl/portable/grid_dda.h"

namespace isowave::core {
namespace {

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  int whole(int first, int last) { return std::uniform_int_distribution(first, last)(engine_); }
  float real(float first, float end) {
    return std::uniform_real_distribution<float>(first, end)(engine_);
  }

 private:
  std::mt19937 engine_;
};

/// Each block is in one brick, and no brick is empty.
void expect_partition(const glm::ivec3 &blocks, const std::vector<BlockBox> &bricks) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    const BlockBox &a = bricks[i];
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_LT(a.begin[axis], a.end[axis]) << "brick " << i;
      ASSERT_GE(a.begin[axis], 0);
      ASSERT_LE(a.end[axis], blocks[axis]);
    }
    sum += num_blocks(a);
    for (std::size_t j = 0; j < i; ++j) {
      const BlockBox &b = bricks[j];
      ASSERT_TRUE(glm::any(glm::lessThanEqual(a.end, b.begin)) ||
                  glm::any(glm::lessThanEqual(b.end, a.begin)))
          << "bricks " << j << " and " << i << " overlap";
    }
  }
  ASSERT_EQ(sum, num_blocks({glm::ivec3(0), blocks}));
}

/// Where a ray, by exact decisions, is in a brick: its first and last moment there, or nothing.
bool passes(const Ray &ray, const BlockBox &box, RayEvent *enter, RayEvent *exit) {
  const auto plane = [](const glm::ivec3 &at) { return LastPlanes{4 * at.x, 4 * at.y, 4 * at.z}; };
  // A ray in the plane where a brick ends is in the next one.
  const RayAxis axes[] = {ray.x, ray.y, ray.z};
  for (int axis = 0; axis < 3; ++axis) {
    if (axes[axis].d == 0 && axes[axis].o >= 4.0f * static_cast<float>(box.end[axis])) return false;
  }
  *enter = start_event();
  *exit = border_event(INFINITY);
  return clip_to_box(&ray, plane(box.begin), plane(box.end), enter, exit) != 0;
}

/// No brick that a ray visits may come before one that the ray visits earlier.
void check_ray(const Cuts &cuts, const std::vector<std::uint32_t> &places, const Ray &ray) {
  struct Visit {
    RayEvent enter, exit;
    std::uint32_t place;
  };
  std::vector<Visit> visits;
  for (std::size_t i = 0; i < places.size(); ++i) {
    Visit visit{{}, {}, places[i]};
    if (passes(ray, cuts.bricks()[i], &visit.enter, &visit.exit)) visits.push_back(visit);
  }
  std::ranges::sort(visits, {}, &Visit::place);
  for (std::size_t i = 1; i < visits.size(); ++i) {
    ASSERT_FALSE(event_before(visits[i].enter, visits[i - 1].exit))
        << "place " << visits[i].place << " before " << visits[i - 1].place;
  }
}

TEST(Cuts, RaysVisitBricksByAscendingPlace) {
  Random random(1);
  std::uint64_t num_visits = 0;
  constexpr int kTrees = 400, kEyes = 50;
  for (int tree = 0; tree < kTrees; ++tree) {
    const glm::ivec3 blocks(random.whole(1, 9), random.whole(1, 9), random.whole(1, 9));
    const int most = std::min(blocks.x * blocks.y * blocks.z, 40);
    const Cuts cuts = tree % 3 != 0
                          ? Cuts(blocks, static_cast<std::uint32_t>(random.whole(1, most)))
                          : Cuts(blocks, glm::uvec3(random.whole(1, std::min(4, blocks.x)),
                                                    random.whole(1, std::min(4, blocks.y)),
                                                    random.whole(1, std::min(4, blocks.z))));
    expect_partition(blocks, cuts.bricks());
    for (int i = 0; i < kEyes; ++i) {
      // Outside, inside, and on planes between blocks.
      glm::vec3 eye;
      for (int axis = 0; axis < 3; ++axis) {
        const float end = 4.0f * static_cast<float>(blocks[axis]);
        eye[axis] = random.whole(0, 2) == 0
                        ? 4.0f * static_cast<float>(random.whole(-1, blocks[axis] + 1))
                        : random.real(-end, 2 * end);
      }
      const std::vector<std::uint32_t> places = cuts.order_from(eye);
      std::vector<std::uint32_t> sorted = places;
      std::ranges::sort(sorted);
      for (std::uint32_t place = 0; place < sorted.size(); ++place) ASSERT_EQ(sorted[place], place);
      for (int ray = 0; ray < 5; ++ray) {
        SCOPED_TRACE(fmt::format("tree {}, eye {}, ray {}", tree, i, ray));
        glm::vec3 d;
        for (int axis = 0; axis < 3; ++axis)
          d[axis] = random.whole(0, 3) == 0 ? 0.0f : random.real(-1, 1);
        check_ray(cuts, places,
                  make_whole_ray(make_ray_axis(eye.x, d.x), make_ray_axis(eye.y, d.y),
                                 make_ray_axis(eye.z, d.z)));
        ++num_visits;
      }
    }
  }
  EXPECT_EQ(num_visits, 100000u);
}

TEST(Cuts, EvenBricksHaveLikeManyBlocks) {
  for (const std::uint32_t count : {2u, 3u, 5u, 8u, 27u, 64u}) {
    const Cuts cuts(glm::ivec3(64, 60, 50), count);
    const auto [least, most] = std::ranges::minmax(cuts.bricks(), {}, num_blocks);
    EXPECT_LE(double(num_blocks(most)), 1.15 * double(num_blocks(least))) << count;
  }
}

TEST(Cuts, WorkIsSharedOut) {
  // All of it in one corner.
  const BlockBox corner{glm::ivec3(0), glm::ivec3(16, 16, 16)};
  const auto work = [&](const BlockBox &box) {
    const BlockBox part{glm::max(box.begin, corner.begin), glm::min(box.end, corner.end)};
    return glm::any(glm::greaterThanEqual(part.begin, part.end)) ? 0 : num_blocks(part);
  };
  const Cuts cuts(glm::ivec3(64, 64, 64), 8, work);
  expect_partition(glm::ivec3(64), cuts.bricks());
  for (const BlockBox &brick : cuts.bricks()) EXPECT_EQ(work(brick), num_blocks(corner) / 8);
}

TEST(Cuts, MoreBlocksThanIdsHaveRoomFor) {
  const glm::ivec3 blocks(1 << 20, 1 << 20, 1 << 19);  // 2^59 blocks, 2^65 voxels
  const Cuts cuts(blocks, 4096);
  std::uint64_t sum = 0;
  for (const BlockBox &brick : cuts.bricks()) sum += num_blocks(brick);
  EXPECT_EQ(sum, std::uint64_t{1} << 59);
  EXPECT_EQ(num_blocks(cuts.bricks()[17]), std::uint64_t{1} << 47);
  EXPECT_EQ(cuts.order_from(glm::vec3(0))[0], 0u);
}

TEST(Cuts, OneBrickForEachBlock) {
  for (const glm::ivec3 blocks : {glm::ivec3(3, 3, 1), glm::ivec3(2, 2, 2), glm::ivec3(7, 1, 1)}) {
    const std::uint64_t all = num_blocks({glm::ivec3(0), blocks});
    for (std::uint32_t count = 1; count <= all; ++count)
      expect_partition(blocks, Cuts(blocks, count).bricks());
  }
}

TEST(Cuts, GridsCountAlongX) {
  const Cuts cuts(glm::ivec3(5, 4, 3), glm::uvec3(2, 3, 1));
  ASSERT_EQ(cuts.bricks().size(), 6u);
  EXPECT_EQ(cuts.bricks()[0].end, glm::ivec3(2, 1, 3));
  EXPECT_EQ(cuts.bricks()[1].begin, glm::ivec3(2, 0, 0));
  EXPECT_EQ(cuts.bricks()[5].end, glm::ivec3(5, 4, 3));
}

TEST(Cuts, CubesAreNotParted) {
  const glm::ivec3 blocks(21, 17, 9);
  for (const Cuts &cuts : {Cuts(blocks, 7, num_blocks, 4), Cuts(blocks, glm::uvec3(3, 2, 1), 4)}) {
    expect_partition(blocks, cuts.bricks());
    for (const BlockBox &brick : cuts.bricks()) {
      EXPECT_EQ(brick.begin % 4, glm::ivec3(0));
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_TRUE(brick.end[axis] % 4 == 0 || brick.end[axis] == blocks[axis]);
    }
  }
  EXPECT_EQ(Cuts(blocks, glm::uvec3(2, 1, 1), 4).order_from({47, 0, 0})[0], 0u);
  EXPECT_EQ(Cuts(blocks, glm::uvec3(2, 1, 1), 4).order_from({48, 0, 0})[0], 1u);
  EXPECT_THROW(Cuts(blocks, glm::uvec3(7, 1, 1), 4), Error);
}

TEST(Cuts, RefusesWhatCannotBeCut) {
  EXPECT_THROW(Cuts(glm::ivec3(2), 0u), Error);
  EXPECT_THROW(Cuts(glm::ivec3(2), 9u), Error);
  EXPECT_THROW(Cuts(glm::ivec3(2), glm::uvec3(3, 1, 1)), Error);
  EXPECT_THROW(Cuts(glm::ivec3(2), glm::uvec3(0, 1, 1)), Error);
  EXPECT_EQ(parse_bricks("2x3x40"), glm::uvec3(2, 3, 40));
  for (const char *text : {"", "2", "2x2", "2x2x", "2x2x2x2", "0x1x1", "-1x1x1", "1x1x1 ", "axbxc"})
    EXPECT_THROW(parse_bricks(text), Error) << text;
}

}  // namespace
}  // namespace isowave::core
