#include "bench/gpu_peer/turns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "bench/frame_measure.hpp"
#include "core/base/ms_since.hpp"
#include "core/frame/appearance.hpp"
#include "core/sources/load_volume.hpp"
#include "core/sources/memory_reader.hpp"
#include "core/stages/zfp_encode.hpp"

namespace isowave::core::bench {

namespace {

/// The voxels in the volume's own type, which float32 holds.
std::vector<std::byte> in_own_type(const VoxelsInMemory &voxels) {
  return with_voxel_type(voxels.info.type, [&]<class T>(T) {
    const std::vector<T> own(voxels.values.begin(), voxels.values.end());
    const auto bytes = std::as_bytes(std::span(own));
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  });
}

/// Compresses the voxels, at a fixed rate on the device.
CompressedVolume compress_voxels(const VoxelsInMemory &voxels, std::optional<std::uint32_t> rate,
                                 ocl::Device &device, bool measure_error) {
  const std::vector<std::byte> bytes = in_own_type(voxels);
  Storage storage{.rate = rate, .exact = !rate, .measure_error = measure_error};
  if (rate) storage.encoder = encoder_on(device);
  const auto open = [&] { return std::make_unique<MemoryReader>(voxels.info, bytes); };
  return compress_volume(open, "the volume", storage);
}

std::string name_of(std::optional<std::uint32_t> rate) {
  return rate ? fmt::format("isowave_rate_{}", *rate) : "isowave_exact";
}

}  // namespace

IsowaveSide::IsowaveSide(const ocl::DeviceInfo &device, const VoxelsInMemory &voxels,
                         ImageSize size, std::optional<std::uint32_t> rate)
    : name_(name_of(rate)) {
  const auto begin = std::chrono::steady_clock::now();
  {
    ocl::Device encodes(device);
    volume_ = compress_voxels(voxels, rate, encodes, false);
    costs_.build_ms = ms_since(begin);
    if (rate) {
      costs_.max_voxel_error =
          compress_voxels(voxels, rate, encodes, true).max_voxel_error.value_or(0);
    }
  }
  device_ = std::make_unique<ocl::Device>(device);
  renderer_ = std::make_unique<DeviceRenderer>(*device_, volume_, RendererOptions{.size = size});
  costs_.build_ms += renderer_->setup_ms();
}

GridCosts IsowaveSide::costs() const {
  GridCosts costs = costs_;
  costs.bytes = device_->ledger().peak();
  return costs;
}

namespace {

/// A frame of the work at hand.
struct Turn {
  const VolumeInfo &info;
  const Views &views;
  std::size_t view;
  bool compares;  ///< in the first round

