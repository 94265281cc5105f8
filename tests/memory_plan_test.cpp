// The plan of all device memory against what is really booked, and budgets that are kept or
// refused.

#include "core/render/memory_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/error.hpp"
#include "core/render/renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;
using testing::HasSubstr;

constexpr float kIsovalue = 0.8f;

class MemoryPlanOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  const ImageSize size_ = is_llvmpipe(GetParam().device) ? ImageSize{9, 7} : ImageSize{37, 23};

  /// What the renderer's device has booked is what the plan says, buffer by buffer.
  static void expect_booked(ocl::Device &device, const MemoryPlan &plan) {
    std::map<std::string, std::uint64_t> planned, booked;
    for (const ocl::BufferSize &buffer : plan.buffers) planned[buffer.name] += buffer.bytes();
    for (const auto &[name, entry] : device.ledger().by_name()) {
      if (entry.current != 0) booked[name] = entry.current;
    }
    EXPECT_EQ(booked, planned);
    EXPECT_EQ(device.ledger().current(), plan.total());
    EXPECT_LE(device.ledger().peak(), plan.peak());
  }

  static std::string refusal(const std::function<void()> &action) {
    try {
      action();
    } catch (const Error &error) {
      return error.what();
    }
    ADD_FAILURE() << "nothing was refused";
    return {};
  }
};
INSTANTIATE_TEST_SUITE_P(Devices, MemoryPlanOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(MemoryPlanOnDevice, PlanIsWhatIsBooked) {
  for (const glm::uvec3 dims : {glm::uvec3(9, 10, 11), glm::uvec3(33, 5, 18)}) {
    const std::vector<float> voxels = test::sample(dims, test::noise_field(3));
    const TestVolume fixed_rate(test::grid_info(dims), voxels, 8);
    const TestVolume accurate(test::grid_info(dims), voxels, ErrorGoal{0.01});
    for (const TestVolume *volume : {&fixed_rate, &accurate}) {
      if (volume == &accurate && dims.x == 33) continue;  // its plan is like the other's
      for (const auto &[slots, place] : {std::pair(0u, StreamPlace::kDevice),
                                         {8u, StreamPlace::kDevice},
                                         {100u, StreamPlace::kHost}}) {
        SCOPED_TRACE(fmt::format("{} x {} x {}, {} bits per block, {} slots", dims.x, dims.y,
                                 dims.z, volume->compressed.bits_per_block, slots));
        ocl::Device device(GetParam().device);
        const Renderer renderer(device, volume->compressed,
                                GetParam().with({.size = size_,
                                                 .cache_slots = slots,
                                                 .stream = place,
                                                 .with_kept_picture = slots == 8}));
        expect_booked(device, renderer.memory_plan());
      }
    }
  }
}

/// From the smallest budget accepted to an ample one: kept, used, and the same picture.
TEST_P(MemoryPlanOnDevice, BudgetsAreKept) {
  const TestVolume volume({30, 27, 33}, test::gyroid_field(10), 8);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  const auto expected = test::twin_hits(volume, camera, size_, kIsovalue);
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    const MemoryRequest request{size_.num_pixels(), GetParam().pipeline, GetParam().grouping, 64,
                                place};
    const std::uint64_t least = plan_memory(volume.compressed, request, kMinCacheSlots).peak();
    std::uint32_t last_slots = 0;
    for (const std::uint64_t budget : {least, least + 10'000, least + 50'000, least + 1'000'000}) {
      SCOPED_TRACE(
          fmt::format("stream on {}, budget {}, least {}", to_string(place), budget, least));
      ocl::Device device(GetParam().device);
      Renderer renderer(device, volume.compressed,
                        GetParam().with({.size = size_, .memory_budget = budget, .stream = place}));
      renderer.render({camera, kIsovalue});
      test::expect_same_hits(renderer.hits(), expected, size_.width);
      renderer.shade();
      expect_booked(device, renderer.memory_plan());
      EXPECT_LE(device.ledger().peak(), budget);
      EXPECT_EQ(renderer.memory_plan().stream, place);
      const std::uint32_t slots = renderer.memory_plan().cache_slots;
      EXPECT_EQ(renderer.options().cache_slots, slots);
      EXPECT_TRUE(slots == volume.compressed.block_count() ||
                  plan_memory(volume.compressed, request, slots + 1).peak() > budget)
          << "a slot more would have done";
      EXPECT_GE(slots, last_slots);
      last_slots = slots;
    }
    EXPECT_EQ(last_slots, volume.compressed.block_count());
  }
}

