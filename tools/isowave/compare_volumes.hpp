#pragma once
// Comparing two volumes: voxel by voxel, and by pictures of an isosurface from one camera.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "core/view/frame.hpp"
#include "isowave/host.hpp"
#include "tools/isowave/view_options.hpp"

namespace isowave::core::tools {

/// How voxels differ as they are decoded. Those without data in both volumes are the same; those
/// without data in one alone have no distance.
struct VoxelComparison {
  std::uint64_t num_voxels = 0, num_differing = 0, without_data_in_one = 0, with_data_in_both = 0;
  double max = 0, rms = 0;  ///< of |A-B|
};

/// The same picture of two volumes.
struct ComparedVolumes {
  std::optional<VoxelComparison> voxels{};  ///< none: other numbers of voxels
  double isovalue = 0;
  isowave::Camera camera{};
  FloatImage depth_a{}, depth_b{};
  Image8 picture_a{}, picture_b{};
};

/// As typed.
struct CompareVolumesOptions {
  std::optional<double> isovalue;  ///< none: the first that A suggests
  ImageSize size{640, 360};
  ViewOptions view;
  std::string cameras;  ///< a camera file, whose first camera is taken
  std::string index;    ///< t=N, of both if they have a fourth axis
};

/// Draws both on the host, from one camera: of a file, or so that A's box fills the picture.
///
/// Throws  Error: a volume that cannot be opened, or drawn in a quarter of the host's memory
ComparedVolumes compare_volumes(const std::filesystem::path &a, const std::filesystem::path &b,
                                const CompareVolumesOptions &options);

}  // namespace isowave::core::tools
