// Voxels without data: no surface touches them, in no renderer; what they are stored as does not
// spoil their neighbours. no_data_levels_test.cpp and no_data_meshes_test.cpp have the rest.

#include "core/zfp/no_data.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/accuracy/certify.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/zfp/voxel_region.hpp"
#include "core/zfp/zfp_file.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/run_program.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_pipelines.hpp"
#include "tests/zfp_trailer_file.hpp"

namespace isowave::core {
namespace {

using test::compressed;
using test::expect_same_hits;
using test::Hole;
using test::holes;
using test::kNone;
using test::NamedHole;
using test::num_hits;
using test::TestVolume;
using test::with_hole;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(NoData, TableHasTheMasks) {
  Random random(3);
  for (const glm::uvec3 dims : {glm::uvec3(9, 6, 7), {64, 33, 34}, {2, 2, 2}, {16, 16, 8}}) {
    NoDataBuilder builder(dims);
    const glm::uvec3 blocks = (dims + 3u) / 4u;
    std::vector<std::uint64_t> masks;
    std::uint64_t count = 0;
    for (std::uint64_t block = 0; block < blocks.x * blocks.y * blocks.z; ++block) {
      const std::uint64_t voxels = voxels_of_block(dims, block);
      const std::uint32_t kind = random() % 3;
      const std::uint64_t bits = std::uint64_t{random()} << 32 | random();
      masks.push_back(kind == 0 ? 0 : kind == 1 ? ~std::uint64_t{0} : bits);
      builder.add(masks.back());
      count += static_cast<std::uint64_t>(std::popcount(masks.back() & voxels));
    }
    const NoData no_data = builder.finish();
    EXPECT_EQ(no_data.num_voxels(), count);
    for (std::uint64_t block = 0; block < masks.size(); ++block) {
      const std::uint64_t voxels = voxels_of_block(dims, block);
      ASSERT_EQ(no_data.mask(block) & voxels, masks[block] & voxels) << block;
    }
  }
  NoDataBuilder none({64, 64, 64});
  for (int block = 0; block < 4096; ++block) none.add(0);
  EXPECT_TRUE(none.finish().table().empty()) << "no memory";
}

TEST(NoData, AreTheNanVoxelsAndThoseOfTheValue) {
  const glm::uvec3 dims(13, 10, 9);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  for (const NamedHole &hole : holes(dims)) {
    for (const float value : {kNone, 1e20f, -9999.0f, std::numeric_limits<float>::infinity()}) {
      SCOPED_TRACE(fmt::format("{}: {}", hole.name, value));
      CompressOptions options{.rate = 16};
      if (!std::isnan(value)) options.input.no_data = double{value};
      const std::vector<float> holed = with_hole(dims, source, hole.hole, value),
                               marked = with_hole(dims, source, hole.hole);
      const CompressedVolume volume = compressed(dims, holed, options);
      const std::vector<float> decoded = decode_with_libzfp(volume);
      std::vector<float> region(decoded.size());
      decode_region(volume, {.begin = {0, 0, 0}, .end = dims}, region);
      std::uint64_t count = 0;
      float least = INFINITY, most = -INFINITY;
      for (std::size_t i = 0; i < decoded.size(); ++i) {
        ASSERT_EQ(std::isnan(decoded[i]), std::isnan(marked[i])) << i;
        ASSERT_EQ(std::isnan(region[i]), std::isnan(marked[i])) << i;
        count += std::isnan(marked[i]) ? 1 : 0;
        if (std::isnan(marked[i])) continue;
        EXPECT_NEAR(decoded[i], marked[i], 0.01);
        least = std::min(least, marked[i]);
        most = std::max(most, marked[i]);
      }
      EXPECT_EQ(volume.no_data.num_voxels(), count);
      if (count < decoded.size()) {
        EXPECT_EQ(volume.value_range, (std::array{least, most}));
      } else {
        EXPECT_EQ(volume.value_range, (std::array{0.0f, 0.0f}));
      }
    }
  }
}

/// In a source of float64 the value is compared before it is cast, in one of integers as it is.
TEST(NoData, ValuesAreComparedInTheSourcesType) {
  const glm::uvec3 dims(4, 4, 4);
  std::vector<double> voxels(64, 1.0);
  voxels[5] = 0.1;
  voxels[6] = double{0.1f};
  ArrayReader doubles(dims, voxels, VoxelType::kFloat64), floats(dims, voxels);
  EXPECT_EQ(compress(doubles, {.rate = 16, .input = {.no_data = 0.1}}).no_data.num_voxels(), 1u);
  EXPECT_EQ(compress(floats, {.rate = 16, .input = {.no_data = 0.1}}).no_data.num_voxels(), 2u);
  EXPECT_TRUE(compress(floats, {.rate = 16, .input = {.no_data = 1e300}}).no_data.empty());
  voxels[5] = -1024;
  voxels[6] = 40000;
  ArrayReader integers(dims, voxels, VoxelType::kInt32);
  const CompressedVolume volume = compress(integers, {.rate = 16, .input = {.no_data = -1024.0}});
  EXPECT_EQ(volume.no_data.num_voxels(), 1u);
  EXPECT_EQ(volume.value_range, (std::array{1.0f, 40000.0f}));
}

TEST(NoData, OtherInfiniteVoxelsAreRefused) {
  const glm::uvec3 dims(4, 4, 4);
  std::vector<float> voxels(64, 1.0f);
  voxels[6] = -INFINITY;
  voxels[7] = kNone;
  EXPECT_THAT(
      [&] { compressed(dims, voxels); },
      ThrowsMessage<Error>(HasSubstr("1 of 64 voxels is infinite, the first at x=2, y=1, z=0")));
  EXPECT_EQ(
      compressed(dims, voxels, {.rate = 16, .input = {.no_data = -INFINITY}}).no_data.num_voxels(),
      2u);
  EXPECT_TRUE(compressed(dims, voxels, {.rate = 16, .input = {.map_nan = 3.0f}}).no_data.empty());
  const CompressedVolume both =
      compressed(dims, voxels, {.rate = 32, .input = {.map_nan = 3.0f, .no_data = 1.0}});
  EXPECT_EQ(both.no_data.num_voxels(), 62u);
  EXPECT_EQ(both.value_range, (std::array{3.0f, 3.0f}));
  EXPECT_THAT(
      [&] { compressed(dims, voxels, {.rate = 16, .input = {.map_nan = 3.0f, .no_data = NAN}}); },
      ThrowsMessage<Error>(HasSubstr("give one of the two")));
}

/// A block with voxels without data is not worse than with ordinary ones in their place.
TEST(NoData, NeighboursKeepTheirError) {
  const glm::uvec3 dims(22, 17, 19);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(15));
  const double usual =
      *compressed(dims, source, {.rate = 12, .measure_error = true}).max_voxel_error;
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const std::vector<float> holed = with_hole(dims, source, hole.hole, 1e20f);
    const CompressedVolume volume =
        compressed(dims, holed, {.rate = 12, .measure_error = true, .input = {.no_data = 1e20}});
    EXPECT_LE(*volume.max_voxel_error, 6 * usual);
    ArrayReader reader(dims, holed);
    const InputOptions input{.no_data = 1e20};
    const BlockPrecision bound = choose_precision(reader, {.tolerance = 1e-3}, input);
    EXPECT_LE(*bound.max_voxel_error, 1e-3);
    const CompressedVolume bounded = compressed(dims, holed, {.precision = bound, .input = input});
    EXPECT_LE(
        bounded.payload_bits(),
        1.15 * static_cast<double>(TestVolume(test::grid_info(dims), source, {.tolerance = 1e-3})
                                       .compressed.payload_bits()));
  }
}

