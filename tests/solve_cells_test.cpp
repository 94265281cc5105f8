// core/solve_cells: every solver of the family gives the same bits on the device as on the host,
// also where it fails; and whole frames drawn with each.

#include "core/stages/solve_cells.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/random.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

/// A cubic of one kind of trouble. Its values are at least 1e-6 or 0, so that no product becomes
/// denormal, which llvmpipe flushes.
Cubic random_cubic(Random &random) {
  const auto coefficient = [&] { return static_cast<float>(random.in(-1, 1)); };
  const std::uint32_t kind = random.below(6);
  if (kind == 0) return {coefficient(), coefficient(), coefficient(), coefficient()};
  if (kind == 1) {  // nearly linear
    const float b0 = coefficient(), b3 = coefficient(), bend = 1e-6f * coefficient();
    return {b0, b0 + (b3 - b0) / 3 + bend, b3 - (b3 - b0) / 3, b3};
  }
  if (kind == 2) {  // three roots, close together or one
    const double at = random.in(0, 1),
                 apart = random.below(3) == 0 ? 0 : std::pow(10, random.in(-4, -1));
    const double r[3] = {at - apart, at, at + apart * random.in(0, 2)};
    const auto blossom = [&](double s, double t, double u) {  // mean over the orders of (s,t,u)
      const auto term = [&](int i, int j, int k) { return (s - r[i]) * (t - r[j]) * (u - r[k]); };
      return static_cast<float>((term(0, 1, 2) + term(0, 2, 1) + term(1, 0, 2) + term(1, 2, 0) +
                                 term(2, 0, 1) + term(2, 1, 0)) /
                                6);
    };
    return {blossom(0, 0, 0), blossom(0, 0, 1), blossom(0, 1, 1), blossom(1, 1, 1)};
  }
  if (kind == 3) {  // plateaus
    const float values[3] = {-1, 0, 1};
    return {values[random.below(3)], values[random.below(3)], values[random.below(3)],
            values[random.below(3)]};
  }
  const float scale = kind == 4 ? 1e12f : 1e-6f;
  return {scale * coefficient(), scale * coefficient(), scale * coefficient(),
          scale * coefficient()};
}

class SolveCellsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void expect_host_bits(std::size_t count) {
    Random random(4711);
    std::vector<Cubic> cubics(count);
    for (Cubic &cubic : cubics) cubic = random_cubic(random);
    const ocl::Buffer<Cubic> on_device(device_, "cubics", std::span<const Cubic>(cubics));
    ocl::Buffer<float> roots(device_, "roots", count);
    for (const std::string_view name : kSolverNames) {
      const Solver solver = solver_from_string(name);
      SolveCells solve(device_, solver);
      solve(on_device, roots);
      const std::vector<float> got = roots.read();
      std::size_t differing = 0, found = 0;
      for (std::size_t i = 0; i < count; ++i) {
        float expected = -1;
        if (!first_change(solver, cubics[i], &expected)) expected = -1;
        found += expected >= 0;
        if (std::bit_cast<std::uint32_t>(got[i]) == std::bit_cast<std::uint32_t>(expected) ||
            differing++ > 0) {
          continue;
        }
        const Cubic &c = cubics[i];
        ADD_FAILURE() << fmt::format("{} {}: {:a} {:a} {:a} {:a} gives {:a}, expected {:a}",
                                     to_string(solver), solver.max_steps, c.b0, c.b1, c.b2, c.b3,
                                     got[i], expected);
      }
      EXPECT_EQ(differing, 0u) << to_string(solver);
      EXPECT_GT(found, count / 8);
      EXPECT_LT(found, count);
    }
  }

  ocl::Device device_{GetParam()};
};

TEST_P(SolveCellsOnDevice, SmallHostBits) {
  expect_host_bits(300);
}

TEST_P(SolveCellsOnDevice, HostBits) {
  expect_host_bits(200000);
}

TEST_P(SolveCellsOnDevice, FramesOfEverySolverEqualTheTwins) {
  const test::TestVolume volume({29, 23, 26}, test::noise_field(5));
  const ImageSize size{64, 48};
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const std::string_view name : kSolverNames) {
    if (is_llvmpipe(device_.info()) && name != "marmitt") continue;
    SCOPED_TRACE(name);
    RendererOptions options;
    options.size = size;
    options.solver = solver_from_string(name);
    DeviceRenderer renderer(device_, volume.compressed, options);
    renderer.render({camera, 0.1f});
    test::expect_same_hits(renderer.hits(),
                           test::twin_hits(make_frame_params(volume.info(), camera, size, 0.1f),
                                           volume.voxels, Normals::kSmooth, options.solver),
                           size.width);
  }
}

TEST(Solvers, AreFoundByName) {
  for (const std::string_view name : kSolverNames)
    EXPECT_EQ(to_string(solver_from_string(name)), name);
  EXPECT_THROW(solver_from_string("newton"), Error);
}

INSTANTIATE_TEST_SUITE_P(Devices, SolveCellsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
