#include "core/accuracy/choose_detail.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/accuracy/candidates.hpp"
#include "core/accuracy/ray_sample.hpp"
#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/view/detail.hpp"

namespace isowave::core {

namespace {

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
    choice.advice = fmt::format("{}; a volume compressed with a tolerance of {:.2g} would do", half,
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

/// The request for hits alone: rays end at the first, also on what is translucent.
FrameRequest of_first_hits(FrameRequest request) {
  request = without_calls(without_light_rays(std::move(request)));
  request.normals = Normals::kCell;
  request.field_values = false;
  for (SurfaceStyle &surface : request.surfaces) surface.opacity = 1;
  for (Slice &slice : request.slices.planes) slice.opacity = 1;
  return request;
}

/// Draws a sample of the rays of some views with one detail after another, and judges each.
class Judge {
 public:
  /// Draws the sample at full detail.
  Judge(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
        double max_surface_error, Evidence by, std::span<const Camera> series)
      : renderer_(renderer),
        volume_(volume),
        request_(of_first_hits(request)),
        views_(views_of(request.camera, series)),
        levels_(renderer.levels()),
        size_(sample_of(size_of(request, renderer.abilities()))),
        max_surface_error_(max_surface_error),
        by_(by) {
    request_.size = size_;
    const View view = make_view(levels_.front(), request.camera, size_);
    for (std::uint32_t ray = 0; ray < size_.num_rays(); ++ray) {
      if (!is_in_picture(view, size_, ray)) beside_.push_back(ray);
    }
    best_ = kept_with({});
  }

  /// Whether enough pixels keep the error with a detail.
  bool keeps(const Detail &detail) {
    const double kept = kept_with(detail);
    return by_ == Evidence::kSample ? suffices(samples_.back()) : kept >= best_ - kLostShare;
  }

  double best() const { return best_; }  ///< share of the pixels, at full detail
  double median() const { return median_; }
  /// Blocks with levels so coarse, as the sample's hits tell.
  HitBlocks blocks(double voxel_pixels) const {
    HitBlocks blocks;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const std::vector<FrameParams> frames =
          make_level_frames(levels_, views_[i], size_, request_.isovalue, voxel_pixels);
      add_hit_blocks(finest_depth_[i], levels_.front(), frames, views_[i], size_.height, INFINITY,
                     blocks);
    }
    return blocks;
  }
  const std::vector<DetailChoice::Try> &tries() const { return tries_; }
  /// A sample with a detail that was tried.
  SampledShare sample_with(const Detail &detail) const {
    const auto found = std::ranges::find(tries_, detail, &DetailChoice::Try::detail);
    SampledShare sample = samples_[std::size_t(found - tries_.begin())];
    sample.lowest = detail == Detail{} ? 1 : lowest_share(sample.num_within, sample.num_hits);
    return sample;
  }

 private:
  double kept_with(const Detail &detail) {
    const FrameRequest request = with_detail(request_, detail);
    tries_.push_back({detail, by_ == Evidence::kSample ? sampled(request) : certified(request)});
    return tries_.back().kept;
  }

  double sampled(const FrameRequest &request) {
    SampledShare own;
    const bool is_first = finest_.empty();
    for (std::size_t i = 0; i < views_.size(); ++i) {
      std::vector<SeenFrame> seen;
      for (const Camera &camera : cameras_beside(views_[i], size_.height, max_surface_error_)) {
        renderer_.render(seen_from(camera, request));
        seen.push_back(seen_frame(renderer_, camera));
      }
      leave_out_beside(seen.front().depth, INFINITY);
      if (is_first) {
        finest_depth_.push_back(seen.front().depth);
        finest_.push_back(seen);
      }
      own += compare_hits(views_[i], size_, finest_[i], seen, max_surface_error_);
    }
    samples_.push_back(of_first(renderer_.team(), std::vector{own}).front());
    return samples_.back().share();
  }

  double certified(const FrameRequest &request) {
    std::vector<float> bounds;  // of all views
    for (const Camera &camera : views_) {
      const FrameRequest view = seen_from(camera, request);
      renderer_.render(view);
      std::vector<float> depth = renderer_.depth();
      std::vector<float> of_view = certify(renderer_, volume_, view, depth).bounds;
      leave_out_beside(of_view, 0);
      leave_out_beside(depth, INFINITY);
      bounds.insert(bounds.end(), of_view.begin(), of_view.end());
      if (finest_depth_.size() < views_.size()) finest_depth_.push_back(std::move(depth));
    }
    const CertificateSummary summary =
        of_first(renderer_.team(), std::vector{summarize(bounds, max_surface_error_)}).front();
    if (tries_.empty()) median_ = summary.median;
    return summary.num_pixels == 0 ? 1.0
                                   : double(summary.num_certified) / double(summary.num_pixels);
  }

  /// values: of the sample's rays, or none
  void leave_out_beside(std::vector<float> &values, float nothing) const {
    if (values.empty()) return;
    for (const std::uint32_t ray : beside_) values[ray] = nothing;
  }

  Renderer &renderer_;
  const CompressedVolume &volume_;
  FrameRequest request_;
  std::vector<Camera> views_;
  std::vector<VolumeInfo> levels_;
  ImageSize size_;
  double max_surface_error_;
  Evidence by_;
  std::vector<std::uint32_t> beside_;  ///< rays of the sample beside the picture
  // At full detail, of each view.
  std::vector<std::vector<float>> finest_depth_;
  std::vector<std::vector<SeenFrame>> finest_;  ///< by sample
  std::vector<DetailChoice::Try> tries_;
  std::vector<SampledShare> samples_;  ///< by sample: of each try
  double best_ = 0, median_ = 0;
};

}  // namespace

DetailChoice choose_detail(Renderer &renderer, const CompressedVolume &volume, double rate,
                           const FrameRequest &request, double max_surface_error, Evidence by,
                           std::span<const Camera> series) {
  check_max_surface_error(max_surface_error);
  const auto begin = std::chrono::steady_clock::now();
  Team &team = renderer.team();
  const Abilities abilities = renderer.abilities();
  check(request, abilities);
  const std::vector<VolumeInfo> levels = renderer.levels();
  const bool by_sample = by == Evidence::kSample;
  // By proof, certify() throws if neither is known.
  const double error = known_voxel_error(volume).value_or(double{largest_bound(volume.bounds)});
  Judge judge(renderer, volume, request, max_surface_error, by, series);
  DetailChoice choice;
  choice.median = judge.median();
  choice.reachable = judge.best() >= 0.5;
  if (!choice.reachable) advise(volume, error, max_surface_error, choice);
  // The first of descending numbers that suffices, or 0. Nearly always, what suffices does so with
  // any less, too: a bisection.
  const auto first_to_suffice = [&](const std::vector<double> &all, const auto &detail_of) {
    const std::vector<double> numbers = of_first(team, all);
    const auto found = std::ranges::partition_point(
        numbers, [&](double number) { return !judge.keeps(detail_of(number)); });
    return found == numbers.end() ? 0.0 : *found;
  };
  // Beside voxels without data, coarser levels have no bound. Slices have the finest alone: places
  // say nothing of the values that they show.
  if (choice.reachable && abilities.levels && levels.size() > 1 &&
      (by_sample || volume.no_data.empty()) && request.slices.planes.empty()) {
    const double coarsest = first_to_suffice(all_voxel_pixels(), [](double voxel_pixels) {
      return Detail{voxel_pixels, 0};
    });
    const double share = of_first(team, std::vector{judge.blocks(coarsest).share()}).front();
    if (share <= kMaxBlocksShare) choice.detail.voxel_pixels = coarsest;
  }
  if (choice.reachable && abilities.fewer_planes && rate > kMinPlaneRate &&
      !volume.precision.is_reversible()) {
    choice.detail.voxel_error =
        first_to_suffice(voxel_errors(volume, error), [&](double voxel_error) {
          return Detail{choice.detail.voxel_pixels, voxel_error};
        });
  }
  choice.tries = judge.tries();
  if (by_sample) choice.sample = judge.sample_with(choice.detail);
  choice.total_ms = ms_since(begin);
  return choice;
}

}  // namespace isowave::core
