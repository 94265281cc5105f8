#include "core/zfp/describe_compression.hpp"

#include <fmt/format.h>

#include "core/base/printed_bound.hpp"

namespace isowave::core {

std::string_view compression_mode(const CompressedVolume &volume) {
  if (volume.precision.is_reversible()) return "reversible";
  if (volume.precision.whole_numbers) return "whole numbers";
  return volume.is_indexed() ? "fixed accuracy" : "fixed rate";
}

std::string describe_compression(const CompressedVolume &volume) {
  const std::optional<double> &error = volume.max_voxel_error;
  return fmt::format("{:.4g} bits per voxel, {}{}", volume.rate(), compression_mode(volume),
                     error ? fmt::format(", max error {}", printed_bound(*error)) : "");
}

}  // namespace isowave::core
