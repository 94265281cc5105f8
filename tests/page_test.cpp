// Pages: what save_page() and `isowave export` write into an engine's page, and refuse. The engine
// here is a text with the places alone; wasm_test.sh and test_pages.py have the real one. And rows
// of pictures, which a page's workers draw.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cstdlib>
#include <isowave/isowave.hpp>
#include <isowave/page.hpp>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/host/host_renderer.hpp"
#include "core/io/png.hpp"
#include "core/zfp/chunk_file.hpp"
#include "tests/api_support.hpp"
#include "tests/frame_scene.hpp"
#include "tests/run_program.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using core::test::expect_one_line_error;
using core::test::public_volume;
using core::test::quoted;
using core::test::read_file;
using core::test::run_isowave;
using core::test::TemporaryFolder;
using core::test::write_file;
using testing::Each;
using testing::HasSubstr;

constexpr const char *kFuelFile = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";
constexpr const char *kPlaces =
    "{@ISOWAVE_CONNECT@}<title>@ISOWAVE_TITLE@</title>[@ISOWAVE_POSTER@]<@ISOWAVE_SCENE@>"
    "(@ISOWAVE_VOLUME@)|@ISOWAVE_FIELD@|end";

std::filesystem::path write_engine(const TemporaryFolder &folder, const std::string &text) {
  const std::filesystem::path path = folder / "engine.html.gz";
  gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  return path;
}

/// The text between two others.
std::string between(const std::string &text, const std::string &begin, const std::string &end) {
  const std::size_t from = text.find(begin) + begin.size();
  return text.substr(from, text.find(end, from) - from);
}

/// Bytes of base64.
std::string decoded(const std::string &text) {
  const std::string letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  unsigned bits = 0, count = 0;
  for (const char letter : text.substr(0, text.find('='))) {
    bits = bits << 6 | static_cast<unsigned>(letters.find(letter));
    count += 6;
    if (count < 8) continue;
    count -= 8;
    result += static_cast<char>(bits >> count & 255);
  }
  return result;
}

TEST(Page, HoldsTheVolumeTheSceneAndItsPicture) {
  const TemporaryFolder folder;
  const auto volume = public_volume();
  const Scene scene{.surfaces = {{.isovalue = 10, .opacity = 0.5f}, {.isovalue = 90}}};
  const PageOptions options{
      .engine = write_engine(folder, kPlaces), .title = "a <b> & c", .poster = {64, 48}};
  save_page(volume, scene, folder / "page.html", options);
  const std::string page = read_file(folder / "page.html");
  EXPECT_EQ(between(page, "<title>", "</title>"), "a &#60;b&#62; &#38; c");
  EXPECT_EQ(page.substr(page.size() - 6), ")||end") << "no second volume";
  EXPECT_EQ(page.substr(0, 2), "{}") << "asks no server";

  volume->save(folder / "volume.zfp");
  EXPECT_EQ(decoded(between(page, "(", ")")), read_file(folder / "volume.zfp"));
  EXPECT_EQ(between(page, "]<", ">("), scene_text(scene));

  Renderer renderer = make_host_renderer(volume);
  FrameRequest request = scene_request(scene);
  request.size = {64, 48};
  request.camera = renderer.camera(scene.surfaces, request.size);
  const std::vector<std::uint8_t> png = encode_png(renderer.render(request));
  EXPECT_EQ(decoded(between(page, "[", "]")), std::string(png.begin(), png.end()));
  EXPECT_EQ(folder.num_files(), 3u) << "a temporary file is left";
}