TEST(NoData, WholeNumbersAreExact) {
  const glm::uvec3 dims(13, 10, 9);
  const std::vector<float> source = test::sample(dims, test::plateau_field());
  const Hole hole = holes(dims)[2].hole;
  VolumeInfo info = test::grid_info(dims);
  info.type = VoxelType::kUint8;
  const TestVolume volume(info, with_hole(dims, source, hole), {.exact = true});
  const std::vector<float> expected = with_hole(dims, source, hole);
  EXPECT_EQ(volume.compressed.max_voxel_error, 0.0);
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_TRUE(volume.voxels[i] == expected[i] || std::isnan(expected[i])) << i;
}

/// Wherever its bits are read from.
TEST(NoData, FilesKeepThem) {
  const glm::uvec3 dims(30, 17, 22);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  const test::TemporaryFolder folder;
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const CompressedVolume volume = compressed(dims, with_hole(dims, source, hole.hole));
    const std::filesystem::path path = folder / "a.zfp";
    write_zfp_file(volume, path);
    for (const CompressedVolume &read : {read_zfp_file(path), open_zfp_file(path)}) {
      EXPECT_TRUE(std::ranges::equal(read.no_data.table(), volume.no_data.table()));
      EXPECT_EQ(read.no_data.num_voxels(), volume.no_data.num_voxels());
    }
    for (const CompressedVolume &info : {check_zfp_file(path), read_zfp_file_info(path)}) {
      EXPECT_EQ(info.no_data.num_voxels(), volume.no_data.num_voxels());
      EXPECT_TRUE(info.no_data.table().empty());
    }
  }
}

