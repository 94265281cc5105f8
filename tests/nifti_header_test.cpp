// NIfTI: geometry in one world convention (LPS), voxels to the byte, and headers that must be
// refused in one line.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/volume_headers.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::expect_geometry;
using test::expect_ramp;
using test::gzip;
using test::Headers;
using test::NiftiFields;
using test::ramp;
using test::write_file;
using test::zlib;
using testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity(),
                kNan = std::numeric_limits<float>::quiet_NaN();

using NiftiFile = Headers;

TEST_F(NiftiFile, RasBecomesLps) {
  write_file(folder_ / "a.nii", NiftiFields().bytes() + ramp());
  write_file(folder_ / "b.nii.gz", gzip(NiftiFields().bytes() + ramp()));
  for (const char *name : {"a.nii", "b.nii.gz"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder_ / name);
    expect_geometry(reader->info());
    EXPECT_EQ(reader->info().type, VoxelType::kUint8);
    EXPECT_TRUE(reader->info().is_anatomical);
    expect_ramp(*reader);
  }
}

TEST_F(NiftiFile, OtherFilesOfTheNameAreNotRead) {
  write_file(folder_ / "a.nii", NiftiFields().bytes() + std::string(60, 'x'));
  expect_read("a.nii.gz",
              gzip(NiftiFields().bytes() + ramp()));  // ITK would take the voxels of a.nii
}

TEST_F(NiftiFile, OriginInTheUnitOfTheSpacings) {
  for (const auto &[unit, millimetres] : {std::pair(char(1), 1e3), {char(3), 1e-3}}) {
    write_file(folder_ / "a.nii", NiftiFields{.xyzt_units = unit}.bytes() + ramp());
    const VolumeInfo info = open_volume(folder_ / "a.nii")->info();
    EXPECT_EQ(info.spacing, glm::dvec3(0.5, 2, 3) * millimetres);
    EXPECT_EQ(info.origin, glm::dvec3(-10, -20, 30) * millimetres);
    const std::vector<std::string> notices = open_volume(folder_ / "a.nii")->notices();
    ASSERT_EQ(notices.size(), 1u);
    EXPECT_THAT(notices[0], HasSubstr(unit == 1 ? "metres" : "micrometres"));
  }
}

/// nibabel's rule, not ITK's: the sform, if there is one.
TEST_F(NiftiFile, TheSformSaysWhereTheVolumeLies) {
  const auto read = [&](const NiftiFields &fields) {
    write_file(folder_ / "a.nii", fields.bytes() + ramp());
    return open_volume(folder_ / "a.nii");
  };
  EXPECT_TRUE(read({})->notices().empty());
  for (const std::int16_t code : std::initializer_list<std::int16_t>{1, 2, 4}) {
    NiftiFields fields{.qform_code = 1, .sform_code = code};
    const auto both = read(fields);
    EXPECT_EQ(both->info().origin, glm::dvec3(-10, -20, 30));
    ASSERT_EQ(both->notices().size(), 1u);
    EXPECT_THAT(both->notices()[0], HasSubstr("its qform says otherwise"));
    fields.quatern = {1, 0, 0};  // turned round x, and flipped along z: the sform's axes
    fields.pixdim[0] = -1;
    fields.qoffset = {10, 20, 30};
    EXPECT_TRUE(read(fields)->notices().empty()) << "both say the same";
  }
  const auto other_steps = read({.pixdim = {1, 0.501f, 2, 3}});
  EXPECT_EQ(other_steps->info().spacing, glm::dvec3(0.5, 2, 3));
  ASSERT_EQ(other_steps->notices().size(), 1u);
  EXPECT_THAT(other_steps->notices()[0], HasSubstr("spacing 0.5 2 3 of its sform is taken"));
  EXPECT_EQ(read({.pixdim = {1, 0.50001f, 2, 3}})->info().spacing.x, double{0.50001f})
      << "rounding";
  EXPECT_EQ(read({.pixdim = {1, 0.6f, 20, 3}})->info().spacing, glm::dvec3(0.5, 2, 3));
}

// As nibabel has it; pixdim[0] alone flips an axis.
TEST_F(NiftiFile, NegativeSpacingsAreTakenByMagnitude) {
  for (const auto &[qform, sform] : {std::pair<std::int16_t, std::int16_t>{0, 0}, {1, 0}, {0, 1}}) {
    for (const float flip : {1.0f, -1.0f}) {
      NiftiFields fields{.qform_code = qform, .sform_code = sform, .pixdim = {flip, 0.5f, 2, 3}};
      write_file(folder_ / "a.nii", fields.bytes() + ramp());
      const VolumeInfo usual = open_volume(folder_ / "a.nii")->info();
      fields.pixdim = {flip, -0.5f, 2, -3};
      write_file(folder_ / "a.nii", fields.bytes() + ramp());
      const auto negative = open_volume(folder_ / "a.nii");
      EXPECT_EQ(negative->info().index_to_world(), usual.index_to_world());
      EXPECT_EQ(negative->info().origin, usual.origin);
      ASSERT_EQ(negative->notices().size(), 2u);
      EXPECT_THAT(negative->notices()[0], HasSubstr("pixdim[1] is -0.5"));
      EXPECT_THAT(negative->notices()[1], HasSubstr("pixdim[3] is -3"));
    }
  }
}

