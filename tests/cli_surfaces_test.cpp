// `isowave render --surface`, run as a user runs it: what is seen of nested spheres, what all
// renderers draw alike, and what is refused.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::quoted;
using testing::HasSubstr;

const std::string kSphere = "generate:sphere_33x33x33_float32 --exact ";

/// The isovalue of a sphere around the volume's middle [voxels].
std::string sphere(double radius) {
  return fmt::format("{:.6f}", 1 - radius / 16 / std::sqrt(3.0));
}

class CliSurfaces : public testing::Test {
 protected:
  CliSurfaces() {
    test::write_file(folder_ / "c.json", R"({"width":40,"height":40,"fovy_deg":60,"cameras":[
        {"eye":[16,16,116],"at":[16,16,16],"up":[0,1,0],"parallel_height":32}]})");
  }
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  test::ProgramResult render(const std::string &options) const {
    test::ProgramResult result = test::run_isowave("render " + options);
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
    return result;
  }
  /// The sphere's picture in parallel projection along -z, by the reference.
  Image8 draw(const std::string &surfaces) const {
    render(kSphere + "--reference --cameras " + in("c.json") + " -o " + in("a.png") + " --stats " +
           in("s.json") + " --depth " + in("d.npy") + " " + surfaces);
    return read_png(folder_ / "a.png");
  }
  /// The statistics of draw().
  json stats() const { return json::parse(test::read_file(folder_ / "s.json")); }
  FloatImage depth() const { return read_npy(folder_ / "d.npy"); }
  /// Largest difference of two pictures' values.
  static int difference(const Image8 &a, const Image8 &b) {
    EXPECT_EQ(a.pixels.size(), b.pixels.size());
    int largest = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
      largest = std::max(largest, std::abs(int{a.pixels[i]} - int{b.pixels[i]}));
    return largest;
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliSurfaces, WhatLiesBehindIsSeenAsFarAsTheFirstLetsIt) {
  const std::string large = sphere(12), small = sphere(6);
  const auto both = [&](const std::string &opacity) {
    return "--surface " + large + ",#3060C0," + opacity + " --surface " + small + ",#DBBD87";
  };
  const Image8 front = draw("--surface " + large + ",#3060C0"), back = draw("-i " + small);
  EXPECT_GT(difference(front, back), 50);
  EXPECT_EQ(difference(draw(both("1")), front), 0) << "an opaque surface hides the other";
  EXPECT_LE(difference(draw(both("0.002")), back), 2) << "a clear one hides hardly anything";
  const Image8 mixed = draw(both("0.5"));
  const std::size_t middle = 3 * (20 * 40 + 20), beside = 3 * (20 * 40 + 20 + 11);
  for (std::size_t i = 0; i < 3; ++i) {
    const double half = 0.5 * front.pixels[middle + i] + 0.5 * back.pixels[middle + i];
    EXPECT_NEAR(mixed.pixels[middle + i], half, 1);
    // Beside the small one, the ray meets the large one twice; then comes the white background.
    const double twice = 0.75 * front.pixels[beside + i] + 0.25 * 255;
    EXPECT_NEAR(mixed.pixels[beside + i], twice, 12);
  }
  EXPECT_EQ(stats()["frames"][0]["layers"]["layers"], 2);
}

/// Caps are hits, too.
TEST_F(CliSurfaces, DepthIsThatOfTheFirstCrossing) {
  const std::string spheres = "--surface " + sphere(6) + ",,0.9 --surface " + sphere(12) + ",,0.1 ";
  for (const std::string clip : {"", "--clip 0,0,-1,-18 "}) {
    draw("-i " + sphere(12) + " " + clip);
    const FloatImage first = depth();
    draw(spheres + clip);
    EXPECT_EQ(depth().pixels, first.pixels) << clip;
    const json layers = stats()["frames"][0]["layers"];
    EXPECT_EQ(layers["layers"], 4) << clip;  // two spheres, twice
    EXPECT_GT(layers["hits"], 2 * stats()["frames"][0]["rays_hit"].get<int>());
    EXPECT_EQ(layers["rays_cut"], 0);
  }
}

TEST_F(CliSurfaces, OneOpaqueSurfaceIsThePictureOfItsIsovalue) {
  const std::string options = "--size 48x36 --samples 2 ";
  for (const std::string renderer : {"--reference", "--device host", "--device cpu"}) {
    const std::string to = options + renderer + " -o ";
    render(kSphere + "-i 0.5 --color '#D08040' " + to + in("a.png"));
    render(kSphere + "--surface 0.5,#D08040 " + to + in("b.png"));
    EXPECT_EQ(test::read_file(folder_ / "a.png"), test::read_file(folder_ / "b.png")) << renderer;
  }
}

