// core/frame/soon_renderer: which of two renderers draws, what a frame sees that goes from one to
// the other, and what is thrown. The renderers draw nothing.

#include "core/frame/soon_renderer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/wait_while.hpp"

namespace isowave::core {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kLargest{8, 6};

/// A frame has four passes, of as many rays as it hits. Its distance from the eye is its hits.
class FakeRenderer : public Renderer {
 public:
  FakeRenderer(Abilities abilities, std::uint64_t rays_hit, int &num_alive)
      : abilities_(abilities), rays_hit_(rays_hit), num_alive_(num_alive) {
    ++num_alive_;
  }
  ~FakeRenderer() override { --num_alive_; }
  FakeRenderer(const FakeRenderer &) = delete;
  FakeRenderer &operator=(const FakeRenderer &) = delete;

  Abilities abilities() const override { return abilities_; }
  std::vector<VolumeInfo> levels() const override { return {}; }
  FrameStats render(const FrameRequest &request) override {
    check(request, abilities_);
    size_ = request.size.value();
    FrameStats stats;
    stats.rays_hit = rays_hit_;
    while (stats.passes.size() < 4 && !stats.cancelled) {
      stats.passes.emplace_back().n_spec = static_cast<double>(rays_hit_);
      stats.cancelled = request.on_pass && !request.on_pass(stats.passes.back());
    }
    num_frames_ += 1;
    return stats;
  }
  std::vector<HitRecord> cast_rays(std::span<const WorldRay>, float, Normals) override {
    return std::vector<HitRecord>(rays_hit_);
  }
  Camera camera(std::span<const float>, std::optional<ImageSize> size,
                const Viewpoint &from) override {
    return {.eye = {rays_hit_, size.value().width, from.num_views - 1}};
  }
  ImageSize size() const override { return size_; }
  std::vector<HitRecord> hits() override { return {}; }
  FrameArrays fetch(const WantedArrays &, const Appearance &) override {
    FrameArrays arrays;
    arrays.depth = memory_.array<float>(1);
    arrays.depth[0] = static_cast<float>(rays_hit_);
    return arrays;
  }
  void clear_cache() override {}
  std::uint64_t memory_bytes() const override { return 1000 + num_frames_; }
  double setup_ms() const override { return 3; }

 private:
  Abilities abilities_;
  std::uint64_t rays_hit_;
  int &num_alive_;
  ImageSize size_;
  std::uint64_t num_frames_ = 0;
  HostMemory memory_;
};

/// The renderer meanwhile hits 1 ray, the other one 2.
class SoonRendererTest : public testing::Test {
 protected:
  static Abilities with_levels() {
    return {.largest = kLargest, .most_rays = kLargest.num_rays(), .levels = true};
  }
  SoonParts parts() {
    return {.abilities = with_levels(),
            .make =
                [this](const std::stop_token &stop) {
                  const std::stop_callback wake(stop, [this] { release(); });
                  wait_while(may_make_, false);
                  if (stop.stop_requested()) throw Error("stopped");
                  return std::make_shared<FakeRenderer>(with_levels(), 2, num_ready_);
                },
            .before_use = [this] { ++num_uses_; },
            .meanwhile_abilities = {},
            .make_meanwhile =
                [this] { return std::make_unique<FakeRenderer>(Abilities{}, 1, num_meanwhile_); }};
  }
  /// Lets the other renderer be made.
  void release() { set_and_wake(may_make_, true); }
  void make_ready(const SoonRenderer &renderer) {
    release();
    renderer.wait();
  }

