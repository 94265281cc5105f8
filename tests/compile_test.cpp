// Kernels are compiled when a renderer is made, those that it launches and no others;
// core/ocl/kernel_cache, and what the program says of it.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "core/ocl/kernel_cache.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "core/stages/march_packets.hpp"
#include "tests/frame_scene.hpp"
#include "tests/run_program.hpp"
#include "tests/setting.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr ImageSize kSize{40, 30};

CompressedVolume levelled_volume() {
  const glm::uvec3 dims(33, 30, 31);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::gyroid_field(12)));
  return compress(reader, CompressOptions{.rate = 8, .levels = 0});
}

/// Stems, and how often each was built.
std::vector<std::string> stems_of(const ocl::Device &device) {
  std::map<std::string, int> counts;
  for (const std::string &program : device.built_programs())
    ++counts[program.substr(0, program.find(' '))];
  std::vector<std::string> stems;
  for (const auto &[stem, count] : counts)
    stems.push_back(count == 1 ? stem : fmt::format("{} x{}", stem, count));
  return stems;
}

class CompileOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
  const CompressedVolume volume_ = levelled_volume();
  const std::vector<Camera> cameras_ = orbit_cameras(volume_.info, 2);

  /// Draws in every way that the options allow. Nothing may be left to compile.
  void expect_all_compiled(const RendererOptions &options) {
    DeviceRenderer renderer(device_, volume_, options);
    EXPECT_GT(device_.compile_ms(), 0);
    const std::vector<std::string> programs = device_.built_programs();
    std::vector<std::string> late;
    device_.on_new_kernel([&](std::string_view kernel) { late.emplace_back(kernel); });
    for (const double pixels : {options.with_levels ? 2.0 : 0.0, 0.0}) {
      for (const float isovalue :
           {0.1f, 0.4f}) {  // the second has the cached blocks classified anew
        renderer.render({.camera = cameras_[0],
                         .isovalue = isovalue,
                         .light = {.towards_light = glm::dvec3(0, 0, 1)},
                         .voxel_pixels = pixels,
                         .ambient_rays = options.with_given_rays || options.with_bounce ? 2u : 0u,
                         .bounce_rays = options.with_bounce ? 2u : 0u});
        EXPECT_EQ(renderer.shade().pixels.size(), 3 * options.size.num_pixels());
      }
    }
    if (options.max_surfaces != 0) {
      FrameRequest request{.camera = cameras_[0], .surfaces = {{0.4f}}, .bounce_rays = 2};
      request.surfaces.push_back({.isovalue = 0.1f, .opacity = 0.5f, .clipped = false});
      request.light.towards_light = glm::dvec3(0, 0, 1);
      renderer.render(request);
      EXPECT_FALSE(renderer.shade().pixels.empty());
    }
    if (options.with_kept_picture) {
      renderer.render({cameras_[0], 0.1f, halved(kSize, 1)});
      renderer.keep_picture();
      renderer.enlarge_kept({cameras_[0], 0.1f});
      renderer.fill_from_kept();
    }
    if (options.with_given_rays || options.with_bounce) {
      renderer.cast_rays(std::vector<WorldRay>(1, {glm::dvec3(-1), glm::dvec3(1)}), 0.1f,
                         Normals::kSmooth);
    }
    device_.on_new_kernel({});
    EXPECT_THAT(late, IsEmpty());
    EXPECT_EQ(device_.built_programs(), programs);
  }
};

TEST_P(CompileOnDevice, NothingIsLeftForFrames) {
  for (const PipelinePtr &pipeline : {rays_pipeline(), blocks_pipeline()}) {
    for (const StreamPlace stream : {StreamPlace::kDevice, StreamPlace::kHost}) {
      expect_all_compiled({.size = kSize, .pipeline = pipeline, .stream = stream});
      expect_all_compiled(
          {.size = {20, 15, 2}, .pipeline = pipeline, .cache_slots = 8, .stream = stream});
    }
  }
  expect_all_compiled({.size = kSize, .with_levels = true});
  expect_all_compiled({.size = kSize, .stream = StreamPlace::kHost, .with_levels = true});
  expect_all_compiled({.size = kSize, .with_kept_picture = true});
  expect_all_compiled({.size = kSize, .with_levels = true, .with_bounce = true});
  expect_all_compiled({.size = kSize, .max_surfaces = 2, .with_bounce = true});
  expect_all_compiled({.size = kSize, .pipeline = blocks_pipeline(), .with_given_rays = true});
}

