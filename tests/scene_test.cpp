// Scenes of the library's users: values, texts, files, and what is refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <isowave/scene.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/api/frame_parts.hpp"
#include "isowave/error.hpp"
#include "tests/api_support.hpp"
#include "tests/run_program.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A scene in which every field has another value than by default.
Scene full_scene() {
  Scene scene;
  scene.volume = "head.h5";
  scene.dataset = "scan/ct";
  scene.index = "t=3,c=0";
  scene.field = "heat.h5";
  scene.field_dataset = "T";
  scene.field_index = "t=1";
  scene.camera = Camera{{1, 2, 3}, {0, 0.1, 0}, {0, 0, 1}, 45, 2.5};
  scene.surfaces = {{500, {1, 128 / 255.0f, 0}, 0.3f}, {1150.25, {0.1f, 0.2f, 0.3f}, 1}};
  scene.surfaces[1].clipped = false;
  scene.slices = {{{0, 1, 0}, 2.5, 0.5f, false}, {.normal = {1, 0, 2}}};
  scene.clip = {{{0, 0, -1}, -60}, {{1, 1, 0}, 0.1}};
  scene.caps = false;
  scene.appearance.background = {0, 0, 0};
  scene.appearance.background_top = {0.25f, 0.5f, 1};
  scene.appearance.ambient = 0.1f;
  scene.appearance.diffuse = 0.2f;
  scene.appearance.specular = 0.3f;
  scene.appearance.above = 0.4f;
  scene.appearance.transparent = true;
  scene.appearance.light_direction = Vector3{1, 0.5, -2};
  scene.appearance.shadow_rays = 16;
  scene.appearance.bounce_rays = 24;
  scene.appearance.light_angle = 1.5;
  scene.appearance.color_map = "magma";
  scene.appearance.color_axis = {1, 0, 0};
  scene.appearance.color_by_depth = true;
  scene.appearance.color_caps_alone = true;
  scene.appearance.color_by_field = true;
  scene.appearance.color_by_label = true;
  scene.appearance.color_low = -1;
  scene.appearance.color_high = 1e30;
  scene.appearance.slice_map = "coolwarm";
  scene.appearance.slice_low = -3;
  scene.appearance.slice_high = 0.5;
  scene.annotations = Annotations{true, true, true, true, "µm", "a head, \"cut\""};
  return scene;
}

/// All fields, as ranks of a team compare requests.
std::string fields_of(const Scene &scene) {
  FrameRequest request = scene_request(scene);
  request.surfaces = scene.surfaces;
  return scene.volume.string() + " " + scene.dataset + " " + scene.index + " " +
         scene.field.string() + " " + scene.field_dataset + " " + scene.field_index +
         (scene.camera ? " seen " : " unseen ") + text_of(request);
}

Scene one_surface() {
  Scene scene;
  scene.surfaces = {{.isovalue = 0.5}};
  return scene;
}

TEST(Scene, TextsKeepEveryField) {
  Scene without_defaults = full_scene();
  for (const Scene &scene : {full_scene(), one_surface()}) {
    const Scene read = parse_scene(scene_text(scene));
    EXPECT_EQ(fields_of(read), fields_of(scene));
    EXPECT_EQ(scene_text(read), scene_text(scene));
  }
  // A new field of Appearance must be in full_scene(), or this test would not see it lost.
  const auto text = nlohmann::json::parse(scene_text(full_scene()));
  for_each_scene_field(without_defaults, [&](const std::string &name, const auto &) {
    if (name != "color_table" && name != "slice_table") {
      EXPECT_TRUE(text.contains(name)) << name;
    }
  });
  for_each_annotations_field(*without_defaults.annotations, [&](const char *name, const auto &) {
    EXPECT_TRUE(text["annotations"].contains(name)) << name;
  });
}

TEST(Scene, AnnotationsAreLeftOutUnlessTheyAreTrue) {
  const auto read = [](const std::string &annotations) {
    return parse_scene(R"({"isowave_scene": 1, "surfaces": [{"isovalue": 1}], "annotations": )" +
                       annotations + "}");
  };
  EXPECT_FALSE(one_surface().annotations);
  for (const char *text : {"{}", R"({"axes": false, "units": "mm"})"}) {
    const Scene scene = read(text);
    ASSERT_TRUE(scene.annotations);
    const Annotations &found = *scene.annotations;
    EXPECT_FALSE(found.scale_bar || found.axes || found.color_bar || found.caption);
    EXPECT_EQ(scene_text(parse_scene(scene_text(scene))), scene_text(scene)) << "and is kept";
  }
  const Annotations found = *read(R"({"axes": true, "units": "Å", "title": "a"})").annotations;
  EXPECT_TRUE(found.axes && !found.caption);
  EXPECT_EQ(found.units + found.title, "Åa");
  EXPECT_TRUE(read(R"({"units": "µµµµµµµµµµµµµµµµ"})").annotations) << "16 letters";
}

