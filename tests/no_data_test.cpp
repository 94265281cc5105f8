// Voxels without data: no surface touches them, in no renderer and no mesh; what they are stored as
// does not spoil their neighbours.

#include "core/zfp/no_data.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/accuracy/certify.hpp"
#include "core/base/error.hpp"
#include "core/extract/extractor.hpp"
#include "core/host/host_renderer.hpp"
#include "core/paper/mesh_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/stated_errors.hpp"
#include "core/zfp/voxel_region.hpp"
#include "core/zfp/zfp_file.hpp"
#include "reference/mesh_twin.hpp"
#include "reference/raster_twin.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/mesh_checks.hpp"
#include "tests/run_program.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_pipelines.hpp"
#include "tests/zfp_trailer_file.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::num_hits;
using test::TestVolume;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// Says of a voxel whether it has no data.
using Hole = std::function<bool(const glm::uvec3 &at)>;

std::vector<float> with_hole(const glm::uvec3 &dims, std::vector<float> voxels, const Hole &hole,
                             float value = kNone) {
  std::size_t i = 0;
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x, ++i) {
        if (hole({x, y, z})) voxels[i] = value;
      }
    }
  }
  return voxels;
}

struct NamedHole {
  const char *name;
  Hole hole;
};

/// Holes of a volume of dims.
std::vector<NamedHole> holes(const glm::uvec3 &dims) {
  const auto scattered = [dims](const glm::uvec3 &at) {
    const std::uint32_t number = at.x + dims.x * (at.y + dims.y * at.z);
    return (number * 2654435761u >> 16) % 23 == 0;
  };
  return {{"half", [=](const glm::uvec3 &at) { return at.x > dims.x / 2; }},
          {"a voxel", [=](const glm::uvec3 &at) { return at == dims / 2u; }},
          {"scattered", scattered},
          {"all", [](const glm::uvec3 &) { return true; }},
          {"the border",
           [=](const glm::uvec3 &at) {
             return at.x == 0 || at.y == 0 || at.z == 0 || at.x + 1 == dims.x ||
                    at.y + 1 == dims.y || at.z + 1 == dims.z;
           }},
          {"partial blocks", [=](const glm::uvec3 &at) {
             return at.x / 4 == (dims.x - 1) / 4 || at.z / 4 == (dims.z - 1) / 4;
           }}};
}

CompressedVolume compressed(const glm::uvec3 &dims, const std::vector<float> &voxels,
                            const CompressOptions &options = {.rate = 12}) {
  ArrayReader reader(dims, voxels);
  return compress(reader, options);
}

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
  EXPECT_THAT([&] { compressed(dims, voxels); },
              ThrowsMessage<Error>(HasSubstr("1 of 64 voxels are infinite, the first at (2,1,0)")));
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

// ---- Levels of detail

/// Voxels of each level without data, [nz][ny][nx] one level after the other; the finest first.
std::vector<std::vector<float>> decoded_levels(const CompressedVolume &volume) {
  std::vector<std::vector<float>> levels = {decode_with_libzfp(volume)};
  for (const CompressedVolume &level : volume.coarser_levels)
    levels.push_back(decode_with_libzfp(level));
  return levels;
}

/// At no level do data reach beyond their border; gaps of one voxel close, wider ones stay in their
/// place.
TEST(NoData, LevelsKeepBordersAndCloseSmallGaps) {
  const glm::uvec3 dims(48, 40, 36);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  struct Case {
    const char *name;
    Hole hole;
    std::uint32_t gap_begin, gap_end;  ///< along x; of the finest level
  };
  for (const Case &of :
       {Case{"half", [](const glm::uvec3 &at) { return at.x > 25; }, 26, 99},
        Case{"a voxel", [](const glm::uvec3 &at) { return at == glm::uvec3(16, 8, 8); }, 99, 99},
        Case{"a plane", [](const glm::uvec3 &at) { return at.x == 16; }, 99, 99},
        Case{"a wide gap", [](const glm::uvec3 &at) { return at.x >= 7 && at.x < 33; }, 7, 33}}) {
    SCOPED_TRACE(of.name);
    const CompressedVolume volume =
        compressed(dims, with_hole(dims, source, of.hole), {.rate = 16, .levels = 0});
    ASSERT_EQ(volume.coarser_levels.size(), 3u);
    const std::vector<std::vector<float>> levels = decoded_levels(volume);
    for (std::uint32_t level = 1; level < levels.size(); ++level) {
      const glm::uvec3 &size = volume.coarser_levels[level - 1].info.dims;
      for (std::size_t i = 0; i < levels[level].size(); ++i) {
        const std::uint32_t x = static_cast<std::uint32_t>(i % size.x) << level;
        const bool missing = x >= of.gap_begin && x < of.gap_end;
        ASSERT_EQ(std::isnan(levels[level][i]), missing) << "level " << level << ", voxel " << i;
        ASSERT_TRUE(missing || std::abs(levels[level][i]) < 4) << levels[level][i];
      }
    }
  }
}