TEST(Page, TheCallerAnnotatesThePicture) {
  const TemporaryFolder folder;
  const auto volume = public_volume();
  Scene scene{.surfaces = {{.isovalue = 10}}};
  scene.annotations = Annotations{.scale_bar = true, .caption = true, .units = "mm"};
  std::vector<AnnotationGroup> groups;
  PageOptions options{.engine = write_engine(folder, kPlaces), .title = "Fuel"};
  options.poster = {200, 150};
  options.annotate = [&](Frame &frame, const std::vector<AnnotationGroup> &given) {
    groups = given;
    std::ranges::fill(frame.picture, std::uint8_t{7});
  };
  save_page(volume, scene, folder / "page.html", options);
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_THAT(groups[0].texts.at(0).text, HasSubstr("mm"));
  EXPECT_EQ(groups[1].texts.at(0).text, "Fuel");
  write_file(folder / "page.png", decoded(between(read_file(folder / "page.html"), "[", "]")));
  EXPECT_THAT(core::read_png(folder / "page.png").pixels, Each(7));

  groups.clear();
  save_site(volume, scene, folder / "site", options);
  EXPECT_EQ(groups.size(), 2u);
  groups.clear();
  options.poster = {199, 150};  // without room
  save_page(volume, scene, folder / "page.html", options);
  options.poster = {200, 150};
  scene.annotations.reset();
  save_page(volume, scene, folder / "page.html", options);
  EXPECT_TRUE(groups.empty());
}

TEST(Page, HoldsTheSecondVolume) {
  const TemporaryFolder folder;
  const auto volume = public_volume();
  const auto field = compress(std::vector<float>(64, 1.0f), Grid{.dims = {4, 4, 4}});
  const PageOptions options{
      .engine = write_engine(folder, kPlaces), .field = field, .poster = {64, 48}};
  Scene scene{.surfaces = {{.isovalue = 10}}};
  scene.field = folder / "heat.nrrd";
  save_page(volume, scene, folder / "unused.html", options);
  EXPECT_EQ(between(read_file(folder / "unused.html"), "|", "|"), "") << "no colours are by it";

  scene.appearance.color_map = "viridis";
  scene.appearance.color_by_field = true;
  save_page(volume, scene, folder / "page.html", options);
  const std::string page = read_file(folder / "page.html");
  field->save(folder / "field.zfp");
  EXPECT_EQ(decoded(between(page, "|", "|")), read_file(folder / "field.zfp"));
  EXPECT_EQ(parse_scene(between(page, "]<", ">(")).field, "heat.nrrd") << "without its folder";
  Renderer renderer = make_host_renderer(volume, {.field = field});
  FrameRequest request = scene_request(scene);
  request.size = {64, 48};
  request.camera = renderer.camera(scene.surfaces, request.size);
  const std::vector<std::uint8_t> png = encode_png(renderer.render(request));
  EXPECT_EQ(decoded(between(page, "[", "]")), std::string(png.begin(), png.end()));

  scene.field.clear();
  save_page(volume, scene, folder / "page.html", options);
  EXPECT_EQ(parse_scene(between(read_file(folder / "page.html"), "]<", ">(")).field, "field");
  EXPECT_THAT(error_of([&] { save_site(volume, scene, folder / "site", options); }),
              HasSubstr("a site has one volume"));
}

TEST(Page, TextsOfAnyLengthAreWhole) {
  const TemporaryFolder folder;
  const std::filesystem::path engine = write_engine(folder, kPlaces);
  for (const std::uint32_t side : {4u, 5u, 6u, 7u}) {
    const auto volume = compress(std::vector<float>(std::size_t{side} * side * side, 1.0f),
                                 Grid{.dims = {side, side, side}});
    save_page(volume, {.surfaces = {{.isovalue = 2}}}, folder / "p.html",
              {.engine = engine, .poster = {side, 3}});
    volume->save(folder / "v.zfp");
    EXPECT_EQ(decoded(between(read_file(folder / "p.html"), "(", ")")),
              read_file(folder / "v.zfp"));
  }
}

TEST(Page, NoTextEndsItsElement) {
  const TemporaryFolder folder;
  Scene scene{.surfaces = {{.isovalue = 10}}};
  scene.field = "volume";
  scene.volume = "</script>.zfp";
  save_page(public_volume(), scene, folder / "p.html",
            {.engine = write_engine(folder, kPlaces), .poster = {8, 8}});
  EXPECT_EQ(read_file(folder / "p.html").find("</script"), std::string::npos);
}

