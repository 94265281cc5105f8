// Where annotations of a picture are: in exact numbers, from the camera's own formulas.

#include "isowave/annotations.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <numbers>

#include "core/view/color_maps.hpp"
#include "isowave/error.hpp"
#include "tests/api_support.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::array<float, 3> kBlack{0, 0, 0}, kWhite{1, 1, 1};

FrameRequest request_from(const Camera &camera, ImageSize size = {640, 480, 1}) {
  FrameRequest request;
  request.camera = camera;
  request.size = size;
  request.isovalue = 80;
  return request;
}

AnnotationGroup only(const Annotations &wanted, const FrameRequest &request,
                     const std::optional<std::array<double, 2>> &range = {}) {
  const std::vector<AnnotationGroup> groups = annotation_layout(wanted, request, range);
  EXPECT_EQ(groups.size(), 1u);
  return groups.empty() ? AnnotationGroup{} : groups.front();
}

std::vector<Camera> cameras() {
  std::vector<Camera> cameras{{{3, 5, 40}, {0, 1, 2}, {0, 1, 0}, 60, {}},
                              {{1e-4, 0, 0}, {0, 0, 0}, {0.2, 1, 0.3}, 5, {}},
                              {{-2e5, 3e5, 1e5}, {1, 2, 3}, {0, 0, 1}, 100, {}}};
  for (const double height : {7.3, 1e-5, 4e6}) {
    cameras.push_back(cameras[0]);
    cameras.back().parallel_height = height;
  }
  return cameras;
}

TEST(Annotations, TheScaleBarIsAsLongAsItSays) {
  for (const ImageSize size :
       {ImageSize{640, 480, 1}, {200, 150, 4}, {1920, 1080, 2}, {300, 900, 1}}) {
    for (const Camera &camera : cameras()) {
      const AnnotationGroup group =
          only({.scale_bar = true, .units = "mm"}, request_from(camera, size));
      ASSERT_EQ(group.strokes.size(), 1u);
      ASSERT_EQ(group.texts.size(), 1u);
      const auto &points = group.strokes[0].points;
      ASSERT_EQ(points.size(), 4u);
      EXPECT_EQ(points[1][1], points[2][1]);
      const double pixels = points[2][0] - points[1][0];
      EXPECT_GE(pixels, 0.1 * size.width * (1 - 1e-12));
      EXPECT_LE(pixels, 0.25 * size.width * (1 + 1e-12));
      const double distance = std::hypot(camera.eye[0] - camera.at[0], camera.eye[1] - camera.at[1],
                                         camera.eye[2] - camera.at[2]);
      const double height = camera.parallel_height.value_or(
          2 * distance * std::tan(camera.fovy_degrees / 2 * std::numbers::pi / 180));
      const std::string &text = group.texts[0].text;
      EXPECT_NEAR(pixels * height / size.height / std::stod(text), 1, 1e-12) << text;
      EXPECT_THAT(text, HasSubstr(" mm"));
      EXPECT_EQ(text.find("at the focal point") == text.npos, camera.parallel_height.has_value());
    }
  }
  const AnnotationGroup plain = only({.scale_bar = true}, request_from(cameras()[3]));
  EXPECT_EQ(plain.texts[0].text, "2");  // a quarter of 640 pixels has 2.43 world units
}

TEST(Annotations, AxesPointWhereTheCameraSeesThem) {
  for (const Camera &camera : cameras()) {
    const AnnotationGroup group = only({.axes = true}, request_from(camera));
    const glm::dvec3 eye(camera.eye[0], camera.eye[1], camera.eye[2]),
        at(camera.at[0], camera.at[1], camera.at[2]), up(camera.up[0], camera.up[1], camera.up[2]);
    const glm::dvec3 forward = glm::normalize(at - eye),
                     right = glm::normalize(glm::cross(forward, up)),
                     above = glm::cross(right, forward);
    ASSERT_EQ(group.strokes.size(), 3u);
    double before = 2;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::string &letter = group.texts[i].text;
      ASSERT_EQ(letter.size(), 1u);
      glm::dvec3 axis(0);
      axis[letter[0] - 'x'] = 1;
      const auto &points = group.strokes[i].points;
      const double arm = 2.4 * group.texts[i].size;
      EXPECT_NEAR(points[1][0] - points[0][0], arm * glm::dot(axis, right), 1e-9);
      EXPECT_NEAR(points[1][1] - points[0][1], -arm * glm::dot(axis, above), 1e-9);
      EXPECT_LE(glm::dot(axis, forward), before) << "those that point away come first";
      before = glm::dot(axis, forward);
      EXPECT_EQ(group.strokes[i].color, group.texts[i].color);
      const auto &color = group.strokes[i].color;
      EXPECT_EQ(std::ranges::max_element(color) - color.begin(), letter[0] - 'x')
          << "red, green, blue";
    }
  }
}

