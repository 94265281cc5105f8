// The block cache over frames of a moving camera: which views need no decoding when they come
// again, in every pipeline. (tests/block_cache_test.cpp has the order of eviction, slot by slot.)

#include <gtest/gtest.h>

#include <numeric>
#include <set>

#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;

constexpr float kIsovalue = 0.1f;

std::uint32_t sum_of(const FrameStats &stats, uint PassCounts::*count) {
  return std::accumulate(
      stats.passes.begin(), stats.passes.end(), 0u,
      [count](std::uint32_t sum, const PassStats &pass) { return sum + pass.counts.*count; });
}

std::uint32_t num_decoded(const FrameStats &stats) {
  return sum_of(stats, &PassCounts::decoded_count) +
         static_cast<std::uint32_t>(stats.normals.decoded_blocks);
}

std::uint32_t num_recycled(const FrameStats &stats) {
  return sum_of(stats, &PassCounts::recycled_count) +
         static_cast<std::uint32_t>(stats.normals.recycled_blocks);
}

/// Close-ups of what lies behind the faces of the volume: hardly any block is in two of them.
std::vector<Camera> close_ups(const glm::dvec3 &dims) {
  std::vector<Camera> cameras;
  const glm::dvec3 centre = 0.5 * (dims - 1.0);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      glm::dvec3 out(0.0);
      out[axis] = side;
      const glm::dvec3 eye = centre + out * (0.5 * dims[axis] + 4.0);
      cameras.push_back(test::camera_along(
          eye, -out, axis == 1 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0), 40.0));
    }
  }
  return cameras;
}

class FrameCacheOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  /// How many blocks a view reads at most: the dual grids of all that its rays look into, which
  /// pipeline `blocks` asks for, and those of its normals.
  std::vector<std::uint32_t> blocks_read(const TestVolume &volume, ImageSize size,
                                         const std::vector<Camera> &cameras) {
    DeviceRenderer ample(
        device_, volume.compressed,
        {.size = size,
         .pipeline = blocks_pipeline(),
         .cache_slots = static_cast<std::uint32_t>(volume.compressed.block_count()),
         .max_speculation = 1});
    std::vector<std::uint32_t> counts;
    for (const Camera &camera : cameras) {
      ample.clear_cache();
      counts.push_back(num_decoded(ample.render({camera, kIsovalue})));
    }
    return counts;
  }

  DeviceRenderer renderer_of(const TestVolume &volume, ImageSize size, std::uint32_t slots,
                             std::uint32_t max_speculation = ISO_MAX_SPECULATION) {
    return {
        device_, volume.compressed,
        GetParam().with({.size = size, .cache_slots = slots, .max_speculation = max_speculation})};
  }

  ocl::Device device_{GetParam().device};
};

/// Views in a random order. If the cache can hold what all views since a view was drawn last have
/// read, it decodes nothing. Without speculation, since a view needs the same blocks then, whatever
/// is cached.
TEST_P(FrameCacheOnDevice, ViewsThatFitAreDecodedOnce) {
  const glm::uvec3 dims(60, 62, 58);
  const ImageSize size{40, 32};
  const TestVolume volume(dims, test::gyroid_field(14));
  const std::vector<Camera> cameras = close_ups(dims);
  const std::vector<std::uint32_t> needs = blocks_read(volume, size, cameras);
  const std::uint32_t most = *std::ranges::max_element(needs);
  ASSERT_GT(most, 40u);
  for (const std::uint32_t slots : {most + most / 4, most + most / 2}) {
    DeviceRenderer renderer = renderer_of(volume, size, slots, 1);
    Random random(slots);
    std::vector<std::size_t> drawn;
    std::size_t num_fitting = 0, num_decoding = 0;
    for (int frame = 0; frame < 60; ++frame) {
      // Often one of the last views, as when somebody looks to and fro.
      const std::size_t view = drawn.size() > 2 && random() % 2 != 0
                                   ? drawn[drawn.size() - 1 - random() % 3]
                                   : random() % cameras.size();
      SCOPED_TRACE(fmt::format("{} slots, frame {}, view {}", slots, frame, view));
      std::set<std::size_t> since{view};
      const auto last = std::find(drawn.rbegin(), drawn.rend(), view);
      for (auto it = drawn.rbegin(); it != last; ++it) since.insert(*it);
      const std::uint32_t needed =
          std::accumulate(since.begin(), since.end(), 0u,
                          [&](std::uint32_t sum, std::size_t v) { return sum + needs[v]; });
      const std::uint32_t decoded = num_decoded(renderer.render({cameras[view], kIsovalue}));
      if (last != drawn.rend() && needed <= slots) {
        EXPECT_EQ(decoded, 0u) << "all views since, this one included, read " << needed
                               << " blocks";
        ++num_fitting;
      }
      num_decoding += decoded != 0;
      drawn.push_back(view);
    }
    EXPECT_GT(num_fitting, 10u) << "else this tests too little";
    EXPECT_GT(num_decoding, 10u) << "else nothing was ever evicted";
  }
}

