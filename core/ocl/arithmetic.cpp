#include "core/ocl/arithmetic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <random>

#include "core/base/error.hpp"

namespace isowave::core::ocl {

namespace {

constexpr std::size_t kNumOperands = 1024;

bool same_bits(float a, float b) {
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

/// A kind of operation, and whether two results of it are the same.
struct Kind {
  const char *name;
  bool (*is_same)(const Results &, const Results &);
};

constexpr Kind kKinds[] = {
    {"addition", [](const Results &a, const Results &b) { return same_bits(a.sum, b.sum); }},
    {"multiplication",
     [](const Results &a, const Results &b) { return same_bits(a.product, b.product); }},
    {"multiplication and addition, which it contracts",
     [](const Results &a, const Results &b) { return same_bits(a.contracted, b.contracted); }},
    {"fma", [](const Results &a, const Results &b) { return same_bits(a.fused, b.fused); }},
    {"division",
     [](const Results &a, const Results &b) { return same_bits(a.quotient, b.quotient); }},
    {"square roots", [](const Results &a, const Results &b) { return same_bits(a.root, b.root); }},
    {"denormal numbers",
     [](const Results &a, const Results &b) { return same_bits(a.denormal, b.denormal); }},
    {"rounding to integers",
     [](const Results &a, const Results &b) { return same_bits(a.rounded, b.rounded); }},
    {"64-bit integers",
     [](const Results &a, const Results &b) { return a.whole == b.whole && a.high == b.high; }},
};

struct SelfTests {
  std::mutex mutex;
  std::map<std::string, SelfTest> by_device;  ///< key: device and driver
};

SelfTests &self_tests() {
  static SelfTests all;
  return all;
}

SelfTest make_self_test(Device &device) {
  const std::vector<Operands> operands = arithmetic_operands();
  const Computed computed = compute_on(device, operands);
  const std::vector<std::string> kinds = differences(operands, computed.results);
  std::string notice;
  if (!kinds.empty()) {
    notice = fmt::format(
        "device '{}' computes {} differently: pictures may differ from other devices' in last "
        "bits",
        device.info().name, fmt::join(kinds, ", "));
  }
  return {std::move(notice), computed.largest_group};
}

}  // namespace

std::vector<Operands> arithmetic_operands() {
  std::mt19937_64 random(20261126);
  // Numbers of either sign between 2^-12 and 2^12, with all bits of the mantissa at random.
  const auto number = [&random] {
    const auto bits = random();
    return std::bit_cast<float>(static_cast<std::uint32_t>(
        (bits & 0x807FFFFFu) | std::uint32_t(127 - 12 + (bits >> 40) % 24) << 23));
  };
  std::vector<Operands> operands(kNumOperands);
  for (std::size_t i = 0; i < operands.size(); ++i) {
    Operands &given = operands[i];
    given = {number(), number(), number(), 0x1p-140f, random(), random()};
    if (i % 4 == 1) given.c = -(given.a * given.b);  // what is left is the product's rounding
    // The product lies halfway between two float32, and c decides. Rounded twice, c is lost.
    if (i % 4 == 2) {
      const auto odd = [&random] { return static_cast<float>(random() % 64 * 2 + 1); };
      given.a = 1 + odd() * 0x1p-12f;
      given.b = 1 + odd() * 0x1p-12f;
      given.c = random() % 2 == 0 ? 0x1p-60f : -0x1p-60f;
    }
  }
  return operands;
}

std::vector<std::string> differences(std::span<const Operands> operands,
                                     std::span<const Results> results) {
  std::vector<std::string> found;
  for (const Kind &kind : kKinds) {
    std::size_t differ = 0;
    for (std::size_t i = 0; i < operands.size(); ++i)
      differ += !kind.is_same(compute(&operands[i]), results[i]);
    if (differ != 0) {
      found.push_back(
          fmt::format("{} ({:.0f} % of results)", kind.name,
                      std::ceil(100 * static_cast<double>(differ) / double(operands.size()))));
    }
  }
  return found;
}

Computed compute_on(Device &device, std::span<const Operands> operands) {
  std::vector<Results> results(operands.size());
  std::size_t largest_group = 0;
  // By OpenCL alone, since neither ledger nor timer are to count it.
  try {
    cl::Kernel kernel(device.build("arithmetic", {}), "arithmetic");
    const cl::Buffer given(device.context(), CL_MEM_READ_ONLY, operands.size_bytes()),
        computed(device.context(), CL_MEM_READ_WRITE, operands.size() * sizeof(Results));
    kernel.setArg(0, given);
    kernel.setArg(1, static_cast<cl_uint>(operands.size()));
    kernel.setArg(2, computed);
    const cl::CommandQueue &queue = device.queue();
    queue.enqueueWriteBuffer(given, CL_TRUE, 0, operands.size_bytes(), operands.data());
    // PoCL 3.1 ends the process if it is to choose a size and has groups of one work-item alone.
    largest_group = kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(
        device.context().getInfo<CL_CONTEXT_DEVICES>().front());
    const std::size_t limit =
        std::min<std::size_t>(largest_group, device.capabilities().max_work_group_size);
    const std::size_t group_size = std::bit_floor(std::clamp<std::size_t>(limit, 1, 64));
    queue.enqueueNDRangeKernel(
        kernel, cl::NullRange,
        cl::NDRange((operands.size() + group_size - 1) / group_size * group_size),
        cl::NDRange(group_size));
    queue.enqueueReadBuffer(computed, CL_TRUE, 0, operands.size() * sizeof(Results),
                            results.data());
  } catch (const cl::Error &error) {
    throw Error("device '{}' fails the test of its arithmetic: {}: {}", device.info().name,
                error.what(), error_name(error.err()));
  }
  return {std::move(results), static_cast<std::uint32_t>(largest_group)};
}

SelfTest self_test(Device &device) {
  const DeviceInfo &info = device.info();
  const std::string key = fmt::format("{}\n{}\n{}", info.platform, info.name, info.driver_version);
  const std::lock_guard lock(self_tests().mutex);
  const auto found = self_tests().by_device.find(key);
  if (found != self_tests().by_device.end()) return found->second;
  return self_tests().by_device[key] = make_self_test(device);
}

std::vector<std::string> arithmetic_notices() {
  const std::lock_guard lock(self_tests().mutex);
  std::vector<std::string> lines;
  for (const auto &[device, test] : self_tests().by_device) {
    if (!test.notice.empty()) lines.push_back(test.notice);
  }
  return lines;
}

}  // namespace isowave::core::ocl