TEST(Page, RefusesWhatAPageDoesNotShow) {
  const TemporaryFolder folder;
  const PageOptions options{.engine = write_engine(folder, kPlaces), .poster = {8, 8}};
  const auto refused = [&](const auto &change) {
    Scene scene{.surfaces = {{.isovalue = 10}}};
    change(scene);
    return error_of([&] { save_page(public_volume(), scene, folder / "p.html", options); });
  };
  EXPECT_THAT(refused([](Scene &s) {
                s.appearance.color_map = "viridis";
                s.appearance.color_by_field = true;
              }),
              HasSubstr("a second volume (field), which was not opened"));
  EXPECT_THAT(refused([](Scene &s) { s.appearance.color_table.resize(256); }),
              HasSubstr("tables of colours"));
  EXPECT_THAT(refused([](Scene &s) { s.surfaces[0].clipped = false; }), HasSubstr("clipped"));
  EXPECT_THAT(refused([](Scene &s) { s.surfaces[0].mapped = false; }), HasSubstr("mapped"));
  EXPECT_THAT(refused([](Scene &s) { s.clip.resize(9); }), HasSubstr("clipping planes"));
  EXPECT_THAT(refused([](Scene &s) { s.surfaces.clear(); }), HasSubstr("surfaces"));
  EXPECT_EQ(folder.num_files(), 1u) << "the engine alone";
}

TEST(Page, RefusesWhatIsNoEngine) {
  const TemporaryFolder folder;
  const auto error = [&](const std::filesystem::path &engine) {
    return error_of([&] {
      save_page(public_volume(), {.surfaces = {{.isovalue = 10}}}, folder / "p.html",
                {.engine = engine, .poster = {8, 8}});
    });
  };
  EXPECT_THAT(error(folder / "none.gz"), HasSubstr("none.gz"));
  EXPECT_THAT(error(write_engine(folder, "<html>")), HasSubstr("no engine of a page"));
  write_file(folder / "page.html.gz", "<html>");
  EXPECT_THAT(error(folder / "page.html.gz"), HasSubstr("page.html.gz"));
  EXPECT_FALSE(std::filesystem::exists(folder / "p.html"));
}

class CliExport : public testing::Test {
 protected:
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  std::string engine() const { return " --engine " + quoted(write_engine(folder_, kPlaces)); }
  /// The scene of a page.
  Scene scene_in(const std::string &name) const {
    return parse_scene(between(read_file(folder_ / name), "]<", ">("));
  }

  TemporaryFolder folder_;
};

TEST_F(CliExport, OneIsovalueOrAScene) {
  const std::string fuel = std::string("export ") + kFuelFile + engine();
  const auto one = run_isowave(fuel + " -i 10 -o " + in("a.html"));
  ASSERT_EQ(one.status, 0) << one.err;
  EXPECT_THAT(one.out, HasSubstr("wrote "));
  EXPECT_THAT(read_file(folder_ / "a.html"), HasSubstr("<title>fuel_64x33x32_uint8.raw.gz<"));
  EXPECT_EQ(scene_in("a.html").surfaces.at(0).isovalue, 10);

  write_file(folder_ / "s.json", R"({"isowave_scene": 1, "volume": ")" + std::string(kFuelFile) +
                                     R"(", "surfaces": [{"isovalue": 20, "opacity": 0.5}]})");
  for (const std::string &what : std::vector<std::string>{"export " + in("s.json") + engine(),
                                                          fuel + " --scene " + in("s.json")}) {
    const auto of_scene = run_isowave(what + " --title Fuel -o " + in("b.html"));
    ASSERT_EQ(of_scene.status, 0) << of_scene.err;
    EXPECT_EQ(scene_in("b.html").surfaces.at(0).opacity, 0.5f);
    EXPECT_THAT(read_file(folder_ / "b.html"), HasSubstr("<title>Fuel<"));
  }
  // A second volume is opened, too.
  const std::string text = R"({"isowave_scene": 1, "surfaces": [{"isovalue": 20}],
    "color_map": "magma", "color_by_field": true, "field": ")" +
                           std::string(kFuelFile) + R"("})";
  write_file(folder_ / "f.json", text);
  const auto of_field = run_isowave(fuel + " --scene " + in("f.json") + " -o " + in("f.html"));
  ASSERT_EQ(of_field.status, 0) << of_field.err;
  EXPECT_EQ(between(read_file(folder_ / "f.html"), "|", "|"),
            between(read_file(folder_ / "f.html"), "(", ")"));
  expect_one_line_error(fuel + " --scene " + in("f.json") + " --site " + in("f"), "one volume");
  // A volume that is compressed already is taken as it is.
  ASSERT_EQ(run_isowave(std::string("convert ") + kFuelFile + " -o " + in("v.zfp")).status, 0);
  ASSERT_EQ(run_isowave("export " + in("v.zfp") + engine() + " -o " + in("c.html")).status, 0);
  EXPECT_EQ(decoded(between(read_file(folder_ / "c.html"), "(", ")")),
            read_file(folder_ / "v.zfp"));
}