TEST_P(CompileOnDevice, EverySolverAndGroupingIsCompiled) {
  for (const std::string_view solver : kSolverNames)
    expect_all_compiled({.size = kSize, .solver = solver_from_string(solver)});
  expect_all_compiled(
      {.size = kSize,
       .pipeline = blocks_pipeline({.grouping = Grouping::kRadix, .closest = ClosestHit::kScan}),
       .group_size = 32});
  expect_all_compiled({.size = kSize, .pipeline = blocks_pipeline({.scanned_pairs = true})});
}

TEST_P(CompileOnDevice, WhatIsNotLaunchedIsNotBuilt) {
  const auto stems = [&](RendererOptions options, bool shading = false,
                         RayPackets packets = RayPackets::kOff) {
    ocl::Device device(GetParam());
    options.packets = packets;
    options.with_shading = shading;
    DeviceRenderer renderer(device, volume_, options);
    renderer.render({.camera = cameras_[0],
                     .isovalue = 0.1f,
                     .voxel_pixels = options.with_levels ? 2.0 : 0.0,
                     .normals = shading ? Normals::kSmooth : Normals::kCell});
    return stems_of(device);
  };
  const auto of_rays = [&](std::vector<std::string> others) {
    for (const char *stem :
         {"block_cache", "macrocells", "march", "request_ahead", "start_rays", "zfp_decode"})
      others.emplace_back(stem);
    if (GetParam().type == ocl::DeviceType::kGpu) others.emplace_back("start_and_march");
    std::ranges::sort(others);
    return others;
  };
  EXPECT_THAT(stems({.size = kSize}), ElementsAreArray(of_rays({})));
  EXPECT_THAT(stems({.size = kSize}, true), ElementsAreArray(of_rays({"shade", "smooth_normals"})));
  EXPECT_THAT(stems({.size = kSize, .with_kept_picture = true}),
              ElementsAreArray(of_rays({"kept_picture"})));
  // One for frames that the finest level draws alone, one for others.
  EXPECT_THAT(stems({.size = kSize, .with_levels = true}),
              ElementsAre("block_cache", "macrocells", "march x2", "request_ahead x2",
                          "start_rays x2", "zfp_decode"));
  if (MarchPackets::suits(GetParam())) {
    EXPECT_THAT(
        stems({.size = kSize}, false, RayPackets::kAuto),
        ElementsAre("block_cache", "macrocells", "march_packets", "request_ahead", "zfp_decode"));
    const auto with_levels = stems({.size = kSize, .with_levels = true}, false, RayPackets::kAuto);
    if (MarchPackets::may_decode(GetParam())) {
      EXPECT_THAT(with_levels, ElementsAre("block_cache", "macrocells", "march", "march_packets x2",
                                           "request_ahead x2", "zfp_decode"));
    } else {
      EXPECT_THAT(with_levels, ElementsAre("block_cache", "macrocells", "march", "march_packets",
                                           "request_ahead x2", "start_rays", "zfp_decode"));
    }
  }
  // Where one work-group scans alone, a GPU gives it more work-items.
  const char *scan = GetParam().type == ocl::DeviceType::kGpu ? "scan x2" : "scan";
  EXPECT_THAT(stems({.size = kSize, .pipeline = blocks_pipeline()}),
              ElementsAre("block_cache", "composite", "group", "initial_rays", "intersect",
                          "macrocells", scan, "speculation", "traverse", "zfp_decode"));
  EXPECT_THAT(
      stems({.size = kSize, .pipeline = blocks_pipeline({.grouping = Grouping::kRadix})}),
      ElementsAre("block_cache", "composite", "group", "initial_rays", "intersect", "macrocells",
                  "radix_sort", scan, "speculation", "traverse", "zfp_decode"));
}

