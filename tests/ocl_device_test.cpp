// core/ocl/device: listing, the rules of choosing, opening, building programs.

#include "core/ocl/device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/ocl/kernel.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::Not;

template <class Exception, class Action>
std::string message_of(const Action &action) {
  try {
    action();
  } catch (const Exception &error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing of this type was thrown";
  return {};
}

ocl::DeviceInfo made_up(std::uint32_t index, std::string name, std::string platform,
                        ocl::DeviceType type) {
  ocl::DeviceInfo info;
  info.index = index;
  info.name = std::move(name);
  info.platform = std::move(platform);
  info.type = type;
  return info;
}

class PickDeviceTest : public testing::Test {
 protected:
  std::uint32_t picked(std::string_view selector, std::string_view environment = "") const {
    return ocl::pick_device(devices_, selector, environment).index;
  }

  std::vector<ocl::DeviceInfo> devices_ = {
      made_up(0, "FPGA card", "Vendor A", ocl::DeviceType::kAccelerator),
      made_up(1, "pthread-Some CPU", "Portable Computing Language", ocl::DeviceType::kCpu),
      made_up(2, "Big GPU 9000", "Vendor B", ocl::DeviceType::kGpu),
      made_up(3, "Small GPU 10", "Vendor B", ocl::DeviceType::kGpu),
  };
};

TEST_F(PickDeviceTest, DefaultIsGpuThenAcceleratorThenCpuThenFirst) {
  EXPECT_EQ(picked(""), 2u);
  devices_.resize(2);
  EXPECT_EQ(picked(""), 0u);
  devices_.front().type = ocl::DeviceType::kOther;
  EXPECT_EQ(picked(""), 1u);
  devices_.resize(1);
  EXPECT_EQ(picked(""), 0u);
}

TEST_F(PickDeviceTest, TheHostIsNoDevice) {
  EXPECT_THAT(message_of<Error>([&] { picked("Host"); }), HasSubstr("'host' is no OpenCL device"));
  EXPECT_THAT(message_of<Error>([&] { picked("", "host"); }), HasSubstr("(from ISOWAVE_DEVICE)"));
  EXPECT_EQ(picked("cpu", "host"), 1u);
}

TEST_F(PickDeviceTest, TheHostDrawsIfItIsNamedOrNoFastDeviceIsThere) {
  using ocl::DrawsOn;
  bool listed = false;
  const auto on = [&](std::string_view selector, std::string_view environment = "") {
    listed = false;
    return ocl::pick_drawing(
        [&] {
          listed = true;
          return devices_;
        },
        selector, environment);
  };
  EXPECT_EQ(on("host"), DrawsOn::kHost);
  EXPECT_EQ(on("HOST", "gpu"), DrawsOn::kHost);
  EXPECT_EQ(on("", "host"), DrawsOn::kHost);
  EXPECT_EQ(on("cpu", "host"), DrawsOn::kDevice);
  EXPECT_EQ(on("", "cpu"), DrawsOn::kDevice);
  EXPECT_FALSE(listed) << "names say enough";
  EXPECT_EQ(on(""), DrawsOn::kDevice);
  EXPECT_TRUE(listed);
  devices_.resize(2);
  EXPECT_EQ(on(""), DrawsOn::kDevice) << "an accelerator";
  devices_.erase(devices_.begin());
  EXPECT_EQ(on(""), DrawsOn::kHostByDefault);
  devices_.clear();
  EXPECT_EQ(on(""), DrawsOn::kHostByDefault);
}

TEST_F(PickDeviceTest, TakesIndexTypeAndFragment) {
  EXPECT_EQ(picked("3"), 3u);
  EXPECT_EQ(picked("cpu"), 1u);
  EXPECT_EQ(picked("GPU"), 2u);
  EXPECT_EQ(picked("accelerator"), 0u);
  EXPECT_EQ(picked("small"), 3u);
  EXPECT_EQ(picked("PORTABLE"), 1u) << "platforms count too";
  EXPECT_EQ(picked("vendor b"), 2u) << "the first of several";
  EXPECT_EQ(picked("Some CPU"), 1u) << "a fragment that contains a type's word";
}

TEST_F(PickDeviceTest, EnvironmentCountsOnlyWithoutSelector) {
  EXPECT_EQ(picked("", "cpu"), 1u);
  EXPECT_EQ(picked("3", "cpu"), 3u);
  EXPECT_EQ(picked("3", "nonsense"), 3u);
}

TEST_F(PickDeviceTest, ErrorsListTheDevicesInOneLine) {
  for (const char *selector : {"4", "99999999999", "-1", "nonsense", "2 "}) {
    const std::string message = message_of<Error>([&] { picked(selector); });
    EXPECT_THAT(message, HasSubstr(fmt::format("'{}'", selector)));
    EXPECT_THAT(message, HasSubstr("1 'pthread-Some CPU' (cpu, Portable Computing Language)"));
    EXPECT_THAT(message, Not(HasSubstr("\n")));
    EXPECT_THAT(message, Not(HasSubstr("ISOWAVE_DEVICE")));
  }
  EXPECT_THAT(message_of<Error>([&] { picked("", "nonsense"); }),
              HasSubstr("'nonsense' (from ISOWAVE_DEVICE)"));
  devices_.resize(1);
  EXPECT_THROW(picked("gpu"), Error) << "a type is not a fragment";
}

TEST_F(PickDeviceTest, NoDeviceNamesThePackageThatHelps) {
  devices_.clear();
  for (const char *selector : {"", "0", "gpu"}) {
    EXPECT_THAT(message_of<Error>([&] { picked(selector); }), HasSubstr("pocl-opencl-icd"));
  }
}

TEST(ListDevices, IndexIsThePositionAndOpenClIsAtLeast12) {
  const std::vector<ocl::DeviceInfo> devices = ocl::list_devices();
  ASSERT_FALSE(devices.empty()) << "no OpenCL device: install pocl-opencl-icd";
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].index, i);
    EXPECT_FALSE(devices[i].name.empty());
    EXPECT_THAT(devices[i].device_version, HasSubstr("OpenCL "));
    EXPECT_THAT(devices[i].device_version, Not(HasSubstr("OpenCL 1.1")));
    EXPECT_GT(devices[i].capabilities.compute_units, 0u);
    EXPECT_GT(devices[i].capabilities.max_work_group_size, 0u);
    EXPECT_GT(devices[i].capabilities.largest_allocation, 0u);
    EXPECT_GE(devices[i].capabilities.global_memory, devices[i].capabilities.largest_allocation);
  }
}