  FrameRequest request() const {
    return {.camera = views.cameras[view],
            .isovalue = views.isovalue,
            .size = views.size,
            .normals = Normals::kCell};
  }
};

/// The first side's frame of a view, which others are compared with.
struct Expected {
  std::vector<float> depth;
  std::vector<std::uint8_t> picture;
};

template <class Work>
double wall_ms(const Work &work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return ms_since(begin);
}

void draw_turn(IsowaveSide &side, const Turn &turn, SideResult &result, Expected *expected) {
  DeviceRenderer &renderer = side.renderer();
  const FrameRequest request = turn.request();
  const FrameRequest next = seen_from(turned(request.camera), request);
  const std::pair<const char *, const FrameRequest *> frames[] = {
      {"cold", &request}, {"warm", &request}, {"next", &next}};
  // Also takes the GPU from the side before, whose context is another one.
  FrameRequest other = request;
  other.isovalue = turn.views.other_isovalue;
  renderer.render(other);
  renderer.clear_cache();
  result.ms["new"].push_back(renderer.render(request).total_ms);
  renderer.clear_cache();
  for (const auto &[kind, frame] : frames)
    result.ms[kind].push_back(renderer.render(*frame).total_ms);
  renderer.clear_cache();
  for (const auto &[kind, frame] : frames) {
    FrameArrays arrays;
    result.ms[std::string(kind) + "_picture"].push_back(wall_ms([&] {
      renderer.render(*frame);
      arrays = renderer.fetch({.picture = true}, {});
    }));
    if (expected != nullptr && frame == &request) expected->picture = arrays.picture.copy();
  }
  if (expected == nullptr) return;
  renderer.render(request);
  expected->depth = renderer.depth();
}

void draw_turn(GridSide &side, const Turn &turn, SideResult &result, HitComparison &comparison,
               const Expected &expected) {
  const View view = make_view(turn.info, turn.views.cameras[turn.view], turn.views.size);
  const ShadeParams shading = make_shade_params(turn.info, Appearance{});
  side.set_isovalue(turn.views.other_isovalue);  // as above
  side.draw(view);
  const double isovalue_ms = side.set_isovalue(turn.views.isovalue);
  double kernel_ms = 0;
  result.ms["hits"].push_back(wall_ms([&] { kernel_ms = side.draw(view); }));
  result.ms["kernel"].push_back(kernel_ms);
  result.ms["new_isovalue"].push_back(isovalue_ms);
  result.ms["new"].push_back(isovalue_ms + kernel_ms);
  std::span<const std::uint8_t> picture;
  result.ms["picture"].push_back(
      wall_ms([&] { picture = side.picture(view, shading, Normals::kCell); }));
  if (!turn.compares) return;
  std::vector<float> depth;
  for (const GridHit &hit : side.hits()) depth.push_back(hit.t);
  comparison.add(depth, expected.depth);
  result.picture_difference =
      std::max(result.picture_difference, share_of_other_bytes(picture, expected.picture));
}

}  // namespace

std::vector<SideResult> draw_in_turns(std::vector<std::unique_ptr<IsowaveSide>> &isowave,
                                      std::vector<NamedSide> &peers, const VolumeInfo &info,
                                      const Views &views) {
  const glm::dvec3 spacing = info.spacing;
  const std::size_t count = isowave.size() + peers.size();
  std::vector<SideResult> results(count);
  std::vector<HitComparison> comparisons(
      count, HitComparison(std::min({spacing.x, spacing.y, spacing.z})));
  const auto draw = [&](std::size_t side, const Turn &turn, SideResult &result,
                        std::vector<Expected> &expected) {
    if (side >= isowave.size()) {
      draw_turn(*peers[side - isowave.size()].side, turn, result, comparisons[side],
                expected[turn.view]);
      return;
    }
    Expected own;
    draw_turn(*isowave[side], turn, result, turn.compares ? &own : nullptr);
    if (!turn.compares) return;
    if (side == 0) expected[turn.view] = std::move(own);
    comparisons[side].add(side == 0 ? expected[turn.view].depth : own.depth,
                          expected[turn.view].depth);
  };
  std::vector<Expected> expected(views.cameras.size());
  // Round 0 warms up, compares, and is not counted. Then every turn begins with another side.
  for (std::uint32_t round = 0; round <= views.rounds; ++round) {
    for (std::size_t view = 0; view < views.cameras.size(); ++view) {
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t side = round == 0 ? i : (round + view + i) % count;
        SideResult not_counted;
        draw(side, {info, views, view, round == 0}, round == 0 ? not_counted : results[side],
             expected);
        results[side].picture_difference =
            std::max(results[side].picture_difference, not_counted.picture_difference);
      }
    }
  }
  for (std::size_t side = 0; side < count; ++side) {
    SideResult &result = results[side];
    result.is_isowave = side < isowave.size();
    result.name = result.is_isowave ? isowave[side]->name() : peers[side - isowave.size()].name;
    result.costs =
        result.is_isowave ? isowave[side]->costs() : peers[side - isowave.size()].side->costs();
    result.difference = comparisons[side].difference();
  }
  return results;
}

}  // namespace isowave::core::bench
