// core/paper/mesh_renderer: its hits have the bits of the twin, with any budget; they are those
// of the ray pipelines as far as triangles can be the trilinear surface.

#include "core/paper/mesh_renderer.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/raster_twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::num_hits;
using test::TestVolume;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSmall{13, 9};
constexpr ImageSize kMedium{96, 64};

std::vector<HitRecord> expected_hits(const TestVolume &volume, const Camera &camera, ImageSize size,
                                     float isovalue) {
  return rasterise_scalar(make_frame_params(volume.info(), camera, size, isovalue),
                          triangles_scalar(volume.info().dims, volume.voxels, isovalue));
}

/// Draws a frame.
MeshFrameStats draw(MeshRenderer &renderer, const Camera &camera, float isovalue) {
  const FrameStats stats =
      renderer.render({.camera = camera, .isovalue = isovalue, .normals = Normals::kCell});
  EXPECT_TRUE(stats.complete);
  EXPECT_EQ(stats.passes.at(0).counts.decoded_count, renderer.last_frame().decoded_blocks);
  return renderer.last_frame();
}

/// What the message of a budget that is too small says would do.
std::uint64_t budget_named(const std::string &text) {
  return std::stoull(text.substr(text.rfind(": ") + 2));
}

class MeshRendererOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, MeshRendererOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(MeshRendererOnDevice, SmallVolumeEqualsTheTwin) {
  const TestVolume volume({9, 6, 7}, test::noise_field(1), 8);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  MeshRenderer renderer(device_, volume.compressed, {.size = kSmall});
  EXPECT_THAT([&] { renderer.hits(); }, ThrowsMessage<Error>(HasSubstr("no frame")));
  const MeshFrameStats stats = draw(renderer, camera, 0.2f);
  const std::vector<HitRecord> expected = expected_hits(volume, camera, kSmall, 0.2f);
  expect_same_hits(renderer.hits(), expected, kSmall.width);
  EXPECT_GT(num_hits(expected), 20u);
  EXPECT_TRUE(stats.is_new_surface && stats.is_kept);
  EXPECT_EQ(stats.decoded_blocks, stats.needed_blocks);
  EXPECT_EQ(stats.device_bytes, device_.ledger().current());
  EXPECT_EQ(renderer.num_hits({}), num_hits(expected));
  EXPECT_EQ(renderer.memory_bytes(), stats.device_bytes);
  EXPECT_EQ(renderer.size().width, kSmall.width);
  EXPECT_EQ(renderer.shade().pixels.size(), 3 * kSmall.num_pixels());
  const float isovalue = 0.2f;
  const Camera chosen = renderer.camera({&isovalue, 1});
  EXPECT_EQ(chosen.eye, HostRenderer(volume.compressed).camera({&isovalue, 1}, kSmall).eye);
}

TEST_P(MeshRendererOnDevice, FurtherFramesDrawTheMeshThatIsThere) {
  const TestVolume volume({18, 13, 15}, test::gyroid_field(12));
  const std::vector<Camera> cameras = orbit_cameras(volume.info(), 2);
  MeshRenderer renderer(device_, volume.compressed, {.size = kMedium});
  std::uint64_t most_slots = 0;
  for (const float isovalue : {0.2f, -1.0f, 0.2f, 0.9f, 100.0f, 0.2f}) {
    SCOPED_TRACE(isovalue);
    const MeshFrameStats first = draw(renderer, cameras[0], isovalue);
    EXPECT_TRUE(first.is_new_surface);
    EXPECT_GE(first.cache_slots, most_slots) << "the cache grows";
    most_slots = first.cache_slots;
    EXPECT_EQ(first.num_triangles == 0, isovalue == 100.0f);
    const MeshFrameStats second = draw(renderer, cameras[1], isovalue);
    EXPECT_FALSE(second.is_new_surface);
    EXPECT_EQ(second.decoded_blocks, 0u);
    EXPECT_EQ(second.num_triangles, first.num_triangles);
    EXPECT_EQ(second.device_bytes, device_.ledger().current());
    expect_same_hits(renderer.hits(), expected_hits(volume, cameras[1], kMedium, isovalue),
                     kMedium.width);
  }
  renderer.render({.camera = cameras[0], .isovalue = 0.2f, .size = ImageSize{20, 11}});
  EXPECT_EQ(renderer.last_frame().decoded_blocks, 0u);
  expect_same_hits(renderer.hits(), expected_hits(volume, cameras[0], {20, 11}, 0.2f), 20);
  renderer.clear_cache();
  const MeshFrameStats cold = draw(renderer, cameras[0], 0.2f);
  EXPECT_EQ(cold.decoded_blocks, cold.needed_blocks);
}

