// NRRD: geometry in one world convention (LPS), voxels to the byte, and headers that must be
// refused in one line; what files of all formats have in common. itk_agreement_test.cpp compares
// the same with ITK.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <limits>
#include <thread>

#include "core/base/error.hpp"
#include "tests/volume_headers.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::expect_geometry;
using test::expect_ramp;
using test::gzip;
using test::Headers;
using test::meta_image;
using test::NiftiFields;
using test::ramp;
using test::TemporaryFolder;
using test::write_file;
using test::zlib;
using testing::Each;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::string nrrd(const std::string &lines, const std::string &type = "uint8") {
  return "NRRD0004\ntype: " + type + "\ndimension: 3\nsizes: 3 4 5\n" + lines;
}
using NrrdFile = Headers;
using DetachedFile = Headers;

TEST_F(NrrdFile, SpaceDirections) {
  const auto read = [&](const std::string &space, const std::string &directions,
                        const std::string &origin) {
    write_file(folder_ / "a.nrrd", nrrd("space: " + space + "\nspace directions: " + directions +
                                        "\nspace origin: " + origin + "\nencoding: raw\n\n") +
                                       ramp());
    const auto reader = open_volume(folder_ / "a.nrrd");
    expect_geometry(reader->info());
    EXPECT_TRUE(reader->info().is_anatomical);
    expect_ramp(*reader);
  };
  read("right-anterior-superior", "(0.5,0,0) (0,-2,0) (0,0,3)", "(10,20,30)");
  read("left-posterior-superior", "(-0.5,0,0) (0,2,0) (0,0,3)", "(-10,-20,30)");
  read("LAS", "(-0.5,0,0) (0,-2,0) (0,0,3)", "(-10,20,30)");  // ITK takes its x for the one to flip
}

TEST_F(NrrdFile, OtherSpacesAreNoPatients) {
  for (const std::string space :
       {"space: scanner-xyz", "space: 3D-right-handed", "space dimension: 3", "spacings: 1 2 3"}) {
    write_file(folder_ / "a.nrrd", nrrd(space + "\nencoding: raw\n\n") + ramp());
    EXPECT_FALSE(open_volume(folder_ / "a.nrrd")->info().is_anatomical) << space;
  }
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

TEST_F(DetachedFile, MissingOrNoFiles) {
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
  const std::string meta = meta_image("");
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

}  // namespace
}  // namespace isowave::core