TEST(ErrorName, KnownAndUnknownCodes) {
  EXPECT_EQ(ocl::error_name(CL_OUT_OF_RESOURCES), "CL_OUT_OF_RESOURCES (-5)");
  EXPECT_EQ(ocl::error_name(-9999), "unknown OpenCL error (-9999)");
}

class OclDeviceOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};

/// The line of `text` in a kernel file, 1 for the first.
int line_of(const std::string &file, const std::string &text) {
  const auto root = std::filesystem::path(ISOWAVE_TEST_DATA).parent_path().parent_path();
  std::ifstream in(root / "kernels_cl" / file);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.find(text) != std::string::npos) return number;
  }
  ADD_FAILURE() << file << " has no line with " << text;
  return 0;
}

TEST_P(OclDeviceOnDevice, CapabilitiesAreEnoughForCore) {
  const ocl::Device device(GetParam());
  EXPECT_GE(device.capabilities().local_memory, 32u << 10);
  EXPECT_GT(device.max_resident_groups(), 0u);
}

TEST_P(OclDeviceOnDevice, VanishedDeviceIsAnError) {
  ocl::DeviceInfo info = GetParam();
  info.name = "renamed";
  EXPECT_THAT(message_of<Error>([&] { ocl::Device device(info); }), HasSubstr("renamed"));
}

