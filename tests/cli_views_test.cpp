// --view, --up, --zoom, --fit and --save-camera of `isowave render`, and `isowave compare` of what
// they draw.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "core/view/camera.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::quoted;
using testing::HasSubstr;
using testing::Not;

constexpr const char *kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz ";

class CliViews : public testing::Test {
 protected:
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  static test::ProgramResult run(const std::string &arguments) {
    test::ProgramResult result = test::run_isowave(arguments);
    EXPECT_EQ(result.status, 0) << arguments << "\n" << result.err;
    return result;
  }
  static void draw(const std::string &options, const std::string &volume = kFuel) {
    const auto unless = [&](const std::string &name, const std::string &value) {
      return options.find(name) == options.npos ? name + value : std::string();
    };
    run("render " + volume + " " + unless("--device", " host ") + unless("--size", " 48x36 ") +
        options);
  }
  CameraFile cameras(const std::string &options, const std::string &volume = kFuel) const {
    const std::string isovalue = options.starts_with("--scene") ? "" : "-i 40 ";
    draw(isovalue + "-o " + in("p.png") + " --save-camera " + in("saved.json") + " " + options,
         volume);
    return read_camera_file(folder_ / "saved.json");
  }
  Camera camera(const std::string &options, const std::string &volume = kFuel) const {
    return cameras(options, volume).cameras.at(0);
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliViews, SavedCamerasDrawTheSamePictures) {
  draw("-i 40 --view iso --zoom 1.5 --up=-z --turntable 2 -o " + in("a.png") + " --save-camera " +
       in("c.json"));
  draw("-i 40 --cameras " + in("c.json") + " -o " + in("b.png"));
  for (const std::string view : {"_iso40_view0.png", "_iso40_view1.png"}) {
    const std::string a = test::read_file(folder_ / ("a" + view));
    EXPECT_FALSE(a.empty());
    EXPECT_EQ(test::read_file(folder_ / ("b" + view)), a) << "also its camera";
  }
  EXPECT_EQ(camera("--cameras " + in("c.json") + " --parallel --zoom 2").parallel_height,
            *in_parallel(read_camera_file(folder_ / "c.json").cameras[0]).parallel_height / 2);
}

TEST_F(CliViews, OptionsSayFromWhere) {
  const auto towards = [&](const std::string &options) {
    const CameraAxes axes = axes_of(camera(options));
    const auto text = [](const glm::dvec3 &v) {
      return fmt::format("{:.0f} {:.0f} {:.0f}", v.x + 0.0, v.y + 0.0, v.z + 0.0);
    };
    return text(axes.forward) + ", " + text(axes.up);
  };
  EXPECT_EQ(towards("--view front"), "0 0 -1, 0 1 0");
  EXPECT_EQ(towards("--view right"), "-1 0 0, 0 1 0");
  EXPECT_EQ(towards("--view top"), "0 -1 0, 0 0 -1");
  EXPECT_EQ(towards("--view bottom --up z"), "0 0 1, 0 -1 0");
  EXPECT_EQ(towards("--view left --up 0,0,2.5"), "1 0 0, 0 0 1");
  EXPECT_EQ(towards("--view back --up=-y"), "0 0 1, 0 -1 0");
  EXPECT_EQ(axes_of(camera("--orbit 2 --up z")).up.x, axes_of(camera("--orbit 2 --up z")).up.x);
  EXPECT_EQ(camera("--orbit 2 --up z").up, glm::dvec3(0, 0, 1));
}

TEST_F(CliViews, TheDefaultIsThatOfTheBox) {
  const Camera box = camera("");
  EXPECT_EQ(camera("--fit box -i 200"), box);
  EXPECT_EQ(camera("--rate 2"), box);
  EXPECT_EQ(camera("--device cpu"), box);
  const Camera surface = camera("--fit surface");
  EXPECT_EQ(surface.up, box.up);
  EXPECT_LT(glm::distance(surface.eye, surface.at), glm::distance(box.eye, box.at));
  const auto distance = [&](const std::string &options) {
    const Camera of = camera(options);
    return glm::distance(of.eye, of.at);
  };
  EXPECT_GT(distance("--size 24x48"), 1.2 * distance("--size 48x48")) << "the width fits, too";
  EXPECT_GT(distance("--orbit 3 --size 24x48"), 1.9 * distance("--orbit 3"));
}

TEST_F(CliViews, UpIsSuperiorInFilesOfAPatient) {
  const std::string nrrd =
      "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 5 6\nencoding: raw\nspace: RAS\nspace "
      "directions: (0,0,1) (2,0,0) (0,3,0)\n\n";
  std::string voxels;
  for (int i = 0; i < 120; ++i) voxels += char(i);
  test::write_file(folder_ / "head.nrrd", nrrd + voxels);
  const std::string volume = in("head.nrrd");
  EXPECT_EQ(camera("", volume).up, glm::dvec3(0, 0, 1));
  EXPECT_EQ(camera("--orbit 1", volume).up, glm::dvec3(0, 0, 1));
  const Camera front = camera("--view front", volume);
  EXPECT_LT(front.eye.y, front.at.y) << "anterior is -y in LPS";
  EXPECT_EQ(camera("--up y", volume).up, glm::dvec3(0, 1, 0));
  run("convert " + volume + " -o " + in("head.zfp"));
  EXPECT_EQ(camera("--view front", in("head.zfp")), front);
}

TEST_F(CliViews, ASceneGivesWayToViews) {
  draw("-i 40 --view left -o " + in("a.png") + " --save-scene " + in("s.json"));
  EXPECT_EQ(camera("--scene " + in("s.json")).eye, camera("--view left").eye);
  EXPECT_EQ(camera("--scene " + in("s.json") + " --view top").eye, camera("--view top").eye);
}

TEST_F(CliViews, WhatCannotBeIsOneLine) {
  draw("-i 40 -o " + in("a.png") + " --save-camera " + in("c.json"));
  const auto refused = [&](const std::string &options, std::string_view text) {
    expect_one_line_error("render --device host -i 40 " + std::string(kFuel) + options, text);
  };
  refused("--view side", "--view");
  refused("--fit all", "--fit");
  refused("--up 0,0,0", "give a direction");
  refused("--up w", "give x, y, z, -x, -y, -z, or X,Y,Z");
  refused("--up 1,2", "give x, y, z, -x, -y, -z, or X,Y,Z");
  refused("--zoom 0", "give 0.01 to 1000");
  refused("--orbit 2 --view front", "use --turntable");
  refused("--orbit 2 --fit surface", "use --turntable");
  refused("--cameras " + in("c.json") + " --up z", "leave out either");
  refused("--cameras " + in("c.json") + " --save-camera " + in("c.json"), "the input");
  refused("--save-camera " + in("absent/c.json"), "is no folder");
}

class CliCompare : public CliViews {
 protected:
  /// What `isowave compare` says.
  static json compared(const std::string &arguments) {
    return json::parse(run("compare --json " + arguments).out);
  }
};

TEST_F(CliCompare, VolumesAreDrawnFromOneCamera) {
  run("convert " + std::string(kFuel) + "--rate 2 -o " + in("b.zfp"));
  const std::string both = kFuel + in("b.zfp") + " -i 40 --size 48x36 ";
  const json result = compared(both + "-o " + in("d.png"));
  EXPECT_EQ(result["kind"], "volumes");
  EXPECT_EQ(result["voxels"]["voxels"], 64 * 33 * 32);
  // The same as the two pictures, drawn apart.
  draw("-i 40 -o " + in("a.png") + " --depth " + in("a.npy"));
  draw("-i 40 -o " + in("b.png") + " --depth " + in("b.npy"), in("b.zfp"));
  EXPECT_EQ(compared(in("a.npy") + " " + in("b.npy")), result["depth"]);
  EXPECT_EQ(compared(in("a.png") + " " + in("b.png")), result["picture"]);
  EXPECT_GT(result["depth"]["hit_both"], 100);
  EXPECT_GT(result["voxels"]["max_difference"], 0.5);
  EXPECT_LT(result["voxels"]["rms_difference"], result["voxels"]["max_difference"]);
  EXPECT_EQ(read_png(folder_ / "d.png").width, 48u);
  const std::string text = run("compare " + both + "-o " + in("d.png")).out;
  EXPECT_THAT(text, HasSubstr("isovalue 40, both from one camera"));
  EXPECT_THAT(text, HasSubstr("d.png: blue, B is nearer"));
  // Other views.
  EXPECT_NE(compared(both + "--view top")["depth"], result["depth"]);
  EXPECT_NE(compared(both + "--zoom 2")["depth"], result["depth"]);
  draw("-i 40 --view top -o " + in("a.png") + " --save-camera " + in("c.json"));
  EXPECT_EQ(compared(both + "--cameras " + in("c.json")), compared(both + "--view top"));
}

TEST_F(CliCompare, EqualVolumesAreEqual) {
  run("convert " + std::string(kFuel) + "-o " + in("b.zfp"));
  const std::string both = "compare --size 24x18 " + std::string(kFuel) + in("b.zfp") + " --exact";
  EXPECT_THAT(run(both).out, HasSubstr("equal: all bits of 67584 voxels"));
  run("convert " + std::string(kFuel) + "--tolerance 3 -o " + in("c.zfp"));
  const std::string other = in("b.zfp") + " " + in("c.zfp") + " --size 24x18";
  EXPECT_EQ(test::run_isowave("compare --exact " + other).status, 1);
  const json voxels = compared(other)["voxels"];
  EXPECT_GT(voxels["max_difference"], 0.5);
  EXPECT_LE(voxels["max_difference"], 3);
}

TEST_F(CliCompare, WarnsOfOtherCameras) {
  draw("-i 40 -o " + in("a.png") + " --depth " + in("a.npy"));
  draw("-i 40 --rate 3 -o " + in("b.png") + " --depth " + in("b.npy"));
  draw("-i 40 --view front -o " + in("c.png") + " --depth " + in("c.npy"));
  for (const std::string kind : {".png", ".npy"}) {
    EXPECT_EQ(run("compare " + in("a" + kind) + " " + in("b" + kind)).err, "") << kind;
    EXPECT_THAT(run("compare " + in("a" + kind) + " " + in("c" + kind)).err,
                HasSubstr("--save-camera"))
        << kind;
  }
  // A picture that says nothing of its camera.
  write_png(read_png(folder_ / "c.png"), folder_ / "d.png");
  EXPECT_EQ(run("compare " + in("a.png") + " " + in("d.png")).err, "");
}

TEST_F(CliCompare, DifferencesAreColoured) {
  const float inf = std::numeric_limits<float>::infinity();
  write_npy({5, 1, {1, 1, 1, inf, inf}}, folder_ / "a.npy");
  write_npy({5, 1, {1, 1.5, inf, 1, inf}}, folder_ / "b.npy");
  run("compare " + in("a.npy") + " " + in("b.npy") + " -o " + in("d.png"));
  EXPECT_EQ(
      read_png(folder_ / "d.png").pixels,
      (std::vector<std::uint8_t>{221, 220, 220, 180, 4, 38, 230, 159, 0, 0, 0, 0, 255, 255, 255}));
  write_png({2, 1, 3, {9, 9, 9, 255, 255, 255}}, folder_ / "a.png");
  write_png({2, 1, 3, {9, 9, 9, 0, 0, 0}}, folder_ / "b.png");
  run("compare " + in("a.png") + " " + in("b.png") + " -o " + in("e.png"));
  const auto pixels = read_png(folder_ / "e.png").pixels;
  EXPECT_GT(pixels.at(3), 200) << "magma's end is bright";
}

TEST_F(CliCompare, WhatCannotBeIsOneLine) {
  write_npy({1, 1, {1}}, folder_ / "a.npy");
  const std::string same = "compare " + in("a.npy") + " " + in("a.npy");
  expect_one_line_error(same + " -i 3", "is for volumes");
  expect_one_line_error(same + " --view top", "is for volumes");
  expect_one_line_error(same + " -o " + in("a.npy"), "PNG");
  expect_one_line_error("compare " + in("a.npy") + " " + kFuel,
                        "a depth image, the other a volume");
  const std::string volumes = "compare " + std::string(kFuel) + kFuel;
  expect_one_line_error(volumes + "--size 3", "WIDTHxHEIGHT");
  expect_one_line_error(volumes + "--up 0,0,0", "give a direction");
  test::write_file(folder_ / "text.txt", "no volume");
  expect_one_line_error("compare " + in("text.txt") + " " + in("text.txt"), "nor a volume");
}

}  // namespace
}  // namespace isowave::core
