// NRRD, MetaImage and NIfTI: geometry in one world convention (LPS), voxels to the byte, and
// headers that must be refused in one line. itk_agreement_test.cpp compares the same with ITK.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <limits>
#include <thread>

#include "core/base/error.hpp"
#include "core/io/open_volume.hpp"
#include "core/volume/volume.hpp"
#include "tests/run_program.hpp"
#include "tests/volume_file.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::gzip;
using test::NiftiFields;
using test::ramp;
using test::TemporaryFolder;
using test::write_file;
using test::zlib;
using testing::Each;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr float kInfinity = std::numeric_limits<float>::infinity(),
                kNan = std::numeric_limits<float>::quiet_NaN();

/// The voxels 1, 2, 3, ... read in two goes, as float.
void expect_ramp(VolumeReader &reader) {
  ASSERT_EQ(reader.info().dims, glm::uvec3(3, 4, 5));
  constexpr std::size_t kLayer = 12;
  std::vector<float> voxels(60), expected(60);
  for (std::size_t i = 0; i < 60; ++i) expected[i] = float(i + 1);
  reader.read_layers(0, 2, std::span(voxels).first(2 * kLayer));
  reader.read_layers(2, 3, std::span(voxels).subspan(2 * kLayer));
  EXPECT_EQ(voxels, expected);
}

void expect_near(const glm::dvec3 &a, const glm::dvec3 &b) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-5) << "axis " << axis;
}

/// The same place in the world from all formats: the defaults of NiftiFields.
void expect_geometry(const VolumeInfo &info) {
  const auto world = [&](const glm::dvec3 &index) {
    return info.origin + info.index_to_world() * index;
  };
  expect_near(info.spacing, {0.5, 2, 3});
  expect_near(world({0, 0, 0}), {-10, -20, 30});  // LPS
  expect_near(world({2, 1, 1}), {-11, -18, 33});
}

std::string nrrd(const std::string &lines, const std::string &type = "uint8") {
  return "NRRD0004\ntype: " + type + "\ndimension: 3\nsizes: 3 4 5\n" + lines;
}
std::string meta_image(const std::string &lines, const std::string &type = "UCHAR") {
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
    EXPECT_THAT(error_of(folder_ / name, bytes), HasSubstr(text))
        << testing::PrintToString(bytes.substr(0, 400));
  }
  TemporaryFolder folder_;
};
using NrrdFile = Headers;
using MetaImageFile = Headers;
using NiftiFile = Headers;
using DetachedFile = Headers;

TEST_F(NrrdFile, SpaceDirections) {
  const auto read = [&](const std::string &space, const std::string &directions,
                        const std::string &origin) {
    write_file(folder_ / "a.nrrd", nrrd("space: " + space + "\nspace directions: " + directions +
                                        "\nspace origin: " + origin + "\nencoding: raw\n\n") +
                                       ramp());
    const auto reader = open_volume(folder_ / "a.nrrd");
    expect_geometry(reader->info());
    expect_ramp(*reader);
  };
  read("right-anterior-superior", "(0.5,0,0) (0,-2,0) (0,0,3)", "(10,20,30)");
  read("left-posterior-superior", "(-0.5,0,0) (0,2,0) (0,0,3)", "(-10,-20,30)");
  read("LAS", "(-0.5,0,0) (0,-2,0) (0,0,3)", "(-10,20,30)");  // ITK takes its x for the one to flip
}

/// Those that float64 holds, exactly.
TEST_F(NrrdFile, IntegersOf64Bits) {
  constexpr std::int64_t kLargest = std::int64_t{1} << 60;
  std::vector<std::int64_t> voxels(60);
  for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = kLargest - std::int64_t(i) * 256;
  const auto bytes = [&] {
    return std::string(reinterpret_cast<const char *>(voxels.data()), 8 * voxels.size());
  };
  const std::string raw = "endian: little\nencoding: raw\n\n";
  const NiftiFields nifti{.datatype = 1024, .bitpix = 64};
  for (const auto &[name, header] :
       {std::pair{"a.nrrd", nrrd(raw, "int64")}, std::pair{"a.nrrd", nrrd(raw, "ulonglong")},
        std::pair{"a.mha", meta_image("", "LONG_LONG")}, std::pair{"a.nii", nifti.bytes()}}) {
    write_file(folder_ / name, header + bytes());
    std::vector<double> read(voxels.size());
    open_volume(folder_ / name)->read_exact_layers(0, 5, read);
    EXPECT_EQ(read, std::vector<double>(voxels.begin(), voxels.end())) << name;
  }
  voxels[7] = kLargest + 1;
  write_file(folder_ / "a.nii", nifti.bytes() + bytes());
  std::vector<double> read(voxels.size());
  EXPECT_THAT([&] { open_volume(folder_ / "a.nii")->read_exact_layers(0, 5, read); },
              ThrowsMessage<Error>(HasSubstr("a voxel is 1152921504606846977")));
}

