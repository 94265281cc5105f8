// Frames within a time: the steps that are drawn, what shows where time was over, and a clock that
// this file winds itself.

#include "core/frame/timed_renderer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/base/error.hpp"
#include "core/stages/march_packets.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr float kIsovalue = 0.4f;
constexpr ImageSize kSize{27, 21};  // no multiple of 8

using Hits = std::vector<HitRecord>;

bool same_bits(const HitRecord &a, const HitRecord &b) {
  return std::memcmp(&a, &b, sizeof(HitRecord)) == 0;
}

/// The picture of `size` made of a smaller one: each pixel has what covers its centre, both being
/// views of the same height.
Hits enlarged(const Hits &small, ImageSize from, ImageSize size) {
  Hits hits;
  for (std::uint32_t row = 0; row < size.height; ++row) {
    for (std::uint32_t column = 0; column < size.width; ++column) {
      const double scale = double(from.height) / size.height,
                   tiny = 1e-9;  // for centres on an edge
      const double x = (column + 0.5 - 0.5 * size.width) * scale + 0.5 * from.width;
      const double y = (row + 0.5) * scale;
      const auto at = [&](double place, std::uint32_t end) {
        return static_cast<std::size_t>(std::clamp(std::floor(place + tiny), 0.0, end - 1.0));
      };
      hits.push_back(small[at(y, from.height) * from.width + at(x, from.width)]);
    }
  }
  return hits;
}

class KeptPictureOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, KeptPictureOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(KeptPictureOnDevice, SmallPicturesCoverLargerOnes) {
  ocl::Device device(GetParam());
  for (const ImageSize full : {ImageSize{27, 21}, {16, 8}, {3, 3}, {5, 2}}) {
    const ImageSize small = halved(full, 1);
    SCOPED_TRACE(
        fmt::format("{} x {} of {} x {}", small.width, small.height, full.width, full.height));
    Wavefront rays(device, {.num_rays = full.num_pixels(), .with_pairs = false});
    KeptPicture kept(device, small.num_rays());
    Hits before(small.num_pixels()), now(full.num_pixels());
    for (std::size_t i = 0; i < before.size(); ++i) before[i].t = float(i);
    for (std::size_t i = 0; i < now.size(); ++i) now[i].t = i % 3 == 0 ? 1000.0f : INFINITY;
    Hits padded = before;
    padded.resize(full.num_pixels());
    rays.hits.write(padded);
    kept.keep(rays, small);
    rays.hits.write(now);
    rays.frame.view.width = full.width;
    rays.frame.view.height = full.height;
    const Hits everywhere = enlarged(before, small, full);
    Hits expected = now;
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (now[i].t == INFINITY) expected[i] = everywhere[i];
    }
    kept.show(rays, false);
    expect_same_hits(rays.hits.read(), expected, full.width);
    kept.show(rays, true);
    expect_same_hits(rays.hits.read(), everywhere, full.width);
    EXPECT_THROW(kept.keep(rays, full), std::invalid_argument);
  }
}

class TimeBudgetOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  /// Every look at the clock takes a millisecond for so many pixels of the picture at work.
  static constexpr double kPixelsPerMs = 10, kFullLook = 27 * 21 / kPixelsPerMs;

  TimeBudgetOnDevice()
      : volume_({14, 15, 13}, test::gyroid_field(9), 16),
        camera_(orbit_cameras(volume_.info(), 1)[0]),
        device_(GetParam().device),
        renderer_(device_, volume_.compressed,
                  GetParam().with({.size = kSize, .cache_slots = 24, .with_kept_picture = true})),
        frames_(renderer_,
                [this] { return ms_ += double(renderer_.size().num_pixels()) / kPixelsPerMs; }) {}

  /// What the renderer draws without a budget.
  Hits picture_of(ImageSize size, Normals normals = Normals::kSmooth) {
    renderer_.render({.camera = camera_, .isovalue = kIsovalue, .size = size, .normals = normals});
    return renderer_.hits();
  }

  TestVolume volume_;
  Camera camera_;
  ocl::Device device_;
  DeviceRenderer renderer_;
  double ms_ = 0;
  TimedRenderer frames_;
};
INSTANTIATE_TEST_SUITE_P(Devices, TimeBudgetOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(TimeBudgetOnDevice, HardlyAnyTimeGivesTheFewestRays) {
  const FrameStats frame = frames_.render(within_ms(1e-6, {camera_, kIsovalue}));
  const Hits shown = renderer_.hits();
  ASSERT_EQ(frame.steps.size(), 1u);
  EXPECT_FALSE(frame.steps[0].cancelled) << "there must be a picture";
  EXPECT_FALSE(frame.complete);
  EXPECT_EQ(frame.steps[0].size.width, 4u);
  EXPECT_EQ(frame.steps[0].size.height, 3u);
  const Hits small = picture_of({4, 3});
  EXPECT_GT(test::num_hits(small), 0u);
  expect_same_hits(shown, enlarged(small, {4, 3}, kSize), kSize.width);
}

/// on_pass may stop a frame at any pass, even of the smallest picture; what is there is shown.
TEST_P(TimeBudgetOnDevice, CanBeStoppedAtAnyPass) {
  FrameRequest request{camera_, kIsovalue};
  std::vector<ImageSize> sizes;
  request.on_pass = [&](const PassStats &) {
    sizes.push_back(renderer_.size());
    return true;
  };
  EXPECT_FALSE(frames_.render(within_ms(1e9, request)).cancelled);
  const std::size_t num_passes = sizes.size();
  ASSERT_GT(num_passes, 2u);
  EXPECT_EQ(sizes.front().width, 4u);
  EXPECT_EQ(sizes.back().width, kSize.width);
  for (std::size_t last = 1; last <= num_passes; ++last) {
    SCOPED_TRACE(last);
    std::size_t passes = 0;
    request.on_pass = [&](const PassStats &) { return ++passes < last; };
    const FrameStats frame = frames_.render(within_ms(1e9, request));
    // Blocks that are cached by then save passes: the frame may be whole before.
    EXPECT_TRUE(passes == last || frame.complete);
    EXPECT_EQ(frame.cancelled, passes == last);
    EXPECT_EQ(renderer_.size().width, kSize.width);
    EXPECT_EQ(renderer_.hits().size(), kSize.num_rays());
    EXPECT_TRUE(last > 1 || !frame.complete);
  }
  request.on_pass = {};
  EXPECT_TRUE(frames_.render(within_ms(1e9, request)).complete);
  expect_same_hits(renderer_.hits(), test::twin_hits(volume_, camera_, kSize, kIsovalue),
                   kSize.width);
}

TEST_P(TimeBudgetOnDevice, AmpleTimeGivesTheWholePicture) {
  const FrameStats frame = frames_.render(within_ms(1e9, {camera_, kIsovalue}));
  EXPECT_EQ(frame.steps.size(), 2u) << "nothing between the first and the full picture";
  EXPECT_TRUE(frame.complete);
  EXPECT_NEAR(frame.total_ms, ms_ - kFullLook, 1e-6);
  EXPECT_FALSE(frame.cancelled);
  expect_same_hits(renderer_.hits(), test::twin_hits(volume_, camera_, kSize, kIsovalue),
                   kSize.width);
}

/// Whatever time there is: each pixel is of the picture cancelled last, with a smooth normal or not
/// yet, or, without a hit there, of the whole one before.
TEST_P(TimeBudgetOnDevice, ThePictureBeforeShowsThrough) {
  std::size_t num_mixed = 0, num_complete = 0;
  for (double budget = 20; budget < 2e4; budget *= 1.5) {
    SCOPED_TRACE(fmt::format("budget {}", budget));
    renderer_.clear_cache();
    const double begin = ms_ + double(renderer_.size().num_pixels()) / kPixelsPerMs;
    const FrameStats frame = frames_.render(within_ms(budget, {camera_, kIsovalue}));
    const Hits shown = renderer_.hits();
    ASSERT_FALSE(frame.steps.empty());
    EXPECT_NEAR(frame.total_ms, ms_ - begin, 1e-6);
    Hits expected;
    ImageSize size;  // of the step before
    for (const TimedStep &step : frame.steps) {
      EXPECT_TRUE(step.cancelled || step.completed_percent == 100);
      EXPECT_TRUE(!step.cancelled || &step == &frame.steps.back());
      const Hits hits = enlarged(picture_of(step.size), step.size, kSize);
      if (!step.cancelled) {
        expected = hits;
        size = step.size;
        continue;
      }
      // Which rays were through cannot be known from outside; what shows must be one of both.
      const Hits rough = enlarged(picture_of(step.size, Normals::kCell), step.size, kSize);
      const Hits under = enlarged(enlarged(picture_of(size), size, step.size), step.size, kSize);
      std::size_t num_new = 0, num_old = 0;
      for (std::size_t i = 0; i < shown.size(); ++i) {
        const bool is_new = same_bits(shown[i], hits[i]) || same_bits(shown[i], rough[i]),
                   is_old = same_bits(shown[i], under[i]);
        EXPECT_TRUE(is_new || is_old) << "pixel " << i;
        num_new += is_new && !is_old;
        num_old += is_old && !is_new;
      }
      num_mixed += num_new > 0 && num_old > 0;
    }
    if (!frame.steps.back().cancelled) expect_same_hits(shown, expected, kSize.width);
    num_complete += frame.complete;
    EXPECT_EQ(frame.complete,
              !frame.steps.back().cancelled && frame.steps.back().size.width == kSize.width);
  }
  EXPECT_GT(num_complete, 0u);
  EXPECT_GT(num_mixed, 0u);
  expect_same_hits(picture_of(kSize), test::twin_hits(volume_, camera_, kSize, kIsovalue),
                   kSize.width);
}

/// The budget is kept where passes take no longer than the one before, but for the first picture
/// and what follows the last pass.
TEST_P(TimeBudgetOnDevice, BudgetIsKeptWhenPassesTakeWhatIsExpected) {
  for (double budget = 15; budget < 1000; budget *= 1.4) {
    renderer_.clear_cache();
    const FrameStats frame = frames_.render(within_ms(budget, {camera_, kIsovalue}));
    const double look = double(frame.steps.back().size.num_pixels()) / kPixelsPerMs;
    EXPECT_LE(frame.total_ms, std::max(budget, frame.steps[0].ms) + 2 * look + kFullLook);
  }
}

/// The arrays are to be there in time, too: the last frame's tell how long they take.
TEST_P(TimeBudgetOnDevice, TimeIsLeftForArrays) {
  class SlowFetch : public RendererAround {
   public:
    SlowFetch(Renderer &inner, double &now, const double &fetch_ms)
        : RendererAround(inner), now_(now), fetch_ms_(fetch_ms) {}
    FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override {
      now_ += fetch_ms_;
      return RendererAround::fetch(wanted, appearance);
    }

   private:
    double &now_;
    const double &fetch_ms_;
  };
  double now = 0, fetch_ms = 2e6;
  SlowFetch slow(renderer_, now, fetch_ms);
  TimedRenderer frames(slow, [&now] { return now += 1; });
  FrameRequest request{camera_, kIsovalue};
  const auto num_steps = [&] {
    request.isovalue = request.isovalue == kIsovalue ? 0.41f : kIsovalue;  // begins anew
    return frames.render(within_ms(1e6, request)).steps.size();
  };
  EXPECT_EQ(num_steps(), 2u);
  frames.fetch({.depth = true}, {});
  EXPECT_EQ(num_steps(), 1u) << "no time is left for a second one";
  fetch_ms = 0;
  request.on_pass = [&](const PassStats &) { return frames.depth().size() != 0; };
  EXPECT_EQ(num_steps(), 1u) << "pictures of passes do not count";
  frames.fetch({.depth = true}, {});
  EXPECT_EQ(num_steps(), 2u);
}

/// With several rays a pixel, steps count rays; each but the last has one for each of its pixels.
TEST_P(TimeBudgetOnDevice, SeveralRaysAPixel) {
  constexpr ImageSize kNine{9, 7, 3};
  DeviceRenderer renderer(device_, volume_.compressed,
                          GetParam().with({.size = kNine, .with_kept_picture = true}));
  TimedRenderer frames(renderer);
  const FrameStats whole = frames.render(within_ms(1e9, {camera_, kIsovalue}));
  EXPECT_TRUE(whole.complete);
  EXPECT_EQ(whole.steps.back().size.samples, 3u);
  expect_same_hits(renderer.hits(), test::twin_hits(volume_, camera_, kSize, kIsovalue),
                   kSize.width);
  const FrameStats coarse = frames.render(within_ms(1e-6, {camera_, kIsovalue}));
  EXPECT_EQ(coarse.steps[0].size.width, 4u);
  EXPECT_EQ(coarse.steps[0].size.samples, 1u);
  expect_same_hits(renderer.hits(), enlarged(picture_of({4, 3}), {4, 3}, kSize), kSize.width);
  const Image8 shown = renderer.shade();
  EXPECT_EQ(shown.width, kNine.width);
  EXPECT_EQ(shown.height, kNine.height);
}

TEST_P(TimeBudgetOnDevice, NoTimeIsRefused) {
  for (const double budget : {0.0, -1.0, double(NAN), double(INFINITY)}) {
    EXPECT_THAT(
        [&] {
          frames_.render(within_ms(budget, {camera_, kIsovalue}));
        },
        ThrowsMessage<Error>(HasSubstr("no picture can be drawn")));
  }
  EXPECT_THROW(frames_.render(within_ms(1, {camera_, NAN})), Error);
  EXPECT_THAT(
      [&] {
        frames_.render(within_ms(1, {camera_, kIsovalue, ImageSize{1, 27 * 21}}));
      },
      ThrowsMessage<Error>(HasSubstr("cannot be kept")));
  EXPECT_THAT([&] { renderer_.hits(); }, ThrowsMessage<Error>(HasSubstr("no frame")))
      << "nothing was drawn";
  DeviceRenderer plain(device_, volume_.compressed, GetParam().with({.size = kSize}));
  EXPECT_THROW(TimedRenderer{plain}, Error);
  plain.render({camera_, kIsovalue});
  EXPECT_THROW(plain.keep_picture(), Error);
}

/// A picture of each width takes a time that does not grow as its pixels do, as on a GPU: a whole
/// picture that has time behind the smallest one is drawn from the second frame on. If it once took
/// too long, it is tried again later.
TEST_P(TimeBudgetOnDevice, AWholePictureThatHasTimeIsDrawn) {
  using Times = std::map<std::uint32_t, double>;
  class SlowPictures : public RendererAround {
   public:
    SlowPictures(Renderer &inner, double &now, const Times &times)
        : RendererAround(inner), now_(now), times_(times) {}
    /// Three quarters of the time go to the first pass, the rest to the second.
    FrameStats render(const FrameRequest &request) override {
      FrameRequest slow = request;
      const double whole_ms = times_.at(request.size->width);
      double pass_ms = 0.75 * whole_ms;
      slow.on_pass = [&](const PassStats &pass) {
        now_ += pass_ms;
        pass_ms = pass_ms > 0.5 * whole_ms ? 0.25 * whole_ms : 0;
        return request.on_pass(pass);
      };
      return inner().render(slow);
    }

   private:
    double &now_;
    const Times &times_;
  };
  double now = 0;
  Times times{{4, 0.9}, {7, 1.1}, {14, 1.6}, {27, 3.1}};
  SlowPictures slow(renderer_, now, times);
  TimedRenderer frames(slow, [&now] { return now; });
  const auto draw = [&](double budget_ms) {
    return frames.render(within_ms(budget_ms, {camera_, kIsovalue}));
  };
  EXPECT_FALSE(draw(5).complete) << "how long it takes is not known yet";
  for (int i = 0; i < 3; ++i) {
    const FrameStats frame = draw(5);
    EXPECT_TRUE(frame.complete);
    EXPECT_EQ(frame.steps.size(), 2u);
    EXPECT_LE(frame.total_ms, 4.0 + 1e-9);
  }
  EXPECT_EQ(draw(6.3).steps.size(), 1u) << "there is time for it twice";
  EXPECT_LE(draw(3.5).total_ms, 3.5);
  times[27] = 8;
  renderer_.clear_cache();
  EXPECT_FALSE(draw(5).complete);
  times[27] = 3.1;
  EXPECT_LE(draw(5.6).total_ms, 5.6) << "it is not tried again at once";
  bool is_complete = false;
  for (int i = 0; i < 20 && !is_complete; ++i) {
    const FrameStats frame = draw(5.6);
    is_complete = frame.complete;
    EXPECT_LE(frame.total_ms, 5.6);
  }
  EXPECT_TRUE(is_complete);
}

/// The first picture of an isovalue is the smallest; later frames begin with what has time twice.
TEST_P(TimeBudgetOnDevice, FurtherFramesBeginWithTheLargestPictureThatHadTime) {
  const FrameRequest request{camera_, kIsovalue};
  const auto sizes_within = [&](double budget_ms, float isovalue) {
    FrameRequest other = request;
    other.isovalue = isovalue;
    std::vector<std::uint32_t> widths;
    for (const auto &step : frames_.render(within_ms(budget_ms, other)).steps)
      widths.push_back(step.size.width);
    return widths;
  };
  const auto first = sizes_within(1e9, kIsovalue);
  ASSERT_GT(first.size(), 1u);
  EXPECT_EQ(first.front(), 4u);
  EXPECT_EQ(first.back(), kSize.width);
  EXPECT_EQ(sizes_within(1e9, kIsovalue), std::vector{kSize.width});
  expect_same_hits(renderer_.hits(), picture_of(kSize), kSize.width);
  EXPECT_EQ(sizes_within(1e9, 0.5f).front(), 4u) << "another isovalue";
  EXPECT_EQ(sizes_within(1e-6, 0.5f), std::vector{4u}) << "hardly any time";
}

/// On a GPU, coarse levels draw small pictures; elsewhere, the levels of the whole picture do.
TEST(TimeBudgetOnDevice, LevelsDrawWhatTheyAreFineEnoughFor) {
  const glm::uvec3 dims(40, 36, 44);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::sphere_field(dims)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 0});
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  for (const ocl::DeviceInfo &info : devices_under_test()) {
    ocl::Device device(info);
    DeviceRenderer renderer(device, volume,
                            {.size = kSize, .with_levels = true, .with_kept_picture = true});
    TimedRenderer frames(renderer);
    const bool pays = renderer.abilities().levels_pay;
    EXPECT_EQ(pays, !MarchPackets::suits(info));
    const FrameStats small = frames.render(within_ms(1e-6, {camera, 0.5f}));
    ASSERT_EQ(small.steps.size(), 1u);
    EXPECT_EQ(small.steps[0].voxel_pixels, pays ? 1.0 : 0.0);
    EXPECT_EQ(small.first_level > 0, pays);
    FrameRequest request{camera, 0.5f};
    request.voxel_pixels = 16;
    const FrameStats coarse = frames.render(within_ms(1e-6, request));
    EXPECT_EQ(coarse.steps[0].voxel_pixels, 2.0) << "of the small picture's pixels";
    EXPECT_GT(coarse.last_level, 0u);
    const FrameStats fine = frames.render(within_ms(1e9, {camera, 0.5f}));
    EXPECT_TRUE(fine.complete);
    EXPECT_EQ(fine.last_level, 0u);
    const std::vector<float> voxels = decode_with_libzfp(volume);
    expect_same_hits(renderer.hits(),
                     test::twin_hits(make_frame_params(volume.info, camera, kSize, 0.5f), voxels),
                     kSize.width);
  }
}

}  // namespace
}  // namespace isowave::core
