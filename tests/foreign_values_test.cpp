// Values that our compressor never writes, in `.zfp` files of other writers and of liars: NaN,
// infinities, and magnitudes that cannot be drawn.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/extract/extractor.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/zfp/stated_errors.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_file.hpp"
#include "reference/mesh_twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/mesh_checks.hpp"
#include "tests/run_program.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_pipelines.hpp"
#include "tests/zfp_trailer_file.hpp"

namespace isowave::core {
namespace {

using test::quoted;
using test::TemporaryFolder;
using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();
constexpr glm::uvec3 kDims(17, 14, 13);

/// A smooth field, of which some voxels have another value.
std::vector<float> with_values(float value, const std::function<bool(const glm::uvec3 &at)> &has) {
  std::vector<float> voxels = test::sample(kDims, test::gyroid_field(9));
  std::size_t i = 0;
  for (std::uint32_t z = 0; z < kDims.z; ++z) {
    for (std::uint32_t y = 0; y < kDims.y; ++y) {
      for (std::uint32_t x = 0; x < kDims.x; ++x, ++i)
        voxels[i] = has({x, y, z}) ? value : voxels[i];
    }
  }
  return voxels;
}
std::vector<float> with_scattered(float value) {
  return with_values(value,
                     [](const glm::uvec3 &at) { return (7 * at.x + at.y + at.z) % 11 == 3; });
}

class ForeignValues : public testing::Test {
 protected:
  /// Compresses voxels by zfp's own tool.
  void write(const std::vector<float> &voxels, const std::string &mode) {
    test::write_file(raw_, voxels);
    const auto run =
        test::run_command(fmt::format("zfp -q -h -f -3 {} {} {} {} -i {} -z {}", kDims.x, kDims.y,
                                      kDims.z, mode, quoted(raw_), quoted(path_)));
    ASSERT_EQ(run.status, 0) << run.err;
  }