/// What compiling leaves behind must not show.
TEST_P(CompileOnDevice, FirstFrameIsThatOfANewRenderer) {
  for (const PipelinePtr &pipeline : {rays_pipeline(), blocks_pipeline()}) {
    ocl::Device device(GetParam(), true);
    DeviceRenderer renderer(device, volume_, {.size = kSize, .pipeline = pipeline});
    EXPECT_THAT(device.timer().collect(), IsEmpty());
    EXPECT_EQ(device.ledger().current(), renderer.memory_plan().total());
    const FrameStats first = renderer.render({cameras_[0], 0.1f});
    EXPECT_EQ(first.passes.front().counts.pass,
              1u + (blocks_options(*pipeline) != nullptr ? 1u : 0u));
    renderer.clear_cache();
    const FrameStats again = renderer.render({cameras_[0], 0.1f});
    ASSERT_EQ(first.passes.size(), again.passes.size());
    for (std::size_t i = 0; i < first.passes.size(); ++i) {
      EXPECT_EQ(first.passes[i].counts.decoded_count, again.passes[i].counts.decoded_count) << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, CompileOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST(KernelCache, FolderIsTheDrivers) {
  const test::Setting home("HOME", "/home/someone"), cache("XDG_CACHE_HOME", ""),
      pocl("POCL_CACHE_DIR", ""), mesa("MESA_SHADER_CACHE_DIR", "");
  ::unsetenv("CUDA_CACHE_PATH");
  const auto folder = [](const char *platform) {
    ocl::DeviceInfo info;
    info.platform = platform;
    return ocl::KernelCache(info).folder();
  };
  EXPECT_EQ(folder("Portable Computing Language"), "/home/someone/.cache/pocl/kcache");
  const passwd *user = ::getpwuid(::getuid());
  ASSERT_NE(user, nullptr);
  EXPECT_EQ(folder("rusticl"), fs::path(user->pw_dir) / ".cache/mesa_shader_cache");
  EXPECT_EQ(folder("NVIDIA CUDA"), "/home/someone/.nv/ComputeCache");
  EXPECT_EQ(folder("Some other platform"), std::nullopt);
  const test::Setting own("POCL_CACHE_DIR", "/elsewhere"), none("CUDA_CACHE_DISABLE", "1"),
      xdg("XDG_CACHE_HOME", "/x");
  EXPECT_EQ(folder("Portable Computing Language"), "/elsewhere");
  EXPECT_EQ(folder("rusticl"), "/x/mesa_shader_cache");
  EXPECT_EQ(folder("NVIDIA CUDA"), std::nullopt);
  {
    const test::Setting on("CUDA_CACHE_DISABLE", "0"), empty("CUDA_CACHE_PATH", "");
    EXPECT_EQ(folder("NVIDIA CUDA"), std::nullopt) << "an empty name has the driver keep none";
  }
  ::unsetenv("CUDA_CACHE_PATH");
}

TEST(KernelCache, NewFilesAreNewKernelsButForBookkeeping) {
  const test::TemporaryFolder folder;
  const test::Setting own("POCL_CACHE_DIR", folder.path().string());
  ocl::DeviceInfo info;
  info.platform = "Portable Computing Language";
  test::write_file(folder / "old.so", "");
  fs::last_write_time(folder / "old.so", fs::file_time_type::clock::now() - std::chrono::hours(1));
  const ocl::KernelCache cache(info);
  EXPECT_FALSE(cache.has_new_kernels());
  fs::create_directories(folder / "a" / "b");
  for (const char *name : {"last_accessed", "tempfile_x", "index"})
    test::write_file(folder / "a" / name, "");
  EXPECT_FALSE(cache.has_new_kernels());
  test::write_file(folder / "a" / "b" / "new.so", "");
  EXPECT_TRUE(cache.has_new_kernels());
  fs::remove_all(folder.path() / "a");
  EXPECT_FALSE(cache.has_new_kernels());
}

std::size_t num_libraries(const fs::path &folder) {
  std::size_t count = 0;
  for (const auto &file : fs::recursive_directory_iterator(folder))
    count += file.path().extension() == ".so";
  return count;
}

/// PoCL compiles a kernel when it is launched first, and leaves a library for each. A frame that
/// meets no block launches few; so whatever the second run adds had been left to its frames.
TEST(CompileCommand, TheFirstOpeningSaysSoAndLeavesNothingToFrames) {
  const test::TemporaryFolder folder, cache;
  const test::Setting own("POCL_CACHE_DIR", cache.path().string());
  const std::string raw = test::quoted(folder / "shell_20x20x20_uint8.raw");
  ASSERT_EQ(test::run_isowave("generate shell --dims 20 --type uint8 -o " + raw).status, 0);
  const auto render = [&](const std::string &options) {
    const test::ProgramResult result = test::run_isowave(
        "render " + raw + " --device Portable --size 32x24 --no-stage-times --stats " +
        test::quoted(folder / "stats.json") + " -o " + test::quoted(folder / "a.png") + options);
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.err, testing::AnyOf("", HasSubstr("outside the volume's values")));
    return result.out;
  };
  for (const std::string pipeline : {" --pipeline rays", " --pipeline blocks"}) {
    EXPECT_THAT(render(pipeline + " -i 1e6"), testing::AllOf(HasSubstr("compiling kernels for"),
                                                             HasSubstr(cache.path().string())));
    const nlohmann::json stats = nlohmann::json::parse(test::read_file(folder / "stats.json"));
    EXPECT_GT(stats.at("compile_ms").get<double>(), 0);
    EXPECT_GE(stats.at("setup_ms").get<double>(), 0);
    const std::size_t libraries = num_libraries(cache.path());
    EXPECT_GT(libraries, 0u);
    EXPECT_THAT(render(pipeline + " -i 100"), Not(HasSubstr("compiling")));
    EXPECT_EQ(num_libraries(cache.path()), libraries) << pipeline;
  }
}

}  // namespace
}  // namespace isowave::core
