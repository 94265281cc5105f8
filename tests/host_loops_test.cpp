// The host's loops over rays, for any processor and for this one: the bits of the twin, which skips
// nothing, and of rays alone.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "core/frame/ambient_rays.hpp"
#include "core/frame/appearance.hpp"
#include "core/host/host_levels.hpp"
#include "core/host/host_loops.hpp"
#include "core/io/open_volume.hpp"
#include "core/view/detail.hpp"
#include "reference/random.hpp"
#include "tests/frame_scene.hpp"
#include "tests/ray_cases.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;

/// The loops for any processor, and for this one.
TEST(HostLoops, AllGiveTheSameBits) {
  const auto reader = open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz");
  const TestVolume volume(*reader, 6);
  HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
  blocks.select(10);
  FrameParams frame =
      make_frame_params(volume.info(), orbit_cameras(volume.info(), 1)[0], {64, 48}, 10);
  const auto expected = render_scalar(frame, volume.voxels);
  frame.surface = blocks.surface();
  const ShadeParams shading = make_shade_params(volume.info(), {});
  const Image8 picture = shade_scalar(frame, shading, expected);
  const auto directions = make_ambient_directions(3);
  const AmbientRays ambient{
      make_ambient_params(volume.info(), 3), directions.data(), 3, &frame, 0, 1};
  const std::vector<FrameParams> frames = {frame};
  const std::vector<VolumeInfo> infos = {volume.info()};
  const std::vector<std::vector<float>> voxels = {volume.voxels};
  const std::vector<uchar> open =
      open_of(frames, infos, voxels, expected, {.num_ambient = 3}).counts;
  std::vector<HitRecord> smooth = expected;
  smooth_gradients(frame, volume.voxels, smooth);
  for (const HostLoops &loops : all_host_loops()) {
    std::vector<HitRecord> hits(64 * 48, no_hit());
    for (const auto trace : {loops.trace, loops.trace_rays}) {
      for (const bool is_smooth : {true, false}) {
        std::ranges::fill(hits, no_hit());
        EXPECT_EQ(trace(frame, blocks.field(), {0, 0, 64, 48}, is_smooth, hits.data()),
                  test::num_hits(expected));
        expect_same_hits(hits, is_smooth ? smooth : expected, 64);
      }
    }
    std::vector<uchar> counts(64 * 48);
    loops.ambient({frame, blocks.field()}, {0, 0, 64, 48}, ambient, hits.data(), counts.data(),
                  nullptr);
    EXPECT_EQ(counts, open);
    std::vector<std::uint8_t> row(3 * 64);
    loops.shade(frame, shading, 1, 23, hits.data(), {}, nullptr, row.data());
    EXPECT_EQ(std::memcmp(row.data(), picture.pixels.data() + 23 * row.size(), row.size()), 0);
    std::size_t num_compared = 0;
    for (std::uint32_t id = 0; id < volume.compressed.block_count(); ++id) {
      if (!blocks.is_decoded(id)) continue;
      ++num_compared;
      float values[64];
      loops.decode({volume.compressed.words.data(), volume.compressed.block_begin(id),
                    volume.compressed.block_bits(id), volume.compressed.precision.min_exponent, 1,
                    0, 4, 4, 4, 0},
                   values);
      ASSERT_EQ(std::memcmp(values, &blocks.field().values[64 * id], sizeof(values)), 0) << id;
      EXPECT_EQ(loops.inside(values, 10), host_loops().inside(values, 10));
    }
    EXPECT_GT(num_compared, 100u);
  }
}

/// Rays that go from level of detail to level of detail, by all loops.
TEST(HostLoops, AllGiveTheSameBitsOfLevels) {
  const glm::uvec3 dims(33, 29, 37);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::gyroid_field(11)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 0});
  const ImageSize size{64, 48};
  HostLevels levels(volume, HostBlocks::kNoLimit, 0);
  std::vector<std::vector<float>> voxels;
  for (const CompressedVolume *level : levels_of(volume, true))
    voxels.push_back(decode_with_libzfp(*level));
  const std::vector<FrameParams> frames =
      make_level_frames(levels.infos(), orbit_cameras(volume.info, 1)[0], size, 0.3f, 2.0);
  std::vector<HitRecord> expected = render_scalar_levels(frames, voxels);
  smooth_gradients(frames, voxels, expected);
  const std::vector<HostLevel> drawing = levels.open(frames);
  EXPECT_GT(drawing.size(), 1u);
  for (const HostLoops &loops : all_host_loops()) {
    for (const auto trace : {loops.trace_levels, loops.trace_rays_of_levels}) {
      std::vector<HitRecord> hits(size.num_rays(), no_hit());
      EXPECT_EQ(trace(drawing, {0, 0, size.width, size.height}, true, hits.data()),
                test::num_hits(expected));
      expect_same_hits(hits, expected, size.width);
    }
  }
}

