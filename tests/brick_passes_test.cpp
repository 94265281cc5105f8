// Pictures of passes of frames of layers that teams draw in bricks, and frames that stop in a pass.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/frame/timed_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "tests/brick_team.hpp"
#include "tests/field_scene.hpp"

namespace isowave::core {
namespace {

constexpr ImageSize kFrame{37, 29};

/// The picture of a pass, at rank 0.
struct Pass {
  Image8 picture;
  std::uint64_t num_hits = 0;
};

class BrickPassesOnDevice : public test::BrickTeam {
 protected:
  void SetUp() override {
    BrickTeam::SetUp();
    request_.size = kFrame;
    request_.surfaces = {{-0.3f, {0.9f, 0.2f, 0.1f}, 0.4f},
                         {0.2f, {0.2f, 0.4f, 0.9f}, 0.6f},
                         {0.5f, {0.8f, 0.8f, 0.3f}, 1}};
  }

  void add_slices() {
    request_.slices = {
        {{{{1, 0, 0}, 16}, 0.5f}, {{{0.3, -1, 0.4}, -8.3}, 0.7f}}, -1, 1, color_map("viridis")};
  }
  void add_light() {
    request_.ambient_rays = 2;
    request_.shadow_rays = 1;
    request_.light.towards_light = glm::dvec3(0.5, 1, -0.3);
  }

  Image8 whole() { return picture_of_one(request_, options_); }

  /// Draws, and looks at each pass, or only at rounds of light rays.
  ///
  /// goes_on  is given the number of passes that were looked at
  static FrameStats draw(TeamRenderer &renderer, FrameRequest request, std::vector<Pass> &passes,
                         const std::function<bool(std::size_t)> &goes_on = {},
                         bool in_rounds = false) {
    passes.clear();
    const std::uint64_t before = renderer.composition().reductions;
    request.on_pass = [&](const PassStats &) {
      if (in_rounds && renderer.composition().reductions == before) return true;
      Pass pass{renderer.shade({})};
      pass.num_hits = renderer.num_hits({});
      passes.push_back(std::move(pass));
      return !goes_on || goes_on(passes.size());
    };
    return renderer.render(request);
  }

  /// More and more rays have hits. The last pass has the whole's picture.
  void expect_whole_in_the_end(std::uint32_t num_ranks, const CompressedVolume &volume,
                               const CompressedVolume *field, const Image8 &expected) {
    std::vector<std::size_t> num_calls(num_ranks);
    on_ranks(num_ranks, volume, field, options_, [&](TeamRenderer &renderer, std::uint32_t rank) {
      std::vector<Pass> passes;
      const FrameStats stats = draw(renderer, request_, passes);
      EXPECT_FALSE(stats.cancelled);
      EXPECT_TRUE(stats.complete);
      num_calls[rank] = passes.size();
      const Image8 last = renderer.shade({});
      EXPECT_EQ(passes.back().num_hits, renderer.num_hits(stats));
      if (rank != 0) {
        EXPECT_TRUE(passes.back().picture.pixels.empty());
        return;
      }
      EXPECT_EQ(last.pixels, expected.pixels);
      EXPECT_EQ(passes.back().picture.pixels, expected.pixels);
      EXPECT_LT(passes.front().num_hits, passes.back().num_hits / 2);
      std::size_t num_changes = 0;
      for (std::size_t i = 1; i < passes.size(); ++i) {
        EXPECT_GE(passes[i].num_hits, passes[i - 1].num_hits) << i;
        num_changes += passes[i].picture.pixels != passes[i - 1].picture.pixels ? 1 : 0;
      }
      EXPECT_GT(num_changes, 10u);
    });
    EXPECT_THAT(num_calls, testing::Each(num_calls[0]));
  }

