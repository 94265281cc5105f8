// core/view/trigonometry: the nearest doubles, whatever the C library has.

#include "core/view/trigonometry.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace isowave::core {
namespace {

struct Known {
  double angle, sine, cosine, tangent, arc_tangent;
};

/// By 113 bits (libquadmath), rounded. The first two are angles of views from the corner;
/// glibc 2.36 has another sine or tangent of the last three.
constexpr std::array<Known, 13> kKnown = {{
    {0x1.657184ae74487p-2, 0x1.5e3a8748a0bf5p-2, 0x1.e11f642522d1cp-1, 0x1.74b49cf3902d4p-2,
     0x1.57e7101b22948p-2},
    {0x1.3333333333333p-2, 0x1.2e9cd95baba33p-2, 0x1.e921dd42f09bap-1, 0x1.3cc2a44e29998p-2,
     0x1.2a73a661eaf06p-2},
    {0x1.0c152382d7365p-1, 0x1.fffffffffffffp-2, 0x1.bb67ae8584cabp-1, 0x1.279a74590331cp-1,
     0x1.edec9c192bfaap-2},
    {0x1.17ac9ff5c1b0ep+1, 0x1.a26fab9c675dp-1, -0x1.270d132e00b9fp-1, -0x1.6b0dfedf2e7cap+0,
     0x1.243e75ae1f8f7p+0},
    {0x1.2cafcbafc85f7p+2, -0x1.fff2dc7abef3dp-1, -0x1.cff48ed1dae5p-7, 0x1.1a7b4d9bd235ap+6,
     0x1.5c6fb989293f9p+0},
    {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53, -0x1p+0, -0x1.1a62633145c07p-53,
     0x1.433b8a322ddd3p+0},
    {0x1.921fb54442d18p+0, 0x1p+0, 0x1.1a62633145c07p-54, 0x1.d02967c31cdb5p+53,
     0x1.00fe987ed02ffp+0},
    {0x1.4f8b588e368f1p-17, 0x1.4f8b588e1e8a2p-17, 0x1.ffffffff920c8p-1, 0x1.4f8b588e6698ep-17,
     0x1.4f8b588e06854p-17},
    {0x1.81cd6c8b43958p+13, -0x1.687d5890974a5p-1, 0x1.6b94c3bbe24b8p-1, -0x1.fba5836323a4ep-1,
     0x1.921a664fe1dc4p+0},
    {0x1.1e1a3p+28, -0x1.c219eed2e54c4p-2, 0x1.cbe31d447d1e2p-1, -0x1.f51af0a5408cep-2,
     0x1.921fb535f1c7ap+0},
    {0x1.7a376922d94a5p-3, 0x1.7811fc0212e53p-3, 0x1.f74b39a6924dap-1, 0x1.7e935d7cb346p-3,
     0x1.7600ac235d762p-3},
    {0x1.2a2834d26fa56p-2, 0x1.25f64256c4f03p-2, 0x1.ea730a7ac907ap-1, 0x1.32e0f93c6541dp-2,
     0x1.2222acb59a697p-2},
    {0x1.3fa7a85015c3dp-1, 0x1.2b4a35b64e0dep-1, 0x1.9f6a390b07c2bp-1, 0x1.70e0254552397p-1,
     0x1.1dc12ed969d39p-1},
}};

TEST(Trigonometry, HasTheNearestDoubles) {
  for (const Known &known : kKnown) {
    SCOPED_TRACE(known.angle);
    EXPECT_EQ(sine(known.angle), known.sine);
    EXPECT_EQ(cosine(known.angle), known.cosine);
    EXPECT_EQ(tangent(known.angle), known.tangent);
    EXPECT_EQ(arc_tangent(known.angle), known.arc_tangent);
    EXPECT_EQ(sine(-known.angle), -known.sine);
    EXPECT_EQ(cosine(-known.angle), known.cosine);
    EXPECT_EQ(tangent(-known.angle), -known.tangent);
    EXPECT_EQ(arc_tangent(-known.angle), -known.arc_tangent);
  }
}

/// An x87 unit or a long double of 113 bits has 11 bits more than a double at least: where its
/// value is clearly on one side of the middle between two doubles, that side is the nearest one.
TEST(Trigonometry, AgreesWithLongDoubles) {
  if (std::numeric_limits<long double>::digits < 64) GTEST_SKIP() << "long double is double";
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> exponent(-8, 6), sign(-1, 1);
  int num_sure = 0;
  const auto expect_nearest = [&](double ours, long double theirs, double angle) {
    const auto nearest = static_cast<double>(theirs);
    const long double gap = std::nextafter(std::abs(nearest), 1e300) - std::abs(nearest);
    const long double beside = std::abs(theirs - nearest) / gap;
    if (std::abs(beside - 0.5L) < 0.01L) return;
    EXPECT_EQ(ours, nearest) << angle;
    ++num_sure;
  };
  for (int i = 0; i < 20000; ++i) {
    const double angle = std::copysign(std::pow(10.0, exponent(random)), sign(random));
    const long double wide = angle;
    expect_nearest(sine(angle), std::sin(wide), angle);
    expect_nearest(cosine(angle), std::cos(wide), angle);
    expect_nearest(tangent(angle), std::tan(wide), angle);
    expect_nearest(arc_tangent(angle), std::atan(wide), angle);
  }
  EXPECT_GT(num_sure, 75000);
}

TEST(Trigonometry, ExtremeAngles) {
  EXPECT_TRUE(std::signbit(sine(-0.0)) && std::signbit(tangent(-0.0)));
  EXPECT_EQ(cosine(0), 1);
  EXPECT_EQ(sine(1e-300), 1e-300);
  EXPECT_TRUE(std::isnan(sine(std::numeric_limits<double>::infinity())));
  EXPECT_TRUE(std::isnan(arc_tangent(std::numeric_limits<double>::quiet_NaN())));
  EXPECT_EQ(arc_tangent(std::numeric_limits<double>::infinity()), std::numbers::pi / 2);
  EXPECT_EQ(sine(1e15), std::sin(1e15));
}

}  // namespace
}  // namespace isowave::core