TEST_F(NrrdFile, SpacingFromTheEndsOfAxes) {
  write_file(
      folder_ / "a.nrrd",
      nrrd("axis mins: 1 0 0\naxis maxs: 4 6 -8\ncenters: cell node node\nencoding: raw\n\n") +
          ramp());
  const VolumeInfo info = open_volume(folder_ / "a.nrrd")->info();
  EXPECT_EQ(info.spacing, glm::dvec3(1, 2, 2));
  EXPECT_EQ(info.origin, glm::dvec3(1.5, 0, 0));
  EXPECT_EQ(info.direction[2], glm::dvec3(0, 0, -1));
}

TEST_F(NrrdFile, LengthsInOtherUnitsBecomeMillimetres) {
  const auto read = [&](const std::string &fields) {
    write_file(folder_ / "a.nrrd", nrrd(fields + "encoding: raw\n\n") + ramp());
    return open_volume(folder_ / "a.nrrd");
  };
  const std::string space =
      "space: LPS\nspace directions: (2,0,0) (0,4,0) (0,0,8)\nspace origin: (1000,2000,4000)\n";
  for (const auto &[unit, millimetres] : {std::pair("um", 1e-3),
                                          {"\u00b5m", 1e-3},
                                          {"\u03bcm", 1e-3},
                                          {"microns", 1e-3},
                                          {"Micrometers", 1e-3},
                                          {"nm", 1e-6},
                                          {"m", 1e3},
                                          {"metre", 1e3},
                                          {"cm", 10.0}}) {
    SCOPED_TRACE(unit);
    const auto reader = read(fmt::format("{0}space units: \"{1}\" \"{1}\" \"{1}\"\n", space, unit));
    EXPECT_EQ(reader->info().spacing, glm::dvec3(2, 4, 8) * millimetres);
    EXPECT_EQ(reader->info().origin, glm::dvec3(1000, 2000, 4000) * millimetres);
    ASSERT_EQ(reader->notices().size(), 1u);
    EXPECT_THAT(reader->notices()[0], HasSubstr("converted to millimetres"));
    EXPECT_THAT(reader->notices()[0], HasSubstr(unit));
  }
  const auto mixed = read(space + "space units: \"mm\" \"mm\" \"um\"\n");
  EXPECT_EQ(mixed->info().spacing, glm::dvec3(2, 4, 0.008));
  EXPECT_EQ(mixed->info().origin, glm::dvec3(1000, 2000, 4));
  EXPECT_THAT(mixed->notices()[0], HasSubstr("space units: mm, um"));
  const auto unknown = read(space + "space units: \"mm\" \"furlong\" \"???\"\n");
  EXPECT_EQ(unknown->info().spacing, glm::dvec3(2, 4, 8));
  ASSERT_EQ(unknown->notices().size(), 1u);
  EXPECT_THAT(unknown->notices()[0], HasSubstr("'furlong': not a known unit"));
  for (const char *names : {"\"mm\" \"mm\" \"mm\"", "\"\" \"\" \"\"", "\"???\" \"none\" \"mm\""})
    EXPECT_TRUE(read(space + "space units: " + names + "\n")->notices().empty()) << names;
  const auto by_axes =
      read("spacings: 2 -4 nan\naxis mins: 10 20 nan\nunits: \"um\" \"mm\" \"um\"\n");
  EXPECT_EQ(by_axes->info().spacing, glm::dvec3(0.002, 4, 1));
  EXPECT_EQ(by_axes->info().origin, glm::dvec3(0.011, 18, 0));
}

/// The direction of an axis that is not in space.
TEST_F(NrrdFile, DirectionsThatAreNanAreNone) {
  const auto header = [](const std::string &directions) {
    return "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 1 3 4 5\nspace: LPS\nspace directions: " +
           directions + "\nspace origin: (nan,nan,nan)\nencoding: raw\n\n" + ramp();
  };
  for (const char *none : {"none", "(nan,nan,nan)", "(NaN, nan, nan)"}) {
    write_file(folder_ / "a.nrrd", header(none + std::string(" (1,0,0) (0,2,0) (0,0,3)")));
    const VolumeInfo info = open_volume(folder_ / "a.nrrd")->info();
    EXPECT_EQ(info.spacing, glm::dvec3(1, 2, 3));
    EXPECT_EQ(info.origin, glm::dvec3(0));
  }
  expect_refused("a.nrrd", header("none (1,nan,0) (0,2,0) (0,0,3)"), "or of 3 nan for none");
  expect_refused("a.nrrd", header("none (1,0,0) (0,0,0) (0,0,3)"), "spacing 1 0 3");
  expect_refused("a.nrrd", header("none (1,0,0) (2,0,0) (0,0,3)"), "singular");
  expect_refused("a.nrrd", header("none (1,inf,0) (0,2,0) (0,0,3)"), "3 finite numbers");
}

