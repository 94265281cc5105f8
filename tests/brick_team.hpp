#pragma once
// Teams of threads that draw a volume's bricks together, each on a device of its own.

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include "core/bricks/brick_volume.hpp"
#include "core/bricks/team_renderer.hpp"
#include "core/view/detail.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"
#include "tests/thread_meeting.hpp"

namespace isowave::core::test {

class ThreadTeam : public Team {
 public:
  ThreadTeam(ThreadMeeting &meeting, std::uint32_t rank) : meeting_(meeting), rank_(rank) {}
  std::uint32_t rank() const override { return rank_; }
  std::uint32_t size() const override { return meeting_.size(); }
  std::vector<std::string> all_gather(const std::string &text) override {
    return meeting_.all_gather(rank_, text);
  }
  void reduce(std::size_t count, Reduction how, Receiver who, const MakeWords &make,
              const TakeWords &take) override {
    const bool for_all = who == Receiver::kAll;
    reduce_in_pieces(count, for_all || rank_ == 0, make, take, [&](std::span<std::uint64_t> words) {
      meeting_.reduce(rank_, words, how, for_all);
    });
  }

 private:
  ThreadMeeting &meeting_;
  std::uint32_t rank_;
};

inline constexpr float kBrickIsovalue = 0.2f;
inline constexpr ImageSize kBrickFrame{49, 33};

class BrickTeam : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (is_llvmpipe(GetParam()) && !long_tests())
      GTEST_SKIP() << "llvmpipe takes minutes to compile the kernels of bricks";
  }

  using Work = std::function<void(TeamRenderer &renderer, std::uint32_t rank)>;

  /// Each rank of a team does this with its brick.
  void on_ranks(std::uint32_t size, const RendererOptions &options, const Work &work) {
    on_ranks(size, volume_.compressed, nullptr, options, work);
  }

  /// The same of any volume.
  ///
  /// field  each rank keeps what its brick needs; null: none; the volume: bricks are their own
  ///        fields
  void on_ranks(std::uint32_t size, const CompressedVolume &volume, const CompressedVolume *field,
                const RendererOptions &options, const Work &work) {
    const std::vector<VolumeInfo> whole = level_infos(volume, options.with_levels);
    const Cuts cuts(blocks_along(volume.info), size, num_blocks, cut_unit(whole.size()));
    ThreadMeeting meeting(size);
    std::vector<std::jthread> threads;
    for (std::uint32_t rank = 0; rank < size; ++rank) {
      threads.emplace_back([&, rank] {
        ThreadTeam team(meeting, rank);
        ocl::Device device(GetParam());
        const BlockBox &own = cuts.bricks()[rank];
        const CompressedVolume brick = cut_brick(volume, own, whole.size());
        CompressedVolume other;
        RendererOptions of_rank = options;
        if (field == &volume) of_rank.field = &brick;
        if (field != nullptr && field != &volume) {
          other = cut_brick(*field, field_blocks(volume.info, own, field->info));
          of_rank.field = &other;
        }
        std::optional<TeamRenderer> renderer;
        in_turns(team, rank == 0,
                 [&] { renderer.emplace(device, brick, of_rank, cuts, whole, team); });
        work(*renderer, rank);
      });
    }
  }

  /// What one renderer draws.
  Image8 picture_of_one(const FrameRequest &request, const RendererOptions &options,
                        const Appearance &appearance = {}) {
    ocl::Device device(GetParam());
    DeviceRenderer renderer(device, volume_.compressed, options);
    renderer.render(request);
    return renderer.shade(appearance);
  }

  TestVolume volume_{{37, 30, 26}, gyroid_field(9)};
  Camera camera_ = orbit_cameras(volume_.info(), 3)[1];
  FrameRequest request_{.camera = camera_, .isovalue = kBrickIsovalue};
};

}  // namespace isowave::core::test
