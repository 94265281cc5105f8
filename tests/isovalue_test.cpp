// core/zfp/isovalue.hpp: which float32 decoded voxels are compared with.

#include "core/zfp/isovalue.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/error.hpp"

namespace isowave::core {
namespace {

CompressedVolume volume_of(VoxelType type, const BlockPrecision &precision) {
  CompressedVolume volume;
  volume.info.type = type;
  volume.precision = precision;
  return volume;
}

constexpr BlockPrecision kReversible{.min_exponent = ISO_REVERSIBLE};
constexpr BlockPrecision kWhole{.min_exponent = -1, .whole_numbers = true};

TEST(DrawnIsovalue, VoxelsOfALosslessVolumeAreInsideAsTheirSourceIs) {
  const CompressedVolume floats = volume_of(VoxelType::kFloat32, kReversible);
  for (const double isovalue : {0.1, 0.7, -0.1, -0.7, 1e-31, 1e-46, -1e-46, 2.5, 0.0, 3e38}) {
    const float nearest = static_cast<float>(isovalue);
    for (const float voxel :
         {std::nextafter(nearest, -1e30f), nearest, std::nextafter(nearest, 1e30f)})
      EXPECT_EQ(voxel >= drawn_isovalue(floats, isovalue), voxel >= isovalue)
          << voxel << " at " << isovalue;
  }
  EXPECT_GT(drawn_isovalue(floats, 0.7), 0.7);
  EXPECT_EQ(drawn_isovalue(volume_of(VoxelType::kUint16, kWhole), 100.00000001),
            std::nextafter(100.0f, 101.0f));
}

// A float64 voxel at the isovalue was rounded as the isovalue is.
TEST(DrawnIsovalue, OtherVolumesHaveTheNearest) {
  for (const CompressedVolume &volume :
       {volume_of(VoxelType::kFloat64, kReversible), volume_of(VoxelType::kFloat32, {}),
        volume_of(VoxelType::kUint32, kReversible)})
    EXPECT_EQ(drawn_isovalue(volume, 0.7), 0.7f);
}

// What is known of decoded voxels is said, and no more.
TEST(IsovalueNotice, ErrorsOfCompressionCanMakeASurface) {
  CompressedVolume volume = volume_of(VoxelType::kFloat32, kReversible);
  EXPECT_EQ(isovalue_notice(volume, 7), "") << "the range is not known";
  volume.value_range = {0, 1};
  EXPECT_EQ(isovalue_notice(volume, 1), "");
  EXPECT_EQ(isovalue_notice(volume, 0),
            "isovalue 0 is the least of the volume's values, 0 to 1: there is no surface");
  EXPECT_EQ(isovalue_notice(volume, 1.125),
            "isovalue 1.125 is outside the volume's values, 0 to 1: there is no surface");
  volume.precision = {};
  const std::string unknown = "any surface comes from errors of compression",
                    known = unknown + ", which are up to 0.25";
  for (const double isovalue : {-0.125, 0.0, 1.125, 1.25})
    EXPECT_THAT(isovalue_notice(volume, isovalue), testing::EndsWith(unknown));
  volume.max_voxel_error = 0.25;
  EXPECT_EQ(isovalue_notice(volume, 0.5), "");
  for (const double isovalue : {-0.125, 0.0, 1.125, 1.25})
    EXPECT_THAT(isovalue_notice(volume, isovalue), testing::EndsWith(known));
  for (const double isovalue : {-0.25, 1.2500001, -3.0})
    EXPECT_THAT(isovalue_notice(volume, isovalue), testing::EndsWith("there is no surface"));
}

// Else a picture without a surface would have no word of it.
TEST(IsovalueNotice, ValuesThatHaveAllBecomeZeroAreNamed) {
  CompressedVolume volume = volume_of(VoxelType::kFloat64, {});
  volume.value_range = {-1e-33f, 2e-33f};
  EXPECT_THAT(isovalue_notice(volume, 1e-33), testing::HasSubstr("have all become 0 at a rate"));
  volume.precision = kReversible;
  EXPECT_EQ(isovalue_notice(volume, 1e-33), "");
  volume.precision = {};
  volume.value_range = {-1e-33f, 2 * kMinMagnitude};
  EXPECT_EQ(isovalue_notice(volume, 1e-33), "");
}

TEST(DrawnIsovalue, OneThatFloat32DoesNotHoldIsRefused) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double bad : {1e39, -1e39, kInfinity, -kInfinity}) {
    EXPECT_THAT([&] { drawn_isovalue(volume_of(VoxelType::kFloat32, kReversible), bad); },
                testing::ThrowsMessage<Error>(testing::HasSubstr("give a finite number")));
  }
  EXPECT_THAT([&] { drawn_isovalue(volume_of(VoxelType::kFloat32, kReversible), std::nan("")); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("NaN")));
}

}  // namespace
}  // namespace isowave::core
