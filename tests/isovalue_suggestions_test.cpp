// core/zfp/isovalue_suggestions.hpp: Otsu's threshold and peaks of the gradient.

#include "core/zfp/isovalue_suggestions.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "core/base/error.hpp"
#include "core/zfp/voxel_sample.hpp"
#include "tests/array_reader.hpp"
#include "tests/no_data_volumes.hpp"

namespace isowave::core {
namespace {

using test::kNone;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;
using Field = std::function<double(const glm::dvec3 &at)>;

constexpr BlockPrecision kLossless{.min_exponent = ISO_REVERSIBLE};

VolumeInfo info_of(const glm::uvec3 &dims, VoxelType type = VoxelType::kFloat32) {
  VolumeInfo info;
  info.dims = dims;
  info.type = type;
  return info;
}

std::vector<float> voxels_of(const glm::uvec3 &dims, const Field &field) {
  std::vector<float> voxels;
  for (std::uint32_t z = 0; z < dims.z; ++z)
    for (std::uint32_t y = 0; y < dims.y; ++y)
      for (std::uint32_t x = 0; x < dims.x; ++x)
        voxels.push_back(static_cast<float>(field({x, y, z})));
  return voxels;
}

CompressedVolume volume_of(const VolumeInfo &info, const std::vector<float> &voxels) {
  ArrayReader reader(info, voxels);
  return compress(reader, {.precision = kLossless});
}

IsovalueSuggestions suggested(const VolumeInfo &info, const Field &field) {
  return suggest_isovalues(volume_of(info, voxels_of(info.dims, field)));
}

/// From 0 to 1 around `middle`, smooth; steepest, 1 / width, in the middle.
double step(double x, double middle, double width) {
  return 0.5 + 0.5 * std::tanh(2 * (x - middle) / width);
}

/// Materials of values 0, 80, 160 and 400. The borders from 0 to 80, along x, and from 80 to 160,
/// along z, are smooth, so that gradients are largest at 40 and at 120; the latter is steeper in
/// voxels. The regions along y meet where blocks do, so no cell of a block has voxels of two.
double four_materials(const glm::dvec3 &at) {
  if (at.y < 12) return 80 * step(at.x, 32, 14);
  if (at.y < 24) return 80 + 80 * step(at.z, 16, 10);
  return 400;
}
constexpr glm::uvec3 kMaterialDims = {64, 36, 32};
constexpr double kMaterialBin = 400.0 / kHistogramBins;

std::vector<double> peaks_of(const IsovalueSuggestions &suggestions) {
  std::vector<double> peaks;
  for (const SuggestedIsovalue &suggestion : suggestions.isovalues)
    if (suggestion.by == SuggestedBy::kGradient) peaks.push_back(suggestion.isovalue);
  return peaks;
}

/// The value whose classes, below it and from it on, have the largest variance between them, found
/// by the voxels themselves.
double best_variance(const std::vector<float> &voxels, double isovalue) {
  double counts[2] = {}, sums[2] = {};
  for (const float voxel : voxels) {
    ++counts[voxel >= isovalue];
    sums[voxel >= isovalue] += voxel;
  }
  const double distance = sums[0] / counts[0] - sums[1] / counts[1];
  return counts[0] * counts[1] * distance * distance;
}

TEST(SuggestedIsovalues, OtsusIsBetweenTwoModes) {
  // Noise around 20, and around 180 in a quarter of the volume.
  const auto field = [](const glm::dvec3 &at) {
    const double noise = std::fmod(at.x * 7 + at.y * 13 + at.z * 29, 31.0) - 15;
    return (at.x < 16 ? 180 : 20) + noise;
  };
  const VolumeInfo info = info_of({64, 32, 32}, VoxelType::kUint8);
  const std::vector<float> voxels = voxels_of(info.dims, field);
  const IsovalueSuggestions result = suggest_isovalues(volume_of(info, voxels));
  ASSERT_FALSE(result.isovalues.empty());
  const auto [isovalue, by] = result.isovalues.front();
  EXPECT_EQ(by, SuggestedBy::kOtsu);
  // The stretch from 35 to 165 is empty: its middle is farthest from both.
  EXPECT_NEAR(isovalue, 100, 1.5);
  EXPECT_EQ(isovalue - std::floor(isovalue), 0.5) << "between integers";
  for (double other = 6; other < 195; other += 0.5)
    EXPECT_LE(best_variance(voxels, other), best_variance(voxels, isovalue)) << other;
  std::uint64_t count = 0;
  for (const std::uint64_t bin : result.counts) count += bin;
  EXPECT_EQ(count, voxels.size());
}

// Otsu's threshold of unequal classes that touch, beside the best of all values.
TEST(SuggestedIsovalues, OtsusDividesBestWithinABin) {
  const auto field = [](const glm::dvec3 &at) { return std::pow(at.x / 63, 3) + 0.001 * at.y; };
  const VolumeInfo info = info_of({64, 32, 8});
  const std::vector<float> voxels = voxels_of(info.dims, field);
  const IsovalueSuggestions result = suggest_isovalues(volume_of(info, voxels));
  double best = 0.001;
  for (int i = 2; i < 1000; ++i)
    if (best_variance(voxels, 0.001 * i) > best_variance(voxels, best)) best = 0.001 * i;
  EXPECT_NEAR(result.isovalues.at(0).isovalue, best, 2 * 1.031 / 256);
}

TEST(SuggestedIsovalues, GradientsPeakAtTheBordersOfMaterials) {
  const IsovalueSuggestions result = suggested(info_of(kMaterialDims), four_materials);
  EXPECT_NEAR(result.isovalues.at(0).isovalue, 280, kMaterialBin);
  EXPECT_THAT(peaks_of(result),
              ElementsAre(DoubleNear(120, 2 * kMaterialBin), DoubleNear(40, 2 * kMaterialBin)));
}

// If voxels are four times as far apart along z, the border along x is the steeper one.
TEST(SuggestedIsovalues, GradientsAreThoseOfWorldSpace) {
  VolumeInfo info = info_of(kMaterialDims);
  info.spacing = {1, 1, 4};
  EXPECT_THAT(peaks_of(suggested(info, four_materials)),
              ElementsAre(DoubleNear(40, 2 * kMaterialBin), DoubleNear(120, 2 * kMaterialBin)));
}

// The border from 80 to 160 now fills the histogram about Otsu's threshold: one of them is enough.
TEST(SuggestedIsovalues, AreFarFromEachOther) {
  const IsovalueSuggestions result = suggested(info_of(kMaterialDims), [](const glm::dvec3 &at) {
    return at.y < 24 ? 300 * step(at.x, 32, 14) : 150;
  });
  for (std::size_t i = 0; i < result.isovalues.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GE(std::abs(result.isovalues[i].isovalue - result.isovalues[j].isovalue), 300 / 12);
  EXPECT_EQ(result.isovalues.at(0).by, SuggestedBy::kOtsu);
}

TEST(SuggestedIsovalues, OneValueSuggestsNothing) {
  const VolumeInfo info = info_of({9, 9, 9});
  const CompressedVolume constant = volume_of(info, std::vector<float>(9 * 9 * 9, 7));
  EXPECT_THAT(suggest_isovalues(constant).isovalues, testing::IsEmpty());
  EXPECT_THAT([&] { first_suggestion(constant, "--isovalue"); },
              ThrowsMessage<Error>(HasSubstr("all voxels have the value 7")));
  const CompressedVolume nothing = volume_of(info, std::vector<float>(9 * 9 * 9, kNone));
  EXPECT_THAT(suggest_isovalues(nothing).isovalues, testing::IsEmpty());
  EXPECT_THAT([&] { first_suggestion(nothing, "--isovalue"); },
              ThrowsMessage<Error>(HasSubstr("no voxel has data, so no isovalue can be suggested: "
                                             "give --isovalue")));
}

// The range is known, but all sampled voxels fall into one bin: the middle is better than nothing.
TEST(SuggestedIsovalues, OneBinSuggestsTheMiddle) {
  const std::vector<float> block(ISO_BLOCK_VOXELS, 1.0f);
  const auto result = suggest_isovalues(info_of({4, 4, 4}), {0, 100}, block);
  ASSERT_EQ(result.isovalues.size(), 1u);
  EXPECT_EQ(result.isovalues[0].isovalue, 50);
  EXPECT_EQ(to_string(result.isovalues[0].by), "middle of the range");
}

// The values in the place of voxels without data, and in the padding of blocks, would move both.
TEST(SuggestedIsovalues, VoxelsWithoutDataAreLeftOut) {
  const glm::uvec3 dims(61, 34, 31);
  const auto hole = [](const glm::uvec3 &at) { return at.y > 24 || at.z == 5 || at.x % 9 == 0; };
  const std::vector<float> voxels = test::with_hole(dims, voxels_of(dims, four_materials), hole);
  const CompressedVolume volume = volume_of(info_of(dims), voxels);
  const IsovalueSuggestions result = suggest_isovalues(volume);
  std::uint64_t count = 0;
  for (const std::uint64_t bin : result.counts) count += bin;
  EXPECT_EQ(count, std::ranges::count_if(voxels, [](float v) { return !std::isnan(v); }));
  EXPECT_NEAR(result.isovalues.at(0).isovalue, 280, kMaterialBin);
  EXPECT_THAT(peaks_of(result),
              ElementsAre(DoubleNear(120, 2 * kMaterialBin), DoubleNear(40, 2 * kMaterialBin)));
}

TEST(SuggestedIsovalues, AreRoundedAndWithinTheRange) {
  for (const double scale : {1e-30, 1e-3, 0.7, 1.0, 3.3, 1e6, 1e30}) {
    const double offset = 12.5 * scale;
    const IsovalueSuggestions result = suggested(info_of(kMaterialDims), [&](const glm::dvec3 &at) {
      return offset + scale * four_materials(at);
    });
    ASSERT_FALSE(result.isovalues.empty());
    for (const SuggestedIsovalue &suggestion : result.isovalues) {
      EXPECT_GT(suggestion.isovalue, result.range[0]);
      EXPECT_LE(suggestion.isovalue, result.range[1]);
      EXPECT_EQ(std::stod(fmt::format("{:.4g}", suggestion.isovalue)), suggestion.isovalue);
    }
  }
}

TEST(SuggestedIsovalues, AreAlwaysTheSame) {
  const VolumeInfo info = info_of({64, 64, 64});
  const std::vector<float> voxels = voxels_of(info.dims, [](const glm::dvec3 &at) {
    return std::sin(at.x / 9) + std::cos(at.y * at.z / 99);
  });
  const CompressedVolume volume = volume_of(info, voxels);
  const auto first = suggest_isovalues(volume), second = suggest_isovalues(volume);
  EXPECT_EQ(first.counts, second.counts);
  ASSERT_EQ(first.isovalues.size(), second.isovalues.size());
  for (std::size_t i = 0; i < first.isovalues.size(); ++i)
    EXPECT_EQ(first.isovalues[i].isovalue, second.isovalues[i].isovalue);
}

// Layers of voxels give the sample that the compressed volume gives.
TEST(LayerSampler, CollectsTheSampleOfBlocks) {
  for (const std::uint64_t max_voxels : {64u, 1000u, 1u << 20}) {
    const glm::uvec3 dims(37, 18, 23);
    const std::vector<float> voxels = test::with_hole(
        dims, voxels_of(dims, [](const glm::dvec3 &at) { return at.x + 100 * at.y + 1e4 * at.z; }),
        [](const glm::uvec3 &at) { return at.x == 9; });
    const std::vector<float> decoded = decode_sample(volume_of(info_of(dims), voxels), max_voxels);
    LayerSampler sampler(dims, max_voxels);
    const std::size_t layer = dims.x * dims.y;
    for (std::uint32_t z = 0; z < dims.z; ++z)
      sampler.add_layer<float>(z, std::span(voxels).subspan(layer * z, layer));
    ASSERT_EQ(decoded.size(), sampler.voxels().size());
    for (std::size_t i = 0; i < decoded.size(); ++i) {
      const float collected = sampler.voxels()[i];
      EXPECT_TRUE(decoded[i] == collected || (std::isnan(decoded[i]) && std::isnan(collected)))
          << decoded[i] << " is " << collected << " at " << i;
    }
    EXPECT_EQ(BlockSample(dims, max_voxels).count() * ISO_BLOCK_VOXELS, decoded.size());
  }
}

}  // namespace
}  // namespace isowave::core