/// The value that says "no data", and the one that replaces NaN, are those of the source alone.
TEST(NoData, LevelsTakeNoMeanForThatValue) {
  const glm::uvec3 dims(16, 16, 16);
  const std::vector<float> waves =
      test::sample(dims, [](const glm::dvec3 &at) { return int(at.x) / 2 % 2 == 0 ? 8 : -8; });
  std::vector<float> source = with_hole(
      dims, waves, [](const glm::uvec3 &at) { return at.y > 7; }, 0);
  source[0] = kNone;
  const CompressedVolume volume =
      compressed(dims, source, {.rate = 24, .levels = 2, .input = {.map_nan = 8.0f, .no_data = 0}});
  EXPECT_EQ(volume.no_data.num_voxels(), 16u * 16 * 8);
  EXPECT_EQ(volume.coarser_levels[0].no_data.num_voxels(), 9u * 9 * 5);
}

TEST(NoData, FilesKeepThoseOfLevels) {
  const glm::uvec3 dims(30, 17, 22);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.zfp", at_once = folder / "b.zfp";
  for (const NamedHole &hole : holes(dims)) {
    for (const CompressOptions &options :
         {CompressOptions{.rate = 12, .measure_error = true, .levels = 0},
          CompressOptions{.precision = BlockPrecision{.min_exponent = -8}, .levels = 0}}) {
      SCOPED_TRACE(hole.name);
      const std::vector<float> holed = with_hole(dims, source, hole.hole);
      const CompressedVolume volume = compressed(dims, holed, options);
      write_zfp_file(volume, path);
      ArrayReader reader(dims, holed);
      compress_to_file(reader, options, at_once);
      EXPECT_EQ(test::read_file(path), test::read_file(at_once));
      const CompressedVolume read = read_zfp_file(path);
      check_stated_errors(read, {});
      for (std::size_t i = 0; i < volume.coarser_levels.size(); ++i) {
        EXPECT_TRUE(std::ranges::equal(read.coarser_levels[i].no_data.table(),
                                       volume.coarser_levels[i].no_data.table()));
        EXPECT_LE(double{largest_bound(volume.coarser_levels[i].bounds)}, 3.0)
            << "bounds are those of voxels with data";
      }
    }
  }
}

class NoDataLevels : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  static constexpr ImageSize kSize{48, 32};

  /// Returns the number of hits.
  std::uint64_t check(const CompressedVolume &volume, float isovalue, double voxel_pixels,
                      StreamPlace place = StreamPlace::kDevice) {
    DeviceRenderer renderer(device_, volume, {.size = kSize, .stream = place, .with_levels = true});
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
    const Twin twin(volume, voxel_pixels);
    std::vector<Camera> cameras = orbit_cameras(volume.info, 2);
    cameras.push_back(test::camera_along({5, 6, 7}, {1, 0.4, -0.3}));  // from within
    std::uint64_t hits = 0;
    for (const Camera &camera : cameras) {
      const auto frames =
          make_level_frames(level_infos(volume, true), camera, kSize, isovalue, voxel_pixels);
      EXPECT_GT(std::ranges::count_if(frames, draws), 1) << "no border is tested";
      const auto expected = twin.render(camera, kSize, isovalue);
      renderer.render({.camera = camera, .isovalue = isovalue, .voxel_pixels = voxel_pixels});
      expect_same_hits(renderer.hits(), expected, kSize.width);
      hits += num_hits(expected);
    }
    return hits;
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, NoDataLevels, testing::ValuesIn(devices_under_test()),
                         device_test_name);