  std::atomic<bool> may_make_ = false;
  int num_ready_ = 0, num_meanwhile_ = 0, num_uses_ = 0;
};

TEST_F(SoonRendererTest, DrawsMeanwhileUntilTheOtherIsReady) {
  SoonRenderer renderer(parts());
  EXPECT_EQ(num_meanwhile_, 0) << "made before a frame needs it";
  EXPECT_THAT([&] { renderer.depth(); }, ThrowsMessage<Error>(HasSubstr("no frame")));
  EXPECT_EQ(renderer.render({}).rays_hit, 1u);
  EXPECT_EQ(renderer.depth(), std::vector{1.0f});
  EXPECT_EQ(renderer.size().width, kLargest.width);
  EXPECT_EQ(renderer.memory_bytes(), 0u);
  EXPECT_EQ(renderer.setup_ms(), 0);
  EXPECT_FALSE(renderer.ready());
  EXPECT_EQ(num_uses_, 0);

  make_ready(renderer);
  EXPECT_TRUE(renderer.ready());
  EXPECT_EQ(renderer.memory_bytes(), 1000u) << "before its first frame";
  EXPECT_EQ(renderer.setup_ms(), 3);
  EXPECT_EQ(renderer.depth(), std::vector{1.0f}) << "the last frame's";
  EXPECT_EQ(renderer.render({}).rays_hit, 2u);
  EXPECT_EQ(renderer.depth(), std::vector{2.0f});
  EXPECT_EQ(renderer.memory_bytes(), 1001u);
  EXPECT_EQ(num_meanwhile_, 0) << "its memory is kept";
  EXPECT_EQ(num_uses_, 1);
}

TEST_F(SoonRendererTest, AllCallsAreAnsweredMeanwhile) {
  SoonRenderer renderer(parts());
  const std::vector<float> isovalues{0};
  EXPECT_EQ(renderer.cast_rays({}, 0, Normals::kCell).size(), 1u);
  EXPECT_EQ(renderer.camera(isovalues).eye, glm::dvec3(1, kLargest.width, 0));
  EXPECT_TRUE(renderer.abilities().levels) << "those of the other one";
  make_ready(renderer);
  EXPECT_EQ(renderer.cast_rays({}, 0, Normals::kCell).size(), 2u);
  EXPECT_EQ(renderer.camera(isovalues, ImageSize{5, 4}).eye, glm::dvec3(2, 5, 0));
  EXPECT_EQ(num_uses_, 2);
}

TEST_F(SoonRendererTest, AFrameAtWorkIsBegunAnew) {
  SoonRenderer renderer(parts());
  std::vector<std::string> passes;
  const FrameRequest request{.on_pass = [&](const PassStats &pass) {
    passes.push_back((pass.begins_anew ? "anew " : "") + std::to_string(int(pass.n_spec)));
    if (passes.size() == 2) make_ready(renderer);
    return true;
  }};
  const FrameStats stats = renderer.render(request);
  EXPECT_EQ(stats.rays_hit, 2u);
  EXPECT_EQ(stats.passes.size(), 4u);
  EXPECT_FALSE(stats.cancelled);
  EXPECT_THAT(passes, ElementsAre("1", "1", "anew 2", "2", "2", "2"));
  passes.clear();
  renderer.render(request);
  EXPECT_THAT(passes, ElementsAre("2", "2", "2", "2")) << "a frame of one renderer";
}

TEST_F(SoonRendererTest, FramesCanBeStoppedMeanwhile) {
  SoonRenderer renderer(parts());
  int num_passes = 0;
  const FrameStats stats =
      renderer.render({.on_pass = [&](const PassStats &) { return ++num_passes < 2; }});
  EXPECT_TRUE(stats.cancelled);
  EXPECT_EQ(stats.passes.size(), 2u);
  EXPECT_THROW(renderer.render({.on_pass = [](const PassStats &) -> bool {
    throw std::runtime_error("the user's");
  }}),
               std::runtime_error);
  EXPECT_EQ(renderer.render({}).rays_hit, 1u);
}

TEST_F(SoonRendererTest, WhatCannotBeDrawnMeanwhileWaits) {
  SoonRenderer renderer(parts());
  const FrameRequest levels{.voxel_pixels = 2};
  EXPECT_TRUE(renderer.ready_for({}));
  EXPECT_FALSE(renderer.ready_for(levels));
  auto frame = std::async(std::launch::async, [&] { return renderer.render(levels).rays_hit; });
  release();
  EXPECT_EQ(frame.get(), 2u);
  EXPECT_TRUE(renderer.ready_for(levels));
  EXPECT_EQ(num_meanwhile_, 0);
}

TEST_F(SoonRendererTest, WaitsIfNothingCanDrawMeanwhile) {
  SoonParts without = parts();
  int num_tries = 0;
  without.make_meanwhile = [&]() -> std::unique_ptr<Renderer> {
    ++num_tries;
    throw Error("not enough memory");
  };
  SoonRenderer renderer(std::move(without));
  auto frame = std::async(std::launch::async, [&] { return renderer.render({}).rays_hit; });
  release();
  EXPECT_EQ(frame.get(), 2u);
  EXPECT_LE(num_tries, 1);
}

TEST_F(SoonRendererTest, ErrorsOfTheMakingComeWithEachCallThatNeedsIt) {
  SoonRenderer renderer(parts());
  EXPECT_EQ(renderer.render({}).rays_hit, 1u);
  renderer.give_up();
  const auto stopped = ThrowsMessage<Error>(HasSubstr("stopped"));
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT([&] { renderer.wait(); }, stopped);
    EXPECT_THAT([&] { renderer.render({}); }, stopped);
    EXPECT_THAT([&] { renderer.camera({}); }, stopped);
  }
  EXPECT_TRUE(renderer.ready());
  EXPECT_EQ(renderer.memory_bytes(), 0u);
}

/// Whether the other renderer was made or not.
TEST_F(SoonRendererTest, LeavesNothingBehind) {
  {
    SoonRenderer renderer(parts());
    renderer.render({});
    EXPECT_EQ(num_meanwhile_, 1);
  }
  EXPECT_EQ(num_meanwhile_ + num_ready_, 0);
  {
    SoonRenderer renderer(parts());
    renderer.wait();
    EXPECT_EQ(num_ready_, 1);
  }
  EXPECT_EQ(num_ready_, 0);
}

}  // namespace
}  // namespace isowave::core
