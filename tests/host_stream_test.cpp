// Frames of a compressed volume that stays on the host, or in several buffers: the same picture,
// bit for bit, and always progress.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/run_program.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using test::twin_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kTiny{6, 5}, kSmall{12, 8}, kMedium{80, 54};
constexpr float kIsovalue = 0.8f;

TestVolume small_volume() {
  return TestVolume({9, 10, 11}, test::noise_field(21), 8);
}
/// Blocks of lengths of their own.
TestVolume accurate_volume(const glm::uvec3 &dims, double tolerance) {
  return TestVolume(test::grid_info(dims), test::sample(dims, test::gyroid_field(10)),
                    ErrorGoal{tolerance});
}
TestVolume medium_volume() {
  return TestVolume({30, 27, 33}, test::gyroid_field(10), 8);
}

std::uint64_t num_decoded(const FrameStats &stats) {
  return std::accumulate(
      stats.passes.begin(), stats.passes.end(), stats.normals.decoded_blocks,
      [](std::uint64_t sum, const PassStats &pass) { return sum + pass.counts.decoded_count; });
}

class HostStreamOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  bool is_slow() const { return is_llvmpipe(device_.info()); }

  DeviceRenderer renderer_of(const CompressedVolume &volume, RendererOptions options) {
    options.stream = StreamPlace::kHost;
    return {device_, volume, GetParam().with(options)};
  }

  /// Two views, each three times by one renderer, once with cells' normals; for the simulator one
  /// view twice.
  void check(const TestVolume &volume, const RendererOptions &options) {
    SCOPED_TRACE(fmt::format("{} slots, window of {}", options.cache_slots, options.window_blocks));
    DeviceRenderer renderer = renderer_of(volume.compressed, options);
    const bool is_simulated = is_simulator(device_.info());
    for (const Camera &camera : orbit_cameras(volume.info(), is_simulated ? 1 : 2)) {
      const auto expected = twin_hits(volume, camera, options.size, kIsovalue);
      std::vector order = {Normals::kSmooth, Normals::kCell, Normals::kSmooth};
      if (is_simulated) order.pop_back();
      for (const Normals normals : order) {
        const FrameStats stats =
            renderer.render({.camera = camera, .isovalue = kIsovalue, .normals = normals});
        expect_same_hits(renderer.hits(),
                         normals == Normals::kSmooth
                             ? expected
                             : twin_hits(volume, camera, options.size, kIsovalue, normals),
                         options.size.width);
        EXPECT_EQ(stats.uploaded_blocks, num_decoded(stats));
        if (!volume.compressed.is_indexed()) {
          EXPECT_EQ(stats.uploaded_bytes,
                    stats.uploaded_blocks * volume.compressed.bits_per_block / 8);
        }
        EXPECT_EQ(stats.passes.back().counts.next_active_count, 0u);
      }
    }
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
  }

  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Devices, HostStreamOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(HostStreamOnDevice, SmallFrameIsTheTwins) {
  const TestVolume volume = small_volume();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer =
      renderer_of(volume.compressed, {.size = kTiny, .cache_slots = 20, .window_blocks = 8});
  renderer.render({camera, kIsovalue});
  expect_same_hits(renderer.hits(), twin_hits(volume, camera, kTiny, kIsovalue), kTiny.width);
}

TEST_P(HostStreamOnDevice, WindowsAndCaches) {
  const TestVolume volume = medium_volume();
  for (const std::uint32_t slots : {13u, 64u, 200u, 504u}) {
    if (is_slow() && slots != 200) continue;
    for (const std::uint32_t window : {8u, 33u, 0u, 5000u}) {
      if (is_slow() && window != 33) continue;
      check(volume,
            {.size = slots < 64 ? kSmall : kMedium, .cache_slots = slots, .window_blocks = window});
    }
  }
}

TEST_P(HostStreamOnDevice, SmallBlocksOfLengthsOfTheirOwn) {
  check(accurate_volume({9, 10, 11}, 0.01), {.size = kTiny, .cache_slots = 20, .window_blocks = 8});
}

TEST_P(HostStreamOnDevice, BlocksOfLengthsOfTheirOwn) {
  for (const double tolerance : {0.2, 1e-5}) {
    const TestVolume volume = accurate_volume({30, 27, 33}, tolerance);
    for (const std::uint32_t window : {8u, 0u, 5000u}) {
      check(volume, {.size = kMedium, .cache_slots = 200, .window_blocks = window});
    }
  }
}

/// One dual grid for all rays, and one at a time through the window.
TEST_P(HostStreamOnDevice, OneDualGridAtATime) {
  check(small_volume(),
        {.size = kTiny, .cache_slots = 8, .max_speculation = 1, .window_blocks = 8});
  if (!is_slow()) check(medium_volume(), {.size = kTiny, .cache_slots = 8, .window_blocks = 8});
}

TEST_P(HostStreamOnDevice, AwkwardRates) {
  for (const std::uint32_t rate : {1u, 5u, 32u}) {
    SCOPED_TRACE(rate);
    check(TestVolume({30, 27, 33}, test::gyroid_field(10), rate),
          {.size = kSmall, .window_blocks = 50});
  }
}

TEST_P(HostStreamOnDevice, WarmFrameUploadsNothing) {
  const TestVolume volume = small_volume();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer = renderer_of(volume.compressed, {.size = kSmall});
  EXPECT_GT(renderer.render({camera, kIsovalue}).uploaded_blocks, 0u);
  EXPECT_EQ(renderer.render({camera, kIsovalue}).uploaded_blocks, 0u);
  EXPECT_EQ(renderer.render({camera, kIsovalue}).uploaded_bytes, 0u);
  renderer.clear_cache();
  EXPECT_GT(renderer.render({camera, kIsovalue}).uploaded_blocks, 0u);
}