TEST_F(CliSurfaces, AllRenderersDrawTheSameBits) {
  const std::string fuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz --size 48x36 ",
                    surfaces = "--surface 10,skin,0.3 --surface 40,,0.5 --surface 120,bone ";
  for (const std::string more :
       {"", "--orbit 2 --clip 0,1,0", "--transparent --samples 2 --normals cell", "--parallel",
        "--tolerance 2 --voxel-error 3 --clip-box ,,,,8, --no-caps"}) {
    const auto draw = [&](const std::string &name, const std::string &renderer) {
      render(fuel + surfaces + more + renderer + " -o " + in(name + ".png") + " --depth " +
             in(name + ".npy") + " --stats " + in(name + ".json"));
      const json frames = json::parse(test::read_file(folder_ / (name + ".json")))["frames"];
      const bool are_two = frames.size() == 2;
      return std::array{test::read_file(folder_ / (name + (are_two ? "_view1.png" : ".png"))),
                        test::read_file(folder_ / (name + (are_two ? "_view1.npy" : ".npy"))),
                        frames.back()["layers"].dump()};
    };
    const auto expected = draw("twin", " --reference");
    EXPECT_FALSE(expected[0].empty());
    EXPECT_EQ(draw("host", " --device host"), expected) << more;
    EXPECT_EQ(draw("device", " --device cpu"), expected) << more;
    EXPECT_EQ(draw("small", " --device cpu --cache-slots 64"), expected) << more;
  }
}

/// By proof and by sample; bit planes are chosen, and levels of detail are not made.
TEST_F(CliSurfaces, WithinAnError) {
  const std::string scene =
      "generate:gyroid_33x33x33_float32 --rate 20 --size 48x36 --surface 0.2,,0.4 --surface 0.6 "
      "--slice z --max-surface-error 0.5 --stats " +
      in("s.json") + " -o " + in("a.png");
  std::array<std::string, 2> maps;
  for (std::size_t i = 0; i < 2; ++i) {
    const auto result = render(scene + (i == 0 ? " --device host" : " --device cpu") +
                               " --error-map " + in("e.npy"));
    const json error = stats()["frames"][0]["error"];
    EXPECT_EQ(error["by"], "proof");
    EXPECT_GT(error["certified"], 500);
    EXPECT_GT(error["chosen"]["voxel_error"], 0);
    EXPECT_EQ(error["chosen"]["voxel_pixels"], 0);
    EXPECT_THAT(result.out, HasSubstr("  within 0.5 pixels of the true surface: "));
    maps[i] = test::read_file(folder_ / "e.npy") + test::read_file(folder_ / "a.png");
  }
  EXPECT_EQ(maps[0], maps[1]);
  render(scene + " --by sample --device host");
  EXPECT_GT(stats()["frames"][0]["error"]["lowest_share"], 0.99);
  expect_one_line_error("render " + scene + " --clip z", "is proven of whole surfaces");
}

TEST_F(CliSurfaces, PicturesAfterEachPassEndWithTheWholeOne) {
  for (const std::string renderer : {"--device host", "--device cpu"}) {
    render(kSphere + "--size 48x36 --surface 0.5,,0.4 --surface 0.7 " + renderer + " -o " +
           in("a.png") + " --progress-dir " + in("p"));
    std::string last;
    for (const auto &entry : std::filesystem::directory_iterator(folder_ / "p"))
      last = std::max(last, entry.path().string());
    EXPECT_EQ(test::read_file(last), test::read_file(folder_ / "a.png")) << renderer;
    std::filesystem::remove_all(folder_ / "p");
  }
}

/// 0.9^16 is far from nothing.
TEST_F(CliSurfaces, RaysThatAreCutAreTold) {
  std::string surfaces;
  for (int i = 0; i < 8; ++i) surfaces += fmt::format("--surface {:.2f},,0.1 ", 0.1 * i - 0.35);
  for (const std::string renderer : {"--reference", "--device host", "--device cpu"}) {
    const auto result = render("generate:gyroid_33x33x33_float32 --size 48x36 " + surfaces +
                               renderer + " --stats " + in("s.json"));
    const json frame = stats()["frames"][0];
    const std::uint64_t cut = frame["layers"]["rays_cut"];
    EXPECT_GT(cut, 100u);
    EXPECT_LT(cut, frame["rays_hit"].get<std::uint64_t>());
    EXPECT_EQ(frame["layers"]["layers"], 16);
    EXPECT_THAT(result.err, HasSubstr(fmt::format(
                                "{} rays have more than 16 hits; what lies behind is left out\n",
                                cut < 1000 ? std::to_string(cut)
                                           : fmt::format("{},{:03}", cut / 1000, cut % 1000))));
    EXPECT_THAT(result.out, HasSubstr(" rays hit, 16 layers, "));
  }
}