TEST(NoData, HostileMasksAreRefused) {
  const glm::uvec3 dims(30, 17, 22);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.zfp";
  const CompressedVolume good = compressed(dims, with_hole(dims, source, holes(dims)[2].hole));
  write_zfp_file(good, path);
  const test::TrailerFile parts(test::read_file(path));
  const std::size_t at = parts.text.find("\"no_data_bytes\":") + 16,
                    end = parts.text.find_first_of(",}", at);
  const std::size_t bytes = std::stoul(parts.text.substr(at, end - at));
  const std::string head = parts.before.substr(0, parts.before.size() - bytes),
                    part = parts.before.substr(head.size());
  const auto refuses = [&](const std::string &changed, const std::string &text) {
    test::write_file(path, test::with_trailer(head + changed, text, parts.version));
    EXPECT_THAT([&] { open_zfp_file(path); }, ThrowsMessage<Error>(HasSubstr("a.zfp: ")));
    EXPECT_THROW(check_zfp_file(path), Error);
  };
  const auto with_length = [&](std::size_t length) {
    return parts.text.substr(0, at) + std::to_string(length) + parts.text.substr(end);
  };
  for (std::size_t i = 0; i < part.size(); ++i) {
    std::string changed = part;
    changed[i] = static_cast<char>(changed[i] ^ 0x10);
    test::write_file(path, test::with_trailer(head + changed, parts.text, parts.version));
    try {
      EXPECT_EQ(open_zfp_file(path).no_data.num_voxels(), good.no_data.num_voxels());
    } catch (const Error &error) {
      EXPECT_THAT(error.what(), HasSubstr("a.zfp: "));
    }
  }
  refuses(part.substr(1), with_length(part.size() - 1));
  refuses(part + "a", with_length(part.size() + 1));
  refuses("", with_length(0));
  const std::size_t count = parts.text.find("\"no_data_voxels\":") + 17;
  refuses(part, parts.text.substr(0, count) + "1" + parts.text.substr(count));
  refuses(part, parts.text.substr(0, count) + "0" +
                    parts.text.substr(parts.text.find_first_of(",}", count)));
}

// ---- Frames

class NoDataFrames : public testing::TestWithParam<PipelineOnDevice> {};
INSTANTIATE_TEST_SUITE_P(Pipelines, NoDataFrames, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

/// Isovalues of a surface, of voxels, and of what stands for voxels without data.
TEST_P(NoDataFrames, SmallHolesHaveTheTwinsBits) {
  const glm::uvec3 dims(17, 14, 13);
  constexpr ImageSize kSize{48, 32};
  ocl::Device device(GetParam().device);
  std::uint64_t hits = 0;
  for (const auto &field : {test::gyroid_field(9), test::plateau_field(), test::noise_field(5)}) {
    const std::vector<float> source = test::sample(dims, field);
    for (const NamedHole &hole : holes(dims)) {
      if (is_simulator(device.info()) && hole.name != std::string("scattered")) continue;
      if (is_llvmpipe(GetParam().device) && !long_tests() && hole.name[0] != 's') continue;
      for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
        const TestVolume volume(test::grid_info(dims), with_hole(dims, source, hole.hole),
                                place == StreamPlace::kHost ? 11 : 16);
        RendererOptions options{.size = kSize};
        options.stream = place;
        DeviceRenderer renderer(device, volume.compressed, GetParam().with(options));
        HostRenderer host(volume.compressed);
        for (const float isovalue : {0.25f, 102.0f, 0.0f}) {
          SCOPED_TRACE(fmt::format("{}, isovalue {}", hole.name, isovalue));
          const Camera camera = orbit_cameras(volume.info(), 3)[2];
          const auto expected = test::twin_hits(volume, camera, kSize, isovalue);
          renderer.render({camera, isovalue});
          expect_same_hits(renderer.hits(), expected, kSize.width);
          host.render({.camera = camera, .isovalue = isovalue, .size = kSize});
          expect_same_hits(host.hits(), expected, kSize.width);
          hits += num_hits(expected);
        }
      }
    }
  }
  EXPECT_GT(hits, 100u);
}

