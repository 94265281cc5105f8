#include "core/accuracy/choose_detail.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/base/error.hpp"
#include "core/view/detail.hpp"

namespace isowave {

namespace {

/// Of the small picture: a pixel for so many of the frame along each axis, but no fewer rows.
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

/// What values may lose: an eighth of their range, and so many times half of it, as long as that
/// matters beside the error that the volume has anyway, and leaves out bit planes.
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
double blocks_share(std::span<const HitRecord> hits, std::span<const FrameParams> frames) {
  double with_levels = 0, finest = 0;
  for (const HitRecord &hit : hits) {
    if (std::isinf(hit.t)) continue;
    int level = 0;
    for (std::size_t i = 1; i < frames.size(); ++i) {
      if (draws(frames[i]) && frames[i].begin_t * frames[i].t_scale <= hit.t)
        level = static_cast<int>(i);
    }
    const double blocks = double{hit.t} * double{hit.t};
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

void check_max_surface_error(double max_surface_error) {
  if (!(max_surface_error > 0) || !std::isfinite(max_surface_error))
    throw Error("an error of {} pixels cannot be kept: give more than 0", max_surface_error);
}

RendererOptions with_choices(RendererOptions options, const CompressedVolume &volume) {
  options.with_bounds = true;
  options.with_levels = !volume.coarser_levels.empty();
  return options;
}

namespace {

/// A smaller picture of the frame, on which details are tried out.
class Trial {
 public:
  Trial(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
        double max_surface_error, std::vector<DetailChoice::Try> &tries)
      : renderer_(renderer),
        volume_(volume),
        request_{.camera = request.camera, .isovalue = request.isovalue},
        max_surface_error_(max_surface_error),
        tries_(tries) {
    const ImageSize size = request.size;
    const std::uint32_t pixels = std::clamp(size.height / kMinRows, 1u, kMaxStride);
    request_.size = {std::max(size.width / pixels, 1u), size.height / pixels};
    stride_ = double(size.height) / request_.size.height;
  }
  double stride() const { return stride_; }  ///< pixels of the frame for one of the picture

  struct Drawn {
    CertificateSummary summary;
    std::vector<HitRecord> hits;
  };
  /// Adds one to the tries. The detail is that of the frame.
  Drawn draw(const Detail &detail) {
    const FrameRequest request =
        with_detail(request_, {detail.voxel_pixels / stride_, detail.voxel_error});
    renderer_.render(request);
    std::vector<HitRecord> hits = renderer_.hits();
    const CertificateSummary summary =
        summarize(certify(renderer_, volume_, request, hits), max_surface_error_ / stride_);
    const double all = std::max<double>(double(summary.num_pixels), 1);
    tries_.push_back({detail, summary.num_pixels == 0 ? 1.0 : double(summary.num_certified) / all});
    return {summary, std::move(hits)};
  }

  /// The first of descending numbers whose detail loses no more than kLostShare against `best`, or
  /// 0. Nearly always, what suffices does so with any less, too: a bisection.
  template <typename DetailOf>
  double first_to_suffice(const std::vector<double> &numbers, double best,
                          const DetailOf &detail_of) {
    const auto found = std::ranges::partition_point(numbers, [&](double number) {
      draw(detail_of(number));
      return tries_.back().certified < best - kLostShare;
    });
    return found == numbers.end() ? 0.0 : *found;
  }

 private:
  Renderer &renderer_;
  const CompressedVolume &volume_;
  FrameRequest request_;
  double max_surface_error_, stride_ = 1;
  std::vector<DetailChoice::Try> &tries_;
};

}  // namespace

DetailChoice choose_detail(Renderer &renderer, const CompressedVolume &volume,
                           const FrameRequest &request, double max_surface_error) {
  check_max_surface_error(max_surface_error);
  renderer.check(request);
  const auto begin = std::chrono::steady_clock::now();
  // Neither is known: certify() throws.
  const double error = known_voxel_error(volume).value_or(double{largest_bound(volume.bounds)});
  DetailChoice choice;
  Trial trial(renderer, volume, request, max_surface_error, choice.tries);
  const Trial::Drawn at_full_detail = trial.draw({});
  choice.median = trial.stride() * at_full_detail.summary.median;
  const double best = choice.tries.front().certified;
  choice.reachable = best >= 0.5;
  if (!choice.reachable) advise(volume, error, max_surface_error, choice);
  if (choice.reachable && renderer.options().with_levels) {
    const double coarsest =
        trial.first_to_suffice(all_voxel_pixels(), best, [](double voxel_pixels) {
          return Detail{voxel_pixels, 0};
        });
    const std::vector<FrameParams> frames = make_level_frames(
        level_infos(volume, true), request.camera, request.size, request.isovalue, coarsest);
    if (blocks_share(at_full_detail.hits, frames) <= kMaxBlocksShare)
      choice.detail.voxel_pixels = coarsest;
  }
  if (choice.reachable && volume.rate() > kMinPlaneRate) {
    choice.detail.voxel_error =
        trial.first_to_suffice(voxel_errors(volume, error), best, [&](double voxel_error) {
          return Detail{choice.detail.voxel_pixels, voxel_error};
        });
  }
  choice.total_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return choice;
}

}  // namespace isowave