/// Rays that fuzz tests draw: half a million, or ISOWAVE_FUZZ_RAYS.
std::uint64_t num_fuzz_rays() {
  const char *asked = std::getenv("ISOWAVE_FUZZ_RAYS");
  return asked != nullptr ? std::strtoull(asked, nullptr, 10) : 500'000;
}

/// Cameras on voxels, along planes and edges, within the volume and around it.
std::vector<Camera> fuzz_cameras(const glm::uvec3 &dims, Random &random) {
  std::vector<Camera> cameras = hard_cameras(dims);
  const glm::dvec3 extent = glm::dvec3(dims) - 1.0;
  const auto anywhere = [&](double margin) {
    return extent * glm::dvec3(random.in(-margin, 1 + margin), random.in(-margin, 1 + margin),
                               random.in(-margin, 1 + margin));
  };
  for (int i = 0; i < 8; ++i) {
    const glm::dvec3 eye = anywhere(i < 4 ? 0 : 2);
    cameras.push_back(test::camera_along(i % 2 == 0 ? glm::round(eye) : eye,
                                         anywhere(0) + glm::dvec3(0.01, 0.02, 0.03) - eye,
                                         {0.3, 1, 0.2}, random.in(2, 110)));
  }
  return cameras;
}

/// A tile that ends within packets of 4 x 2 rays: nothing beyond it is drawn, nothing missing.
TEST(HostLoops, TilesOfAnySize) {
  const glm::uvec3 dims(20, 21, 22);
  const TestVolume volume(dims, test::gyroid_field(9), 8);
  HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
  blocks.select(0.2f);
  FrameParams frame =
      make_frame_params(volume.info(), orbit_cameras(volume.info(), 1)[0], {64, 48}, 0.2f);
  const auto whole = render_scalar(frame, volume.voxels);
  frame.surface = blocks.surface();
  for (const RayTile tile : {RayTile{20, 15, 37, 32}, {21, 16, 22, 17}, {30, 20, 30, 20}}) {
    std::vector<HitRecord> expected(whole.size(), no_hit()), hits = expected;
    for (uint y = tile.begin_y; y < tile.end_y; ++y) {
      for (uint x = tile.begin_x; x < tile.end_x; ++x) expected[x + 64 * y] = whole[x + 64 * y];
    }
    EXPECT_EQ(host_loops().trace(frame, blocks.field(), tile, false, hits.data()),
              test::num_hits(expected));
    expect_same_hits(hits, expected, 64);
    for (const HostLoops &loops : all_host_loops()) {  // one level is a special case of several
      const HostLevel level{frame, blocks.field()};
      std::ranges::fill(hits, no_hit());
      EXPECT_EQ(loops.trace_levels({&level, 1}, tile, false, hits.data()),
                test::num_hits(expected));
      expect_same_hits(hits, expected, 64);
    }
  }
}

