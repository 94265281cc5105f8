#include "core/ocl/arithmetic.hpp"

#include <gmock/gmock.h>

#include <utility>

#include "tests/test_devices.hpp"

namespace isowave::core::ocl {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::StartsWith;

std::vector<Results> right_results(std::span<const Operands> operands) {
  std::vector<Results> results;
  for (const Operands &given : operands) results.push_back(compute(&given));
  return results;
}

/// What a device with this mistake would be said to do differently.
template <class Mistake>
std::vector<std::string> found(Mistake &&mistake) {
  const std::vector<Operands> operands = arithmetic_operands();
  std::vector<Results> results = right_results(operands);
  for (std::size_t i = 0; i < operands.size(); ++i) mistake(operands[i], results[i]);
  return differences(operands, results);
}

TEST(Arithmetic, EachMistakeIsNamed) {
  EXPECT_THAT(found([](const Operands &, Results &) {}), IsEmpty());
  EXPECT_THAT(found([](const Operands &given, Results &results) {
                results.contracted = std::fma(given.a, given.b, given.c);
              }),
              ElementsAre(StartsWith("multiplication and addition, which it contracts (")));
  EXPECT_THAT(found([](const Operands &given, Results &results) {
                results.fused = given.a * given.b + given.c;
              }),
              ElementsAre(StartsWith("fma (")));
  EXPECT_THAT(found([](const Operands &given, Results &results) {  // rounded twice, as by mingw
                results.fused = static_cast<float>(double(given.a) * given.b + double(given.c));
              }),
              ElementsAre(StartsWith("fma (")));
  EXPECT_THAT(found([](const Operands &given, Results &results) {
                results.quotient = given.a * (1.0f / given.b);
              }),
              ElementsAre(StartsWith("division (")));
  EXPECT_THAT(found([](const Operands &, Results &results) {
                if (std::fpclassify(results.denormal) == FP_SUBNORMAL) results.denormal = 0;
              }),
              ElementsAre(StartsWith("denormal numbers (")));
  EXPECT_THAT(found([](const Operands &, Results &results) { results.sum = -results.sum; }),
              ElementsAre("addition (100 % of results)"));
  EXPECT_THAT(found([](const Operands &, Results &results) {
                results.product = std::nextafter(results.product, 0.0f);
              }),
              ElementsAre("multiplication (100 % of results)"));
  EXPECT_THAT(found([](const Operands &, Results &results) {
                results.root = std::nextafter(results.root, 0.0f);
              }),
              ElementsAre("square roots (100 % of results)"));
  EXPECT_THAT(found([](const Operands &, Results &results) { results.rounded += 1; }),
              ElementsAre("rounding to integers (100 % of results)"));
  EXPECT_THAT(found([](const Operands &, Results &results) { results.whole &= 0xFFFFFFFFu; }),
              ElementsAre(StartsWith("64-bit integers (")));
  EXPECT_THAT(found([](const Operands &, Results &results) { results.high &= 0xFFFFFFFFu; }),
              ElementsAre(StartsWith("64-bit integers (")));
}

class ArithmeticOnDevice : public testing::TestWithParam<DeviceInfo> {};

TEST_P(ArithmeticOnDevice, SmallComputesAsTheHost) {
  Device device(GetParam());
  const std::vector<Operands> operands = arithmetic_operands();
  const std::vector<std::string> kinds =
      differences(operands, compute_on(device, operands).results);
  EXPECT_EQ(kinds.empty(), device.notice().empty());
  if (device.capabilities().denormals && device.capabilities().correctly_rounded_divide) {
    EXPECT_THAT(kinds, IsEmpty());
  }
  for (const std::string &kind : kinds) EXPECT_THAT(device.notice(), testing::HasSubstr(kind));
}

INSTANTIATE_TEST_SUITE_P(Devices, ArithmeticOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core::ocl
