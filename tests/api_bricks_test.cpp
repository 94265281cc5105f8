// make_team_renderer(): threads in the place of processes draw together what one renderer draws.
// tools/python/tests/test_bricks.py has real ones.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <isowave/isowave.hpp>
#include <memory>
#include <thread>
#include <utility>

#include "tests/api_support.hpp"
#include "tests/thread_meeting.hpp"

namespace isowave {
namespace {

const std::string kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";
constexpr std::uint32_t kCount = 2;

class ThreadProcess : public Processes {
 public:
  ThreadProcess(core::test::ThreadMeeting &meeting, std::uint32_t rank)
      : meeting_(meeting), rank_(rank) {}
  std::uint32_t rank() const override { return rank_; }
  std::uint32_t size() const override { return kCount; }
  std::uint32_t local_rank() const override { return rank_; }
  std::vector<std::string> all_gather(const std::string &bytes) override {
    if (on_gather) on_gather();
    return meeting_.all_gather(rank_, bytes);
  }
  void reduce(std::span<std::uint64_t> words, Reduction how, bool for_all) override {
    using Of = core::Reduction;
    meeting_.reduce(rank_, words,
                    how == Reduction::kMin           ? Of::kMin
                    : how == Reduction::kMinOfHalves ? Of::kMinOfHalves
                                                     : Of::kOr,
                    for_all);
  }

  std::function<void()> on_gather{};