TEST_P(HostStreamOnDevice, CancelledFrameLeavesNoTrace) {
  const TestVolume volume = small_volume();
  const auto cameras = orbit_cameras(volume.info(), 2);
  DeviceRenderer renderer =
      renderer_of(volume.compressed,
                  {.size = kTiny, .cache_slots = 8, .max_speculation = 2, .window_blocks = 8});
  for (const std::size_t stop_after : {1u, 2u}) {
    SCOPED_TRACE(stop_after);
    std::size_t calls = 0;
    const FrameStats cancelled = renderer.render(
        {.camera = cameras[0], .isovalue = kIsovalue, .on_pass = [&](const PassStats &) {
           return ++calls < stop_after;
         }});
    EXPECT_TRUE(cancelled.cancelled);
    EXPECT_GT(cancelled.passes.back().counts.next_active_count, 0u)
        << "else there was nothing to cancel";
    EXPECT_EQ(test::num_hits(renderer.hits()), cancelled.rays_hit);
    renderer.render({cameras[1], kIsovalue});
    expect_same_hits(renderer.hits(), twin_hits(volume, cameras[1], kTiny, kIsovalue), kTiny.width);
  }
}

TEST_P(HostStreamOnDevice, ProfilingChangesNothing) {
  const TestVolume volume = small_volume();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  ocl::Device device(GetParam().device, true);
  DeviceRenderer renderer(
      device, volume.compressed,
      GetParam().with({.size = kSmall, .stream = StreamPlace::kHost, .window_blocks = 8}));
  const FrameStats stats = renderer.render({camera, kIsovalue});
  expect_same_hits(renderer.hits(), twin_hits(volume, camera, kSmall, kIsovalue), kSmall.width);
  const bool uploads = std::ranges::any_of(
      stats.passes, [](const PassStats &pass) { return pass.stage_ms.contains("upload"); });
  EXPECT_TRUE(uploads);
}

/// From the file, which is read when a renderer is made: a file that is cut later is found out
/// then.
TEST_P(HostStreamOnDevice, FilesAlsoCutOnes) {
  const test::TemporaryFolder folder;
  const TestVolume volume = medium_volume();
  const auto path = folder / "a.zfp";
  ArrayReader source(volume.info(), test::sample(volume.info().dims, test::gyroid_field(10)));
  compress_to_file(source, {.rate = 8}, path);
  const CompressedVolume opened = open_zfp_file(path);
  EXPECT_TRUE(opened.words.empty());
  const auto cameras = orbit_cameras(volume.info(), 2);
  const auto expected = twin_hits(volume, cameras[0], kMedium, kIsovalue);
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    SCOPED_TRACE(to_string(place));
    DeviceRenderer renderer(
        device_, opened, GetParam().with({.size = kMedium, .stream = place, .window_blocks = 50}));
    renderer.render({cameras[0], kIsovalue});
    expect_same_hits(renderer.hits(), expected, kMedium.width);
  }
  DeviceRenderer renderer =
      renderer_of(opened, {.size = kMedium, .cache_slots = 200, .window_blocks = 50});
  std::size_t passes = 0;
  const OnPass cut_after_one_pass = [&](const PassStats &) {
    if (++passes == 1) std::filesystem::resize_file(path, 100);
    return true;
  };
  renderer.render({.camera = cameras[1], .isovalue = kIsovalue, .on_pass = cut_after_one_pass});
  EXPECT_EQ(std::filesystem::file_size(path), 100u);
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    EXPECT_THAT(
        [&] {
          DeviceRenderer(device_, opened, GetParam().with({.size = kMedium, .stream = place}));
        },
        ThrowsMessage<Error>(HasSubstr("truncated while it was in use")));
  }
  EXPECT_THAT([&] { decode_with_libzfp(opened); }, ThrowsMessage<Error>(HasSubstr("truncated")));
  renderer.render({cameras[0], kIsovalue});
  expect_same_hits(renderer.hits(), expected, kMedium.width);
}

TEST_P(HostStreamOnDevice, WindowsBelowOneDualGridAreRefused) {
  const TestVolume volume = small_volume();
  EXPECT_THAT([&] { renderer_of(volume.compressed, {.size = kTiny, .window_blocks = 7}); },
              ThrowsMessage<Error>(HasSubstr("a window of 7 blocks cannot be used: 8")));
}

TEST_P(HostStreamOnDevice, SplitFramesAreTheTwins) {
  const TestVolume volume = medium_volume();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  const auto expected = twin_hits(volume, camera, kMedium, kIsovalue);
  for (const std::uint32_t parts : {2u, 3u, 4u}) {
    SCOPED_TRACE(fmt::format("{} parts", parts));
    const std::uint64_t part_blocks = (volume.compressed.block_count() + parts - 1) / parts;
    DeviceRenderer renderer(
        device_, volume.compressed,
        GetParam().with(
            {.size = kMedium, .cache_slots = 300, .largest_stream_part = part_blocks * 64 + 72}));
    EXPECT_EQ(
        std::ranges::count(renderer.memory_plan().buffers, "zfp stream", &ocl::BufferSize::name),
        parts);
    renderer.render({camera, kIsovalue});
    expect_same_hits(renderer.hits(), expected, kMedium.width);
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
  }
}

}  // namespace
}  // namespace isowave::core
