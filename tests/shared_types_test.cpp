// The device's compiler must lay out kernels_cl/shared_types.h as the host's does.

#include "kernels_cl/shared_types.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "core/ocl/kernel.hpp"
#include "tests/test_devices.hpp"

namespace isowave {
namespace {

class SharedTypesTest : public testing::TestWithParam<ocl::DeviceInfo> {};

TEST_P(SharedTypesTest, SizesAreTheHosts) {
  ocl::Device device(GetParam());
  const std::vector<uint> expected = {sizeof(FrameParams), sizeof(PairHit), sizeof(HitRecord),
                                      sizeof(PassCounts)};
  ocl::Buffer<uint> sizes(device, "sizes", expected.size());
  ocl::Kernel<ocl::Out<uint>>{device, "shared_types", "shared_type_sizes"}({1, 1}, sizes);
  EXPECT_EQ(sizes.read(), expected);
}

INSTANTIATE_TEST_SUITE_P(Devices, SharedTypesTest, testing::ValuesIn(devices_under_test()), device_test_name);

}  // namespace
}  // namespace isowave