TEST_F(NiftiFile, AnSformMayHaveShear) {
  for (const float shear : {2e-4f, 0.2f}) {
    NiftiFields fields;
    fields.sform[0][1] = shear;
    write_file(folder_ / "a.nii", fields.bytes() + ramp());
    const VolumeInfo info = open_volume(folder_ / "a.nii")->info();
    const glm::dvec3 step = info.index_to_world()[1];
    EXPECT_NEAR(step.x, -double{shear}, 1e-7);
    EXPECT_NEAR(step.y, 2, 1e-7);  // pixdim is 2, and the column 1e-8 longer
  }
  NiftiFields flat;
  flat.sform[1][1] = 0;  // y along x
  flat.sform[0][1] = 2;
  expect_refused("a.nii", flat.bytes() + ramp(), "its sform is singular");
  flat.qform_code = 1;
  write_file(folder_ / "a.nii", flat.bytes() + ramp());
  const auto by_qform = open_volume(folder_ / "a.nii");
  EXPECT_EQ(by_qform->info().origin, glm::dvec3(-1, -2, 3));
  EXPECT_THAT(by_qform->notices()[0], HasSubstr("singular"));
}

/// float32 does not hold them: what it loses is an error like any other.
TEST_F(NiftiFile, ScaledVoxelsAreFloat64) {
  const auto path = folder_ / "a.nii";
  const auto check = [&](const NiftiFields &fields, const auto &voxels) {
    const std::string bytes(reinterpret_cast<const char *>(voxels.data()),
                            voxels.size() * sizeof(voxels[0]));
    write_file(path, fields.bytes() + bytes);
    const auto reader = open_volume(path);
    EXPECT_EQ(reader->info().type, VoxelType::kFloat64);
    std::vector<double> read(60), expected(60);
    std::vector<float> read_floats(60), expected_floats(60);
    for (std::size_t i = 0; i < 60; ++i) {
      expected[i] = double{fields.scl_slope} * double(voxels[i]) + double{fields.scl_inter};
      expected_floats[i] = float(expected[i]);
    }
    reader->read_exact_layers(0, 5, read);
    EXPECT_EQ(read, expected);
    open_volume(path)->read_layers(0, 5, read_floats);
    EXPECT_EQ(read_floats, expected_floats);
  };
  std::vector<std::int16_t> shorts(60);
  std::vector<std::int32_t> ints(60);
  std::vector<float> floats(60);
  for (int i = 0; i < 60; ++i) {
    shorts[std::size_t(i)] = std::int16_t(i * 541 - 16000);
    ints[std::size_t(i)] = (1 << 30) + 7 * i;
    floats[std::size_t(i)] = 0.37f * float(i);
  }
  check({.datatype = 8, .bitpix = 32, .scl_slope = 0.3f, .scl_inter = 5}, ints);
  check({.datatype = 16, .bitpix = 32, .scl_slope = 3, .scl_inter = 1e6f}, floats);
  check({.datatype = 4, .bitpix = 16, .scl_slope = 1e-3f, .scl_inter = 1e6f}, shorts);
  // Up to 1e6, float32's steps are of 1/16.
  const auto run = test::run_isowave("convert " + test::quoted(path) + " --rate 32 -o " +
                                     test::quoted(folder_ / "a.zfp"));
  const std::size_t at = run.out.find("max error ");
  ASSERT_NE(at, std::string::npos) << run.out << run.err;
  EXPECT_GT(std::stod(run.out.substr(at + 10)), 0.02) << run.out;
}

TEST_F(NiftiFile, NumbersThatAreNoneAreRefused) {
  for (const float value : {kNan, kInfinity, -kInfinity}) {
    for (std::size_t i = 0; i < 12; ++i) {
      NiftiFields fields;
      fields.sform[i / 4][i % 4] = value;
      expect_refused("a.nii", fields.bytes() + ramp(), "the sform is");
      expect_refused("a.nii.gz", gzip(fields.bytes() + ramp()), "the sform is");
    }
    for (std::size_t i = 0; i < 4; ++i) {
      NiftiFields fields{.qform_code = 1};
      fields.pixdim[i] = value;
      expect_refused("a.nii", fields.bytes() + ramp(), "pixdim");
    }
    for (std::size_t i = 0; i < 3; ++i) {
      NiftiFields fields{.qform_code = 1, .sform_code = 0};
      fields.quatern[i] = value;
      expect_refused("a.nii", fields.bytes() + ramp(), "quatern");
      fields.quatern[i] = 0;
      fields.qoffset[i] = value;
      expect_refused("a.nii", fields.bytes() + ramp(), "qoffset");
    }
    expect_refused("a.nii", NiftiFields{.vox_offset = value}.bytes() + ramp(), "vox_offset");
  }
  expect_refused("a.nii", NiftiFields{.scl_slope = kInfinity}.bytes() + ramp(), "scl_slope");
  expect_refused("a.nii", NiftiFields{.scl_slope = 1, .scl_inter = kNan}.bytes() + ramp(),
                 "scl_inter");
  expect_refused("a.nii", NiftiFields{.scl_inter = 1}.bytes() + ramp(),
                 "scl_inter 1 without a scl_slope");
}

