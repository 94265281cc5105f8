#include "core/zfp/isovalue.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "core/base/printed_bound.hpp"
#include "core/zfp/level_bounds.hpp"

namespace isowave::core {

std::string all_zero_notice(const CompressedVolume &volume) {
  const auto [least, most] = volume.value_range;
  const float magnitude = std::max(-least, most);
  if (volume.precision.is_reversible() || !(magnitude > 0 && magnitude < kMinMagnitude)) return {};
  return fmt::format(
      "the volume's values, {} to {}, have all become 0 at a rate or by a tolerance: there is no "
      "surface. Scale the volume up, or compress it without these",
      least, most);
}

std::string isovalue_notice(const CompressedVolume &volume, double isovalue) {
  if (std::string notice = all_zero_notice(volume); !notice.empty()) return notice;
  const auto [least, most] = volume.value_range;
  const bool is_known = std::isfinite(least) && std::isfinite(most);
  if (!is_known || (least < isovalue && isovalue <= most)) return {};
  const std::optional<double> error = known_voxel_error(volume);
  const bool may_cross =
      !error || (isovalue > double{least} - *error && isovalue <= double{most} + *error);
  return fmt::format(
      "isovalue {} is {} the volume's values, {} to {}: {}", isovalue,
      isovalue == least ? "the least of" : "outside", least, most,
      !may_cross ? "there is no surface"
                 : "any surface comes from errors of compression" +
                       (error ? fmt::format(", which are up to {}", printed_bound(*error)) : ""));
}

float drawn_isovalue(const CompressedVolume &volume, double isovalue) {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  constexpr float kMost = std::numeric_limits<float>::max();
  if (!(std::abs(isovalue) <= kMost))
    throw Error("isovalue {}: give a finite number that float32 holds", isovalue);
  const float nearest = static_cast<float>(isovalue);
  const BlockPrecision &precision = volume.precision;
  const bool equals_source =
      fits_float32(volume.info.type) && (precision.is_reversible() || precision.whole_numbers);
  return equals_source && nearest < isovalue ? std::nextafter(nearest, kMost) : nearest;
}

std::vector<float> drawn_isovalues(const CompressedVolume &volume,
                                   std::span<const double> isovalues) {
  std::vector<float> result(isovalues.size());
  std::ranges::transform(isovalues, result.begin(),
                         [&](double isovalue) { return drawn_isovalue(volume, isovalue); });
  return result;
}

}  // namespace isowave::core
