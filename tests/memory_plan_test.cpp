// The plan of all device memory against what is really booked, and budgets that are kept or
// refused.

#include "core/render/memory_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;
using testing::AllOf;
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
        const DeviceRenderer renderer(device, volume->compressed,
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
    const MemoryRequest request{size_.num_pixels(), GetParam().pipeline, 64, place};
    const std::uint64_t least = plan_memory(volume.compressed, request, kMinCacheSlots).peak();
    std::uint32_t last_slots = 0;
    for (const std::uint64_t budget : {least, least + 10'000, least + 50'000, least + 1'000'000}) {
      SCOPED_TRACE(
          fmt::format("stream on {}, budget {}, least {}", to_string(place), budget, least));
      ocl::Device device(GetParam().device);
      DeviceRenderer renderer(
          device, volume.compressed,
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
  const MemoryRequest request{size_.num_pixels(), GetParam().pipeline, 64, StreamPlace::kHost};
  const std::uint64_t least = plan_memory(volume.compressed, request, kMinCacheSlots).peak();
  EXPECT_LT(least, stream_bytes) << "else this scene tests nothing";
  std::vector<StreamPlace> places;
  for (const std::uint64_t budget : {least, stream_bytes - 1, least + stream_bytes,
                                     least + 2 * stream_bytes, least + 10 * stream_bytes}) {
    SCOPED_TRACE(fmt::format("budget {}, least {}, stream {}", budget, least, stream_bytes));
    ocl::Device device(GetParam().device);
    DeviceRenderer renderer(device, volume.compressed,
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
                DeviceRenderer(device, volume.compressed,
                               GetParam().with({.size = size_, .memory_budget = least - 1}));
              }),
              HasSubstr(fmt::format("{} would do", least)));
}

/// Slots that were asked for leave the choice to the budget too; a place that was asked for is
/// never left.
TEST_P(MemoryPlanOnDevice, SmallPlacesOfTheStreamWithSlotsAskedFor) {
  const TestVolume volume({17, 18, 19}, test::noise_field(3), 32);
  MemoryRequest request{size_.num_pixels(), GetParam().pipeline, 64};
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
  const MemoryRequest request{size_.num_pixels(), GetParam().pipeline, 64};
  const std::uint64_t least = plan_memory(volume.compressed, request, kMinCacheSlots).peak();
  ocl::Device device(GetParam().device);
  const auto render_within = [&](std::uint64_t budget, std::uint32_t slots) {
    DeviceRenderer(device, volume.compressed,
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
TEST_P(MemoryPlanOnDevice, SmallDefaultsStayWithinTheLargestBuffer) {
  const TestVolume volume({30, 27, 33}, test::gyroid_field(10), 8);
  ocl::DeviceInfo info = GetParam().device;
  const auto plan = [&](std::uint64_t largest) {
    info.capabilities.largest_allocation = largest;
    const ocl::Device device(info);
    return make_plan(device, volume.compressed,
                     checked(GetParam().with({.size = size_}), volume.compressed, device));
  };
  const std::uint32_t all = plan(1 << 30).most_slots;
  for (const std::uint64_t largest : {120'000u, 60'000u}) {
    const MemoryPlan small = plan(largest);
    EXPECT_LT(small.most_slots, all);
    EXPECT_GE(small.most_slots, kMinCacheSlots);
    for (const ocl::BufferSize &buffer : resized(small, small.most_slots).buffers)
      EXPECT_LE(buffer.bytes(), largest) << buffer.name;
  }
  EXPECT_THAT(refusal([&] { plan(1000); }), AllOf(HasSubstr("bytes, and device '"),
                                                  HasSubstr("gives at most 1000 to one buffer")));
}

TEST_P(MemoryPlanOfLevelsOnDevice, PeakOfSetupIsPlanned) {
  const glm::uvec3 dims(128, 128, 8);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::noise_field(3)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 2});
  ocl::Device device(GetParam());
  const DeviceRenderer renderer(device, volume,
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

// ---- caches that grow

TEST(MemoryPlan, FirstSlotsAreForWhatAFrameNeeds) {
  constexpr std::uint64_t kRays = 1280 * 720;
  EXPECT_EQ(first_cache_slots(128 * 128 * 128, kRays), 12u * 128 * 128) << "of the volume";
  EXPECT_EQ(first_cache_slots(256 * 256 * 256, kRays), kRays / 8 * 5) << "of the picture";
  EXPECT_EQ(first_cache_slots(128 * 128 * 128, kRays, true), 24u * 128 * 128) << "and of its hits";
  EXPECT_EQ(first_cache_slots(64 * 64 * 64, 800), 16'384u) << "not worth saving";
  EXPECT_EQ(first_cache_slots(16'384, kRays), 16'384u) << "all";
  EXPECT_EQ(first_cache_slots(27, kRays), 27u) << "all";
  EXPECT_EQ(first_cache_slots(1, 1), kMinCacheSlots);
}

TEST(MemoryPlan, ACacheGrowsByWhatItLackedAtMostToFourTimes) {
  MemoryPlan plan;
  plan.cache_slots = 1600;
  plan.most_slots = 3000;
  EXPECT_EQ(grown_cache_slots(plan, 0), 1600u);
  EXPECT_EQ(grown_cache_slots(plan, 50), 1600u) << "one of 32: the next frame finds enough";
  EXPECT_EQ(grown_cache_slots(plan, 51), 2060u);
  EXPECT_EQ(grown_cache_slots(plan, 400), 2500u) << "a quarter more than was needed";
  EXPECT_EQ(grown_cache_slots(plan, 100'000), 3000u) << "no more than it may";
  plan.most_slots = 10'000;
  EXPECT_EQ(grown_cache_slots(plan, 100'000), 6400u);
  plan.most_slots = plan.cache_slots;
  EXPECT_FALSE(plan.can_grow());
  EXPECT_EQ(grown_cache_slots(plan, 100'000), 1600u);
}

/// A volume of that size with 4 bits a voxel, without data: enough for a plan.
CompressedVolume volume_of_size(const glm::uvec3 &dims) {
  CompressedVolume volume;
  volume.info = test::grid_info(dims);
  volume.bits_per_block = 4 * ISO_BLOCK_VOXELS;
  return volume;
}

/// Usher, Dyken and Kumar give 191 MB for 512^3 at 1280 x 720; the decoded volume has 537 MB.
TEST_P(MemoryPlanOfLevelsOnDevice, DefaultIsBelowThePaperAndTheDecodedVolume) {
  const ocl::Device device(GetParam());
  MemoryRequest request{.num_rays = 1280 * 720};
  const auto plan_of = [&](const glm::uvec3 &dims) {
    const CompressedVolume volume = volume_of_size(dims);
    return plan_to_grow(device, volume, request, 4'000'000'000,
                        static_cast<std::uint32_t>(
                            std::min<std::uint64_t>(volume.block_count(), kAmpleCacheSlots)));
  };
  if (device.capabilities().largest_allocation < 512u << 20)
    GTEST_SKIP() << "a device that cannot have the largest cache";
  const MemoryPlan plan = plan_of({512, 512, 512});
  EXPECT_LE(plan.peak(), 191'000'000u);
  EXPECT_EQ(plan.cache_slots, 196'608u);
  EXPECT_EQ(plan.most_slots, 128u * 128 * 128) << "all blocks";
  EXPECT_TRUE(plan.can_grow());
  EXPECT_LE(plan_of({256, 256, 256}).peak(), 256u * 256 * 256 * 4) << "with fewer slots";
  EXPECT_GE(plan_of({256, 256, 256}).cache_slots, 24'576u) << "but not with too few";
  request.num_rays = 1920 * 1080;
  EXPECT_EQ(plan_of({256, 256, 256}).cache_slots, 49'152u) << "the picture alone has more bytes";
}

/// What growing makes of a plan is what would have been planned.
TEST_P(MemoryPlanOfLevelsOnDevice, GrownPlansArePlans) {
  ArrayReader reader(test::grid_info({40, 41, 42}),
                     test::sample({40, 41, 42}, test::noise_field(3)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 2});
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    for (const PipelinePtr &pipeline :
         {rays_pipeline(), blocks_pipeline(), blocks_pipeline({.grouping = Grouping::kRadix})}) {
      const MemoryRequest request{.num_rays = 500,
                                  .pipeline = pipeline,
                                  .stream = place,
                                  .window_blocks = 8,
                                  .with_levels = pipeline->has_levels()};
      const MemoryPlan grown = resized(plan_memory(volume, request, 20), 300),
                       planned = plan_memory(volume, request, 300);
      EXPECT_EQ(grown.cache_slots, planned.cache_slots);
      ASSERT_EQ(grown.buffers.size(), planned.buffers.size());
      for (std::size_t i = 0; i < grown.buffers.size(); ++i) {
        const ocl::BufferSize &a = *(grown.buffers.begin() + std::ptrdiff_t(i)),
                              &b = *(planned.buffers.begin() + std::ptrdiff_t(i));
        EXPECT_EQ(a.name, b.name);
        EXPECT_EQ(a.bytes(), b.bytes()) << a.name;
      }
    }
  }
}

class GrowingCacheOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  const bool is_slow_ = is_simulator(GetParam().device) || is_llvmpipe(GetParam().device);
  const ImageSize size_ = is_slow_ ? ImageSize{9, 7} : ImageSize{37, 23};
  const TestVolume volume_{{22, 21, 20}, test::gyroid_field(10), 8};
  const Camera camera_ = orbit_cameras(volume_.info(), 1)[0];
  const std::vector<HitRecord> expected_ = test::twin_hits(volume_, camera_, size_, kIsovalue);
  ocl::Device device_{GetParam().device};

  DeviceRenderer renderer_of(RendererOptions options) {
    options.size = size_;
    return {device_, volume_.compressed, GetParam().with(options)};
  }
  FrameStats draw(DeviceRenderer &renderer, const FrameRequest &request) {
    const FrameStats stats = renderer.render(request);
    if (!stats.cancelled) test::expect_same_hits(renderer.hits(), expected_, size_.width);
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
    EXPECT_EQ(renderer.options().cache_slots, renderer.memory_plan().cache_slots);
    return stats;
  }
  FrameStats draw(DeviceRenderer &renderer) {
    return draw(renderer, {.camera = camera_, .isovalue = kIsovalue});
  }
  static std::uint64_t decoded(const FrameStats &stats) {
    std::uint64_t sum = stats.normals.decoded_blocks;
    for (const PassStats &pass : stats.passes) sum += pass.counts.decoded_count;
    return sum;
  }
};
INSTANTIATE_TEST_SUITE_P(Devices, GrowingCacheOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(GrowingCacheOnDevice, UntilAFrameFits) {
  DeviceRenderer renderer = renderer_of({.first_slots = 16});
  const std::uint64_t planned =
      resized(renderer.memory_plan(), renderer.memory_plan().most_slots).peak();
  EXPECT_EQ(renderer.memory_plan().most_slots, volume_.compressed.block_count());
  std::vector<std::uint32_t> slots;
  std::uint64_t last_decoded = 1;
  for (int frame = 0; frame < 8 && last_decoded != 0; ++frame) {
    last_decoded = decoded(draw(renderer));
    slots.push_back(renderer.memory_plan().cache_slots);
    EXPECT_TRUE(frame == 0 || slots[frame] <= 4 * slots[frame - 1]) << slots[frame];
  }
  EXPECT_EQ(slots.front(), 16u) << "not before the frame that finds them missing";
  EXPECT_TRUE(std::ranges::is_sorted(slots));
  EXPECT_GT(slots.back(), 32u);
  EXPECT_LE(device_.ledger().peak(), planned) << "the old cache goes before the new one comes";
  EXPECT_EQ(last_decoded, 0u) << "now all that the frame needs has slots";
  draw(renderer);
  EXPECT_EQ(renderer.memory_plan().cache_slots, slots.back()) << "it is enough";
}

/// The next view finds free slots, so that it need not free those of the view before.
TEST_P(GrowingCacheOnDevice, UntilTwoViewsFit) {
  if (is_simulator(GetParam().device)) GTEST_SKIP() << "takes a simulator too long";
  FrameRequest first{.camera = camera_, .isovalue = kIsovalue}, second = first;
  first.camera.fovy_deg = second.camera.fovy_deg = 9;
  second.camera = turned(first.camera, 90);
  DeviceRenderer ample = renderer_of({});
  const auto needed = static_cast<std::uint32_t>(decoded(ample.render(first)));
  const std::uint64_t both = needed + decoded(ample.render(second));
  const std::vector<HitRecord> expected = ample.hits();
  ASSERT_GT(both, needed + needed / 4) << "else this scene tests nothing";
  DeviceRenderer renderer = renderer_of({.first_slots = needed + needed / 8});
  const std::uint32_t slots = renderer.memory_plan().cache_slots;
  for (int frame = 0; frame < 3; ++frame) renderer.render(first);
  EXPECT_EQ(renderer.memory_plan().cache_slots, slots) << "one view fits";
  for (int round = 0; round < 6; ++round) {
    renderer.render(first);
    renderer.render(second);
    test::expect_same_hits(renderer.hits(), expected, size_.width);
  }
  EXPECT_GE(renderer.memory_plan().cache_slots, both);
  EXPECT_EQ(decoded(renderer.render(first)), 0u);
  EXPECT_EQ(decoded(renderer.render(second)), 0u);
}

TEST_P(GrowingCacheOnDevice, NotWhereSlotsOrABudgetAreGiven) {
  for (const RendererOptions &options :
       {RendererOptions{.cache_slots = 16, .first_slots = 16},
        RendererOptions{.memory_budget = renderer_of({.cache_slots = 16}).memory_plan().peak(),
        .first_slots = 9}}) {
    DeviceRenderer renderer = renderer_of(options);
    const std::uint32_t slots = renderer.memory_plan().cache_slots;
    EXPECT_FALSE(renderer.memory_plan().can_grow());
    for (int frame = 0; frame < 2; ++frame) draw(renderer);
    EXPECT_EQ(renderer.memory_plan().cache_slots, slots);
  }
  EXPECT_THAT([&] { renderer_of({.first_slots = 7}); },
              testing::ThrowsMessage<Error>(HasSubstr("begin with 7 slots")));
}

/// A device that gives no more, then less: the cache stays, or shrinks; the pictures stay.
TEST_P(GrowingCacheOnDevice, WhereMemoryIsShort) {
  for (const bool less : {true, false}) {
    SCOPED_TRACE(less);
    if (!less && is_slow_) break;
    DeviceRenderer renderer = renderer_of({.first_slots = 24});
    draw(renderer);
    device_.ledger().set_limit(device_.ledger().current() - (less ? 1 : 0));
    draw(renderer);
    EXPECT_EQ(renderer.memory_plan().cache_slots, less ? 12u : 24u);
    EXPECT_FALSE(renderer.memory_plan().can_grow()) << "it does not try again";
    device_.ledger().set_limit(UINT64_MAX);
    const std::uint32_t slots = renderer.memory_plan().cache_slots;
    draw(renderer);
    EXPECT_EQ(renderer.memory_plan().cache_slots, slots);
  }
}

/// Frames that were stopped have asked for blocks that were not brought.
TEST_P(GrowingCacheOnDevice, AfterFramesThatWereStopped) {
  for (const std::size_t last : {1u, 2u, 5u}) {
    SCOPED_TRACE(last);
    DeviceRenderer renderer = renderer_of({.first_slots = 16});
    FrameRequest stopped{.camera = camera_, .isovalue = kIsovalue};
    std::size_t num_passes = 0;
    stopped.on_pass = [&](const PassStats &) { return ++num_passes < last; };
    draw(renderer, stopped);
    draw(renderer);
    draw(renderer);
    EXPECT_GT(renderer.memory_plan().cache_slots, 16u);
    if (is_slow_) break;
  }
}

/// What a frame's ambient rays need is the frame's: the cache grows until it has all blocks of
/// both.
TEST_P(GrowingCacheOnDevice, UntilAmbientRaysFit) {
  if (is_simulator(GetParam().device)) GTEST_SKIP() << "takes a simulator too long";
  FrameRequest request{.camera = camera_, .isovalue = kIsovalue};
  request.camera.fovy_deg = 9;  // its own rays see a part of the volume
  const auto needed = [](const FrameStats &stats) {
    return decoded(stats) + stats.ambient.decoded_blocks;
  };
  DeviceRenderer ample = renderer_of({.with_given_rays = true}),
                 renderer = renderer_of({.first_slots = 16, .with_given_rays = true});
  const std::uint64_t by_camera = needed(ample.render(request));
  ample.clear_cache();
  request.ambient_rays = 6;
  const std::uint64_t by_both = needed(ample.render(request));
  EXPECT_GT(by_both, by_camera) << "else this scene tests nothing";
  std::uint64_t num_decoded = 1;
  for (int frame = 0; frame < 8 && num_decoded != 0; ++frame)
    num_decoded = needed(renderer.render(request));
  EXPECT_EQ(num_decoded, 0u);
  EXPECT_GE(renderer.memory_plan().cache_slots, by_both);
}

/// A cache grows between frames with ambient rays, and between lists of rays.
TEST_P(GrowingCacheOnDevice, WithRaysOfAnyOrigin) {
  if (is_simulator(GetParam().device)) GTEST_SKIP() << "takes a simulator too long";
  DeviceRenderer ample = renderer_of({.with_given_rays = true}),
                 renderer = renderer_of({.first_slots = 16, .with_given_rays = true});
  const FrameRequest request{.camera = camera_, .isovalue = kIsovalue, .ambient_rays = 2};
  const std::vector<WorldRay> rays(3, {camera_.eye, camera_.at - camera_.eye});
  ample.render(request);
  const auto expected_rays = ample.cast_rays(rays, kIsovalue, Normals::kSmooth);
  for (int frame = 0; frame < 3; ++frame) {
    renderer.render(request);
    EXPECT_EQ(renderer.open().counts, ample.open().counts);
    test::expect_same_hits(renderer.cast_rays(rays, kIsovalue, Normals::kSmooth), expected_rays, 3);
    test::expect_same_hits(renderer.hits(), expected_, size_.width);
  }
  EXPECT_GT(renderer.memory_plan().cache_slots, 32u);
}

/// A stream on the host, with several levels, has more that depends on the slots.
TEST_P(MemoryPlanOfLevelsOnDevice, CachesOfLevelsGrow) {
  const glm::uvec3 dims(40, 41, 42);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::gyroid_field(10)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 2});
  const ImageSize size = is_llvmpipe(GetParam()) ? ImageSize{9, 7} : ImageSize{37, 23};
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  const FrameRequest request{.camera = camera, .isovalue = kIsovalue, .voxel_pixels = 1};
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    ocl::Device device(GetParam());
    DeviceRenderer ample(device, volume, {.size = size, .stream = place, .with_levels = true});
    ample.render(request);
    const std::vector<HitRecord> expected = ample.hits();
    const std::uint64_t others = device.ledger().current();
    DeviceRenderer renderer(
        device, volume, {.size = size, .first_slots = 16, .stream = place, .with_levels = true});
    for (int frame = 0; frame < 3; ++frame) {
      renderer.render(request);
      test::expect_same_hits(renderer.hits(), expected, size.width);
      EXPECT_EQ(device.ledger().current() - others, renderer.memory_plan().total());
    }
    EXPECT_GT(renderer.memory_plan().cache_slots, 32u);
  }
}

}  // namespace
}  // namespace isowave::core