TEST_F(NrrdFile, ValidHeadersOfAllKinds) {
  const std::string raw = "encoding: raw\n\n";
  std::string comments;
  while (comments.size() < 3u << 20)
    comments += "# " + std::string(comments.size() % 90000, 'x') + "\n";
  for (const std::string &fields :
       {std::string("key:=value\ntype:=of a key: what\n"),
        std::string("line skip: 0\nbyte skip: 0\n"), comments,
        "key:=" + std::string(200000, 'v') + "\n",
        std::string("content: a: b\nnumber: 60\nmin: 1\nold max: nan\n"),
        std::string(
            "labels: \"x\" \"a \\\" b\" \"\"\nunits: \"mm\" \"mm\" \"mm\"\nthicknesses: nan 1 1\n"),
        std::string("space: lps\nspace units: \"mm\" \"mm\" \"mm\"\nmeasurement frame: (1,0,0) "
                    "(0,1,0) (0,0,1)\n"),
        std::string("Sample Units: any\nkinds: space domain ???\nCENTERINGS: cell node none\n")}) {
    expect_read("a.nrrd", nrrd(fields + raw) + ramp());
    expect_read("a.nrrd",
                "NRRD0004\n" + fields + nrrd(raw).substr(9) + ramp());  // before the others
  }
  for (std::size_t length = 65530; length < 65545;
       ++length) {  // where a line is cut and a buffer ends
    expect_read("a.nrrd", nrrd("#" + std::string(length, '#') + "\r\n" + raw) + ramp());
    expect_read("a.nrrd", nrrd("key:=" + std::string(2 * length, ':') + "\n" + raw) + ramp());
  }
  expect_read("a.nrrd",
              nrrd("encoding: gzip\n\n") + gzip(ramp().substr(0, 31)) + gzip(ramp().substr(31)));
  std::string commas;
  for (int i = 1; i <= 60; ++i) commas += fmt::format("{}, ", i);
  expect_read("a.nrrd", nrrd("encoding: ascii\n\n") + commas + "\n \t\n");
  write_file(folder_ / "named.raw", "a\n" + ramp());
  expect_read("a.nhdr", nrrd("line skip: 1\nencoding: raw\ndata file: named.raw\n"));
  expect_read("a.nhdr",
              nrrd("byte skip: -1\nencoding: raw\ndatafile: ./named.raw"));  // no end of line
}

TEST_F(NrrdFile, WrongVoxelsAreRefused) {
  const auto with = [&](const std::string &encoding, const std::string &data) {
    return nrrd("encoding: " + encoding + "\n\n") + data;
  };
  expect_refused("a.nrrd", with("raw", ramp().substr(1)),
                 "truncated: 3x4x5 uint8 voxels need 60 bytes, found 59");
  expect_refused("a.nrrd", with("raw", ramp() + "x"),
                 "too long: 3x4x5 uint8 voxels need 60 bytes, found 61");
  const std::string packed = gzip(ramp());
  EXPECT_EQ(error_of(folder_ / "a.nrrd", with("gzip", packed)), "");
  expect_refused("a.nrrd", with("gzip", zlib(ramp())), "not a gzip file");
  expect_refused("a.nrrd", with("gzip", packed + "x"),
                 "bytes that do not belong to its gzip stream follow it");
  expect_refused("a.nrrd", with("gzip", packed + std::string(1, '\0')), "follow it");
  expect_refused("a.nrrd", with("gzip", packed + gzip("x")),
                 "too long: 3x4x5 uint8 voxels need 60 bytes, found 61");
  expect_refused("a.nrrd", with("gzip", gzip(ramp() + ramp())), "too long");
  expect_refused("a.nrrd", with("gzip", gzip(ramp().substr(1))),
                 "truncated: 3x4x5 uint8 voxels need 60 bytes, found 59");
  for (std::size_t length = 0; length < packed.size(); ++length) {
    EXPECT_NE(error_of(folder_ / "a.nrrd", with("gzip", packed.substr(0, length))), "") << length;
  }
  for (std::size_t at = packed.size() - 8; at < packed.size(); ++at) {  // checksum and length
    std::string flipped = packed;
    flipped[at] ^= 1;
    expect_refused("a.nrrd", with("gzip", flipped), "broken gzip stream");
  }
  std::string hex;
  for (int i = 1; i <= 60; ++i) hex += fmt::format("{:02X} ", i);
  EXPECT_EQ(error_of(folder_ / "a.nrrd", with("hex", hex)), "");
  expect_refused("a.nrrd", with("hex", hex + "0"), "odd number");
  expect_refused("a.nrrd", with("hex", hex + "00"), "too long");
  expect_refused("a.nrrd", with("hex", hex.substr(0, 177)), "truncated");
  hex[7] = 'g';
  expect_refused("a.nrrd", with("hex", hex), "'g' among");
  std::string numbers;
  for (int i = 1; i <= 59; ++i) numbers += fmt::format("{} ", i);
  EXPECT_EQ(error_of(folder_ / "a.nrrd", with("ascii", numbers + "60")), "");
  EXPECT_EQ(error_of(folder_ / "a.nrrd", with("ascii", numbers + "2.55e2\n")), "");
  expect_refused("a.nrrd", with("ascii", numbers),
                 "truncated: 3x4x5 uint8 voxels need 60 bytes, found 59");
  expect_refused("a.nrrd", with("ascii", numbers + "60 61"), "too long");
  for (const char *word :
       {"256", "-1", "1.5", "abc", "nan", "1e999", "0x10", "6;0", "--1", "1e", "+-1"}) {
    expect_refused("a.nrrd", with("ascii", numbers + word), "is no uint8 voxel");
  }
  expect_refused("a.nrrd", with("ascii", numbers + std::string(1 << 20, '1')), "is no voxel");
  EXPECT_EQ(error_of(folder_ / "a.nrrd", nrrd("encoding: ascii\n\n", "float") + numbers + "1e-50"),
            "");
  expect_refused("a.nrrd", nrrd("encoding: ascii\n\n", "float") + numbers + "1e39",
                 "is no float32 voxel");
}