  TemporaryFolder folder_;
  const std::filesystem::path raw_ = folder_ / "a_17x14x13_float32.raw", path_ = folder_ / "a.zfp";
};

TEST_F(ForeignValues, NanHasNoData) {
  const auto scattered = with_scattered(kNan),
             half = with_values(kNan, [](const glm::uvec3 &at) { return at.x > 8; }),
             all = with_values(kNan, [](const glm::uvec3 &) { return true; }),
             last = with_values(kNan, [](const glm::uvec3 &at) { return at == kDims - 1u; }),
             none = with_values(kNan, [](const glm::uvec3 &) { return false; });
  for (const auto &voxels : {scattered, half, all, last, none}) {
    write(voxels, "-R");
    ArrayReader reader(kDims, voxels);
    const CompressedVolume ours = compress(reader, {.precision = BlockPrecision{ISO_REVERSIBLE}}),
                           theirs = open_zfp_file(path_);
    EXPECT_TRUE(std::ranges::equal(theirs.no_data.table(), ours.no_data.table()));
    EXPECT_EQ(theirs.no_data.num_voxels(), ours.no_data.num_voxels());
    EXPECT_EQ(check_zfp_file(path_).no_data.num_voxels(), ours.no_data.num_voxels());
    const std::vector<float> got = decode_with_libzfp(theirs), expected = decode_with_libzfp(ours);
    EXPECT_EQ(std::memcmp(got.data(), expected.data(), got.size() * sizeof(float)), 0);
    write_zfp_file(theirs, folder_ / "b.zfp");
    const CompressedVolume again = open_zfp_file(folder_ / "b.zfp");
    EXPECT_TRUE(std::ranges::equal(again.no_data.table(), ours.no_data.table()));
    EXPECT_NO_THROW(check_stated_errors(again, {}));
  }
}

TEST_F(ForeignValues, NanIsDrawnAndExtractedAsInOurFiles) {
  write(with_scattered(kNan), "-R");
  const auto info = test::run_isowave("info --json " + quoted(path_));
  EXPECT_THAT(info.out, HasSubstr("\"no_data_voxels\": ")) << info.err;
  const std::filesystem::path picture = folder_ / "p.png", mesh = folder_ / "m.ply";
  for (const std::string &command : std::vector<std::string>{
           "render -i 0.2 --device cpu --size 48x32 -o " + quoted(picture) + " ",
           "render -i 0.2 --reference --size 48x32 -o " + quoted(picture) + " ",
           "extract -i 0.2 --device cpu -o " + quoted(mesh) + " "}) {
    const std::filesystem::path &output = command[0] == 'e' ? mesh : picture;
    std::vector<std::string> outputs;
    for (const std::filesystem::path &volume : {raw_, path_}) {
      const auto run = test::run_isowave(command + quoted(volume));
      ASSERT_EQ(run.status, 0) << run.err;
      outputs.push_back(test::read_file(output));
    }
    EXPECT_TRUE(outputs[0] == outputs[1]) << command;
  }
}

TEST_F(ForeignValues, OthersAreRefusedInOneLine) {
  const auto one = [](float value) {
    return with_values(value, [](const glm::uvec3 &at) { return at == glm::uvec3(5, 9, 12); });
  };
  const auto refused = [this](const std::string &text) {
    for (const std::string command :
         {"info ", "render --reference -i 0 -o a.png ", "render --device cpu -i 0 -o a.png ",
          "extract --device cpu -i 0 -o a.ply "}) {
      const auto run = test::run_isowave(command + quoted(path_));
      EXPECT_EQ(run.status, 1) << command;
      EXPECT_EQ(std::ranges::count(run.err, '\n'), 1) << run.err;
      EXPECT_THAT(run.err, HasSubstr(text)) << command;
    }
  };
  for (const float value : {kInfinity, -kInfinity}) {
    write(one(value), "-R");
    refused("voxel x=5, y=9, z=12 is infinite: decode the file by zfp -h -z");
  }
  for (const std::string mode : {"-R", "-a 1e30", "-r 16", "-r 8"}) {
    write(one(mode == "-r 8" ? -3e38f : 1e38f), mode);
    refused("cannot be drawn, scale the volume down");
    write(one(0x1.8p125f), mode);
    EXPECT_NO_THROW(open_zfp_file(path_)) << mode;
  }
}

TEST_F(ForeignValues, InfoRefusesNanThatATrailerDoesNotName) {
  write(with_scattered(kNan), "-R");
  CompressedVolume volume = open_zfp_file(path_);
  volume.no_data = {};
  volume.value_range = {-2, 2};
  write_zfp_file(volume, path_);
  test::expect_one_line_error("info " + quoted(path_), "0 voxels have no data, its blocks hold");
}

// ---- trailers that hide them: what is drawn may be anything, but nothing is read or written
// beside memory, and it ends

class HostileValues : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  void draw(const CompressedVolume &volume) {
    constexpr ImageSize kSize{24, 16};
    ocl::Device device(GetParam().device);
    DeviceRenderer renderer(device, volume, GetParam().with({.size = kSize}));
    HostRenderer host(volume);
    const Camera camera = orbit_cameras(volume.info, 3)[2];
    for (const float isovalue : {0.2f, -1e38f}) {
      FrameRequest request{.camera = camera, .isovalue = isovalue};
      renderer.render(request);
      EXPECT_EQ(renderer.hits().size(), 24u * 16);
      request.size = kSize;
      host.render(request);
      EXPECT_EQ(host.hits().size(), 24u * 16);
    }
    Extractor extractor(device, volume, {});
    for (const float isovalue : {0.2f, -1e38f}) {
      Mesh mesh;
      extractor.extract(isovalue, mesh);
      for (const Triangle &triangle : mesh.triangles) {
        for (const std::uint32_t vertex : triangle) ASSERT_LT(vertex, mesh.vertices.size());
      }
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Pipelines, HostileValues, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(HostileValues, SmallHiddenOnesDoNoHarm) {
  for (const float value : {kNan, kInfinity, -kInfinity, 3e38f}) {
    CompressedVolume volume = compress_with_libzfp(with_scattered(value), kDims, 0, ISO_REVERSIBLE);
    volume.index = index_by_decoding(volume);
    draw(volume);
  }
}

TEST_P(HostileValues, SmallRandomStreamsDoNoHarm) {
  Random random(5);
  for (const std::int32_t min_exponent : {ISO_REVERSIBLE, ISO_ALL_PLANES}) {
    CompressedVolume volume;
    volume.info = test::grid_info(kDims);
    volume.precision.min_exponent = min_exponent;
    BlockIndexBuilder index;
    for (std::uint64_t block = 0; block < volume.block_count(); ++block) {
      const std::uint32_t bits = 1 + random() % ISO_MAX_BLOCK_BITS;
      index.add(bits);
      volume.indexed_bits += bits;
    }
    volume.index = index.finish();
    volume.words.resize((volume.indexed_bits + 31) / 32 + kDecoderAhead);
    for (std::uint64_t block = 0; block < volume.words.size() - kDecoderAhead; ++block)
      volume.words[block] = random();
    for (std::uint64_t block = 0; min_exponent == ISO_REVERSIBLE && block < volume.block_count();
         ++block) {  // bits of floats: any are NaN, infinite, huge, tiny
      const std::uint64_t bit = volume.block_begin(block);
      volume.words[bit / 32] |= 3u << bit % 32;
      if (bit % 32 == 31) volume.words[bit / 32 + 1] |= 1u;
    }
    draw(volume);
  }
}

}  // namespace
}  // namespace isowave::core
