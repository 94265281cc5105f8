// core/ocl/kernel: arguments of every kind, launch shapes, errors.

#include "core/ocl/kernel.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "core/base/error.hpp"
#include "kernels/launch_probe.hpp"
#include "kernels/macrocells.hpp"
#include "kernels/prefix_sum.hpp"
#include "kernels/rasterise.hpp"
#include "kernels/scan.hpp"
#include "kernels/shade.hpp"
#include "kernels_cl/portable/shared_types.h"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using ocl::In;
using ocl::Local;
using ocl::Out;
using ocl::Params;
using ocl::Range;
using testing::AllOf;
using testing::HasSubstr;

// What kernels_cl says is what C++ knows: a parameter of each kind.
template <class Signature, class... Types>
constexpr bool kTakes = std::is_same_v<typename Signature::Params, Params<Types...>>;
static_assert(kTakes<kernels::launch_empty>);
static_assert(kTakes<kernels::scale_values, In<uint>, uint, uint, Out<uint>>);
static_assert(kTakes<kernels::reverse_groups, Out<uint>, Local<uint>>);
static_assert(kTakes<kernels::store_pair_hit, PairHit, Out<PairHit>>);
static_assert(kTakes<kernels::prefix_tile_offsets, uint, Out<uint>, Out<uint>>);  // attributes
static_assert(kTakes<kernels::macrocell_coarse_ranges, FrameParams, uint, In<ushort>,
                     Out<ushort>>);  // const FrameParams
static_assert(
    kTakes<kernels::shade, FrameParams, ShadeParams, In<uint>, uint, In<HitRecord>, In<uchar>, uint,
           uint, In<float>, uint, In<float>, uint, Out<std::byte>>);                       // void
static_assert(kTakes<kernels::compact_count, In<uint>, In<PassCounts>, uint, Out<uint>>);  // words
static_assert(kTakes<kernels::raster_part, FrameParams, RasterView, uint, uint, In<BlockVertex>,
                     Out<uint>, Out<uint>, uint, Out<uint>>);  // volatile global uint *

using ScaleKernel = ocl::Kernel<kernels::scale_values>;

// The C++ compiler refuses other arguments.
static_assert(std::is_invocable_v<ScaleKernel &, Range, ocl::Buffer<uint> &, uint, uint,
                                  ocl::Buffer<uint> &>);
static_assert(!std::is_invocable_v<ScaleKernel &, Range, ocl::Buffer<float> &, uint, uint,
                                   ocl::Buffer<uint> &>);
static_assert(!std::is_invocable_v<ScaleKernel &, Range, ocl::Buffer<uint> &, uint, uint,
                                   const ocl::Buffer<uint> &>);
static_assert(
    !std::is_invocable_v<ScaleKernel &, Range, ocl::Buffer<uint> &, uint, ocl::Buffer<uint> &>);

class OclKernelOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};

TEST_P(OclKernelOnDevice, ScalesAtAwkwardCounts) {
  ScaleKernel scale(device_);
  for (const uint count : {0u, 1u, 63u, 64u, 65u, 1000u}) {
    std::vector<uint> values(count);
    std::iota(values.begin(), values.end(), 1u);
    const ocl::Buffer<uint> input(device_, "input", values);
    ocl::Buffer<uint> output(device_, "output", count);
    scale(Range::strided(count, 64, device_), input, count, 3, output);
    for (uint &value : values) value *= 3;
    EXPECT_EQ(output.read(), values) << count;
  }
}

TEST_P(OclKernelOnDevice, SmallGroupsOfDevicesThatGiveNoLargerOnes) {
  ocl::DeviceInfo info = GetParam();
  info.capabilities.max_work_group_size = 6;
  ocl::Device device(info);
  ScaleKernel scale(device);
  std::vector<uint> values(1000);
  std::iota(values.begin(), values.end(), 1u);
  const ocl::Buffer<uint> input(device, "input", values);
  ocl::Buffer<uint> output(device, "output", values.size());
  scale(Range::covering(values.size(), 64), input, 1000, 3, output);
  for (uint &value : values) value *= 3;
  EXPECT_EQ(output.read(), values);
  // Built for groups of 4 instead of 64, of which one stands for all.
  ocl::Kernel<kernels::group_sizes> sizes(device, {{"ISO_GROUP_SIZE", "64u"}});
  ocl::Buffer<uint> seen(device, "seen", 3);
  sizes(Range::groups(1, 64), seen);
  EXPECT_THAT(seen.read(), testing::ElementsAre(4u, 16u, 1u));
}

/// Also where the device promises larger groups than it gives any kernel.
TEST_P(OclKernelOnDevice, SmallKernelsAreBuiltOnce) {
  ocl::Kernel<kernels::group_sizes> sizes(device_, {{"ISO_GROUP_SIZE", "64u"}});
  ocl::Buffer<uint> seen(device_, "seen", 3);
  sizes(Range::groups(1, 64), seen);
  EXPECT_EQ(device_.built_programs().size(), 1u);
}