TEST_F(NrrdFile, RefusedHeaders) {
  const std::string raw = "encoding: raw\n\n";
  const auto with = [&](const std::string &fields) { return nrrd(fields + raw) + ramp(); };
  EXPECT_EQ(error_of(folder_ / "a.nrrd", with("")), "");
  expect_refused("a.nrrd", "", "not an NRRD file");
  expect_refused("a.nrrd", std::string(100, '\0') + std::string(1 << 20, 'x'), "not an NRRD file");
  expect_refused("a.nrrd", "NRRD0099\n", "'NRRD0099' is not a version");
  expect_refused("a.nrrd", nrrd("encoding: raw\n"), "no empty line");
  expect_refused("a.nrrd", nrrd("\n") + ramp(), "no 'encoding'");
  expect_refused("a.nrrd", with("who knows: 1\n"), "line 5, 'who knows: 1', is neither");
  expect_refused("a.nrrd", with("spacings 1 2 3\n"), "line 5");
  expect_refused("a.nrrd", with("bad \x01\xff: 1\n"), R"('bad \x01\xff: 1')");
  expect_refused("a.nrrd", with("sizes: 3 4 5\n"), "'sizes' is given twice");
  expect_refused("a.nrrd", with("axismins: 0 0 0\naxis mins: 0 0 0\n"),
                 "'axis mins' is given twice");
  for (const char *spacings :
       {"1 2", "1 2 3 4", "1 2 x", "1 2 inf", "1 2 1e999", "1 2 3,", "1 2 0x3", ""}) {
    expect_refused("a.nrrd", with(fmt::format("spacings: {}\n", spacings)),
                   "broken header: spacings");
  }
  for (const char *value : {"(1,0,0) (0,1,0)", "(1,0,0) (0,1,0) (0,0,inf)", "(1,0) (0,1) (0,0)",
                            "1 2 3", "(1,0,0) (0,1,0) (0,0,1", "(1,0,0) (0,1,0) (0,0,1) (0,0,1)",
                            "(1,0,0,0) (0,1,0) (0,0,1)", "(1,,0) (0,1,0) (0,0,1)"}) {
    expect_refused("a.nrrd", with(fmt::format("space: LPS\nspace directions: {}\n", value)),
                   "space directions");
  }
  expect_refused("a.nrrd", with("space: LPS\nspace directions: none none none\n"),
                 "need a volume of 3");
  expect_refused("a.nrrd", with("space: LPS\nspace directions: (1,0,0) (2,0,0) (0,0,1)\n"),
                 "singular");
  expect_refused("a.nrrd", with("space: LPS\nspace directions: (0,0,0) (0,1,0) (0,0,1)\n"),
                 "spacing");
  expect_refused("a.nrrd", with("space: LPS\nspace directions: (1e300,0,0) (0,1,0) (0,0,1)\n"),
                 "spacing");
  expect_refused("a.nrrd", with("space: LPS\nspacings: 1 1 1\n"), "spacings");
  expect_refused("a.nrrd", with("space: LPST\n"), "space 'LPST'");
  expect_refused("a.nrrd", with("space dimension: 2\n"), "space dimension");
  expect_refused("a.nrrd", with("space: LPS\nspace dimension: 3\n"), "given beside");
  expect_refused("a.nrrd", with("space origin: (1,2,3)\n"), "needs 'space'");
  expect_refused("a.nrrd", with("kinds: domain domain\n"), "kinds");
  expect_refused("a.nrrd", with("kinds: list domain domain\n"), "3 components");
  expect_refused("a.nrrd", with("labels: \"a\" \"b\" c\n"), "labels");
  expect_refused("a.nrrd", with("number: 61\n"), "number");
  expect_refused("a.nrrd", with("line skip: -1\n"), "line skip");
  expect_refused("a.nrrd", with("line skip: 9999999999\n"), "lines to skip");
  expect_refused("a.nrrd", with("byte skip: -2\n"), "byte skip");
  expect_refused("a.nrrd", with("byte skip: 9223372036854775807\n"), "truncated");
  expect_refused("a.nrrd", with("byte skip: 9223372036854775808\n"), "byte skip");
  expect_refused("a.nrrd", with("endian: middle\n"), "endian");
  expect_refused("a.nrrd", with("content: " + std::string(1 << 20, 'x') + "\n"),
                 "'content' is too long");
  expect_refused("a.nrrd", nrrd(raw, "int16") + ramp<std::int16_t>(), "no 'endian'");
  expect_refused("a.nrrd", nrrd("endian: little\n" + raw, "block") + ramp(), "type 'block'");
  expect_refused("a.nrrd", nrrd("encoding: bzip2\n\n") + ramp(), "encoding 'bzip2'");
  const auto sizes = [&](const std::string &dimension, const std::string &value) {
    return "NRRD0004\ntype: double\nendian: little\ndimension: " + dimension + "\nsizes: " + value +
           "\n" + raw + ramp();
  };
  expect_refused("a.nrrd", sizes("3", "60000 60000 60000"), "truncated");
  expect_refused("a.nrrd", sizes("3", "3 4 9999999999"),
                 "sizes '3 4 9999999999': each must be 1 to 65536");
  expect_refused("a.nrrd", sizes("3", "3 4 1"), "dims 3x4x1: each must be 2 to 65536");
  expect_refused("a.nrrd", sizes("3", "3 4 99999999999999999999"), "sizes");
  expect_refused("a.nrrd", sizes("3", "3 4 -5"), "sizes");
  expect_refused("a.nrrd", sizes("2", "3 4"), "an image of 2 axes");
  expect_refused("a.nrrd", sizes("4", "3 4 5 2"), "an image of 4 axes");
  expect_refused("a.nrrd", sizes("4000000000", "3 4 5"), "dimension");
}

