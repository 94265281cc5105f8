// make_renderer(): what draws, and that it has the bits of a device.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <isowave/isowave.hpp>
#include <optional>
#include <string>

#include "tests/api_support.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using core::test::public_volume;
using testing::HasSubstr;

/// Sets ISOWAVE_DEVICE as long as this lives. Empty: unset.
class DeviceVariable {
 public:
  explicit DeviceVariable(const char *value) {
    if (const char *old = std::getenv("ISOWAVE_DEVICE")) old_ = old;
    ::setenv("ISOWAVE_DEVICE", value, 1);
  }
  ~DeviceVariable() {
    if (old_) {
      ::setenv("ISOWAVE_DEVICE", old_->c_str(), 1);
    } else {
      ::unsetenv("ISOWAVE_DEVICE");
    }
  }
  DeviceVariable(const DeviceVariable &) = delete;
  DeviceVariable &operator=(const DeviceVariable &) = delete;

 private:
  std::optional<std::string> old_;
};

bool has_fast_device() {
  for (const DeviceInfo &info : list_devices())
    if (info.type == "gpu" || info.type == "accelerator") return true;
  return false;
}

TEST(ApiMakeRenderer, TheHostDrawsTheBitsOfADevice) {
  const RendererOptions options{.largest = {64, 48}, .with_bounds = true};
  Renderer on_host = make_renderer(public_volume(), options, "host");
  Renderer on_device =
      make_renderer(public_volume(), options, std::to_string(list_devices().at(0).index));
  on_device.wait();
  EXPECT_EQ(on_host.device(), nullptr);
  EXPECT_EQ(on_host.device_info().name, "");
  EXPECT_TRUE(on_host.ready());
  EXPECT_GT(on_host.setup_ms(), 0);
  EXPECT_NE(on_device.device(), nullptr);
  FrameRequest request{.camera = on_host.camera(10),
                       .isovalue = 10,
                       .size = {64, 48},
                       .want_depth = true,
                       .want_bounds = true};
  EXPECT_EQ(request.camera.eye, on_device.camera(10).eye) << "both fill 64 x 48 pixels";
  const Frame expected = on_device.render(request), got = on_host.render(request);
  EXPECT_EQ(got.picture, expected.picture);
  EXPECT_EQ(got.depth, expected.depth);
  EXPECT_EQ(got.bounds, expected.bounds);
  request.size = {160, 120};
  EXPECT_FALSE(on_device.can_draw(request));
  EXPECT_EQ(on_host.render(request).size.width, 160u);
}

TEST(ApiMakeRenderer, TheHostDrawsByDefaultIfThereIsNoGpu) {
  const DeviceVariable none("");
  EXPECT_EQ(draws_on_host(), !has_fast_device());
  const Renderer renderer = make_renderer(public_volume(), {.largest = {64, 48}});
  EXPECT_EQ(renderer.device() == nullptr, draws_on_host());
}

TEST(ApiMakeRenderer, TheEnvironmentChooses) {
  {
    const DeviceVariable host("host");
    EXPECT_TRUE(draws_on_host());
    EXPECT_FALSE(draws_on_host("cpu"));
    EXPECT_EQ(make_renderer(public_volume()).device(), nullptr);
    EXPECT_THAT(error_of([] { open_device(); }), HasSubstr("'host' (from ISOWAVE_DEVICE)"));
  }
  const DeviceVariable wrong("no such device");
  EXPECT_FALSE(draws_on_host());
  EXPECT_THAT(error_of([] { make_renderer(public_volume()); }), HasSubstr("no such device"));
  EXPECT_EQ(make_renderer(public_volume(), {}, "host").device(), nullptr);
}

TEST(ApiMakeRenderer, OptionsOfDevicesNeedOne) {
  const auto make = [](const RendererOptions &options, std::string_view selector,
                       bool profiling = false) {
    return make_renderer(public_volume(), options, selector, {.profiling = profiling});
  };
  const RendererOptions blocks{.largest = {64, 48}, .cache_blocks = 64};
  EXPECT_THAT(error_of([&] { make(blocks, "host"); }), HasSubstr("cache_blocks is for devices"));
  EXPECT_THAT(error_of([&] { make({}, "host", true); }), HasSubstr("profiling is for devices"));
  EXPECT_THAT(error_of([&] { make({.memory_budget = 1000}, "host"); }),
              HasSubstr("raise the limit"));
  EXPECT_THAT(error_of([] { make_renderer(nullptr); }), HasSubstr("needs a volume"));
  const DeviceVariable none("");
  EXPECT_NE(make(blocks, "").device(), nullptr);
  EXPECT_NE(make({.largest = {64, 48}}, "", true).device(), nullptr);
  // Too little for the host, and for the device, too, which says so.
  EXPECT_THAT(error_of([&] { make({.memory_budget = 1000}, ""); }),
              HasSubstr("a memory budget of 1000 bytes is too small"));
}

}  // namespace
}  // namespace isowave