TEST(Annotations, TheColorBarHasTheColorsAndTicksOfItsRange) {
  FrameRequest request = request_from(cameras()[0]);
  request.appearance.color_map = "viridis";
  for (const std::array<double, 2> range : {std::array{-1.0, 3.0}, {40.0, 10.0}, {1e-7, 5e-7}}) {
    const AnnotationGroup group = only({.color_bar = true, .units = "um"}, request, range);
    const auto colors = core::color_map("viridis");
    const auto word_of = [](const std::array<float, 3> &color) {
      std::uint32_t word = 0;
      for (std::size_t i = 0; i < 3; ++i)
        word |= std::uint32_t(std::lround(255 * color[i])) << 8 * i;
      return word;
    };
    const double top = group.boxes.front().begin[1], bottom = group.boxes.back().end[1];
    EXPECT_NEAR(bottom - top, 0.42 * 480, 1.5);
    double next = top;
    for (const AnnotationBox &box : group.boxes) {
      EXPECT_EQ(box.begin[1], next) << "no gaps";
      EXPECT_EQ(box.begin[1], std::round(box.begin[1])) << "whole pixels";
      next = box.end[1];
      const double at = 1 - ((box.begin[1] + box.end[1]) / 2 - top) / (bottom - top);
      const auto place = std::ranges::find(colors, word_of(box.color)) - colors.begin();
      EXPECT_LE(std::abs(double(place) - 255 * at), 2);
    }
    const std::size_t num_ticks = group.texts.size() - 1;
    EXPECT_GE(num_ticks, 3u);
    EXPECT_LE(num_ticks, 5u);
    ASSERT_EQ(group.strokes.size(), num_ticks + 1);
    for (std::size_t i = 0; i < num_ticks; ++i) {
      const double up = (bottom - group.strokes[i + 1].points[0][1]) / (bottom - top);
      const double value = std::stod(group.texts[i].text);
      EXPECT_NEAR(range[0] + up * (range[1] - range[0]), value,
                  1e-9 * std::abs(range[1] - range[0]));
    }
    EXPECT_EQ(group.texts.back().text, "z [um]");
  }
  request.appearance.color_axis = {1, 1, 0};
  EXPECT_EQ(only({.color_bar = true}, request, std::array{0.0, 1.0}).texts.back().text,
            "along (1, 1, 0)");
  request.appearance.color_by_depth = true;
  EXPECT_EQ(
      only({.color_bar = true, .units = "um"}, request, std::array{0.0, 1.0}).texts.back().text,
      "depth [um]");
  request.appearance.color_by_field = true;
  EXPECT_EQ(only({.color_bar = true, .units = "um"}, request, std::array{2.0, 2.0}).texts.size(),
            2u);
  EXPECT_TRUE(annotation_layout({.color_bar = true}, request, {}).empty()) << "no hit has a value";
}

std::vector<std::string> texts_of(const AnnotationGroup &group) {
  std::vector<std::string> texts;
  for (const AnnotationText &text : group.texts) texts.push_back(text.text);
  return texts;
}

TEST(Annotations, TheCaptionNamesSurfacesInTheirColors) {
  FrameRequest request = request_from(cameras()[0]);
  const Annotations wanted{.caption = true, .title = "head.nrrd"};
  AnnotationGroup group = only(wanted, request);
  EXPECT_THAT(texts_of(group), ElementsAre("head.nrrd", "isovalue 80"));
  ASSERT_EQ(group.boxes.size(), 1u);
  EXPECT_EQ(group.boxes[0].color, request.appearance.surface);
  request.appearance.color_map = "gray";
  EXPECT_TRUE(only(wanted, request).boxes.empty()) << "surfaces have no colours of their own";
  request.appearance.color_map.clear();
  request.surfaces = {{500, {1, 0, 0}, 0.25f}, {1150.5, {0, 1, 0}, 1}};
  group = only({.caption = true}, request);
  EXPECT_THAT(texts_of(group), ElementsAre("isovalue 500, opacity 0.25", "isovalue 1150.5"));
  ASSERT_EQ(group.boxes.size(), 2u);
  EXPECT_EQ(group.boxes[1].color, request.surfaces[1].color);
  // Too long: both ends stay.
  const std::string title = "first" + std::string(200, 'x') + "last.nrrd";
  const std::string shown = only({.caption = true, .title = title}, request).texts[0].text;
  EXPECT_TRUE(shown.starts_with("first") && shown.ends_with("last.nrrd")) << shown;
  EXPECT_THAT(shown, HasSubstr("…"));
  EXPECT_LT(shown.size(), 100u);
  EXPECT_THAT(only({.caption = true, .title = "a\n\xFF"}, request).texts[0].text,
              "a\xEF\xBF\xBD\xEF\xBF\xBD");
}