TEST_F(DetachedFile, MissingSeveralOrNoFiles) {
  const std::string header =
      "NRRD0001\ndatafile: ./a.raw\ndimension: 3\nsizes: 3 4 5\nspacings: 1 2 3\ntype: "
      "uchar\nencoding: "
      "raw\n";
  expect_refused("a.nhdr", header, "its data file './a.raw': no such file");
  write_file(folder_ / "a.raw", ramp());
  expect_read("a.nhdr", header);
  EXPECT_EQ(open_volume(folder_ / "a.nhdr", {.dims = {}, .type = {}, .spacing = glm::dvec3(7)})
                ->info()
                .spacing,
            glm::dvec3(7));
  expect_refused("a.nhdr", nrrd("encoding: raw\ndata file: a.raw" + std::string(1, '\0') + "x\n"),
                 "no file can have this name");
  expect_refused("a.nhdr", nrrd("encoding: raw\ndata file: \x1b[1m\xff.raw\n"),
                 R"(its data file '\x1b[1m\xff.raw': no such file)");
  expect_refused("a.nhdr", nrrd("encoding: raw\ndata file: Sch\u00e4del.raw\n"),
                 "its data file 'Sch\u00e4del.raw': no such file");
  for (const char *names :
       {"data file: slice%03d.raw 1 5 1\n", "data file: LIST\na.raw\nb.raw\n",
        "data file: LIST 2\na.raw\n", "data file:  LIST \t\n\na.raw\n", "datafile: LIST\na.raw\n",
        "DATA FILE: LIST\r\na.raw\r\n", "data file: LIST"})
    expect_refused("a.nhdr", nrrd("encoding: raw\n" + std::string(names)), "several files");
  std::string meta = meta_image("");
  for (const char *name : {"LIST", "slice%03d.raw 1 5 1"}) {
    expect_refused("a.mhd", meta.substr(0, meta.size() - 6) + name + "\n", "several files");
  }
  expect_read("a.mhd", meta.substr(0, meta.size() - 6) + "a.raw\n");
  ASSERT_EQ(::mkfifo((folder_ / "pipe.raw").c_str(), 0600), 0);
  expect_refused("a.nhdr", nrrd("encoding: raw\ndata file: pipe.raw\n"),
                 "'pipe.raw': not a regular file");
  expect_refused("a.mhd", meta.substr(0, meta.size() - 6) + "pipe.raw\n",
                 "'pipe.raw': not a regular file");
  for (const char *name :
       {"a_3x4x5_uint8.raw", "a_3x4x5_uint8.raw.gz", "p.nrrd", "p.mha", "p.nii", "p.nii.gz"}) {
    ASSERT_EQ(::mkfifo((folder_ / name).c_str(), 0600), 0);
    EXPECT_THAT(error_of(folder_ / name), HasSubstr("not a regular file"));
  }
}