TEST_P(OclKernelOnDevice, SmallLocalMemoryAndGroups) {
  constexpr std::size_t kGroupSize = 32, kNumGroups = 5;
  std::vector<uint> values(kGroupSize * kNumGroups);
  std::iota(values.begin(), values.end(), 0u);
  ocl::Buffer<uint> buffer(device_, "values", values);
  ocl::Kernel<kernels::reverse_groups> reverse(device_);
  reverse(Range::covering(values.size(), kGroupSize), buffer, {kGroupSize});
  for (std::size_t group = 0; group < kNumGroups; ++group) {
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(group * kGroupSize);
    std::reverse(begin, begin + kGroupSize);
  }
  EXPECT_EQ(buffer.read(), values);
}

TEST_P(OclKernelOnDevice, SmallStructsPassByValue) {
  ocl::Buffer<PairHit> stored(device_, "stored", 1);
  ocl::Kernel<kernels::store_pair_hit>{device_}({1, 1}, {42, 0.25f}, stored);
  EXPECT_EQ(stored.read().front().cell, 42u);
  EXPECT_EQ(stored.read().front().s, 0.25f);
}

TEST_P(OclKernelOnDevice, SmallKernelsOfOneProgramKeepTheirOwnArguments) {
  const ocl::Buffer<uint> input(device_, "input", std::vector<uint>{1});
  ocl::Buffer<uint> twice(device_, "twice", 1), thrice(device_, "thrice", 1);
  ScaleKernel first(device_), second(device_);
  first({1, 1}, input, 1, 2, twice);
  second({1, 1}, input, 1, 3, thrice);
  EXPECT_EQ(twice.read().front(), 2u);
  EXPECT_EQ(thrice.read().front(), 3u);
}

TEST_P(OclKernelOnDevice, NoGroupsEnqueueNothing) {
  ocl::Kernel<kernels::launch_empty> empty(device_);
  EXPECT_NO_THROW(empty({0, 64}));
  EXPECT_NO_THROW(empty({1, 1}));
  device_.finish();
}

struct NoSuchKernel {
  static constexpr const char *kStem = "launch_probe", *kName = "no_such_kernel";
  using Params = ocl::Params<>;
};

TEST_P(OclKernelOnDevice, MissingKernelIsAnError) {
  try {
    ocl::Kernel<NoSuchKernel>{device_}({1, 1});
    FAIL() << "a missing kernel was made";
  } catch (const Error &error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("'no_such_kernel'"), HasSubstr("CL_INVALID_KERNEL_NAME (-46)")));
  }
}

TEST_P(OclKernelOnDevice, MovedFromBufferIsAnInvalidArgument) {
  ScaleKernel scale(device_);
  ocl::Buffer<uint> input(device_, "input", 1), output(device_, "output", 1);
  const ocl::Buffer<uint> moved(std::move(output));
  // NOLINTNEXTLINE(bugprone-use-after-move): what the test is about
  EXPECT_THROW(scale({1, 1}, input, 1, 1, output), std::invalid_argument);
}

TEST_P(OclKernelOnDevice, LaunchErrorsNameKernelAndCode) {
  ocl::Kernel<kernels::prefix_tile_sums> sums(device_, {{"ISO_GROUP_SIZE", "4u"}});
  const ocl::Buffer<uint> input(device_, "input", 1);
  ocl::Buffer<uint> output(device_, "output", 1);
  try {
    sums({1, 3}, input, 1, output);
    FAIL() << "a group of another size than the kernel's was started";
  } catch (const Error &error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("'prefix_tile_sums'"), HasSubstr("CL_INVALID_WORK_")));
  }
}

TEST_P(OclKernelOnDevice, Ranges) {
  EXPECT_EQ(Range::covering(0, 64).num_groups, 0u);
  EXPECT_EQ(Range::covering(1, 64).num_groups, 1u);
  EXPECT_EQ(Range::covering(64, 64).num_groups, 1u);
  EXPECT_EQ(Range::covering(65, 64).num_groups, 2u);
  EXPECT_EQ(Range::strided(0, 64, device_).num_groups, 0u);
  EXPECT_EQ(Range::strided(65, 64, device_).num_groups, 2u);
  EXPECT_EQ(Range::strided(1u << 30, 64, device_).num_groups, device_.max_resident_groups());
  const bool is_gpu = device_.info().type == ocl::DeviceType::kGpu;
  EXPECT_EQ(Range::each(65, 64, device_).num_groups, 2u);
  EXPECT_EQ(Range::each(1u << 30, 64, device_).num_groups,
            is_gpu ? device_.max_resident_groups() : 1u << 24);
}

INSTANTIATE_TEST_SUITE_P(Devices, OclKernelOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