TEST(Annotations, TextsContrastWithTheBackgroundBehindThem) {
  FrameRequest request = request_from(cameras()[0]);
  const auto inks = [&] {
    const std::vector<AnnotationGroup> groups =
        annotation_layout({.scale_bar = true, .caption = true}, request, {});
    for (const AnnotationGroup &group : groups) EXPECT_NE(group.halo_color, group.texts[0].color);
    return std::array{groups[0].texts[0].color, groups[1].texts[0].color};
  };
  EXPECT_THAT(inks(), ElementsAre(kBlack, kBlack));
  request.appearance.background = {0.1f, 0.1f, 0.4f};
  EXPECT_THAT(inks(), ElementsAre(kWhite, kWhite));
  request.appearance.background_top = {0.9f, 0.9f, 0.9f};
  EXPECT_THAT(inks(), ElementsAre(kWhite, kBlack)) << "lower edge, upper edge";
  request.appearance.background = {1, 0, 0};
  request.appearance.background_top.reset();
  EXPECT_THAT(inks(), ElementsAre(kBlack, kBlack)) << "5.25 to 1, white 4 to 1";
  request.appearance.background = {0, 0, 0};
  request.appearance.transparent = true;
  EXPECT_THAT(inks(), ElementsAre(kBlack, kBlack));
}

/// Nothing of the layout is outside of its group's rows and columns, nor outside of the picture.
TEST(Annotations, GroupsHoldTheirThings) {
  for (const ImageSize size : {ImageSize{200, 150, 1}, {1280, 720, 1}, {200, 4000, 1}}) {
    FrameRequest request = request_from(cameras()[0], size);
    for (int i = 0; i < 8; ++i) request.surfaces.push_back({i + 0.125, {0, 0, 1}, 0.5f});
    request.appearance.color_map = "magma";
    const std::vector<AnnotationGroup> groups = annotation_layout(
        {true, true, true, true, "mm", "head.nrrd"}, request, std::array{0.0, 7.0});
    ASSERT_EQ(groups.size(), 4u);
    for (const AnnotationGroup &group : groups) {
      ASSERT_LT(group.begin[0], group.end[0]);
      ASSERT_LT(group.begin[1], group.end[1]);
      ASSERT_LE(group.end[0], size.width);
      ASSERT_LE(group.end[1], size.height);
      const auto expect_inside = [&](const PicturePlace &place, double reach) {
        for (std::size_t i = 0; i < 2; ++i) {
          EXPECT_GE(place[i] - reach, group.begin[i]);
          EXPECT_LE(place[i] + reach, group.end[i]);
        }
      };
      for (const AnnotationBox &box : group.boxes) {
        expect_inside(box.begin, 0);
        expect_inside(box.end, 0);
      }
      for (const AnnotationStroke &stroke : group.strokes) {
        for (const PicturePlace &place : stroke.points)
          expect_inside(place, stroke.width / 2 + group.halo);
      }
      for (const AnnotationText &text : group.texts) expect_inside(text.place, group.halo);
    }
  }
}

TEST(Annotations, WhatCannotBeIsOneLine) {
  const FrameRequest request = request_from(cameras()[0]);
  FrameRequest small = request;
  small.size = {199, 150, 1};
  EXPECT_EQ(error_of([&] { annotation_layout({.axes = true}, small, {}); }),
            "199 x 150 pixels are too few for annotations: draw at least 200 x 150");
  EXPECT_THAT(error_of([&] { annotation_layout({.color_bar = true}, request, {}); }),
              HasSubstr("a colour bar needs a colour map"));
  FrameRequest blind = request;
  blind.camera.at = blind.camera.eye;
  EXPECT_THAT(error_of([&] { annotation_layout({.axes = true}, blind, {}); }), HasSubstr("camera"));
  EXPECT_TRUE(annotation_layout({}, request, {}).empty());
}

}  // namespace
}  // namespace isowave