/// Hardly packed, and larger than any buffer.
std::string noise_of_1_mib() {
  std::string noise;
  for (std::uint32_t i = 0, bits = 1; i < 1u << 20; ++i, bits = bits * 1664525 + 1013904223)
    noise += char(bits >> 24);
  return noise;
}

/// 800 million voxels, which the file is long enough to have if they are alike.
TEST(OpenVolume, TakesNoMoreMemoryThanTheFileHas) {
  const TemporaryFolder folder;
  const auto path = folder / "a_20000x20000x2_uint8.raw.gz";
  write_file(path, gzip(noise_of_1_mib()));
  const std::string out = (folder / "a.zfp").string();
  EXPECT_LT(test::peak_of_isowave({"convert", path.string(), "--rate", "4", "-o", out}), 400);
  EXPECT_LT(test::peak_of_isowave({"convert", path.string(), "--tolerance", "1", "-o", out}), 400);
  EXPECT_LT(test::peak_of_isowave({"info", path.string()}), 400);
}

TEST(OpenVolume, FilesThatBecomeShorterAreOneLine) {
  const TemporaryFolder folder;
  const std::string noise = noise_of_1_mib();
  const std::string sizes = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 128 128 64\n";
  std::string hex;
  for (const char c : noise) hex += fmt::format("{:02x}", static_cast<unsigned char>(c));
  for (const auto &[name, bytes] : std::vector<std::pair<std::string, std::string>>{
           {"a_128x128x64_uint8.raw", noise},
           {"a_128x128x64_uint8.raw.gz", gzip(noise)},
           {"raw.nrrd", sizes + "encoding: raw\n\n" + noise},
           {"hex.nrrd", sizes + "encoding: hex\n\n" + hex},
           {"gzip.nrrd", sizes + "encoding: gzip\n\n" + gzip(noise)}}) {
    write_file(folder / name, bytes);
    const auto reader = open_volume(folder / name);
    std::filesystem::resize_file(folder / name, bytes.size() / 2);
    EXPECT_THAT([&] { test::read_all(*reader); },
                ThrowsMessage<Error>(HasSubstr("truncated while it was in use")))
        << name;
  }
}

/// One file takes another's name again and again: header and voxels are of the same.
TEST_F(NrrdFile, IsReadFromOneFileWhoeverTakesItsName) {
  const auto path = folder_ / "a.nrrd";
  const auto put = [&](const std::string &sizes, char voxel) {
    write_file(folder_ / "new", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: " + sizes +
                                    "\nencoding: raw\n\n" + std::string(60, voxel));
    std::filesystem::rename(folder_ / "new", path);
  };
  put("3 4 5", 3);
  std::atomic<bool> done = false;
  std::thread other([&] {
    while (!done) {
      put("5 4 3", 5);
      put("3 4 5", 3);
    }
  });
  for (int run = 0; run < 5000; ++run) {
    const auto reader = open_volume(path);
    const auto expected = static_cast<float>(reader->info().dims.x);
    EXPECT_THAT(test::read_all(*reader), Each(expected));
  }
  done = true;
  other.join();
}

TEST(Extensions, InAnyCase) {
  const TemporaryFolder folder;
  const std::string nifti = NiftiFields().bytes() + ramp();
  const std::string meta = meta_image("") + ramp();
  for (const auto &[name, bytes] : std::vector<std::pair<std::string, std::string>>{
           {"a.NII", nifti},
           {"a.Nii.GZ", gzip(nifti)},
           {"a.nii.GZ", gzip(nifti)},
           {"a.MHA", meta},
           {"a.NRRD", nrrd("encoding: raw\n\n") + ramp()},
           {"a_3x4x5_uint8.RAW", ramp()},
           {"a_3x4x5_uint8.Raw.GZ", gzip(ramp())}}) {
    EXPECT_EQ(error_of(folder / name, bytes), "") << name;
  }
  EXPECT_THAT(error_of(folder / "b.nii.GZ", nifti), HasSubstr("not a gzip file"));
  EXPECT_THAT(error_of(folder / "b.nii", gzip(nifti)), HasSubstr("NIfTI"));
}