/// Around a hole in a field that rises along x, nothing is hit that is not a change of inside
/// within cells with data; through the hole the ray goes on.
TEST_P(NoDataFrames, SmallGapsAreNoHits) {
  const glm::uvec3 dims(16, 9, 9);
  const std::vector<float> source =
      test::sample(dims, [](const glm::dvec3 &at) { return at.x < 12 ? at.x : 24 - at.x; });
  const Hole hole = [](const glm::uvec3 &at) { return at.x >= 4 && at.x <= 6; };
  const TestVolume volume(test::grid_info(dims), with_hole(dims, source, hole), 24);
  ocl::Device device(GetParam().device);
  DeviceRenderer renderer(device, volume.compressed, GetParam().with({.size = {8, 8}}));
  const Camera camera = test::camera_along({-5, 4, 4}, {1, 0.001, 0.002}, {0, 1, 0}, 10);
  renderer.render({camera, 5.0f});  // rising within the hole; falling behind the ridge is none
  for (const HitRecord &hit : renderer.hits()) EXPECT_TRUE(std::isinf(hit.t)) << hit.t;
  renderer.render({camera, 9.5f});
  for (const HitRecord &hit : renderer.hits()) EXPECT_NEAR(hit.t, 14.5, 0.2);
}

/// A difference beside a voxel without data is one-sided: in a linear field all normals are alike.
TEST_P(NoDataFrames, SmallNormalsIgnoreThem) {
  const glm::uvec3 dims(14, 13, 12);
  const std::vector<float> source =
      test::sample(dims, [](const glm::dvec3 &at) { return at.x + 2 * at.y + 4 * at.z - 35; });
  const TestVolume volume(test::grid_info(dims), with_hole(dims, source, holes(dims)[2].hole), 28);
  ocl::Device device(GetParam().device);
  DeviceRenderer renderer(device, volume.compressed, GetParam().with({.size = {24, 16}}));
  renderer.render({orbit_cameras(volume.info(), 3)[1], 0.5f});
  EXPECT_GT(num_hits(renderer.hits()), 20u);
  for (const HitRecord &hit : renderer.hits()) {
    if (std::isinf(hit.t)) continue;
    EXPECT_NEAR(hit.grad_x, 1, 1e-3);
    EXPECT_NEAR(hit.grad_y, 2, 1e-3);
    EXPECT_NEAR(hit.grad_z, 4, 1e-3);
  }
}

// ---- Bounds of a frame's error

class NoDataBounds : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, NoDataBounds, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// The true hits are those of the volume before compression.
TEST_P(NoDataBounds, SmallCertainPixelsAreRight) {
  const glm::uvec3 dims(22, 19, 17);
  constexpr ImageSize kSize{48, 32};
  ocl::Device device(GetParam());
  std::uint64_t hits = 0, misses = 0, uncertain = 0, wrong = 0;
  for (const auto &field : {test::gyroid_field(9), test::noise_field(5)}) {
    const std::vector<float> source = test::sample(dims, field);
    for (const NamedHole &hole : holes(dims)) {
      if (is_llvmpipe(GetParam()) && !long_tests() && hole.name[0] != 's') continue;
      SCOPED_TRACE(hole.name);
      const std::vector<float> holed = with_hole(dims, source, hole.hole);
      for (const std::uint32_t rate : {4u, 7u, 14u}) {
        const CompressedVolume volume =
            compressed(dims, holed, {.rate = rate, .measure_error = true, .levels = 2});
        DeviceRenderer renderer(device, volume,
                                {.size = kSize, .with_levels = true, .with_bounds = true});
        for (const float isovalue : {0.25f, 0.0f}) {
          for (const Camera &camera : orbit_cameras(volume.info, 3)) {
            const FrameRequest request{.camera = camera, .isovalue = isovalue};
            renderer.render(request);
            const std::vector<HitRecord> drawn = renderer.hits();
            const std::vector<float> bounds = certify(renderer, volume, request, drawn).bounds;
            const FrameParams frame = make_frame_params(volume.info, camera, kSize, isovalue);
            const std::vector<HitRecord> truth = render_scalar(frame, holed);
            for (std::size_t pixel = 0; pixel < bounds.size(); ++pixel) {
              if (std::isinf(bounds[pixel])) {
                ++uncertain;
              } else if (bounds[pixel] == 0) {
                ++misses;
                wrong += std::isfinite(truth[pixel].t) || std::isfinite(drawn[pixel].t);
              } else {
                ++hits;
                const double pixel_size = 2 * double{frame.view.pixel_scale} * drawn[pixel].t;
                wrong += !(std::abs(double{truth[pixel].t} - drawn[pixel].t) <=
                           bounds[pixel] * pixel_size);
              }
            }
          }
        }
        EXPECT_THAT(
            [&] {
              certify(renderer, volume,
                      {.camera = orbit_cameras(volume.info, 1)[0],
                       .isovalue = 0.25f,
                       .voxel_pixels = 1e3},
                      renderer.hits());
            },
            ThrowsMessage<Error>(HasSubstr("coarser levels of detail has no bound")));
      }
    }
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_GT(hits, 1000u);
  EXPECT_GT(misses, 1000u);
  EXPECT_GT(uncertain, 1000u);
}

}  // namespace
}  // namespace isowave::core