CompressedVolume pyramid_of(const glm::uvec3 &dims, const test::VoxelFunction &field,
                            const Hole &hole) {
  return compressed(dims, with_hole(dims, test::sample(dims, field), hole),
                    {.rate = 12, .levels = 0});
}

TEST_P(NoDataLevels, SmallBandsHaveTheTwinsBits) {
  const glm::uvec3 dims(24, 22, 19);
  std::uint64_t hits = 0;
  for (const auto &field : {test::gyroid_field(9), test::noise_field(5)}) {
    for (const NamedHole &hole : holes(dims)) {
      if (is_llvmpipe(GetParam()) && !long_tests() && hole.name[0] != 's') continue;
      SCOPED_TRACE(hole.name);
      const CompressedVolume volume = pyramid_of(dims, field, hole.hole);
      hits += check(volume, 0.25f, 2.5);
      hits += check(volume, 0.0f, 5.0, StreamPlace::kHost);
    }
  }
  EXPECT_GT(hits, 1000u);
}

/// Where a level ends in cells without data, no side is carried to the next: else each border would
/// be a surface.
TEST_P(NoDataLevels, SmallGapsAtBordersAreNoHits) {
  const glm::uvec3 dims(24, 22, 19);
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const auto inside = [](const glm::dvec3 &) { return 1; };
    for (const double voxel_pixels : {2.0, 4.0})
      EXPECT_EQ(check(pyramid_of(dims, inside, hole.hole), 0.5f, voxel_pixels), 0u);
  }
}

/// Blocks that are as a whole on one side, of levels that contradict each other, and are without
/// data in other places.
TEST_P(NoDataLevels, SmallSidesOfWholeBlocksNeedData) {
  const glm::uvec3 dims(40, 37, 33);
  const auto ball = [](float inner, float outer) {
    return [=](const glm::dvec3 &at) {
      return glm::distance(at, glm::dvec3(30, 20, 20)) < 9 ? inner : outer;
    };
  };
  const auto in_layers = [](std::uint32_t axis, std::uint32_t period) {
    return [=](const glm::uvec3 &at) {
      return at[static_cast<glm::length_t>(axis)] / (period / 2) % 2 == 0;
    };
  };
  CompressedVolume volume = pyramid_of(dims, ball(1, 0), in_layers(0, 12));
  volume.coarser_levels = pyramid_of(dims, ball(0, 1), in_layers(1, 14)).coarser_levels;
  EXPECT_GT(check(volume, 0.5f, 2.5), 100u);
  const CompressedVolume scattered = pyramid_of(dims, ball(1, 0), holes(dims)[2].hole);
  volume = pyramid_of(dims, ball(0, 1), holes(dims)[0].hole);
  volume.coarser_levels = scattered.coarser_levels;
  EXPECT_GT(check(volume, 0.5f, 2.5), 100u);
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

// ---- Meshes

class NoDataMeshes : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, NoDataMeshes, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// The triangles of a whole volume's mesh, as sets of corners, whose cell has data.
std::multiset<std::vector<float>> triangles_with_data(const Mesh &mesh, const glm::uvec3 &dims,
                                                      const Hole &hole) {
  std::multiset<std::vector<float>> kept;
  for (const Triangle &triangle : mesh.triangles) {
    std::vector<float> corners;
    glm::vec3 middle(0);
    for (const std::uint32_t vertex : triangle) {
      const glm::vec3 at = mesh.vertices[vertex];
      middle += at / 3.0f;
      corners.insert(corners.end(), {at.x, at.y, at.z});
    }
    const glm::uvec3 cell(glm::floor(middle));
    bool has_data = true;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      const glm::uvec3 at = cell + glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
      has_data = has_data && !hole(glm::min(at, dims - 1u));
    }
    if (has_data) kept.insert(corners);
  }
  return kept;
}