TEST_F(MetaImageFile, FlippedDirection) {
  const std::string grid =
      "TransformMatrix = -1 0 0 0 1 0 0 0 1\nOffset = -10 -20 30\nElementSpacing = 0.5 2 3\n";
  const std::string packed = zlib(ramp());
  write_file(folder_ / "raw.mha", meta_image(grid + "CompressedData = False\n") + ramp());
  write_file(folder_ / "packed.mha",
             meta_image(grid + fmt::format("CompressedData = True\nCompressedDataSize = {}\n",
                                           packed.size())) +
                 packed);
  for (const char *name : {"raw.mha", "packed.mha"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder_ / name);
    expect_geometry(reader->info());
    expect_ramp(*reader);
  }
}

TEST_F(MetaImageFile, LengthsInOtherUnitsBecomeMillimetres) {
  for (const auto &[unit, millimetres] : {std::pair("um", 1e-3), {"cm", 10.0}, {"mm", 1.0}}) {
    write_file(folder_ / "a.mha",
               meta_image(fmt::format("DistanceUnits = {}\nElementSpacing = 2 -4 8\n"
                                      "Offset = 1 2 3\n",
                                      unit)) +
                   ramp());
    const auto reader = open_volume(folder_ / "a.mha");
    EXPECT_EQ(reader->info().spacing, glm::dvec3(2, 4, 8) * millimetres);
    EXPECT_EQ(reader->info().origin, glm::dvec3(1, 2, 3) * millimetres);
    EXPECT_EQ(reader->notices().size(), millimetres == 1 ? 0u : 1u);
  }
}

TEST_F(MetaImageFile, CompressedVoxelsEndWithTheFile) {
  const std::string packed = zlib(ramp());
  const auto with = [&](const std::string &size, const std::string &data) {
    return meta_image("CompressedData = True\n" +
                      (size.empty() ? "" : "CompressedDataSize = " + size + "\n")) +
           data;
  };
  const auto plus = [&](int bytes) { return fmt::format("{}", int(packed.size()) + bytes); };
  for (const std::string &size : {plus(0), std::string(), std::string("0")}) {
    expect_read("a.mha", with(size, packed));
    expect_refused("a.mha", with(size, packed + "x"),
                   size == plus(0) ? "but the header says" : "follow it");
    expect_refused("a.mha", with(size, packed.substr(0, packed.size() - 1)),
                   size == plus(0) ? "but the header says" : "truncated");
  }
  expect_read("a.mha", with(fmt::format("{}", gzip(ramp()).size()), gzip(ramp())));
  for (const int bytes : {-1, 1, 1000})
    expect_refused("a.mha", with(plus(bytes), packed), "but the header says");
  expect_refused("a.mha", with("-5", packed), "CompressedDataSize");
  expect_refused("a.mha", with("1e2", packed), "CompressedDataSize");
  expect_refused("a.mha", with("", zlib(ramp() + "x")), "too long");
  expect_refused("a.mha", with("", zlib(ramp().substr(1))), "truncated");
  expect_refused("a.mha", with("", ramp()), "broken zlib stream");
  write_file(folder_ / "a.zraw", "12345" + packed);
  std::string detached = meta_image("CompressedData = True\nHeaderSize = 5\n");
  detached.replace(detached.find("LOCAL"), 5, "a.zraw");
  expect_read("a.mhd", detached);
}

TEST_F(MetaImageFile, WhereVoxelsBegin) {
  expect_read("a.mha", meta_image("HeaderSize = 0\n") + ramp());
  expect_read("a.mha", meta_image("HeaderSize = -1\n") + "any" + ramp());
  for (const char *size : {"1", "10", "-2", "1e2", "9223372036854775808", ""}) {
    expect_refused("a.mha", meta_image(fmt::format("HeaderSize = {}\n", size)) + ramp(),
                   "HeaderSize");
  }
  const std::string head = meta_image("HeaderSize = 200\n");
  expect_read("a.mha", head + std::string(200 - head.size(), '#') + ramp());
  expect_refused("a.mha", head + std::string(201 - head.size(), '#') + ramp(), "too long");
  expect_refused("a.mha", head + ramp().substr(30), "truncated");
  expect_refused("a.mha", meta_image("") + ramp() + "x", "too long");
  expect_refused("a.mha", meta_image("HeaderSize = -1\n") + ramp().substr(1), "truncated");
  expect_refused("a.mha", meta_image("HeaderSize = -1\nBinaryData = False\n") + ramp(),
                 "HeaderSize");
}