TEST_F(CliExport, ThePictureIsThatOfRenderWithItsAnnotations) {
  write_file(folder_ / "s.json",
             R"({"isowave_scene": 1, "surfaces": [{"isovalue": 20}], "annotations":
                 {"scale_bar": true, "axes": true, "caption": true, "units": "mm"}})");
  const std::string scene = std::string(" ") + kFuelFile + " --scene " + in("s.json");
  const auto drawn =
      run_isowave("render" + scene + " --fit surface --device host -o " + in("a.png"));
  if (drawn.err.find("built without Cairo") != drawn.err.npos) GTEST_SKIP() << drawn.err;
  ASSERT_EQ(drawn.status, 0) << drawn.err;
  const core::Image8 expected = core::read_png(folder_ / "a.png");
  ASSERT_EQ(run_isowave("export" + scene + engine() + " -o " + in("a.html")).status, 0);
  ASSERT_EQ(run_isowave("export" + scene + engine() + " --site " + in("site")).status, 0);
  for (const char *page : {"a.html", "site/index.html"}) {
    write_file(folder_ / "b.png", decoded(between(read_file(folder_ / page), "[", "]")));
    EXPECT_TRUE(core::read_png(folder_ / "b.png").pixels == expected.pixels) << page;
  }
  ASSERT_EQ(run_isowave("render" + scene + " --fit surface --device host --annotate none -o " +
                        in("a.png"))
                .status,
            0);
  EXPECT_FALSE(core::read_png(folder_ / "a.png").pixels == expected.pixels);
}

TEST_F(CliExport, ASiteHasAPageAndTheVolumeInChunks) {
  const std::string fuel = std::string("export ") + kFuelFile + engine() + " -i 10 --site ";
  std::filesystem::create_directory(folder_ / "there");
  for (const std::string name : {"there", "new/site"}) {
    const auto done = run_isowave(fuel + in(name));
    ASSERT_EQ(done.status, 0) << done.err;
    EXPECT_THAT(done.out, HasSubstr("volume.chunks: "));
    const std::string page = read_file(folder_ / name / "index.html"),
                      volume = read_file(folder_ / name / "volume.chunks");
    EXPECT_EQ(between(page, "{", "}"), " connect-src 'self';");
    EXPECT_TRUE(parse_scene(between(page, "]<", ">(")).camera) << "the picture's";
    const auto about = nlohmann::json::parse(between(page, "(", ")"));
    EXPECT_EQ(about.at("file"), "volume.chunks");
    EXPECT_EQ(about.at("bytes"), volume.size());
    EXPECT_EQ(about.at("range"), nlohmann::json({0, 255}));
    const std::size_t head_bytes = about.at("head_bytes");
    const core::CompressedVolume read =
        core::read_chunks_head(std::as_bytes(std::span(volume)).first(head_bytes), volume.size());
    EXPECT_EQ(read.info.dims, glm::uvec3(64, 33, 32));
    EXPECT_EQ(read.coarser_levels.size(), 3u);
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "there"), {}), 2);
}