TEST_F(NiftiFile, HugeNumbersEnd) {
  for (const float value :
       {0x1p127f, -0x1p127f, std::numeric_limits<float>::max(), 1e20f, 1e-38f, 0.0f}) {
    for (std::size_t i = 0; i < 12; ++i) {
      NiftiFields fields;
      fields.sform[i / 4][i % 4] = value;
      const std::string error = error_of(folder_ / "a.nii", fields.bytes() + ramp());
      if (i % 5 == 0) {  // on the diagonal
        EXPECT_EQ(error.find("its sform is singular") != std::string::npos, value == 0.0f) << error;
      }
    }
  }
}

TEST_F(NiftiFile, RefusedHeaders) {
  EXPECT_EQ(error_of(folder_ / "a.nii", NiftiFields().bytes() + ramp()), "");
  expect_refused("a.nii", "", "shorter than a NIfTI header");
  expect_refused("a.nii", std::string(352, 'x'), "not a NIfTI-1 file");
  expect_refused("a.nii.gz", gzip(std::string(352, 'x')), "not a NIfTI-1 file");
  expect_refused("a.nii", NiftiFields{.sizeof_hdr = 540}.bytes() + ramp(), "NIfTI-2");
  expect_refused("a.nii", NiftiFields{.magic = std::string("ni1\0", 4)}.bytes() + ramp(),
                 ".img file");
  expect_refused("a.nii", NiftiFields{.magic = std::string(4, '\0')}.bytes() + ramp(),
                 "not a NIfTI-1 file");
  expect_refused("a.nii", NiftiFields{.dim = {3, -3, 4, 5}}.bytes() + ramp(),
                 "-3 voxels along axis 1");
  expect_refused("a.nii", NiftiFields{.dim = {3, 32767, 4, 5}}.bytes() + ramp(), "truncated");
  expect_refused("a.nii", NiftiFields{.dim = {4, 3, 4, 5, 2}}.bytes() + ramp() + ramp(),
                 "an image of 4 axes");
  expect_refused("a.nii", NiftiFields{.dim = {2, 3, 4}}.bytes() + ramp(), "an image of 2 axes");
  expect_refused("a.nii", NiftiFields{.dim = {8, 3, 4, 5}}.bytes() + ramp(), "8 axes");
  expect_refused("a.nii", NiftiFields{.datatype = 128, .bitpix = 24}.bytes() + ramp(false, 180),
                 "datatype 128");
  expect_refused("a.nii", NiftiFields{.datatype = 1536, .bitpix = 128}.bytes() + ramp(),
                 "datatype 1536");
  expect_refused("a.nii", NiftiFields{.bitpix = 16}.bytes() + ramp(), "bitpix 16");
  expect_refused("a.nii", NiftiFields{.intent = 1004}.bytes() + ramp(), "matrices");
  for (const float offset : {-1.0f, 0.0f, 348.0f, 352.5f, 1e30f}) {
    expect_refused("a.nii", NiftiFields{.vox_offset = offset}.bytes() + ramp(), "voxels at byte");
  }
  expect_refused("a.nii", NiftiFields{.vox_offset = 1e8f}.bytes() + ramp(), "truncated");
  expect_refused("a.nii.gz", gzip(NiftiFields{.vox_offset = 1e8f}.bytes() + ramp()), "truncated");
  expect_refused("a.nii", NiftiFields().bytes() + ramp() + "x", "too long");
  expect_refused("a.nii", NiftiFields().bytes() + ramp().substr(1), "truncated");
  const std::string packed = gzip(NiftiFields().bytes() + ramp());
  expect_refused("a.nii.gz", gzip(NiftiFields().bytes() + ramp() + "x"), "too long");
  expect_refused("a.nii.gz", gzip(NiftiFields().bytes() + ramp().substr(1)), "truncated");
  expect_refused("a.nii.gz", packed + std::string(512, '\0'), "follow it");
  expect_refused("a.nii.gz", zlib(NiftiFields().bytes() + ramp()), "not a gzip file");
  expect_refused("a.nii", NiftiFields{.xyzt_units = 7}.bytes() + ramp(), "xyzt_units");
  expect_refused("a.nii", NiftiFields{.sform_code = -1}.bytes() + ramp(), "code -1");
  expect_refused("a.nii", NiftiFields{.qform_code = 1, .quatern = {0.9f, 0.9f, 0}}.bytes() + ramp(),
                 "quaternion");
}

}  // namespace
}  // namespace isowave::core