/// Packets against rays alone: odd volumes, eyes anywhere, ties.
TEST(HostLoops, PacketsFindWhatRaysAloneFind) {
  const std::uint64_t num_rays = num_fuzz_rays();
  const ImageSize size{41, 31};
  Random random(17);
  std::uint64_t rays = 0, num_hits = 0;
  for (std::uint32_t volume_number = 0; rays < num_rays; ++volume_number) {
    const auto dim = [&] { return static_cast<std::uint32_t>(random.in(2, 46)); };
    const glm::uvec3 dims(dim(), dim(), dim());
    const bool is_whole = volume_number % 3 == 1;
    const TestVolume volume(dims,
                            volume_number % 3 == 0 ? test::gyroid_field(random.in(6, 60))
                            : is_whole             ? test::plateau_field()
                                                   : test::noise_field(volume_number),
                            16);
    const float isovalue = is_whole ? volume.voxels[volume.voxels.size() / 2]
                                    : static_cast<float>(random.in(-0.9, 0.9));
    HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
    blocks.select(isovalue);
    const std::vector<Camera> cameras = fuzz_cameras(dims, random);
    for (std::size_t view = 0; view < cameras.size(); ++view, rays += size.num_rays()) {
      FrameParams frame = make_frame_params(volume.info(), cameras[view], size, isovalue);
      frame.surface = blocks.surface();
      std::vector<HitRecord> expected(size.num_rays(), no_hit()), hits = expected;
      const RayTile all = {0, 0, size.width, size.height};
      num_hits += host_loops().trace_rays(frame, blocks.field(), all, false, expected.data());
      for (const HostLoops &loops : all_host_loops()) {
        if (loops.trace == loops.trace_rays) continue;
        hits.assign(size.num_rays(), no_hit());
        loops.trace(frame, blocks.field(), all, false, hits.data());
        expect_same_hits(hits, expected, size.width);
      }
      ASSERT_FALSE(HasFailure()) << fmt::format("volume {} ({}x{}x{}), isovalue {}, view {}",
                                                volume_number, dims.x, dims.y, dims.z, isovalue,
                                                view);
    }
  }
  RecordProperty("rays", std::to_string(rays));
  EXPECT_GT(num_hits, rays / 20);
}

/// The same in frames of several levels of detail, which agree on little in noise. Their bands have
/// any length, some of them whole numbers of t.
TEST(HostLoops, PacketsOfLevelsFindWhatRaysAloneFind) {
  const std::uint64_t num_rays = num_fuzz_rays();
  const ImageSize size{41, 31};
  Random random(18);
  std::uint64_t rays = 0, num_hits = 0, num_at_borders = 0;
  for (std::uint32_t volume_number = 0; rays < num_rays; ++volume_number) {
    const auto dim = [&] { return static_cast<std::uint32_t>(random.in(9, 70)); };
    const glm::uvec3 dims(dim(), dim(), dim());
    ArrayReader reader(
        test::grid_info(dims),
        test::sample(dims, volume_number % 2 == 0 ? test::gyroid_field(random.in(6, 60))
                                                  : test::noise_field(volume_number)));
    const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 0});
    HostLevels levels(volume, HostBlocks::kNoLimit, 0);
    const auto isovalue = static_cast<float>(random.in(-0.6, 0.6));
    for (const Camera &camera : fuzz_cameras(dims, random)) {
      std::vector<FrameParams> frames =
          make_level_frames(levels.infos(), camera, size, isovalue, std::exp2(random.in(-2, 6)));
      const bool is_even = random.in(0, 1) < 0.3;
      for (std::size_t level = 1; is_even && level < frames.size(); ++level) {
        Band &behind = frames[level].band, &before = frames[level - 1].band;
        if (behind.begin_t == 0 || !draws(frames[level])) continue;
        // t of the coarsest level; the others' are multiples by powers of two.
        const float last = frames.back().view.t_scale;
        const float t = std::ceil(behind.begin_t * frames[level].view.t_scale / last);
        before.end_t = t * (last / frames[level - 1].view.t_scale);
        behind.begin_t = t * (last / frames[level].view.t_scale);
      }
      const std::vector<HostLevel> drawing = levels.open(frames);
      if (drawing.size() == 1) continue;
      rays += size.num_rays();
      std::vector<HitRecord> expected(size.num_rays(), no_hit()), hits = expected;
      const RayTile all = {0, 0, size.width, size.height};
      num_hits += host_loops().trace_rays_of_levels(drawing, all, false, expected.data());
      for (const HostLevel &level : drawing)
        num_at_borders += static_cast<std::uint64_t>(std::ranges::count(
            expected, level.frame.band.begin_t * level.frame.view.t_scale, &HitRecord::t));
      for (const HostLoops &loops : all_host_loops()) {
        if (loops.trace_levels == loops.trace_rays_of_levels) continue;
        hits.assign(size.num_rays(), no_hit());
        loops.trace_levels(drawing, all, false, hits.data());
        expect_same_hits(hits, expected, size.width);
      }
      ASSERT_FALSE(HasFailure()) << fmt::format("volume {} ({}x{}x{}), isovalue {}", volume_number,
                                                dims.x, dims.y, dims.z, isovalue);
    }
  }
  RecordProperty("rays", std::to_string(rays));
  EXPECT_GT(num_hits, rays / 20);
  EXPECT_GT(num_at_borders, rays / 1000);
}

}  // namespace
}  // namespace isowave::core
