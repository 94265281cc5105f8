#pragma once
// Isovalues that are worth a first look, found in a fixed sample of whole blocks.
//
// The first divides the histogram of voxels best. The others are those of borders between
// materials: there, values change fast. Each of a block's 27 cells has a value, the mean of its
// corners, and the gradient of the trilinear field in its centre, in world space. The mean gradient
// magnitude of all cells of a bin is smoothed over neighbouring bins. Its peaks are suggested if
// they stand out, enough cells are near, and they are at least 1/12 of the range away from each
// other and from Otsu's threshold.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// How an isovalue was found.
enum class SuggestedBy {
  kOtsu,      ///< divides the histogram into two classes of the least variance [Otsu 1979]
  kGradient,  ///< the mean gradient magnitude of cells of this value is a local maximum
              ///< [Pekar et al. 2001]
  kMiddle     ///< middle of the range, if all sampled voxels fall into one bin
};
/// "Otsu's threshold", "gradient peak" or "middle of the range".
std::string_view to_string(SuggestedBy by);

struct SuggestedIsovalue {
  double isovalue = 0;
  SuggestedBy by = SuggestedBy::kOtsu;
};

/// Number of equally wide bins of the histogram.
inline constexpr std::size_t kHistogramBins = 256;
/// Most voxels that suggestions are made of.
inline constexpr std::uint64_t kMostSuggestionVoxels = std::uint64_t{1} << 22;

struct IsovalueSuggestions {
  std::array<double, 2> range{};  ///< values that the histogram begins, ends at
  std::array<std::uint64_t, kHistogramBins> counts{};  ///< sampled voxels by value
  /// Otsu's threshold first, then up to three peaks of the gradient, the most prominent first. Each
  /// is above range[0] and at most range[1], and has few digits. Between integers, if the volume
  /// has integers of a small range. Empty if all voxels have the same value, or none has data.
  std::vector<SuggestedIsovalue> isovalues{};
};

/// Suggests isovalues of sampled blocks. The result is the same on all machines.
///
/// info    of the volume: spacing [world units], since gradients are those of world space; and type
/// range   least and largest value of the volume; not finite: those of the sample
/// blocks  as of decode_sample()
IsovalueSuggestions suggest_isovalues(const VolumeInfo &info, std::array<float, 2> range,
                                      std::span<const float> blocks);
/// The same for a sample of kMostSuggestionVoxels voxels of a volume.
///
/// Throws  Error: a file is shorter than it was, or cannot be read
IsovalueSuggestions suggest_isovalues(const CompressedVolume &volume);

/// The first suggestion.
///
/// Throws  Error: there is none; one line that asks for `argument`, such as "--isovalue"
SuggestedIsovalue first_suggestion(const CompressedVolume &volume, std::string_view argument);

}  // namespace isowave::core
