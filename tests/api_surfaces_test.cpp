// Several and translucent surfaces of the library's users: requests, the frames that renderers
// make of them, what is refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <isowave/isowave.hpp>
#include <limits>
#include <map>
#include <memory>
#include <set>

#include "core/api/frame_parts.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/api/volume_implementation.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/api_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using core::test::sphere;
using testing::HasSubstr;

constexpr ImageSize kSize{64, 48, 1};

Renderer make_twin(const std::shared_ptr<const Volume> &volume) {
  return Renderer(std::make_unique<Renderer::Implementation>(
      std::make_shared<Turns>(), volume,
      std::make_unique<core::TwinRenderer>(volume->implementation().volume,
                                           core::ImageSize{64, 48, 1})));
}

/// Spheres within each other, the inner one of the larger isovalue, and a plane that cuts both.
FrameRequest spheres(Renderer &renderer) {
  FrameRequest request{.size = kSize, .want_depth = true, .want_normals = true, .want_hits = true};
  request.surfaces = {{.isovalue = 0.7, .color = {0.9f, 0.2f, 0.1f}},
                      {.isovalue = 0.45, .color = {0.2f, 0.4f, 0.9f}, .opacity = 0.4f}};
  request.camera = renderer.camera(request.surfaces);
  return request;
}

void expect_same(const Frame &frame, const Frame &expected) {
  EXPECT_EQ(frame.picture, expected.picture);
  EXPECT_EQ(frame.depth, expected.depth);
  EXPECT_EQ(frame.normals, expected.normals);
  ASSERT_EQ(frame.hits.size(), expected.hits.size());
  for (std::size_t i = 0; i < frame.hits.size(); ++i) {
    ASSERT_EQ(frame.hits[i].surface, expected.hits[i].surface) << "ray " << i;
    ASSERT_EQ(frame.hits[i].cap, expected.hits[i].cap) << "ray " << i;
    ASSERT_EQ(frame.hits[i].cell, expected.hits[i].cell) << "ray " << i;
  }
  EXPECT_EQ(frame.statistics.hits, expected.statistics.hits);
  EXPECT_EQ(frame.statistics.layers, expected.statistics.layers);
  EXPECT_EQ(frame.statistics.layer_hits, expected.statistics.layer_hits);
  EXPECT_EQ(frame.statistics.rays_cut, expected.statistics.rays_cut);
}

TEST(ApiSurfaces, HitsNameTheirSurface) {
  Renderer twin = make_twin(sphere());
  FrameRequest request = spheres(twin);
  const Frame whole = twin.render(request);
  std::set<std::uint32_t> seen;
  for (const Hit &hit : whole.hits) {
    EXPECT_FALSE(hit.cap);
    if (std::isfinite(hit.t)) seen.insert(hit.surface);
  }
  EXPECT_EQ(seen, std::set{1u}) << "the outer sphere is in front of the inner one";
  EXPECT_EQ(whole.statistics.layers, 2u);
  EXPECT_GT(whole.statistics.layer_hits, whole.statistics.hits);
  EXPECT_EQ(whole.statistics.rays_cut, 0u);
  // Before this plane lies the eye: caps of both spheres face it.
  const Vector3 middle{5 + 10, 6 + 2 * 10, 7 + 10}, &eye = request.camera.eye;
  ClipPlane plane;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    plane.normal[axis] = middle[axis] - eye[axis];
    plane.offset += plane.normal[axis] * middle[axis];
  }
  request.clip = {plane};
  std::map<std::uint32_t, int> caps;
  for (const Hit &hit : twin.render(request).hits) {
    if (hit.cap) ++caps[hit.surface];
  }
  EXPECT_GT(caps[0], 50) << "of hits at one place, the surface of the larger isovalue is first";
  EXPECT_GT(caps[1], 50);
  // One surface has no number, but caps.
  request.isovalue = 0.45;
  request.surfaces.clear();
  const Frame single = twin.render(request);
  int num_caps = 0;
  for (const Hit &hit : single.hits) {
    EXPECT_EQ(hit.surface, 0u);
    num_caps += hit.cap ? 1 : 0;
  }
  EXPECT_EQ(num_caps, caps[0] + caps[1]);
  EXPECT_EQ(single.statistics.layers, 0u);
}

TEST(ApiSurfaces, TheHostDrawsTheTwinsFrames) {
  for (const Compression &compression : {Compression{.rate = 16}, Compression{.exact = true}}) {
    const auto volume = sphere(compression);
    Renderer twin = make_twin(volume), host = make_host_renderer(volume);
    FrameRequest request = spheres(twin);
    EXPECT_TRUE(host.can_draw(request));
    expect_same(host.render(request), twin.render(request));
    request.appearance.transparent = true;
    request.normals = Normals::kCell;
    expect_same(host.render(request), twin.render(request));
  }
}