TEST_F(CliSurfaces, ColorsHaveDefaultsAndNames) {
  draw("--surface 0.2 --surface 0.3,,0.5 --surface 0.4,bone --surface 0.5,#ff8000,1");
  const json options = stats()["options"];
  EXPECT_EQ(options["isovalues"], json::parse("[0.2, 0.3, 0.4, 0.5]"));
  std::string colors;
  for (const json &surface : options["surfaces"]) {
    colors +=
        fmt::format("{} {}", surface["isovalue"].get<double>(), surface["opacity"].get<double>());
    for (const json &part : surface["color"])
      colors += fmt::format(" {:.0f}", 255 * part.get<double>());
    colors += "\n";
  }
  EXPECT_EQ(colors, "0.2 1 219 189 135\n0.3 0.5 86 180 233\n0.4 1 227 218 201\n0.5 1 255 128 0\n");
  EXPECT_FALSE(stats()["frames"][0].contains("isovalue"));
  draw("-i 0.5");
  EXPECT_FALSE(stats()["options"].contains("surfaces"));
  EXPECT_FALSE(stats()["frames"][0].contains("layers"));
}

TEST_F(CliSurfaces, PicturesAreNamedAfterAllIsovalues) {
  const std::string begin = "cd " + in("") + " && " + test::isowave_program() +
                            " render generate:sphere_9x9x9_float32 --size 16x12 --reference "
                            "--surface 0.5 --surface -1 ";
  const auto one = test::run_command(begin);
  EXPECT_THAT(one.out, HasSubstr("isovalues 0.5, -1, view 0: "));
  EXPECT_THAT(one.out, HasSubstr("wrote sphere_9x9x9_float32_iso0.5_-1.png;"));
  EXPECT_THAT(one.err, HasSubstr("isovalue -1 is outside the volume's values"));
  EXPECT_TRUE(exists(folder_ / "sphere_9x9x9_float32_iso0.5_-1.png"));
  const auto two = test::run_command(begin + "--orbit 2");
  EXPECT_THAT(two.out, HasSubstr("wrote sphere_9x9x9_float32_iso0.5_-1_viewK.png;"));
  EXPECT_TRUE(exists(folder_ / "sphere_9x9x9_float32_iso0.5_-1_view1.png"));
  const auto more = test::run_command(begin + "--orbit 2 -o a.png");
  EXPECT_TRUE(exists(folder_ / "a_view0.png"));
}

TEST(CliSurfaceOptions, WhatIsNoSurfaceIsRefused) {
  const std::string render = "render " + kSphere + "--size 16x12 --surface ";
  const auto refuse = [&](const std::string &options, std::string_view text) {
    expect_one_line_error(render + options, text);
  };
  for (const char *value : {"0.5,", "0.5,bone,", ",bone", "0.5,bone,1,1", ",", "0.5,,,whole,",
                            "0.5,,,own,own", "0.5,,,whole,own,whole"})
    refuse(value,
           fmt::format("--surface {}: give VALUE, VALUE,COLOR, VALUE,COLOR,OPACITY or", value));
  refuse("''", "--surface: the value is empty");
  refuse("--samples", "--surface: a value is missing before --samples");
  refuse("nan", "--surface nan: 'nan' is no finite number that float32 holds");
  refuse("1e39", "'1e39' is no finite number that float32 holds");
  refuse("0.5,bone,half", "'half' is no finite number");
  refuse("0.5,bones", "--surface: there is no colour 'bones': give #RRGGBB, or one of bone, skin");
  refuse("0.5,#12345g", "there is no colour '#12345g'");
  refuse("0.5,bone,0", "an opacity of 0 is out of range: give more than 0, at most 1");
  refuse("0.5,bone,2", "an opacity of 2 is out of range");
  refuse("0.5 --surface 0.50", "two surfaces have the isovalue 0.5: give each once");
  std::string nine = "0.1";
  for (int i = 2; i <= 9; ++i) nine += fmt::format(" --surface 0.{}", i);
  refuse(nine, "9 surfaces are more than a frame can have: give at most 8");
}

TEST(CliSurfaceOptions, WhatDrawsOneSurfaceRefusesThem) {
  const std::string render = "render " + kSphere + "--size 16x12 --surface 0.5,,0.5 ";
  expect_one_line_error(render + "-i 0.5", "--isovalue: draws pictures of one surface each");
  expect_one_line_error(render + "--color red", "--color: surfaces have colours of their own");
  for (const char *option : {"--max-image-error 0.1", "--time-budget 9"})
    expect_one_line_error(render + option, "--surface draws without it: leave it out");
  for (const char *option : {"--ambient 2", "--light 1,0,0 --shadow 1", "--light 1,0,0 --bounce 1"})
    expect_one_line_error(render + option, "end at surfaces of opacity 1, and there is none");
  expect_one_line_error(render + "--pipeline blocks", "--surface: --pipeline blocks draws one");
  expect_one_line_error(render + "--solver linear", "--surface: needs --solver bernstein");
  expect_one_line_error("verify generate:sphere_9x9x9_float32 --surface 0.5,,,whole",
                        "the oracle clips all surfaces");
  expect_one_line_error(render + "--bricks 1x1x1", "--bricks: one process draws the whole");
  for (const char *command : {"extract", "bench pareto"})
    expect_one_line_error(std::string(command) + " --surface 0.5 generate:sphere_9x9x9_float32",
                          "--surface");
}

}  // namespace
}  // namespace isowave::core