/// What is left of the whole volume's mesh: it ends with an open border, and no vertex is left
/// over.
TEST_P(NoDataMeshes, SmallHolesAreCutOutOfTheMesh) {
  const glm::uvec3 dims(17, 14, 13);
  std::vector<float> source = test::sample(dims, test::noise_field(9));
  for (float &voxel : source) voxel = std::round(voxel * 100);  // exact with and without holes
  VolumeInfo info = test::grid_info(dims);
  info.type = VoxelType::kInt8;
  ocl::Device device(GetParam());
  const TestVolume whole(info, source, {.exact = true});
  const float isovalue = 10.5f;
  const Mesh all = extract_scalar(whole.compressed, isovalue);
  const Hole none = [](const glm::uvec3 &) { return false; };
  ASSERT_EQ(triangles_with_data(all, dims, none).size(), all.triangles.size());
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const TestVolume volume(info, with_hole(dims, source, hole.hole), {.exact = true});
    for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
      Extractor extractor(device, volume.compressed, {.stream = place});
      Mesh mesh;
      extractor.extract(isovalue, mesh);
      expect_same_mesh(mesh, extract_scalar(volume.compressed, isovalue));
      EXPECT_EQ(triangles_with_data(mesh, dims, none), triangles_with_data(all, dims, hole.hole));
      std::set<std::uint32_t> used;
      for (const Triangle &triangle : mesh.triangles) used.insert(triangle.begin(), triangle.end());
      EXPECT_EQ(used.size(), mesh.vertices.size());
    }
  }
}

TEST_P(NoDataMeshes, SmallDrawnTrianglesHaveTheTwinsBits) {
  const glm::uvec3 dims(17, 14, 13);
  constexpr ImageSize kSize{48, 32};
  ocl::Device device(GetParam());
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const TestVolume volume(test::grid_info(dims),
                            with_hole(dims, test::sample(dims, test::gyroid_field(9)), hole.hole),
                            16);
    MeshRenderer renderer(device, volume.compressed, {.size = kSize});
    const Camera camera = orbit_cameras(volume.info(), 3)[2];
    renderer.render({camera, 0.25f});
    expect_same_hits(renderer.hits(),
                     rasterise_scalar(make_frame_params(volume.info(), camera, kSize, 0.25f),
                                      triangles_scalar(dims, volume.voxels, 0.25f)),
                     kSize.width);
  }
}

/// The device's memory without them is what it was; programs built for them draw other volumes.
TEST_P(NoDataMeshes, SmallOtherVolumesAreDrawnAsBefore) {
  const glm::uvec3 dims(17, 14, 13);
  constexpr ImageSize kSize{24, 16};
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  const TestVolume full(test::grid_info(dims), source, 12),
      holed(test::grid_info(dims), with_hole(dims, source, holes(dims)[2].hole), 12);
  ocl::Device device(GetParam());
  const Camera camera = orbit_cameras(full.info(), 3)[2];
  const auto expected = test::twin_hits(full, camera, kSize, 0.25f);
  std::uint64_t bytes = 0;
  for (int turn = 0; turn < 2; ++turn) {
    DeviceRenderer renderer(device, full.compressed, {.size = kSize});
    renderer.render({camera, 0.25f});
    expect_same_hits(renderer.hits(), expected, kSize.width);
    if (turn == 0) bytes = device.ledger().current();
    EXPECT_EQ(device.ledger().current(), bytes);
    DeviceRenderer other(device, holed.compressed, {.size = kSize});
    EXPECT_EQ(device.ledger().current(), 2 * bytes + holed.compressed.no_data.table().size_bytes());
  }
  ocl::DeviceInfo without = GetParam();
  without.capabilities.nan = false;
  ocl::Device plain(without);
  EXPECT_NO_THROW(DeviceRenderer(plain, full.compressed, {.size = kSize}));
  EXPECT_THAT([&] { DeviceRenderer(plain, holed.compressed, {.size = kSize}); },
              ThrowsMessage<Error>(HasSubstr("has no NaN")));
}

}  // namespace
}  // namespace isowave::core