/// As the budget grows, the stream moves from the host to the device, once; the smallest budget is
/// below the stream's size.
TEST_P(MemoryPlanOnDevice, TheStreamMovesToTheHostWhereTheBudgetIsTight) {
  const TestVolume volume({30, 27, 33}, test::gyroid_field(10), 32);
  const std::uint64_t stream_bytes = volume.compressed.word_count() * sizeof(uint);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  const auto expected = test::twin_hits(volume, camera, size_, kIsovalue);
  const MemoryRequest request{size_.num_pixels(), GetParam().pipeline, GetParam().grouping, 64,
                              StreamPlace::kHost};
  const std::uint64_t least = plan_memory(volume.compressed, request, kMinCacheSlots).peak();
  EXPECT_LT(least, stream_bytes) << "else this scene tests nothing";
  std::vector<StreamPlace> places;
  for (const std::uint64_t budget : {least, stream_bytes - 1, least + stream_bytes,
                                     least + 2 * stream_bytes, least + 10 * stream_bytes}) {
    SCOPED_TRACE(fmt::format("budget {}, least {}, stream {}", budget, least, stream_bytes));
    ocl::Device device(GetParam().device);
    Renderer renderer(device, volume.compressed,
                      GetParam().with({.size = size_, .memory_budget = budget}));
    const FrameStats stats = renderer.render({camera, kIsovalue});
    test::expect_same_hits(renderer.hits(), expected, size_.width);
    renderer.shade();
    expect_booked(device, renderer.memory_plan());
    EXPECT_LE(device.ledger().peak(), budget);
    places.push_back(renderer.memory_plan().stream);
    EXPECT_EQ(renderer.options().stream, places.back());
    EXPECT_EQ(stats.uploaded_blocks != 0, places.back() == StreamPlace::kHost);
    EXPECT_FALSE(renderer.memory_plan().reason.empty());
  }
  EXPECT_EQ(places.front(), StreamPlace::kHost);
  EXPECT_EQ(places.back(), StreamPlace::kDevice);
  EXPECT_TRUE(std::is_sorted(places.rbegin(), places.rend())) << "kDevice is below kHost";
  ocl::Device device(GetParam().device);
  EXPECT_THAT(refusal([&] {
                Renderer(device, volume.compressed,
                         GetParam().with({.size = size_, .memory_budget = least - 1}));
              }),
              HasSubstr(fmt::format("{} would do", least)));
}

/// Slots that were asked for leave the choice to the budget too; a place that was asked for is
/// never left.
TEST_P(MemoryPlanOnDevice, SmallPlacesOfTheStreamWithSlotsAskedFor) {
  const TestVolume volume({17, 18, 19}, test::noise_field(3), 32);
  MemoryRequest request{size_.num_pixels(), GetParam().pipeline, GetParam().grouping, 64};
  const auto plan_of = [&](std::uint64_t budget, std::uint32_t slots) {
    return plan_with_slots(volume.compressed, request, budget, slots);
  };
  const std::uint64_t on_device = plan_memory(volume.compressed, request, 10).peak();
  EXPECT_EQ(plan_of(on_device, 10).stream, StreamPlace::kDevice);
  EXPECT_EQ(plan_of(on_device, 10).peak(), on_device);
  const MemoryPlan on_host = plan_of(on_device - 1, 10);
  EXPECT_EQ(on_host.stream, StreamPlace::kHost);
  EXPECT_EQ(on_host.window_blocks, 8u);
  EXPECT_LT(on_host.peak(), on_device);
  request.window_blocks = 200;  // more than the volume has
  EXPECT_EQ(plan_of(on_device - 1, 10).stream, StreamPlace::kDevice);
  request.window_blocks = 0;
  request.largest_stream_part = 32 * 256 + 264;  // 125 blocks of 256 bytes: four parts
  EXPECT_EQ(plan_of(~std::uint64_t(0), 10).stream, StreamPlace::kDevice);
  request.largest_stream_part = 31 * 256 + 264;  // five
  EXPECT_EQ(plan_of(~std::uint64_t(0), 10).stream, StreamPlace::kHost);
  request.stream = StreamPlace::kDevice;
  EXPECT_THAT(refusal([&] { plan_of(on_device, 10); }), HasSubstr("leave it on the host"));
}

TEST_P(MemoryPlanOnDevice, SmallBudgetsTooSmallAreRefusedWithTheOneThatWouldDo) {
  const TestVolume volume({9, 10, 11}, test::noise_field(3), 8);
  const MemoryRequest request{size_.num_pixels(), GetParam().pipeline, GetParam().grouping, 64};
  const std::uint64_t least = plan_memory(volume.compressed, request, kMinCacheSlots).peak();
  ocl::Device device(GetParam().device);
  const auto render_within = [&](std::uint64_t budget, std::uint32_t slots) {
    Renderer(device, volume.compressed,
             GetParam().with({.size = size_, .memory_budget = budget, .cache_slots = slots}));
  };
  EXPECT_THAT(refusal([&] { render_within(least - 1, 0); }),
              HasSubstr(fmt::format("{} would do", least)));
  EXPECT_THAT(refusal([&] { render_within(1, 0); }), HasSubstr(fmt::format("{} would do", least)));
  EXPECT_THAT(refusal([&] { render_within(least, 9); }), HasSubstr("more than the budget"));
  EXPECT_EQ(device.ledger().peak(), 0u) << "refused before any memory was taken";
}

class MemoryPlanOfLevelsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, MemoryPlanOfLevelsOnDevice,
                         testing::ValuesIn(devices_under_test()), device_test_name);

/// Where scratch for the ranges of the last level is what the most memory is taken with, nothing
/// but what is needed by then is there.
TEST_P(MemoryPlanOfLevelsOnDevice, PeakOfSetupIsPlanned) {
  const glm::uvec3 dims(128, 128, 8);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::noise_field(3)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 2});
  ocl::Device device(GetParam());
  const Renderer renderer(device, volume,
                          {.size = {9, 7},
                           .cache_slots = 8,
                           .stream = StreamPlace::kHost,
                           .window_blocks = 1024,
                           .with_levels = true});
  const MemoryPlan &plan = renderer.memory_plan();
  EXPECT_GT(plan.setup_bytes, plan.total()) << "else this scene tests nothing";
  EXPECT_EQ(device.ledger().peak(), plan.setup_bytes);
  EXPECT_EQ(device.ledger().current(), plan.total());
}

}  // namespace
}  // namespace isowave::core
