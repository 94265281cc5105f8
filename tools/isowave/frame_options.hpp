#pragma once
// Options that `render` and `verify` share: which frames of which volume are drawn.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "tools/isowave/view_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

/// Options as typed; read_views() and load_volume_and_views() check them.
struct FrameOptions {
  CompressionOptions compression;  ///< of a volume that is not
  std::vector<double> isovalues;
  double voxel_error = 0;     ///< see FrameRequest::voxel_error
  std::string size;           ///< WxH
  std::uint32_t samples = 1;  ///< ImageSize::samples
  std::uint32_t orbit = 0;    ///< views; 0: one, or the camera file's
  std::string cameras;        ///< camera file
  ViewOptions view;           ///< render's alone
};

/// Adds --isovalue, --voxel-error, --size, --orbit, --cameras and add_compression_options().
/// Returns the option --isovalue.
/// (--samples is render's alone.)
CLI::Option *add_frame_options(CLI::App &command, FrameOptions &options);

/// "1280x720". Throws Error.
ImageSize parse_size(const std::string &text);

/// The views, as far as they are known before the volume is.
struct Views {
  std::optional<CameraFile> file;
  std::uint32_t count = 1;
  ImageSize size;
};

/// Reads the camera file, if there is one. Throws Error.
Views read_views(const FrameOptions &options);

/// The volume and the views of it.
struct VolumeAndViews {
  CompressedVolume volume;
  std::vector<Camera> cameras;
  ImageSize size;
};

/// The views of a volume of that grid, of which `path` is the name. Throws Error when a camera file
/// is for another volume.
std::vector<Camera> make_cameras(const std::string &path, const VolumeInfo &info,
                                 const FrameOptions &options, const Views &views);

/// Reads or compresses the volume and makes its cameras. Throws Error in one line, also when a
/// camera file is for another volume. Where a device is given, it compresses the volume.
VolumeAndViews load_volume_and_views(const std::string &path, const VolumeOptions &volume,
                                     const FrameOptions &options, const Views &views,
                                     ocl::Device *device = nullptr);

}  // namespace isowave::core::tools
