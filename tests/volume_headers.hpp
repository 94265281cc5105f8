#pragma once
// Tests of volumes' headers: small files that must be read, or refused in one line.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/io/open_volume.hpp"
#include "core/volume/volume.hpp"
#include "tests/run_program.hpp"
#include "tests/volume_file.hpp"

namespace isowave::core::test {

/// The voxels 1, 2, 3, ... read in two goes, as float.
inline void expect_ramp(VolumeReader &reader) {
  ASSERT_EQ(reader.info().dims, glm::uvec3(3, 4, 5));
  constexpr std::size_t kLayer = 12;
  std::vector<float> voxels(60), expected(60);
  for (std::size_t i = 0; i < 60; ++i) expected[i] = float(i + 1);
  reader.read_layers(0, 2, std::span(voxels).first(2 * kLayer));
  reader.read_layers(2, 3, std::span(voxels).subspan(2 * kLayer));
  EXPECT_EQ(voxels, expected);
}

inline void expect_near(const glm::dvec3 &a, const glm::dvec3 &b) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-5) << "axis " << axis;
}

/// The same place in the world from all formats: the defaults of NiftiFields.
inline void expect_geometry(const VolumeInfo &info) {
  const auto world = [&](const glm::dvec3 &index) {
    return info.origin + info.index_to_world() * index;
  };
  expect_near(info.spacing, {0.5, 2, 3});
  expect_near(world({0, 0, 0}), {-10, -20, 30});  // LPS
  expect_near(world({2, 1, 1}), {-11, -18, 33});
}

inline std::string meta_image(const std::string &lines, const std::string &type = "UCHAR") {
  return "ObjectType = Image\nNDims = 3\nDimSize = 3 4 5\nElementType = MET_" + type + "\n" +
         lines + "ElementDataFile = LOCAL\n";
}

class Headers : public testing::Test {
 protected:
  /// The file must be read, with the values 1, 2, 3, ...
  void expect_read(const std::string &name, const std::string &bytes) {
    SCOPED_TRACE(testing::PrintToString(bytes.substr(0, 400)));
    write_file(folder_ / name, bytes);
    expect_ramp(*open_volume(folder_ / name));
  }
  /// The file must be refused in one line that has `text` in it.
  void expect_refused(const std::string &name, const std::string &bytes, const std::string &text) {
    EXPECT_THAT(error_of(folder_ / name, bytes), testing::HasSubstr(text))
        << testing::PrintToString(bytes.substr(0, 400));
  }
  TemporaryFolder folder_;
};

}  // namespace isowave::core::test
