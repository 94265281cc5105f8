#pragma once
// Options for slices: --slice, --slice-opacity, --slice-map and --slice-range.

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/volume/volume.hpp"
#include "isowave/frame.hpp"

namespace isowave::core::tools {

/// Options as typed; read_slices() checks them.
struct SliceOptions {
  std::vector<std::string> planes;  ///< NX,NY,NZ[,D], x[,D], y[,D] or z[,D] each
  double opacity = 1;               ///< of all of them
  std::string map = "gray";
  std::string range;  ///< LOW,HIGH; empty: the volume's
};

void add_slice_options(CLI::App &command, SliceOptions &options);

/// Sets the colours of slices in an appearance. Normals have length 1.
///
/// info    slices without a distance go through the middle of this volume
/// Throws  Error in one line: what the options cannot mean, for any volume
std::vector<isowave::Slice> read_slices(const SliceOptions &options, const VolumeInfo &info,
                                        isowave::Appearance &appearance);

/// [{normal, offset, opacity, clipped}]
nlohmann::ordered_json slices_json(const std::vector<isowave::Slice> &slices);

}  // namespace isowave::core::tools
