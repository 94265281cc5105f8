// The device's compiler must lay out kernels_cl/portable/shared_types.h as the host's does.

#include "kernels_cl/portable/shared_types.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "kernels/shared_types.hpp"
#include "kernels_cl/portable/shared_types_fields.h"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

class SharedTypesOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};

#define ISO_ADD_OFFSET(field)                                    \
  offsets.push_back(static_cast<uint>(offsetof(Object, field))); \
  listed_bytes += sizeof(Object::field);

/// The fields' offsets in the order of shared_types.cl. Fails when a struct has fields that are not
/// listed: there is no padding in any of them, so the listed sizes must add up.
std::vector<uint> host_offsets() {
  std::vector<uint> offsets;
  std::size_t listed_bytes = 0;
  {
    using Object = FrameParams;
    ISO_FRAME_PARAMS_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "FrameParams";
  }
  {
    using Object = PairHit;
    ISO_PAIR_HIT_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "PairHit";
  }
  {
    using Object = BlockRays;
    ISO_BLOCK_RAYS_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "BlockRays";
  }
  {
    using Object = HitRecord;
    ISO_HIT_RECORD_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "HitRecord";
  }
  {
    using Object = GivenRay;
    ISO_GIVEN_RAY_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "GivenRay";
  }
  {
    using Object = StreamLayout;
    ISO_STREAM_LAYOUT_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "StreamLayout";
  }
  {
    using Object = PassCounts;
    ISO_PASS_COUNTS_FIELDS(ISO_ADD_OFFSET)
    EXPECT_EQ(std::exchange(listed_bytes, 0), sizeof(Object)) << "PassCounts";
  }
  return offsets;
}

TEST_P(SharedTypesOnDevice, SmallSizesAreTheHosts) {
  const std::vector<uint> expected = {sizeof(FrameParams), sizeof(PairHit),  sizeof(BlockRays),
                                      sizeof(HitRecord),   sizeof(GivenRay), sizeof(StreamLayout),
                                      sizeof(PassCounts)};
  ocl::Buffer<uint> sizes(device_, "sizes", expected.size());
  ocl::Kernel<kernels::shared_type_sizes>{device_}({1, 1}, sizes);
  EXPECT_EQ(sizes.read(), expected);
}

TEST_P(SharedTypesOnDevice, SmallOffsetsAreTheHosts) {
  const std::vector<uint> expected = host_offsets();
  ocl::Buffer<uint> offsets(device_, "offsets", expected.size());
  ocl::Kernel<kernels::shared_type_offsets>{device_}({1, 1}, offsets);
  EXPECT_EQ(offsets.read(), expected);
}

INSTANTIATE_TEST_SUITE_P(Devices, SharedTypesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
