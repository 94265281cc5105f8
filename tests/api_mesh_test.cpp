// isowave/mesh.hpp: meshes as users of the library get them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <isowave/isowave.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/run_program.hpp"
#include "tests/test_devices.hpp"

namespace isowave {
namespace {

using core::test::read_file;
using core::test::TemporaryFolder;
using testing::HasSubstr;
using testing::ThrowsMessage;

class ApiMeshOnDevice : public testing::TestWithParam<core::ocl::DeviceInfo> {
 protected:
  std::shared_ptr<Device> device_ = open_device(std::to_string(GetParam().index));
  std::shared_ptr<const Volume> fuel_ =
      open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz", {.exact = true, .levels = 2});
};
INSTANTIATE_TEST_SUITE_P(Devices, ApiMeshOnDevice, testing::ValuesIn(core::devices_under_test()),
                         core::device_test_name);

TEST_P(ApiMeshOnDevice, InMemoryAndInAFile) {
  std::vector<std::string> steps;
  double last = 0;
  const ExtractOptions options{.memory_budget = 4'000'000,
                               .cache_blocks = 100,
                               .progress = [&](std::string_view what, double done) {
                                 if (steps.empty() || steps.back() != what)
                                   steps.emplace_back(what);
                                 last = done;
                               }};
  const Mesh mesh = extract(device_, fuel_, 10), batches = extract(device_, fuel_, 10, options);
  EXPECT_GT(mesh.triangles.size(), 1000u);
  EXPECT_EQ(mesh.normals.size(), mesh.vertices.size());
  EXPECT_EQ(mesh.vertices, batches.vertices);
  EXPECT_EQ(mesh.triangles, batches.triangles);
  EXPECT_EQ(steps, std::vector<std::string>{"extracting"});
  EXPECT_EQ(last, 1);
  const TemporaryFolder folder;
  extract_to_file(device_, fuel_, 10, folder / "a.ply", options);
  EXPECT_EQ(steps, (std::vector<std::string>{"extracting", "writing"}));
  save_mesh(mesh, folder / "b.ply");
  EXPECT_EQ(read_file(folder / "a.ply"), read_file(folder / "b.ply"));
  EXPECT_EQ(device_->memory_in_use(), 0u);
}

TEST_P(ApiMeshOnDevice, LevelsAndNormals) {
  const Mesh fine = extract(device_, fuel_, 10, {.with_normals = false});
  EXPECT_TRUE(fine.normals.empty());
  const Mesh coarse = extract(device_, fuel_, 10, {.level = 1});
  EXPECT_LT(coarse.triangles.size(), fine.triangles.size());
  EXPECT_GT(coarse.triangles.size(), fine.triangles.size() / 8);
}

TEST_P(ApiMeshOnDevice, Refusals) {
  EXPECT_THAT([&] { extract(device_, fuel_, std::nanf("")); },
              ThrowsMessage<Error>(HasSubstr("NaN")));
  EXPECT_THAT([&] { extract(device_, fuel_, 10, {.level = 2}); },
              ThrowsMessage<Error>(HasSubstr("level 2 of a volume that has 2")));
  EXPECT_THAT([&] { extract({}, fuel_, 10); }, ThrowsMessage<Error>(HasSubstr("needs a device")));
  EXPECT_THAT(
      [&] {
        extract(device_, fuel_, 10,
                {.progress = [](std::string_view, double) { throw std::runtime_error("enough"); }});
      },
      ThrowsMessage<Error>(HasSubstr("enough")));
  EXPECT_EQ(device_->memory_in_use(), 0u);
  const TemporaryFolder folder;
  const auto save = [&](const Mesh &mesh) { save_mesh(mesh, folder / "a.ply"); };
  EXPECT_THAT(
      [&] {
        save({.vertices = {{0, 0, 0}}, .triangles = {{0, 1, 0}}});
      },
      ThrowsMessage<Error>(HasSubstr("names vertex 1 of 1")));
  EXPECT_THAT(
      [&] {
        save({.vertices = {{0, 0, 0}}, .normals = {{1, 0, 0}, {0, 1, 0}}});
      },
      ThrowsMessage<Error>(HasSubstr("1 vertices and 2 normals")));
  EXPECT_EQ(folder.num_files(), 0u);
}

}  // namespace
}  // namespace isowave