 private:
  core::test::ThreadMeeting &meeting_;
  std::uint32_t rank_;
};

/// Calls work(processes, rank) in a thread for each.
template <class Work>
void in_threads(const Work &work) {
  core::test::ThreadMeeting meeting(kCount);
  std::vector<std::jthread> threads;
  for (std::uint32_t rank = 0; rank < kCount; ++rank) {
    threads.emplace_back([&, rank] {
      ThreadProcess process(meeting, rank);
      work(process, rank);
    });
  }
}

TEST(ApiBricks, DrawWhatOneRendererDraws) {
  const Compression exact{.exact = true};
  FrameRequest request{.isovalue = 40, .size = {48, 32}, .want_depth = true, .want_normals = true};
  Renderer whole(open_device(), open_volume(kFuel, exact), {.largest = {48, 32}});
  request.camera = whole.camera(40);
  const Frame expected = whole.render(request);
  in_threads([&](Processes &processes, std::uint32_t rank) {
    Renderer renderer =
        make_team_renderer(processes, kFuel, exact, {}, {.renderer = {.largest = {48, 32}}});
    FrameRequest own = request;
    own.camera = renderer.camera(40);
    EXPECT_EQ(own.camera.eye, request.camera.eye);
    const Frame frame = renderer.render(own);
    EXPECT_EQ(frame.picture, rank == 0 ? expected.picture : std::vector<std::uint8_t>());
    EXPECT_EQ(frame.depth, rank == 0 ? expected.depth : std::vector<float>());
    EXPECT_EQ(frame.normals.size(), rank == 0 ? expected.normals.size() : 0u);
    if (rank == 0) {
      EXPECT_EQ(frame.normals, expected.normals);
      EXPECT_EQ(frame.statistics.hits, expected.statistics.hits);
    }
  });
  EXPECT_GT(expected.statistics.hits, 100u);
}

TEST(ApiBricks, SurfacesOfOneRenderer) {
  const Compression exact{.exact = true};
  FrameRequest request{.size = {48, 32}, .want_depth = true, .want_normals = true};
  request.surfaces = {{.isovalue = 20, .opacity = 0.4f}, {90, {0.2f, 0.4f, 0.9f}, 0.7f}};
  const RendererOptions options{.largest = {48, 32}, .with_surfaces = 2};
  Renderer whole(open_device(), open_volume(kFuel, exact), options);
  request.camera = whole.camera(request.surfaces);
  const Frame expected = whole.render(request);
  in_threads([&](Processes &processes, std::uint32_t rank) {
    Renderer renderer = make_team_renderer(processes, kFuel, exact, {}, {.renderer = options});
    EXPECT_EQ(renderer.camera(request.surfaces).eye, request.camera.eye);
    const Frame frame = renderer.render(request);
    EXPECT_EQ(frame.picture, rank == 0 ? expected.picture : std::vector<std::uint8_t>());
    EXPECT_EQ(frame.depth, rank == 0 ? expected.depth : std::vector<float>());
    EXPECT_EQ(frame.statistics.layers, expected.statistics.layers);
    EXPECT_EQ(frame.statistics.layer_hits, expected.statistics.layer_hits);
    if (rank == 0) {
      EXPECT_EQ(frame.normals, expected.normals);
      EXPECT_EQ(frame.statistics.hits, expected.statistics.hits);
    }
    std::vector<std::uint8_t> last;
    FrameRequest in_passes = request;
    in_passes.on_pass = [&](const Progress &progress) {
      last = progress.picture();
      return true;
    };
    EXPECT_EQ(renderer.render(in_passes).depth, frame.depth);
    EXPECT_EQ(last, frame.picture);
    in_passes.on_pass = [&](const Progress &progress) {
      return rank == 0 || progress.passes() < 3;
    };
    const Frame stopped = renderer.render(in_passes);
    EXPECT_TRUE(stopped.statistics.cancelled);
    EXPECT_EQ(stopped.picture.size(), frame.picture.size());
    in_passes = request;
    if (rank == 1) in_passes.on_pass = [](const Progress &) { return true; };
    EXPECT_THAT(core::test::error_of([&] { renderer.render(in_passes); }),
                testing::HasSubstr("rank 1 has another request"));
  });
  EXPECT_GT(expected.statistics.layers, 4u);
}

/// Each process keeps what it needs of the field. Labels have their own colours.
TEST(ApiBricks, FieldsAndLabelsOfOneRenderer) {
  const Compression exact{.exact = true};
  const std::shared_ptr<const Volume> fuel = open_volume(kFuel, exact);
  for (const bool draws_labels : {false, true}) {
    FrameRequest request{.isovalue = 40, .size = {48, 32}, .want_field = true};
    RendererOptions options{.largest = {48, 32}};
    if (draws_labels) {
      options.with_surfaces = 2;
      options.with_labels = true;
      request.want_field = false;
      request.surfaces = {{.opacity = 0.4f, .labels = {20, 21, 22, 40}}, {.labels = {90, 91, 92}}};
    }
    request.appearance.color_by_field = true;
    request.appearance.color_by_label = draws_labels;
    request.appearance.color_map = draws_labels ? "labels" : "viridis";
    RendererOptions of_one = options;
    of_one.field = fuel;
    Renderer whole(open_device(), fuel, of_one);
    request.camera = draws_labels ? whole.camera(request.surfaces) : whole.camera(40);
    const Frame expected = whole.render(request);
    in_threads([&](Processes &processes, std::uint32_t rank) {
      Renderer renderer =
          make_team_renderer(processes, kFuel, exact, {}, {.field = kFuel, .renderer = options});
      const Frame frame = renderer.render(request);
      EXPECT_EQ(frame.statistics.field_range, expected.statistics.field_range);
      EXPECT_EQ(frame.picture, rank == 0 ? expected.picture : std::vector<std::uint8_t>());
      EXPECT_EQ(frame.field.size(), rank == 0 ? expected.field.size() : 0u);
    });
    EXPECT_GT(expected.statistics.hits, 50u);
  }
  in_threads([&](Processes &processes, std::uint32_t) {
    EXPECT_THAT(core::test::error_of([&] {
                  make_team_renderer(processes, kFuel, exact, {}, {.renderer = {.field = fuel}});
                }),
                testing::HasSubstr("a team's field is a file: give BrickOptions::field"));
  });
}

/// Also of a volume whose error is known only when it is compressed, brick by brick.
TEST(ApiBricks, BoundsOfOneRenderer) {
  const Compression at_rate{.rate = 20, .measure_error = true};
  FrameRequest request{
      .isovalue = 40, .size = {48, 32}, .max_surface_error = 2, .want_bounds = true};
  const RendererOptions options{.largest = {48, 32}, .with_bounds = true};
  Renderer whole(open_device(), open_volume(kFuel, at_rate), options);
  request.camera = whole.camera(40);
  const Frame expected = whole.render(request);
  EXPECT_GT(expected.detail.value().voxel_error, 0) << "bit planes are left out";
  in_threads([&](Processes &processes, std::uint32_t rank) {
    Renderer renderer =
        make_team_renderer(processes, kFuel, {.rate = 20}, {}, {.renderer = options});
    const Frame frame = renderer.render(request);
    EXPECT_EQ(frame.bounds, rank == 0 ? expected.bounds : std::vector<float>());
    EXPECT_EQ(frame.picture, rank == 0 ? expected.picture : std::vector<std::uint8_t>());
    ASSERT_EQ(frame.detail.has_value(), rank == 0);
    if (rank == 0) {
      EXPECT_EQ(frame.detail->voxel_error, expected.detail->voxel_error);
      EXPECT_EQ(frame.detail->voxel_pixels, expected.detail->voxel_pixels);
    }
  });
}

/// A call of the renderer that waits for them.
TEST(ApiBricks, CallsFromItsOwnProcessesAreRefused) {
  in_threads([](ThreadProcess &processes, std::uint32_t) {
    Renderer renderer =
        make_team_renderer(processes, kFuel, {}, {}, {.renderer = {.largest = {16, 16}}});
    FrameRequest request{.isovalue = 40, .size = {16, 16}};
    request.camera = renderer.camera(40);
    std::string error;
    bool is_first = true;
    processes.on_gather = [&] {
      if (!std::exchange(is_first, false)) return;
      try {
        renderer.render(request);
      } catch (const Error &refused) {
        error = refused.what();
      }
    };
    renderer.render(request);
    EXPECT_THAT(error, testing::HasSubstr("at work"));
  });
}

TEST(ApiBricks, WhatGoesWrongIsThrownAtAll) {
  in_threads([&](Processes &processes, std::uint32_t rank) {
    const auto expect_error = [](const auto &work, const std::string &text) {
      try {
        work();
        ADD_FAILURE() << "no error: " << text;
      } catch (const Error &error) {
        EXPECT_THAT(error.what(), testing::HasSubstr(text));
      }
    };
    const auto make = [&](const std::string &path, const BrickOptions &options) {
      return make_team_renderer(processes, path, {}, {}, options);
    };
    const BrickOptions small{.renderer = {.largest = {16, 16}}};
    expect_error([&] { make(rank == 1 ? "nowhere.zfp" : kFuel, small); }, "rank 1: nowhere.zfp");
    expect_error(
        [&] {
          make(kFuel, {.renderer = {.largest = {16 + rank, 16}}});
        },
        "rank 1 has another request");
    expect_error(
        [&] {
          make(kFuel, {.renderer = {.largest = {16, 16}, .with_surfaces = rank}});
        },
        "rank 1 has another request");
    Renderer renderer = make(kFuel, small);
    FrameRequest request{.isovalue = 40, .size = {16, 16}};
    request.camera = renderer.camera(40);
    request.want_positions = true;
    expect_error([&] { renderer.render(request); }, "leave out want_positions");
    request.want_positions = false;
    request.want_bounds = true;
    expect_error([&] { renderer.render(request); }, "made with_bounds");
    request.want_bounds = false;
    request.surfaces = {{.isovalue = 40}};
    expect_error([&] { renderer.render(request); }, "made with_surfaces");
    request.surfaces.clear();
    request.isovalue = static_cast<float>(40 + rank);
    expect_error([&] { renderer.render(request); }, "rank 1 has another request");
    request.isovalue = 40;
    EXPECT_EQ(renderer.render(request).picture.size(), rank == 0 ? 3u * 16 * 16 : 0u);
  });
}

TEST(ApiBricks, PicturesWithinATimeAndPassByPass) {
  in_threads([](Processes &processes, std::uint32_t rank) {
    Renderer renderer = make_team_renderer(
        processes, kFuel, {}, {}, {.renderer = {.largest = {48, 32}, .with_time_budget = true}});
    FrameRequest request{.camera = renderer.camera(40), .isovalue = 40, .size = {48, 32}};
    const std::vector<std::uint8_t> whole = renderer.render(request).picture;
    std::uint32_t passes = 0;
    request.on_pass = [&](const Progress &progress) {
      ++passes;
      EXPECT_EQ(progress.picture().size(), rank == 0 ? 3u * 48 * 32 : 0u);
      return true;
    };
    EXPECT_EQ(renderer.render(request).picture, whole);
    EXPECT_GT(passes, 0u);
    request.on_pass = {};
    request.time_budget_ms = 1e6;
    const Frame in_time = renderer.render(request);
    EXPECT_TRUE(in_time.statistics.complete);
    EXPECT_EQ(in_time.picture, whole);
    request.time_budget_ms = 1e-6;
    EXPECT_FALSE(renderer.render(request).statistics.complete);
  });
}

}  // namespace
}  // namespace isowave