TEST_F(CliExport, ASiteThatFailsLeavesNothing) {
  const std::string fuel = std::string("export ") + kFuelFile + engine();
  expect_one_line_error(fuel + " -i 10 --site " + in("s") + " -o " + in("a.html"), "--output");
  expect_one_line_error("export " + in("no.zfp") + engine() + " --site " + in("s"), "no.zfp");
  write_file(folder_ / "file", "");
  expect_one_line_error(fuel + " --site " + in("file"), "is no folder");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "s"));
  const PageOptions options{.engine = write_engine(folder_, kPlaces), .poster = {8, 8}};
  Scene scene;  // without surfaces
  EXPECT_THAT(error_of([&] { save_site(public_volume(), scene, folder_ / "s", options); }),
              HasSubstr("surfaces"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "s"));
  scene.surfaces = {{.isovalue = 10}};
  save_site(public_volume(), scene, folder_ / "s", options);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "s" / "volume.chunks"));
}

TEST_F(CliExport, WrongInputIsOneLine) {
  const std::string fuel = std::string("export ") + kFuelFile;
  write_file(folder_ / "s.json", R"({"isowave_scene": 1, "surfaces": [{"isovalue": 20}]})");
  expect_one_line_error("export " + in("s.json") + engine(), "names no volume");
  expect_one_line_error(fuel + engine() + " -i 10 -o " + in("a.png"), "HTML");
  expect_one_line_error(fuel + engine() + " -i 3 --scene " + in("s.json") + " -o " + in("a.html"),
                        "--isovalue");
  expect_one_line_error(fuel + " -i 10 --engine " + in("none") + " -o " + in("a.html"), "none");
  expect_one_line_error("export " + in("no.zfp") + engine() + " -o " + in("a.html"), "no.zfp");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.html"));
}

}  // namespace

namespace core {
namespace {

/// Renderers that share a picture's rows out draw it together.
TEST(HostRows, TogetherAreThePicture) {
  const test::TestVolume volume({21, 18, 23}, test::gyroid_field(9), 8);
  const Camera camera = orbit_cameras(volume.info(), 3)[1];
  const SurfaceStyle front{.isovalue = 0.6f, .opacity = 0.4f}, behind{.isovalue = 0.0f};
  FrameRequest plain{.camera = camera, .isovalue = 0.1f, .size = ImageSize{23, 17, 2}};
  plain.ambient_rays = 3;
  FrameRequest layered = plain;
  layered.surfaces = {front, behind};
  for (const FrameRequest &request : {plain, layered}) {
    HostRenderer whole(volume.compressed);
    whole.render(request);
    const std::vector<std::uint8_t> expected = whole.shade().pixels;
    std::vector<std::uint8_t> together(expected.size());
    std::uint64_t hits = 0;
    for (const std::array<std::uint32_t, 2> rows : {std::array{0u, 1u}, {1u, 9u}, {9u, 17u}}) {
      HostRenderer part(volume.compressed);
      part.set_rows(rows[0], rows[1]);
      hits += part.render(request).rays_hit;
      const std::vector<std::uint8_t> pixels = part.shade().pixels;
      const std::size_t row = std::size_t{3} * 23;
      std::copy(pixels.begin() + std::ptrdiff_t(row * rows[0]),
                pixels.begin() + std::ptrdiff_t(row * rows[1]),
                together.begin() + std::ptrdiff_t(row * rows[0]));
    }
    EXPECT_EQ(together, expected);
    EXPECT_GT(hits, 100u);
    EXPECT_EQ(hits, whole.render(request).rays_hit);
  }
}

TEST(HostRows, RefusesRowsThatAreNotThere) {
  const test::TestVolume volume({5, 5, 5}, test::gyroid_field(9), 8);
  HostRenderer renderer(volume.compressed);
  FrameRequest request{.camera = orbit_cameras(volume.info(), 3)[1], .size = ImageSize{23, 17}};
  renderer.set_rows(17, 20);
  EXPECT_THAT(test::error_of([&] { renderer.render(request); }), HasSubstr("there are none"));
  renderer.set_rows(0, 9);
  request.light.towards_light = glm::dvec3(0, 0, 1);
  request.bounce_rays = 2;
  EXPECT_THAT(test::error_of([&] { renderer.render(request); }), HasSubstr("whole pictures"));
  renderer.set_rows(0, 17);
  renderer.render(request);
}

}  // namespace
}  // namespace core
}  // namespace isowave