TEST(Scene, TextsKeepTablesOfColours) {
  Scene scene = one_surface();
  for (int i = 0; i < 256; ++i)
    scene.appearance.color_table.push_back({static_cast<float>(i) / 255, 0.123f, 1});
  scene.appearance.slice_table = scene.appearance.color_table;
  scene.appearance.slice_table[3] = {0, 1, 0};
  const Appearance read = parse_scene(scene_text(scene)).appearance;
  EXPECT_EQ(read.color_table, scene.appearance.color_table);
  EXPECT_EQ(read.slice_table, scene.appearance.slice_table);
}

TEST(Scene, TextsAreShort) {
  EXPECT_EQ(scene_text(one_surface()),
            "{\n  \"isowave_scene\": 1,\n  \"surfaces\": [\n    {\n      \"isovalue\": 0.5,\n"
            "      \"color\": \"#dbbd87\"\n    }\n  ]\n}\n");
}

TEST(Scene, WhatIsLeftOutHasItsDefault) {
  const Scene scene = parse_scene(
      R"({"isowave_scene": 1, "surfaces": [{"isovalue": 1, "color": "bone"}, {"isovalue": 2}]})");
  EXPECT_EQ(scene.surfaces[0].color, parse_color("bone"));
  EXPECT_EQ(scene.surfaces[1].color, surface_color(1)) << "unlike the first";
  EXPECT_EQ(scene.surfaces[1].opacity, 1);
  EXPECT_TRUE(scene.volume.empty() && scene.field.empty() && !scene.camera && scene.clip.empty() &&
              scene.caps);
}

TEST(Scene, OneOpaqueSurfaceIsDrawnByItsIsovalue) {
  Scene scene = one_surface();
  scene.surfaces[0].color = {0, 1, 0};
  EXPECT_TRUE(scene_request(scene).surfaces.empty());
  EXPECT_EQ(scene_request(scene).isovalue, 0.5);
  EXPECT_EQ(scene_request(scene).appearance.surface, scene.surfaces[0].color);
  const Scene again = scene_of(scene_request(scene));
  ASSERT_EQ(again.surfaces.size(), 1u);
  EXPECT_EQ(again.surfaces[0].color, scene.surfaces[0].color);
  scene.surfaces[0].opacity = 0.5f;
  EXPECT_EQ(scene_request(scene).surfaces.size(), 1u);
  scene.surfaces[0] = {.isovalue = 0.5, .clipped = false};
  EXPECT_EQ(scene_request(scene).surfaces.size(), 1u);
}