/// A view that is drawn twice in a row is not decoded twice, unless it needs more blocks than there
/// are slots. Many views, so that the table is rebuilt now and then, which must lose nothing.
TEST_P(FrameCacheOnDevice, ViewsThatComeAgainAtOnceAreDecodedOnce) {
  const glm::uvec3 dims(60, 62, 58);
  const ImageSize size{56, 40};
  const TestVolume volume(dims, test::gyroid_field(14));
  const std::vector<Camera> cameras = close_ups(dims);
  const std::vector<std::uint32_t> needs = blocks_read(volume, size, cameras);
  DeviceRenderer renderer = renderer_of(volume, size, 2 * *std::ranges::max_element(needs));
  Random random(3);
  int num_decoding = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const std::size_t view = random() % cameras.size();
    SCOPED_TRACE(fmt::format("frame {}, view {}", frame, view));
    const FrameStats first = renderer.render({cameras[view], kIsovalue});
    num_decoding += num_decoded(first) != 0;
    const FrameStats again = renderer.render({cameras[view], kIsovalue});
    if (num_recycled(first) == 0) {
      EXPECT_EQ(num_decoded(again), 0u);
    }
  }
  EXPECT_GT(num_decoding, 20) << "else nothing was ever evicted";
}

/// A view of more blocks than there are slots, again and again. Where a few are missing, the others
/// stay, though speculation has asked for more since than there are slots; where many are, the
/// cache is emptied, and no frame is worse off than the first.
TEST_P(FrameCacheOnDevice, ViewsThatDoNotFitAreNoWorseOffThanCold) {
  const glm::uvec3 dims(96, 90, 84);
  const ImageSize size{96, 72};
  const TestVolume volume(dims, test::gyroid_field(24));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  const auto expected = test::twin_hits(volume, camera, size, kIsovalue);
  std::uint32_t needed = 0;
  {
    DeviceRenderer ample =
        renderer_of(volume, size, static_cast<std::uint32_t>(volume.compressed.block_count()));
    needed = num_decoded(ample.render({camera, kIsovalue}));
  }
  int num_kept = 0, num_emptied = 0;
  for (const double share : {0.97, 0.8, 0.6, 0.4}) {
    const auto slots = static_cast<std::uint32_t>(share * needed);
    DeviceRenderer renderer = renderer_of(volume, size, slots);
    FrameStats last = renderer.render({camera, kIsovalue});
    const std::uint32_t cold = num_decoded(last);
    for (int frame = 0; frame < 4; ++frame) {
      SCOPED_TRACE(fmt::format("{} slots, {} blocks needed, warm frame {}", slots, needed, frame));
      const bool emptied =
          num_recycled(last) > slots / (GetParam().device.type == ocl::DeviceType::kCpu ? 2 : 8);
      last = renderer.render({camera, kIsovalue});
      test::expect_same_hits(renderer.hits(), expected, size.width);
      const PassCounts &first = last.passes.front().counts;
      if (emptied) {
        EXPECT_EQ(first.free_count, slots - first.decoded_count);
        ++num_emptied;
      } else {
        EXPECT_LT(first.free_count, slots / 2);
        EXPECT_LT(num_decoded(last), cold);
        ++num_kept;
      }
    }
  }
  EXPECT_GT(num_kept, 0);
  EXPECT_GT(num_emptied, 0);
}

INSTANTIATE_TEST_SUITE_P(Pipelines, FrameCacheOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

}  // namespace
}  // namespace isowave::core