/// The error of the first crossing.
TEST(ApiSurfaces, HaveBoundsOfTheirError) {
  const auto volume = sphere({.rate = 20, .measure_error = true});
  Renderer twin = make_twin(volume), host = make_host_renderer(volume);
  FrameRequest request = spheres(twin);
  request.want_bounds = true;
  const Frame frame = host.render(request);
  EXPECT_EQ(frame.bounds.to_vector(), twin.render(request).bounds.to_vector());
  request.surfaces.erase(request.surfaces.begin());  // the inner one
  EXPECT_EQ(frame.bounds.to_vector(), host.render(request).bounds.to_vector());
  EXPECT_GT(std::ranges::count_if(frame.bounds, [](float b) { return b > 0 && b < 1; }), 100);
  request = spheres(twin);
  request.max_surface_error = 2;
  for (const Evidence by : {Evidence::kProof, Evidence::kSample}) {
    request.by = by;
    EXPECT_TRUE(host.can_draw(request));
    const Frame chosen = host.render(request);
    EXPECT_TRUE(chosen.detail.value().reachable);
    EXPECT_EQ(chosen.detail->voxel_pixels, 0);
    EXPECT_EQ(chosen.statistics.layers, 2u);
  }
}

class ApiSurfacesOnDevice : public testing::TestWithParam<core::ocl::DeviceInfo> {
 protected:
  std::shared_ptr<Device> device_ = open_device(std::to_string(GetParam().index));
};

TEST_P(ApiSurfacesOnDevice, DrawsTheTwinsFrames) {
  const auto volume = sphere();
  Renderer twin = make_twin(volume),
           renderer(device_, volume, {.largest = kSize, .cache_blocks = 64, .with_surfaces = 2});
  const FrameRequest request = spheres(twin);
  EXPECT_EQ(renderer.camera(request.surfaces).eye, request.camera.eye);
  EXPECT_TRUE(renderer.can_draw(request));
  expect_same(renderer.render(request), twin.render(request));
  FrameRequest single = request;
  single.surfaces.clear();
  single.isovalue = 0.45;
  expect_same(renderer.render(single), twin.render(single));
}

TEST_P(ApiSurfacesOnDevice, IsMadeForSoMany) {
  const auto volume = sphere();
  FrameRequest request{.size = kSize, .surfaces = {{.isovalue = 0.4}, {.isovalue = 0.5}}};
  Renderer none(device_, volume, {.largest = kSize}),
      one(device_, volume, {.largest = kSize, .with_surfaces = 1});
  EXPECT_FALSE(none.can_draw(request));
  EXPECT_THAT(error_of([&] { none.render(request); }), HasSubstr("made with_surfaces"));
  EXPECT_THAT(error_of([&] { one.render(request); }),
              HasSubstr("made for 1 surface, and 2 are given"));
  EXPECT_THAT(error_of([&] { Renderer(device_, volume, {.with_surfaces = 9}); }),
              HasSubstr("a frame has at most 8 surfaces: 9 are too many"));
}

INSTANTIATE_TEST_SUITE_P(Devices, ApiSurfacesOnDevice,
                         testing::ValuesIn(core::devices_under_test()), core::device_test_name);

TEST(ApiSurfaces, BadRequestsAreOneLine) {
  Renderer renderer = make_twin(sphere());
  const FrameRequest good = spheres(renderer);
  const std::vector<std::uint8_t> picture = renderer.render(good).picture;
  const auto refuse = [&](const char *text, const auto &change) {
    FrameRequest bad = good;
    change(bad);
    EXPECT_THAT(error_of([&] { renderer.render(bad); }), HasSubstr(text));
    EXPECT_FALSE(renderer.can_draw(bad)) << text;
    EXPECT_EQ(renderer.render(good).picture, picture) << text;
  };
  using Request = FrameRequest;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  refuse("9 surfaces are more than a frame can have", [](Request &r) {
    for (int i = 0; i < 7; ++i) r.surfaces.push_back({.isovalue = 0.01 * i});
  });
  refuse("two surfaces have the isovalue", [](Request &r) { r.surfaces[1].isovalue = 0.7; });
  refuse("NaN", [](Request &r) { r.surfaces[1].isovalue = kNan; });
  refuse("an opacity of 0 is", [](Request &r) { r.surfaces[0].opacity = 0; });
  refuse("an opacity of 2 is", [](Request &r) { r.surfaces[0].opacity = 2; });
  refuse("an opacity of nan", [](Request &r) { r.surfaces[0].opacity = float(kNan); });
  refuse("a colour of 1.5 is", [](Request &r) { r.surfaces[0].color[2] = 1.5f; });
  refuse("leave out bound", [](Request &r) { r.bound = FieldBound::kLower; });
  refuse("end at surfaces of opacity 1, and there is none", [](Request &r) {
    r.ambient_rays = 1;
    for (Surface &surface : r.surfaces) surface.opacity = 0.5f;
  });
  refuse("leave out max_surface_error", [](Request &r) { r.max_surface_error = 1; });
  refuse("leave out time_budget_ms", [](Request &r) { r.time_budget_ms = 1; });
  refuse("errors are bounded of whole surfaces: leave out clip", [](Request &r) {
    r.want_bounds = true;
    r.clip = {{{1, 0, 0}, 15}};
  });
  refuse("labels are drawn without an error: leave out want_bounds", [](Request &r) {
    r.want_bounds = true;
    r.surfaces = {{.labels = {1}}};
  });
}

