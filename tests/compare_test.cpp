// What `isowave compare` counts, and its exit status.

#include "core/accuracy/compare.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(CompareDepth, EqualBits) {
  const FloatImage image{2, 2, {1.0f, kInf, kNan, -0.0f}};
  const DepthComparison result = compare_depth(image, image);
  EXPECT_EQ(result.num_pixels, 4u);
  EXPECT_EQ(result.num_differing, 0u);
  EXPECT_EQ(result.hit_both, 2u);
  EXPECT_EQ(result.false_positives + result.false_negatives, 0u);
  ASSERT_TRUE(result.error);
  EXPECT_EQ(result.error->max, 0.0);
}

TEST(CompareDepth, CountsBitsHolesAndGhosts) {
  const FloatImage a{3, 2, {1.0f, kInf, 2.0f, 3.0f, kInf, 0.0f}};
  const FloatImage b{3, 2, {1.0f, 5.0f, kInf, 3.5f, kInf, -0.0f}};
  const DepthComparison result = compare_depth(a, b);
  EXPECT_EQ(result.num_differing, 4u) << "-0 and 0 are different bits";
  EXPECT_EQ(result.hit_both, 3u);
  EXPECT_EQ(result.false_positives, 1u);
  EXPECT_EQ(result.false_negatives, 1u);
  EXPECT_EQ(result.error->p50, 0.0);
  EXPECT_EQ(result.error->max, 0.5);
}

TEST(CompareDepth, PercentilesAreNearestRank) {
  FloatImage a{200, 1, std::vector<float>(200, 0.0f)}, b = a;
  for (std::size_t i = 0; i < 200; ++i)
    b.pixels[i] = static_cast<float>((i * 77) % 200 + 1);  // 1..200, shuffled
  const DepthComparison result = compare_depth(a, b);
  EXPECT_EQ(result.error->p50, 100.0);
  EXPECT_EQ(result.error->p99, 198.0);
  EXPECT_EQ(result.error->max, 200.0);
  EXPECT_EQ(compare_depth({1, 1, {2.0f}}, {1, 1, {5.0f}}).error->p50, 3.0);
}

TEST(CompareDepth, NoHitsMeanNoError) {
  const FloatImage nothing{2, 1, {kInf, kInf}};
  EXPECT_FALSE(compare_depth(nothing, nothing).error);
  EXPECT_FALSE(compare_depth({0, 0, {}}, {0, 0, {}}).error);
}

TEST(CompareDepth, SizesMustAgree) {
  EXPECT_THROW(compare_depth({2, 1, {1, 1}}, {1, 2, {1, 1}}), Error);
}

TEST(CompareColour, CountsPixelsNotChannels) {
  const Image8 a{2, 1, 3, {10, 20, 30, 40, 50, 60}};
  Image8 b = a;
  EXPECT_EQ(compare_colour(a, b).num_differing, 0u);
  EXPECT_FALSE(compare_colour(a, b).psnr_db);
  b.pixels = {13, 24, 30, 40, 50, 60};
  const ColourComparison result = compare_colour(a, b);
  EXPECT_EQ(result.num_pixels, 2u);
  EXPECT_EQ(result.num_differing, 1u);
  EXPECT_EQ(result.max_channel_difference, 4u);
  EXPECT_NEAR(result.psnr_db.value(), 20.0 * std::log10(255.0) - 10.0 * std::log10(25.0 / 6.0),
              1e-12);
}

TEST(CompareColour, SizesAndChannelsMustAgree) {
  EXPECT_THROW(compare_colour({1, 1, 3, {1, 2, 3}}, {1, 1, 4, {1, 2, 3, 4}}), Error);
  EXPECT_THROW(compare_colour({1, 2, 3, {1, 2, 3, 4, 5, 6}}, {2, 1, 3, {1, 2, 3, 4, 5, 6}}), Error);
}

class CompareProgram : public testing::Test {
 protected:
  struct Outcome {
    int status = -1;
    std::string output;  ///< stdout and stderr
  };

  /// Runs `isowave compare` with the folder's files a and b.
  Outcome run(const std::string &a, const std::string &b, const std::string &options = "") {
    const std::string command = test::isowave_program() + " compare " + (folder_ / a).string() +
                                " " + (folder_ / b).string() + " " + options + " 2>&1";
    std::FILE *pipe = popen(command.c_str(), "r");
    Outcome outcome;
    std::array<char, 256> buffer{};
    while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr)
      outcome.output += buffer.data();
    outcome.status = WEXITSTATUS(pclose(pipe));
    return outcome;
  }

  void SetUp() override {
    write_npy({2, 1, {1.0f, kInf}}, folder_ / "a.npy");
    write_npy({2, 1, {1.0f, 4.0f}}, folder_ / "b.npy");
    write_npy({1, 1, {1.0f}}, folder_ / "small.npy");
    write_png({1, 1, 3, {1, 2, 3}}, folder_ / "a.png");
    write_png({1, 1, 3, {1, 2, 9}}, folder_ / "b.png");
  }

  test::TemporaryFolder folder_;
};

TEST_F(CompareProgram, ExactFailsOnlyOnDifferences) {
  EXPECT_EQ(run("a.npy", "a.npy", "--exact").status, 0);
  EXPECT_EQ(run("a.npy", "b.npy").status, 0);
  const Outcome differing = run("a.npy", "b.npy", "--exact");
  EXPECT_EQ(differing.status, 1);
  EXPECT_THAT(differing.output, HasSubstr("differing: 1 of 2 pixels"));
  EXPECT_THAT(differing.output, testing::Not(HasSubstr("isowave:")));
  EXPECT_EQ(run("a.png", "a.png", "--exact").status, 0);
  EXPECT_EQ(run("a.png", "b.png", "--exact").status, 1);
}

TEST_F(CompareProgram, PrintsJson) {
  const auto depth = nlohmann::json::parse(run("a.npy", "b.npy", "--json").output);
  EXPECT_EQ(depth.at("differing"), 1);
  EXPECT_EQ(depth.at("false_positives"), 1);
  EXPECT_EQ(depth.at("false_negatives"), 0);
  EXPECT_EQ(depth.at("depth_error").at("max"), 0.0);
  const auto colour = nlohmann::json::parse(run("a.png", "b.png", "--json").output);
  EXPECT_EQ(colour.at("max_channel_difference"), 6);
  EXPECT_GT(colour.at("flip"), 0.0);
}

TEST_F(CompareProgram, ErrorsAreOneLine) {
  for (const char *other : {"small.npy", "a.png", "absent.npy"}) {
    const Outcome outcome = run("a.npy", other);
    EXPECT_EQ(outcome.status, 1) << other;
    EXPECT_THAT(outcome.output, StartsWith("isowave: "));
    EXPECT_EQ(outcome.output.find('\n'), outcome.output.size() - 1) << outcome.output;
  }
}

}  // namespace
}  // namespace isowave::core