TEST(Scene, BadTextsAreOneLineThatSaysWhere) {
  const auto with = [](const std::string &more) { return R"({"isowave_scene": 1, )" + more + "}"; };
  const std::string surface = R"("surfaces": [{"isovalue": 1}])";
  const std::vector<std::pair<std::string, const char *>> texts = {
      {"", "no JSON"},
      {"[1]", "must be an object"},
      {"{}", "\"isowave_scene\" is missing"},
      {R"({"isowave_scene": 2})", "version 2 cannot be read"},
      {with(R"("surfaces": [])"), "surfaces: give at least one"},
      {with(R"("caps": true)"), "surfaces is missing"},
      {with(R"("surfaces": {})"), "surfaces must be a list"},
      {with(R"("surfaces": [{}])"), "surfaces[0].isovalue is missing"},
      {with(R"("surfaces": [{"isovalue": "1"}])"), "surfaces[0].isovalue must be a number"},
      {with(R"("surfaces": [{"isovalue": 1, "opacty": 1}])"), "surfaces[0] has no \"opacty\""},
      {with(R"("surfaces": [{"isovalue": 1, "opacity": 2}])"), "an opacity of 2 is out of range"},
      {with(R"("surfaces": [{"isovalue": 1, "opacity": 1e200}])"), "surfaces[0].opacity"},
      {with(R"("surfaces": [{"isovalue": 1, "color": "blu"}])"), "surfaces[0].color: "},
      {with(R"("surfaces": [{"isovalue": 1, "color": [1, 2, 3]}])"), "surfaces[0].color: "},
      {with(R"("surfaces": [{"isovalue": 1}, {"isovalue": 1}])"), "two surfaces"},
      {with(R"("surfaces": [{"isovalue": 1}, {"isovalue": 2}, {"isovalue": 3}, {"isovalue": 4},
                            {"isovalue": 5}, {"isovalue": 6}, {"isovalue": 7}, {"isovalue": 8},
                            {"isovalue": 9}])"),
       "9 surfaces are more than"},
      {with(surface + R"(, "surface": 1)"), "the scene has no \"surface\""},
      {with(surface + R"(, "caps": 1)"), "caps must be true or false"},
      {with(surface + R"(, "caps": true, "caps": false)"), "\"caps\" is given twice"},
      {with(surface + R"(, "clip": [{"offset": 1}])"), "clip[0].normal is missing"},
      {with(surface + R"(, "clip": [{"normal": [0, 0, 0]}])"), "normal"},
      {with(surface + R"(, "clip": [{"normal": [0, 0]}])"), "clip[0].normal must be [x, y, z]"},
      {with(surface + R"(, "camera": {"eye": [0, 0, 0]})"), "camera.at is missing"},
      {with(surface + R"(, "camera": {"eye": [0, 0, 0], "at": [0, 0, 0]})"), "camera"},
      {with(surface + R"(, "color_map": 5)"), "color_map must be a text"},
      {with(surface + R"(, "field": ["heat.nrrd"])"), "field must be a text"},
      {with(surface + R"(, "index": 3, "volume": "a.nrrd")"), "index must be a text"},
      {with(surface + R"(, "dataset": "ct")"), "dataset: the scene names no file of the volume"},
      {with(surface + R"(, "index": "t=1")"), "index: the scene names no file of the volume"},
      {with(surface + R"(, "field_dataset": "T")"),
       "field_dataset: the scene names no file of the field"},
      {with(surface + R"(, "field": "volume", "field_index": "t=1")"),
       "field_index: the scene names no file of the field"},
      {with(surface + R"(, "color_by_field": true)"), "colours by a field need a colour map"},
      {with(surface + R"(, "color_map": "viridis", "color_low": 1)"), "color_low and color_high"},
      {with(surface + R"(, "background": null)"), "background"},
      {with(surface + R"(, "light_direction": [0, 0, 0])"), "a light in direction 0 0 0"},
      {with(surface + R"(, "shadow_rays": 1.5)"), "shadow_rays must be a whole number"},
      {with(surface + R"(, "shadow_rays": 1)"), "shadows need a light"},
      {with(surface + R"(, "light_direction": [0, 1, 0], "shadow_rays": 256)"), "256 shadow rays"},
      {with(surface + R"(, "bounce_rays": 16)"), "bounced light needs a light"},
      {with(surface + R"(, "light_direction": [0, 1, 0], "bounce_rays": 256)"), "256 bounce rays"},
      {with(surface + R"(, "light_direction": [0, 1, 0], "shadow_rays": 9, "light_angle": 50)"),
       "50"},
      {with(surface + R"(, "color_map": "jet")"), "jet"},
      {with(surface + R"(, "color_map": "gray", "color_axis": [0, 0, 0])"), "axis"},
      {with(surface + R"(, "annotations": true)"), "annotations must be an object"},
      {with(surface + R"(, "annotations": null)"), "annotations must be an object"},
      {with(surface + R"(, "annotations": {"axis": true})"), "annotations has no \"axis\""},
      {with(surface + R"(, "annotations": {"axes": 1})"), "annotations.axes must be true or false"},
      {with(surface + R"(, "annotations": {"units": 1})"), "annotations.units must be a text"},
      {with(surface + R"(, "annotations": {"units": "12345678901234567"})"),
       "annotations.units: 17 letters are too many: give at most 16"},
      {with(surface + R"(, "annotations": {"title": []})"), "annotations.title must be a text"},
      {with(surface + R"(, "annotations": {"color_bar": true})"),
       "annotations.color_bar: there is no colour map, and no slice"},
  };
  for (const auto &[text, why] : texts) {
    const std::string error = error_of([&] { parse_scene(text); });
    EXPECT_THAT(error, AllOf(HasSubstr(why), Not(HasSubstr("\n")))) << text;
  }
}