TEST_F(MetaImageFile, Numbers) {
  std::string numbers;
  for (int i = 1; i <= 59; ++i) numbers += fmt::format("{}\n", i);
  const std::string head = meta_image("BinaryData = False\n");
  expect_read("a.mha", head + numbers + "6e1");
  expect_refused("a.mha", head + numbers, "truncated");
  expect_refused("a.mha", head + numbers + "60 1", "too long");
  for (const char *word : {"x", "256", "-1", "0.5"})
    expect_refused("a.mha", head + numbers + word, "is no uint8 voxel");
}

TEST_F(MetaImageFile, RefusedHeaders) {
  const auto with = [](const std::string &fields) { return meta_image(fields) + ramp(); };
  EXPECT_EQ(error_of(folder_ / "a.mha", with("")), "");
  expect_refused("a.mha", "", "no 'ElementDataFile'");
  expect_refused("a.mha", "garbage\n", "line 1, 'garbage'");
  for (const char *axes :
       {"-1", "0", "11", "5000", "65536", "2147483648", "1e308", "3.0", "3 3", "nan", ""}) {
    for (const char *matrix : {"", "TransformMatrix = 1 0 0 0 1 0 0 0 1\n"}) {
      expect_refused(
          "a.mha",
          fmt::format(
              "NDims = {}\nDimSize = 3 4 5\nElementType = MET_UCHAR\n{}ElementDataFile = LOCAL\n",
              axes, matrix) +
              ramp(),
          "NDims");
    }
  }
  expect_refused("a.mha", with(std::string(300, 'k') + " = 1\n"), "is not like 'Key = Value'");
  expect_refused("a.mha", with("Offset = " + std::string(1 << 20, '1') + "\n"),
                 "'Offset' is too long");
  for (const char *value : {"yes", "1", "", "True False"}) {
    expect_refused("a.mha", with(fmt::format("CompressedData = {}\n", value)),
                   "must be True or False");
    expect_refused("a.mha", with(fmt::format("BinaryData = {}\n", value)), "must be True or False");
  }
  expect_refused("a.mha", with("CompressedData = False\nCompressedData = True\n"),
                 "'CompressedData' is given twice");
  expect_refused("a.mha", with("compresseddata = True\n"), "must be written 'CompressedData'");
  expect_refused("a.mha", with("CompressedData = True\nBinaryData = False\n"),
                 "not with BinaryData");
  expect_refused("a.mha", with("ElementByteOrderMSB = True\nBinaryDataByteOrderMSB = False\n"),
                 "says otherwise");
  expect_refused("a.mha", with("Offset = 1 2 3\nPosition = 1 2 4\n"), "says otherwise");
  expect_refused("a.mha", with("Offset = 1 2\n"), "Offset");
  expect_refused("a.mha", with("ID = one\n"), "ID");
  expect_refused("a.mha", with("ElementSpacing = 1 2 nan\n"), "ElementSpacing");
  expect_refused("a.mha", with("ElementSpacing = 1 2 0\n"), "spacing");
  expect_refused("a.mha", with("TransformMatrix = 1 0 0 0 1 0 0 0\n"), "TransformMatrix");
  expect_refused("a.mha", with("TransformMatrix = 1 0 0 0 1 0 0 0 0\n"), "singular");
  expect_refused("a.mha", with("ElementNumberOfChannels = 3\n"), "3 components");
  expect_refused("a.mha", with("ElementToIntensityFunctionSlope = 2\n"),
                 "ElementToIntensityFunctionSlope");
  expect_refused("a.mha", meta_image("", "STRING") + ramp(), "MET_STRING");
  std::string tube = with("");
  expect_refused("a.mha", tube.replace(tube.find("Image"), 5, "Tube"), "ObjectType");
  for (const char *sizes : {"3 4", "3 4 0", "3 4 -5", "3 4 5 6", "3 4 5.5", "3 4 4294967301",
                            "60000 60000 60000", "3 4 99999999999999999999"}) {
    std::string header = with("");
    EXPECT_NE(error_of(folder_ / "a.mha", header.replace(header.find("3 4 5"), 5, sizes)), "")
        << sizes;
  }
}

TEST_F(NiftiFile, RasBecomesLps) {
  write_file(folder_ / "a.nii", NiftiFields().bytes() + ramp());
  write_file(folder_ / "b.nii.gz", gzip(NiftiFields().bytes() + ramp()));
  for (const char *name : {"a.nii", "b.nii.gz"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder_ / name);
    expect_geometry(reader->info());
    EXPECT_EQ(reader->info().type, VoxelType::kUint8);
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