/// Blocks come and go until the cache's table is full of those that went.
TEST_P(MeshRendererOnDevice, ManyIsovaluesInOneCache) {
  const TestVolume volume({160, 12, 12}, [](const glm::dvec3 &p) { return p.x; });
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  MeshRenderer renderer(device_, volume.compressed, {.size = kSmall});
  for (std::uint32_t i = 0; i < 200; ++i) {
    const float isovalue = 1.5f + static_cast<float>(37 * i % 157);
    SCOPED_TRACE(isovalue);
    EXPECT_EQ(draw(renderer, camera, isovalue).num_triangles, 2u * 11 * 11);
  }
}

TEST_P(MeshRendererOnDevice, AnyBudgetDrawsTheSamePicture) {
  const TestVolume volume({40, 41, 39}, test::gyroid_field(7), 4);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  std::vector<HitRecord> expected, other;
  std::uint64_t ample = 0, least = 0;
  {
    MeshRenderer renderer(device_, volume.compressed, {.size = kMedium});
    ample = draw(renderer, camera, 0.1f).device_bytes;
    expected = renderer.hits();
    draw(renderer, camera, 0.5f);
    other = renderer.hits();
  }
  EXPECT_EQ(device_.ledger().current(), 0u);
  EXPECT_GT(num_hits(expected), 1000u);
  try {
    MeshRenderer renderer(device_, volume.compressed, {.size = kMedium, .memory_budget = 400'000});
    draw(renderer, camera, 0.1f);
  } catch (const Error &error) {
    EXPECT_THAT(error.what(), HasSubstr("a memory budget of 400000 bytes is too small"));
    least = budget_named(error.what());
  }
  ASSERT_GT(least, 400'000u);
  std::uint32_t last_parts = 1000000;
  for (const std::uint64_t bytes : {least, least + 200'000, least + (ample - least) / 2, ample}) {
    SCOPED_TRACE(bytes);
    ocl::Device device(GetParam());
    MeshRenderer renderer(device, volume.compressed, {.size = kMedium, .memory_budget = bytes});
    const MeshFrameStats stats = draw(renderer, camera, 0.1f);
    expect_same_hits(renderer.hits(), expected, kMedium.width);
    EXPECT_EQ(stats.is_kept, bytes == ample);
    EXPECT_LE(stats.num_parts, last_parts);
    last_parts = stats.num_parts;
    draw(renderer, camera, 0.1f);
    expect_same_hits(renderer.hits(), expected, kMedium.width);
    draw(renderer, camera, 0.5f);
    expect_same_hits(renderer.hits(), other, kMedium.width);
    EXPECT_LE(device.ledger().peak(), bytes);
  }
  EXPECT_THROW(
      MeshRenderer(device_, volume.compressed, {.size = kMedium, .memory_budget = least - 1})
          .render({camera, 0.1f}),
      Error);
}

TEST_P(MeshRendererOnDevice, SmallRefusals) {
  const TestVolume volume({5, 5, 5}, test::noise_field(6), 8);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  MeshRenderer renderer(device_, volume.compressed, {.size = kSmall});
  EXPECT_THAT([&] { draw(renderer, camera, std::nanf("")); },
              ThrowsMessage<Error>(HasSubstr("NaN")));
  const auto refuses = [&](const FrameRequest &request, const char *text) {
    EXPECT_THAT([&] { renderer.render(request); }, ThrowsMessage<Error>(HasSubstr(text)));
  };
  refuses({.camera = camera, .size = ImageSize{13, 10}}, "more than the 117 rays");
  refuses({.camera = {camera.eye, camera.eye}}, "");
  refuses({.camera = camera, .voxel_pixels = 1}, "leave out voxel_pixels");
  refuses({.camera = camera, .voxel_error = 1}, "leave out voxel_error");
  refuses({.camera = camera, .bound = FieldBound::kLower}, "leave out bound");
  refuses({.camera = camera, .ambient_rays = 1}, "ambient rays");
  refuses({.camera = camera, .time_budget_ms = 1}, "leave out time_budget_ms");
  Camera parallel = camera;
  parallel.parallel_height = 4;
  refuses({.camera = parallel}, "leave out parallel projection");
  EXPECT_THAT([&] { renderer.cast_rays({}, 0, Normals::kCell); },
              ThrowsMessage<Error>(HasSubstr("no rays of any origin")));
  EXPECT_THAT(
      [&] {
        MeshRenderer(device_, volume.compressed, {.size = {0, 5}});
      },
      ThrowsMessage<Error>(HasSubstr("image of 0 x 5")));
  EXPECT_THAT(
      [&] {
        MeshRenderer(device_, volume.compressed, {kSmall, 1000});
      },
      ThrowsMessage<Error>(HasSubstr("a memory budget of 1000 bytes is too small")));
  const MeshFrameStats none = draw(renderer, camera, 50);
  EXPECT_EQ(none.num_triangles, 0u);
  EXPECT_EQ(num_hits(renderer.hits()), 0u);
  EXPECT_EQ(renderer.num_hits({}), 0u);
}

/// A sphere: where rays do not graze it, both hit it, and as far apart as the triangles allow.
TEST_P(MeshRendererOnDevice, DepthIsThatOfTheRaysAsFarAsTrianglesAllow) {
  const double radius = 16;
  const glm::dvec3 middle(20);
  const TestVolume volume(
      glm::uvec3(41), [&](const glm::dvec3 &p) { return radius - glm::length(p - middle); }, 16);
  // Seen along the normal: a plane triangle in a cell lies below the sphere through its corners by
  // up to (sqrt(3) / 2)^2 / 2 r; the trilinear field lies off the distance by the sum of its second
  // derivatives, 2 / r, over 8, and compression; vertices by half of that, and half a step.
  const double off = 0.375 / radius + 1.5 * 0.25 / radius + 0.0035 + 0.002;
  const double grazing = 0.5;  // cosine of ray and normal
  for (const Camera &camera : orbit_cameras(volume.info(), 3)) {
    DeviceRenderer rays(device_, volume.compressed, {.size = kMedium});
    rays.render({.camera = camera, .isovalue = 0});
    MeshRenderer mesh(device_, volume.compressed, {.size = kMedium});
    draw(mesh, camera, 0);
    const std::vector<HitRecord> of_rays = rays.hits(), of_mesh = mesh.hits();
    std::uint64_t num_compared = 0;
    for (std::size_t i = 0; i < of_rays.size(); ++i) {
      const HitRecord &ray = of_rays[i], &triangle = of_mesh[i];
      if (!std::isfinite(ray.t)) continue;
      const glm::dvec3 gradient(ray.grad_x, ray.grad_y, ray.grad_z);
      const FrameParams frame = make_frame_params(volume.info(), camera, kMedium, 0);
      const Ray r = make_ray(&frame, static_cast<uint>(i));
      const glm::dvec3 along(r.x.d, r.y.d, r.z.d);
      const double cosine =
          std::abs(glm::dot(gradient, along)) / (glm::length(gradient) * glm::length(along));
      if (cosine < grazing) continue;
      ASSERT_TRUE(std::isfinite(triangle.t)) << "pixel " << i;
      ASSERT_NEAR(triangle.t, ray.t, off / (grazing - 0.1)) << "pixel " << i;
      ++num_compared;
    }
    EXPECT_GT(num_compared, 500u);
  }
}

/// Anything else: pixels differ at silhouettes, and where a cell has several sheets.
TEST_P(MeshRendererOnDevice, SheetsAreThoseOfTheRays) {
  const TestVolume volume({48, 40, 44}, test::gyroid_field(16), 16);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer rays(device_, volume.compressed, {.size = kMedium});
  rays.render({.camera = camera, .isovalue = 0.3f});
  MeshRenderer mesh(device_, volume.compressed, {.size = kMedium});
  draw(mesh, camera, 0.3f);
  const std::vector<HitRecord> a = rays.hits(), b = mesh.hits();
  std::uint64_t num_near = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    num_near += a[i].t == b[i].t || std::abs(a[i].t - b[i].t) < std::sqrt(3.0) ? 1 : 0;
  EXPECT_GT(num_near, a.size() / 100 * 97) << "within a cell's diagonal";
  EXPECT_GT(num_hits(b), a.size() / 10);
}

}  // namespace
}  // namespace isowave::core