TEST(Scene, WhatNoTextHoldsIsNotWritten) {
  Scene scene = one_surface();
  EXPECT_THROW(scene_text({}), Error);
  scene.appearance.above = std::numeric_limits<float>::infinity();
  EXPECT_THAT(error_of([&] { scene_text(scene); }), HasSubstr("inf cannot be written"));
}

TEST(Scene, FilesFindTheirVolumeFromAnyFolder) {
  const core::test::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "scenes");
  Scene scene = one_surface();
  for (const std::filesystem::path &volume :
       {folder / "data" / "head.nrrd", std::filesystem::path("/data/head.nrrd"),
        std::filesystem::path("generate:sphere_8x8x8_uint8"), std::filesystem::path()}) {
    scene.volume = volume;
    write_scene(scene, folder / "scenes" / "a.json");
    EXPECT_EQ(read_scene(folder / "scenes" / "a.json").volume, volume);
  }
  std::ofstream(folder / "scenes" / "b.json")
      << R"({"isowave_scene": 1, "volume": "../head.nrrd", "surfaces": [{"isovalue": 1}]})";
  EXPECT_EQ(read_scene(folder / "scenes" / "b.json").volume, folder / "head.nrrd");
  std::ofstream(folder / "scenes" / "c.json")
      << R"({"isowave_scene": 1, "field": "heat.nrrd", "surfaces": [{"isovalue": 1}]})";
  EXPECT_EQ(read_scene(folder / "scenes" / "c.json").field, folder / "scenes" / "heat.nrrd");
  // A relative path is seen from the current folder.
  scene.volume = "head.nrrd";
  write_scene(scene, folder / "scenes" / "a.json");
  EXPECT_EQ(read_scene(folder / "scenes" / "a.json").volume,
            std::filesystem::current_path() / "head.nrrd");
}

TEST(Scene, TheIndexOfAFileChoosesItsStep) {
  Scene scene = full_scene();
  EXPECT_THAT(error_of([&] { scene_volume(scene); }),
              AllOf(HasSubstr("dataset scan/ct: "), HasSubstr("isowave[files]")));
  EXPECT_THAT(error_of([&] { scene_field(scene); }), HasSubstr("field_dataset T: "));
  scene.dataset = scene.field_dataset = "";
  EXPECT_EQ(scene_field(scene).step, 1u);
  EXPECT_THAT(error_of([&] { scene_volume(scene); }), HasSubstr("index t=3,c=0: give t=N"));
  scene.index = "t=3";
  EXPECT_EQ(scene_volume(scene).step, 3u);
  EXPECT_FALSE(scene_volume(one_surface()).step.has_value());
}

TEST(Scene, TheDrawnVolumeIsNoFileOfThatName) {
  const core::test::TemporaryFolder folder;
  Scene scene = one_surface();
  scene.volume = folder / "volume";
  for (const std::filesystem::path &field :
       {std::filesystem::path("volume"), std::filesystem::path("generate:sphere_8x8x8_uint8"),
        folder / "volume"}) {
    scene.field = field;
    write_scene(scene, folder / "a.json");
    EXPECT_EQ(read_scene(folder / "a.json").field, field);
  }
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  scene.field = "./volume";
  for (const char *file : {"a.json", "./a.json"}) {
    write_scene(scene, file);
    EXPECT_EQ(read_scene(file).field, "./volume") << file;
  }
  std::filesystem::current_path(before);
  EXPECT_THAT(core::test::read_file(folder / "a.json"), HasSubstr("\"./volume\""));
}

TEST(Scene, BadFilesAreOneLineWithTheirName) {
  const core::test::TemporaryFolder folder;
  EXPECT_THAT(error_of([&] { read_scene(folder / "absent.json"); }), HasSubstr("absent.json"));
  std::ofstream(folder / "a.json") << R"({"isowave_scene": 1})";
  EXPECT_THAT(error_of([&] { read_scene(folder / "a.json"); }),
              AllOf(HasSubstr("a.json: surfaces is missing"), Not(HasSubstr("\n"))));
  std::ofstream(folder / "large.json") << std::string(2 << 20, ' ');
  EXPECT_THAT(error_of([&] { read_scene(folder / "large.json"); }), HasSubstr("more than"));
  EXPECT_THAT(error_of([&] { write_scene(one_surface(), folder / "a.png"); }), HasSubstr("a.png"));
  EXPECT_THAT(error_of([&] { write_scene(one_surface(), folder / "no" / "a.json"); }),
              HasSubstr("no"));
}

}  // namespace
}  // namespace isowave
