#include "core/accuracy/choose_detail.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/view/detail.hpp"

namespace isowave::core {

namespace {

/// Stride of the small picture's pixels in the frame, along each axis, and its fewest rows.
constexpr std::uint32_t kMaxStride = 8, kMinRows = 64;
/// Distances between voxels that may be chosen: 8 pixels, and so many times an eighth of an octave
/// less.
constexpr int kNumVoxelPixels = 41;
std::vector<double> all_voxel_pixels() {
  std::vector<double> errors;
  errors.reserve(kNumVoxelPixels);
  for (int i = 0; i < kNumVoxelPixels; ++i) errors.push_back(std::exp2(3.0 - 0.125 * i));
  return errors;
}

/// Number of errors of voxels that may be chosen. The largest is an eighth of the range of values,
/// and each further one is half of the one before. Errors that are small beside the volume's own,
/// or that leave out no bit planes, are dropped.
constexpr int kNumValueErrors = 8;
std::vector<double> voxel_errors(const CompressedVolume &volume, double error) {
  const double range = double{volume.value_range[1]} - double{volume.value_range[0]};
  double voxel_error = std::exp2(std::floor(std::log2(std::max(range, 1e-30) / 8)));
  std::vector<double> errors;
  errors.reserve(kNumValueErrors);
  for (int i = 0; i < kNumValueErrors && voxel_error > error / 2; ++i, voxel_error /= 2) {
    if (plane_error(volume.precision, voxel_error) != 0) errors.push_back(voxel_error);
  }
  return errors;
}

/// Blocks that frames of levels of detail decode for these hits, against those of the finest level
/// alone: a pixel covers blocks by the square of its distance, and of each level a quarter as many.
double blocks_share(std::span<const float> depth, std::span<const FrameParams> frames) {
  double with_levels = 0, finest = 0;
  for (const float t : depth) {
    if (std::isinf(t)) continue;
    int level = 0;
    for (std::size_t i = 1; i < frames.size(); ++i) {
      if (draws(frames[i]) && frames[i].band.begin_t * frames[i].view.t_scale <= t)
        level = static_cast<int>(i);
    }
    const double blocks = double{t} * double{t};
    finest += blocks;
    with_levels += std::ldexp(blocks, -2 * level);
  }
  return finest == 0 ? 1.0 : with_levels / finest;
}

/// An error of at least so much can be kept in any volume of these values: 2^-24 of the next power
/// of two above them is lost by the cast to float32 and another by zfp, at most, or all of a value
/// that is flushed to 0.
double least_tolerance(const std::array<float, 2> &range) {
  return std::max(std::ldexp(double{std::max(std::abs(range[0]), std::abs(range[1]))}, -22),
                  2 * double{kMinMagnitude});
}

/// Two digits, which are not more.
double rounded_down(double value) {
  const double digit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return std::floor(value / digit) * digit;
}

/// Says what would help where most pixels do not keep max_surface_error. error: of the volume's
/// voxels.
void advise(const CompressedVolume &volume, double error, double max_surface_error,
            DetailChoice &choice) {
  const double least = least_tolerance(volume.value_range);
  if (choice.median > max_surface_error && error > 0) {
    const double tolerance = rounded_down(error * max_surface_error / choice.median);
    if (tolerance >= least && tolerance < error) choice.tolerance = tolerance;
  }
  const std::string half =
      fmt::format("at full detail half of those with a bound are within {:.3g}", choice.median);
  if (choice.tolerance) {
    choice.advice = fmt::format("{}; a volume converted with --tolerance {:.2g} would do", half,
                                *choice.tolerance);
  } else if (error <= least) {
    choice.advice = "voxels can hardly be stored with a smaller error than these have";
  } else if (choice.median > max_surface_error) {
    choice.advice = fmt::format("{}; no error that voxels can be stored with would do", half);
  } else {
    choice.advice = fmt::format(
        "most have no bound at all; with voxels that are off by less than these, by up to {:.3g}, "
        "more would",
        error);
  }
}

}  // namespace

DetailChoice choose_detail(Renderer &renderer, const CompressedVolume &volume, double rate,
                           const FrameRequest &request, double max_surface_error) {
  check_max_surface_error(max_surface_error);
  const auto begin = std::chrono::steady_clock::now();
  Team &team = renderer.team();
  const Abilities abilities = renderer.abilities();
  check(request, abilities);
  const ImageSize size = size_of(request, abilities);
  const std::vector<VolumeInfo> levels = renderer.levels();
  const std::uint32_t pixels = std::clamp(size.height / kMinRows, 1u, kMaxStride);
  const ImageSize small{std::max(size.width / pixels, 1u), size.height / pixels};
  const double stride = double(size.height) / small.height;
  // Neither is known: certify() throws.
  const double error = known_voxel_error(volume).value_or(double{largest_bound(volume.bounds)});
  DetailChoice choice;
  const auto try_out = [&](const Detail &detail) {
    FrameRequest sample = with_detail(request, {detail.voxel_pixels / stride, detail.voxel_error});
    sample.normals = Normals::kCell;
    sample.ambient_rays = 0;
    sample.size = small;
    sample.on_pass = {};
    renderer.render(sample);
    std::vector<float> depth = renderer.depth();
    const CertificateSummary summary =
        of_first(team, std::vector{summarize(certify(renderer, volume, sample, depth),
                                             max_surface_error / stride)})
            .front();
    const double all = std::max<double>(double(summary.num_pixels), 1);
    choice.tries.push_back(
        {detail, summary.num_pixels == 0 ? 1.0 : double(summary.num_certified) / all});
    return std::pair(summary, std::move(depth));
  };
  const auto [at_full_detail, finest_depth] = try_out({});
  choice.median = stride * at_full_detail.median;
  const double best = choice.tries.front().certified;
  choice.reachable = best >= 0.5;
  if (!choice.reachable) advise(volume, error, max_surface_error, choice);
  const auto suffices = [&](const Detail &detail) {
    try_out(detail);
    return choice.tries.back().certified >= best - kLostShare;
  };
  // The first of descending numbers that suffices, or 0. Nearly always, what suffices does so with
  // any less, too: a bisection.
  const auto first_to_suffice = [&](const std::vector<double> &all, const auto &detail_of) {
    const std::vector<double> numbers = of_first(team, all);
    const auto found = std::ranges::partition_point(
        numbers, [&](double number) { return !suffices(detail_of(number)); });
    return found == numbers.end() ? 0.0 : *found;
  };
  // Beside voxels without data, coarser levels have no bound.
  if (choice.reachable && levels.size() > 1 && volume.no_data.empty()) {
    const double coarsest = first_to_suffice(all_voxel_pixels(), [](double voxel_pixels) {
      return Detail{voxel_pixels, 0};
    });
    const std::vector<FrameParams> level_frames =
        make_level_frames(levels, request.camera, size, request.isovalue, coarsest);
    const double share =
        of_first(team, std::vector{blocks_share(finest_depth, level_frames)}).front();
    if (share <= kMaxBlocksShare) choice.detail.voxel_pixels = coarsest;
  }
  if (choice.reachable && rate > kMinPlaneRate && !volume.precision.is_reversible()) {
    choice.detail.voxel_error =
        first_to_suffice(voxel_errors(volume, error), [&](double voxel_error) {
          return Detail{choice.detail.voxel_pixels, voxel_error};
        });
  }
  choice.total_ms = ms_since(begin);
  return choice;
}

}  // namespace isowave::core
