#include "core/zfp/isovalue_suggestions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "core/base/error.hpp"
#include "core/zfp/voxel_sample.hpp"

namespace isowave::core {

namespace {

using Bins = std::array<double, kHistogramBins>;

/// Bins that a moving mean takes together; two of them, one after the other, smooth the gradient.
constexpr std::size_t kWindow = 7;
/// Least cells near a bin whose mean gradient counts: a number, and a share of all cells.
constexpr double kFewestCells = 32, kLeastShare = 2e-5;
constexpr double kLeastProminence = 0.1;     ///< of a peak, as a part of the largest mean gradient
constexpr double kLeastDistance = 1.0 / 12;  ///< between isovalues, as a part of the range
constexpr std::size_t kMostPeaks = 3;
/// Suggestions are multiples of the largest power of ten that is at most this part of the range.
constexpr double kLargestStep = 1.0 / 200;

/// A bin: its place, and how high it stands out.
struct Peak {
  double bin = 0, prominence = 0;
};

/// Counts and sums of gradient magnitudes of the cells of each bin.
struct CellBins {
  Bins counts{}, sums{};
};

std::array<double, 2> range_of(std::span<const float> voxels) {
  std::array<double, 2> range = {std::numeric_limits<double>::infinity(),
                                 -std::numeric_limits<double>::infinity()};
  for (const float voxel : voxels) {
    if (std::isnan(voxel)) continue;
    range = {std::min(range[0], double{voxel}), std::max(range[1], double{voxel})};
  }
  return range;
}

std::size_t bin_of(const std::array<double, 2> &range, double value) {
  const double place = (value - range[0]) / (range[1] - range[0]) * double{kHistogramBins};
  return static_cast<std::size_t>(std::clamp(place, 0.0, double{kHistogramBins - 1}));
}

/// The value at a place, 0 to kHistogramBins: bin i lies from i to i + 1.
double value_at(const std::array<double, 2> &range, double place) {
  return range[0] + place / double{kHistogramBins} * (range[1] - range[0]);
}

/// Adds the 27 cells of a block, each at the mean of its corners: the trilinear field and its
/// gradient there. A cell with a corner that is NaN has neither.
void add_cells(std::span<const float> block, const glm::dvec3 &spacing,
               const std::array<double, 2> &range, CellBins &bins) {
  for (std::size_t cell = 0; cell < 27; ++cell) {
    const std::size_t first = cell % 3 + cell / 3 % 3 * 4 + cell / 9 * 16;
    double sum = 0;
    glm::dvec3 differences(0);
    for (std::size_t corner = 0; corner < 8; ++corner) {
      const double value = block[first + (corner & 1) + (corner >> 1 & 1) * 4 + (corner >> 2) * 16];
      sum += value;
      differences.x += (corner & 1) != 0 ? value : -value;
      differences.y += (corner & 2) != 0 ? value : -value;
      differences.z += (corner & 4) != 0 ? value : -value;
    }
    if (std::isnan(sum)) continue;
    const std::size_t bin = bin_of(range, sum / 8);
    bins.counts.at(bin) += 1;
    bins.sums.at(bin) += glm::length(differences / (4.0 * spacing));
  }
}

/// Otsu's threshold, as a place. Not given if all voxels are in one bin.
std::optional<double> otsu_place(const std::array<std::uint64_t, kHistogramBins> &counts) {
  double count = 0, sum = 0;
  for (std::size_t i = 0; i < kHistogramBins; ++i) {
    count += static_cast<double>(counts.at(i));
    sum += static_cast<double>(counts.at(i)) * (double(i) + 0.5);
  }
  Bins between{};  // variance between the classes, if the second begins with the bin
  double below = 0, sum_below = 0;
  for (std::size_t i = 1; i < kHistogramBins; ++i) {
    below += static_cast<double>(counts.at(i - 1));
    sum_below += static_cast<double>(counts.at(i - 1)) * (double(i) - 0.5);
    const double above = count - below;
    if (below == 0 || above == 0) continue;
    const double distance = sum_below / below - (sum - sum_below) / above;
    between.at(i) = below * above * distance * distance;
  }
  const double most = *std::ranges::max_element(between);
  if (most <= 0) return std::nullopt;
  // An empty stretch divides equally well anywhere: its middle is farthest from both classes.
  const auto is_best = [&](double variance) { return variance >= most * (1 - 1e-12); };
  const auto first = std::ranges::find_if(between, is_best);
  const auto last = std::find_if(between.rbegin(), between.rend(), is_best);
  return double((first - between.begin()) + (between.rend() - 1 - last)) / 2;
}

/// Sums of kWindow bins around each.
Bins windowed(const Bins &bins) {
  Bins sums{};
  for (std::size_t i = 0; i < kHistogramBins; ++i) {
    const std::size_t begin = i - std::min(i, kWindow / 2),
                      end = std::min(kHistogramBins, i + kWindow / 2 + 1);
    sums.at(i) = std::accumulate(bins.begin() + begin, bins.begin() + end, 0.0);
  }
  return sums;
}

/// The smoothed mean gradient magnitude of each bin; negative: too few cells are near.
Bins mean_gradients(const CellBins &cells) {
  const Bins counts = windowed(windowed(cells.counts)), sums = windowed(windowed(cells.sums));
  const double all = std::accumulate(cells.counts.begin(), cells.counts.end(), 0.0);
  const double fewest = double{kWindow} * std::max(kFewestCells, kLeastShare * all);
  Bins means{};
  for (std::size_t i = 0; i < kHistogramBins; ++i)
    means.at(i) = counts.at(i) < fewest ? -1 : sums.at(i) / counts.at(i);
  return means;
}

/// Least of means[begin], means[begin + step], ... until one is above `height` or not known.
double lowest_beside(const Bins &means, std::size_t begin, int step, double height) {
  double lowest = height;
  for (std::size_t i = begin; i < kHistogramBins && means.at(i) >= 0 && means.at(i) <= height;
       i += static_cast<std::size_t>(step))
    lowest = std::min(lowest, means.at(i));
  return lowest;
}

/// Local maxima between lower bins, the most prominent first. The bins where cells become too few
/// are none: what lies behind is not known.
std::vector<Peak> find_peaks(const Bins &means) {
  const double least = kLeastProminence * *std::ranges::max_element(means);
  std::vector<Peak> peaks;
  for (std::size_t i = 1, end = 0; i + 1 < kHistogramBins; i = end) {
    end = i + 1;
    const double height = means.at(i);
    while (end < kHistogramBins && means.at(end) == height) ++end;
    if (height <= 0 || end == kHistogramBins) continue;
    const double before = means.at(i - 1), after = means.at(end);
    if (before < 0 || before > height || after < 0 || after > height) continue;
    const double foot =
        std::max(lowest_beside(means, i - 1, -1, height), lowest_beside(means, end, 1, height));
    if (height - foot >= least) peaks.push_back({double(i + end) / 2, height - foot});
  }
  std::ranges::stable_sort(peaks, std::greater{}, &Peak::prominence);
  return peaks;
}

double parse(const std::string &text) {
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// A value with few digits. By decimal texts, since powers of libm differ between machines.
double rounded(double value, double width, bool is_integer) {
  const std::string scale = fmt::format("{:e}", width * kLargestStep);
  const std::string exponent = scale.substr(scale.find('e') + 1);
  const double step = parse("1e" + exponent);
  if (is_integer && step <= 1) return std::ceil(value) - 0.5;
  return parse(fmt::format("{:.0f}e{}", std::round(value / step), exponent));
}

}  // namespace

std::string_view to_string(SuggestedBy by) {
  switch (by) {
    case SuggestedBy::kOtsu:
      return "Otsu's threshold";
    case SuggestedBy::kGradient:
      return "gradient peak";
    case SuggestedBy::kMiddle:
      return "middle of the range";
  }
  return "";
}

IsovalueSuggestions suggest_isovalues(const VolumeInfo &info, std::array<float, 2> range,
                                      std::span<const float> blocks) {
  IsovalueSuggestions result;
  result.range = {range[0], range[1]};
  if (!std::isfinite(range[0]) || !std::isfinite(range[1])) result.range = range_of(blocks);
  const double width = result.range[1] - result.range[0];
  if (!(width > 0)) return result;
  CellBins cells;
  for (std::size_t begin = 0; begin < blocks.size(); begin += ISO_BLOCK_VOXELS) {
    const std::span<const float> block = blocks.subspan(begin, ISO_BLOCK_VOXELS);
    for (const float voxel : block)
      if (!std::isnan(voxel)) ++result.counts.at(bin_of(result.range, voxel));
    add_cells(block, info.spacing, result.range, cells);
  }
  const auto add = [&](double place, SuggestedBy by) {
    const double value = value_at(result.range, place);
    result.isovalues.push_back({rounded(value, width, is_integer(info.type)), by});
  };
  const std::optional<double> otsu = otsu_place(result.counts);
  add(otsu.value_or(double{kHistogramBins} / 2), otsu ? SuggestedBy::kOtsu : SuggestedBy::kMiddle);
  for (const Peak &peak : find_peaks(mean_gradients(cells))) {
    const double value = value_at(result.range, peak.bin);
    const bool is_new =
        std::ranges::all_of(result.isovalues, [&](const SuggestedIsovalue &suggested) {
          return std::abs(suggested.isovalue - value) >= kLeastDistance * width;
        });
    if (is_new && result.isovalues.size() <= kMostPeaks) add(peak.bin, SuggestedBy::kGradient);
  }
  return result;
}

IsovalueSuggestions suggest_isovalues(const CompressedVolume &volume) {
  return suggest_isovalues(volume.info, volume.value_range,
                           decode_sample(volume, kMostSuggestionVoxels));
}

SuggestedIsovalue first_suggestion(const CompressedVolume &volume, std::string_view argument) {
  const IsovalueSuggestions suggestions = suggest_isovalues(volume);
  if (!suggestions.isovalues.empty()) return suggestions.isovalues.front();
  if (volume.no_data.num_voxels() == volume.info.num_voxels())
    throw Error("no voxel has data, so no isovalue can be suggested: give {}", argument);
  throw Error("all voxels have the value {}, so no isovalue can be suggested: give {}",
              suggestions.range[0], argument);
}

}  // namespace isowave::core