  /// A small cache, so that there are many passes.
  RendererOptions options_{
      .size = kFrame, .cache_slots = 60, .max_surfaces = 3, .with_given_rays = true};
};
INSTANTIATE_TEST_SUITE_P(Devices, BrickPassesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(BrickPassesOnDevice, SurfacesAndSlices) {
  expect_whole_in_the_end(3, volume_.compressed, nullptr, whole());
  add_slices();
  for (const std::uint32_t num_ranks : {2u, 5u})
    expect_whole_in_the_end(num_ranks, volume_.compressed, nullptr, whole());
}

TEST_P(BrickPassesOnDevice, LightRays) {
  add_slices();
  add_light();
  expect_whole_in_the_end(3, volume_.compressed, nullptr, whole());
}

TEST_P(BrickPassesOnDevice, ColorsByAField) {
  const CompressedVolume volume = test::turned_gyroid(), field = test::field_of_gyroid();
  request_.camera = orbit_cameras(volume.info, 3)[1];
  request_.field_values = true;
  request_.light = test::by_field();
  RendererOptions of_one = options_;
  of_one.field = &field;
  ocl::Device device(GetParam());
  DeviceRenderer alone(device, volume, of_one);
  alone.render(request_);
  expect_whole_in_the_end(3, volume, &field, alone.shade({}));
}

/// A team of one shows what its renderer shows in each pass.
TEST_P(BrickPassesOnDevice, ShowsWhatOneRendererShows) {
  request_.normals = Normals::kCell;
  on_ranks(1, options_, [&](TeamRenderer &renderer, std::uint32_t) {
    auto &alone = const_cast<DeviceRenderer &>(renderer.renderer());
    FrameRequest request = request_;
    std::size_t num_calls = 0;
    std::vector<std::uint8_t> last;
    request.on_pass = [&](const PassStats &) {
      ++num_calls;
      last = renderer.shade({}).pixels;
      EXPECT_EQ(last, alone.shade({}).pixels) << "pass " << num_calls;
      EXPECT_EQ(renderer.depth(), alone.depth()) << "pass " << num_calls;
      return true;
    };
    renderer.render(request);
    EXPECT_GT(num_calls, 10u);
    EXPECT_EQ(last, renderer.shade({}).pixels);
  });
}

/// The picture is that of the last pass, or has a layer more.
TEST_P(BrickPassesOnDevice, AllStopInTheSamePass) {
  add_slices();
  add_light();
  const Image8 expected = whole();
  on_ranks(3, options_, [&](TeamRenderer &renderer, std::uint32_t rank) {
    std::vector<Pass> passes;
    const auto expect_stop = [&](std::size_t last, bool in_rounds) {
      renderer.clear_cache();
      const auto goes_on = [&](std::size_t pass) { return pass < last; };
      const FrameStats stats = draw(renderer, request_, passes, goes_on, in_rounds);
      EXPECT_TRUE(stats.cancelled);
      EXPECT_FALSE(stats.complete);
      EXPECT_EQ(passes.size(), last);
      Image8 picture = renderer.shade({});
      const std::uint64_t num_hits = renderer.num_hits(stats);
      EXPECT_GE(num_hits, passes.back().num_hits);
      EXPECT_GT(num_hits, 0u);
      EXPECT_TRUE(rank != 0 || picture.pixels != expected.pixels);
      return picture;
    };
    draw(renderer, request_, passes);
    ASSERT_GT(passes.size(), 40u);
    const std::size_t middle = passes.size() / 3;  // their number varies
    expect_stop(middle, false);
    const Image8 early = expect_stop(3, false);
    EXPECT_EQ(early.pixels, passes.back().picture.pixels);
    for (const std::size_t round : {1u, 3u, 5u}) {
      const Image8 lit = expect_stop(round, true);
      EXPECT_EQ(lit.pixels, passes.back().picture.pixels) << round;
    }
    renderer.render(request_);
    const Image8 picture = renderer.shade({});
    EXPECT_TRUE(rank != 0 || picture.pixels == expected.pixels);
  });
}

/// A rank may say so alone, in a pass of bricks or in a round of light rays.
TEST_P(BrickPassesOnDevice, OneRankStopsAll) {
  add_light();
  FrameRequest of_one_surface = request_;
  of_one_surface.surfaces.clear();
  for (const FrameRequest &request : {request_, of_one_surface}) {
    const Image8 expected = picture_of_one(request, options_);
    on_ranks(3, options_, [&](TeamRenderer &renderer, std::uint32_t rank) {
      std::vector<Pass> passes;
      for (const bool in_rounds : {false, true}) {
        renderer.clear_cache();
        const std::size_t last = in_rounds ? 1 : 2;
        const auto goes_on = [&](std::size_t pass) { return rank != 1 || pass < last; };
        EXPECT_TRUE(draw(renderer, request, passes, goes_on, in_rounds).cancelled);
        EXPECT_EQ(passes.size(), last);
        const Image8 picture = renderer.shade({});
        EXPECT_TRUE(rank != 0 || picture.pixels != expected.pixels);
      }
      EXPECT_FALSE(draw(renderer, request, passes).cancelled);
      EXPECT_TRUE(rank != 0 || passes.back().picture.pixels == expected.pixels);
    });
  }
}

TEST_P(BrickPassesOnDevice, OneRankStopsAFrameWithinATime) {
  request_.surfaces.clear();
  RendererOptions options = options_;
  options.with_kept_picture = true;
  on_ranks(2, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
    TimedRenderer timed(renderer);
    for (const std::size_t last : {2u, 9u}) {
      FrameRequest request = within_ms(1e9, request_);
      std::size_t calls = 0;
      request.on_pass = [&](const PassStats &) { return ++calls < last || rank != 1; };
      const FrameStats stats = timed.render(request);
      EXPECT_TRUE(stats.cancelled);
      EXPECT_EQ(calls, last);
    }
    EXPECT_TRUE(timed.render(within_ms(1e9, request_)).complete);
  });
}

/// In a pass, or in a round of light rays; the next frame is drawn as any.
TEST_P(BrickPassesOnDevice, WhereOneFailsAllDo) {
  add_light();
  const Image8 expected = whole();
  on_ranks(3, options_, [&](TeamRenderer &renderer, std::uint32_t rank) {
    for (const bool in_round : {false, true}) {
      FrameRequest request = request_;
      const std::uint64_t before = renderer.composition().reductions;
      int calls = 0;
      request.on_pass = [&](const PassStats &) {
        const bool fails = in_round ? renderer.composition().reductions > before : ++calls == 2;
        if (rank == 1 && fails) throw Error("the disk is full");
        return true;
      };
      EXPECT_THAT([&] { renderer.render(request); },
                  testing::ThrowsMessage<Error>("rank 1: the disk is full"));
    }
    renderer.render(request_);
    const Image8 picture = renderer.shade({});
    EXPECT_TRUE(rank != 0 || picture.pixels == expected.pixels);
  });
}

/// Only pictures that are asked for are put together.
TEST_P(BrickPassesOnDevice, PassesAloneSendNoWords) {
  add_slices();
  on_ranks(2, options_, [&](TeamRenderer &renderer, std::uint32_t) {
    std::array<std::uint64_t, 2> num_words{};
    for (const bool in_step : {false, true}) {
      FrameRequest request = request_;
      if (in_step) request.on_pass = [](const PassStats &) { return true; };
      const std::uint64_t before = renderer.composition().bytes;
      renderer.render(request);
      num_words[in_step ? 1 : 0] = renderer.composition().bytes - before;
    }
    EXPECT_EQ(num_words[1], num_words[0]);
  });
}

}  // namespace
}  // namespace isowave::core