TEST_P(OclDeviceOnDevice, TooLittleLocalMemoryIsRefused) {
  ocl::DeviceInfo info = GetParam();
  info.capabilities.local_memory = 16 << 10;
  EXPECT_THAT(message_of<Error>([&] { ocl::Device device(info); }),
              HasSubstr("16 KiB of local memory"));
}

TEST_P(OclDeviceOnDevice, ProgramsAreBuiltOncePerDefines) {
  ocl::Device device(GetParam());
  const cl::Program &first = device.program("scan", {{"ISO_GROUP_SIZE", "32u"}});
  const cl::Program &other = device.program("scan", {{"ISO_GROUP_SIZE", "64u"}});
  EXPECT_EQ(&device.program("scan", {{"ISO_GROUP_SIZE", "32u"}}), &first);
  EXPECT_EQ(&device.program("scan", {{"ISO_GROUP_SIZE", "64u"}}), &other);
  EXPECT_NE(&first, &other);
  EXPECT_EQ(&device.program("scan", {{"ISO_GROUP_SIZE", "32u"}, {"ISO_NOT_IN_ITS_TEXT", "1"}}),
            &first);
}

TEST_P(OclDeviceOnDevice, ProgramsAreSharedByAllWhoOpenADevice) {
  ocl::Device first(GetParam());
  const cl::Program &program = first.program("scan", {{"ISO_GROUP_SIZE", "32u"}});
  ocl::Device second(GetParam());
  EXPECT_THAT(second.built_programs(), testing::IsEmpty()) << "a list for each";
  EXPECT_EQ(&second.program("scan", {{"ISO_GROUP_SIZE", "32u"}}), &program);
  EXPECT_EQ(second.built_programs().size(), 1u);
}

TEST_P(OclDeviceOnDevice, AbandonedContextsAreNotGivenToOthers) {
  ocl::Device first(GetParam());
  const cl_context context = first.context()();
  ocl::DeviceContext::of(cl::Device(first.context().getInfo<CL_CONTEXT_DEVICES>().front()))
      ->abandon();
  ocl::Device second(GetParam());
  EXPECT_NE(second.context()(), context);
  EXPECT_EQ(ocl::Device(GetParam()).context()(), second.context()());
}

TEST_P(OclDeviceOnDevice, BuildErrorsNameFileAndLine) {
  ocl::Device device(GetParam());
  const auto build = [&](const char *define) {
    try {
      device.program("shared_types", {{define, "1+"}});
    } catch (const BuildError &error) {
      EXPECT_EQ(std::string_view(error.what()).find('\n'), std::string_view::npos)
          << "one line, and the log apart";
      return error.what() + ("\n" + error.log());
    }
    return std::string("it builds");
  };
  const std::string in_kernel = build("sizes"), in_header = build("isovalue_index");
  EXPECT_THAT(in_kernel, HasSubstr("shared_types.cl does not build"));
  EXPECT_THAT(in_kernel, HasSubstr("CL_BUILD_PROGRAM_FAILURE"));
  // After two includes the numbers must still be those of the .cl file.
  EXPECT_THAT(in_kernel,
              HasSubstr(fmt::format("shared_types.cl:{}:",
                                    line_of("probes/shared_types.cl", "void shared_type_sizes"))));
  EXPECT_THAT(in_header,
              HasSubstr(fmt::format("shared_types.h:{}:",
                                    line_of("portable/shared_types.h", "uint isovalue_index"))));
}

TEST_P(OclDeviceOnDevice, MisuseIsAnInvalidArgument) {
  ocl::Device device(GetParam());
  EXPECT_THAT(message_of<std::invalid_argument>([&] { device.program("no_such_stem"); }),
              HasSubstr("no_such_stem.cl"));
  EXPECT_THROW(device.program("launch_probe", {{"ISO_A", "1 -cl-fast-relaxed-math"}}),
               std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Devices, OclDeviceOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