/// Lossless voxels are compared as if in double.
TEST(ApiSurfaces, CoreGetsTheIsovaluesThatAreDrawn) {
  const auto volume = sphere({.exact = true});
  FrameRequest request{.isovalue = std::numeric_limits<double>::quiet_NaN(),
                       .surfaces = {{.isovalue = 0.7, .opacity = 0.25f}, {.isovalue = 0.5}}};
  request.appearance.diffuse = 0.125f;
  const core::FrameRequest core = core_request(request, volume->implementation().volume);
  ASSERT_EQ(core.surfaces.size(), 2u);
  EXPECT_EQ(core.surfaces[0].isovalue, std::nextafter(0.7f, 1.0f)) << "0.7f is below 0.7";
  EXPECT_EQ(core.surfaces[0].opacity, 0.25f);
  EXPECT_EQ(core.surfaces[1].color, core::SurfaceStyle{}.color) << "as Appearance::surface";
  EXPECT_EQ(core.isovalue, core.surfaces[0].isovalue) << "the request's own is not used";
  EXPECT_EQ(core.light.diffuse, 0.125f);
}

/// Processes of a team must agree on each field.
TEST(ApiSurfaces, TextsTellRequestsApart) {
  std::set<std::string> texts;
  FrameRequest request;
  const auto add = [&](const auto &change) {
    change();
    EXPECT_TRUE(texts.insert(text_of(request)).second);
  };
  add([] {});
  add([&] { request.surfaces = {{.isovalue = 1}}; });
  add([&] { request.surfaces[0].isovalue = 2; });
  add([&] { request.surfaces[0].color[1] = 0; });
  add([&] { request.surfaces[0].opacity = 0.5f; });
  add([&] { request.surfaces.push_back({}); });
}

TEST(ApiSurfaces, TheCameraSeesAllOfThem) {
  Renderer renderer = make_host_renderer(sphere());
  const auto eye = [&](const std::vector<Surface> &surfaces) {
    return renderer.camera(surfaces, kSize).eye;
  };
  EXPECT_NE(renderer.camera(0.4, kSize).eye, renderer.camera(0.8, kSize).eye);
  EXPECT_EQ(eye({{.isovalue = 0.8}, {.isovalue = 0.4}}), renderer.camera(0.4, kSize).eye);
  EXPECT_EQ(eye({{.isovalue = 0.8}}), renderer.camera(0.8, kSize).eye);
}

TEST(ApiSurfaces, ColorsOfTexts) {
  const auto rgb = [](int red, int green, int blue) {
    return std::array{float(red) / 255.0f, float(green) / 255.0f, float(blue) / 255.0f};
  };
  EXPECT_EQ(parse_color("#0180fF"), rgb(1, 128, 255));
  EXPECT_EQ(parse_color("orange"), rgb(255, 165, 0));
  for (const char *text : {"", "#", "#12345", "#1234567", "#12345g", "#+12345", "Orange", "oran"})
    EXPECT_THAT(error_of([&] { parse_color(text); }),
                HasSubstr(std::string("there is no colour '") + text +
                          "': give #RRGGBB, or one of bone, skin, "));
  EXPECT_EQ(surface_color(0), Appearance{}.surface);
  std::set<std::array<float, 3>> colors;
  for (std::size_t i = 0; i < 8; ++i) colors.insert(surface_color(i));
  EXPECT_EQ(colors.size(), 8u);
}

}  // namespace
}  // namespace isowave
