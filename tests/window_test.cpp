// kernels_cl/portable/window.h: how many rays take part in a pass, and how far they look ahead.

#include "kernels_cl/portable/window.h"

#include <gtest/gtest.h>

namespace isowave::core {
namespace {

FrameParams frame_of(uint width, uint height) {
  FrameParams frame{};
  frame.view.width = width;
  frame.view.height = height;
  frame.schedule.max_spec_count = 64;
  frame.schedule.cache_slots = 200;
  return frame;
}

constexpr uint kRays = 35 * 29;

TEST(Window, FirstPassIsForAllRays) {
  const FrameParams frame = frame_of(35, 29);
  EXPECT_EQ(first_window(&frame), kRays);
  EXPECT_EQ(rays_in_window(kRays, 12), 12u);
  EXPECT_EQ(rays_in_window(12, kRays), 12u);
}

TEST(Window, GrowsByAQuarterUntilAllTakePart) {
  const FrameParams frame = frame_of(35, 29);
  EXPECT_EQ(next_window(&frame, 1, 1000, 5, 5), 2u);
  EXPECT_EQ(next_window(&frame, 100, 1000, 0, 0), 126u);
  EXPECT_EQ(next_window(&frame, 100, 3, 7, 7), 126u) << "few rays are left: that leaves out none";
  EXPECT_EQ(next_window(&frame, kRays - 1, 1000, 9, 9), kRays);
  EXPECT_EQ(next_window(&frame, kRays, 1000, 9, 9), kRays);
}

TEST(Window, ShrinksToTheRaysThatCanBeServed) {
  const FrameParams frame = frame_of(35, 29);
  EXPECT_EQ(next_window(&frame, 400, 1000, 100, 50), 200u);
  EXPECT_EQ(next_window(&frame, 400, 200, 100, 50), 100u) << "of the rays that asked";
  EXPECT_EQ(next_window(&frame, 400, 1000, 100, 0), 100u) << "a quarter at least";
  EXPECT_EQ(next_window(&frame, 3, 1000, 100, 0), 1u) << "one at least";
  EXPECT_EQ(next_window(&frame, 400, 0, 100, 50), 1u);
}

TEST(Window, CountsBlocksBeyond32Bits) {
  const FrameParams frame = frame_of(1u << 14, 1u << 14);
  EXPECT_EQ(next_window(&frame, 1u << 27, 1u << 28, 1u << 30, 1u << 29), 1u << 26);
}

TEST(Window, SpeculationSharesTheFramesRaysOut) {
  FrameParams frame = frame_of(35, 29);
  EXPECT_EQ(speculation_count(&frame, 0), 0u);
  EXPECT_EQ(speculation_count(&frame, 1), 64u);
  EXPECT_EQ(speculation_count(&frame, 100), 10u);
  EXPECT_EQ(speculation_count(&frame, kRays), 1u);
  frame.schedule.max_spec_count = 3;
  EXPECT_EQ(speculation_count(&frame, 100), 3u);
  EXPECT_EQ(speculation_count(&frame, kRays), 1u);
}

/// 50 groups of 8 table entries are for 200 slots.
TEST(Window, RaysLookAheadForAsManyBlocksAsThereAreSlots) {
  const FrameParams frame = frame_of(35, 29);
  EXPECT_EQ(most_ahead(&frame, kRays, 1), 64u) << "all take part";
  EXPECT_EQ(most_ahead(&frame, kRays - 1, 19), 10u);
  EXPECT_EQ(most_ahead(&frame, kRays - 1, 1000), 1u);
  EXPECT_EQ(most_ahead(&frame, 1, 0), 200u);
}

}  // namespace
}  // namespace isowave::core
