#include "tools/isowave/frame_options.hpp"

#include <charconv>
#include <optional>

#include "core/base/error.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

ImageSize parse_size(const std::string &text) {
  ImageSize size;
  const char *end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec == std::errc{} && width.ptr != end && *width.ptr == 'x') {
    const auto height = std::from_chars(width.ptr + 1, end, size.height);
    if (height.ec == std::errc{} && height.ptr == end) return size;
  }
  throw Error("--size {}: give WIDTHxHEIGHT in pixels, such as 1280x720", text);
}

namespace {

std::string dims_text(const glm::uvec3 &dims) {
  return fmt::format("{}x{}x{}", dims.x, dims.y, dims.z);
}

}  // namespace

Views read_views(const FrameOptions &options) {
  Views views;
  if (!options.cameras.empty()) views.file = read_camera_file(options.cameras);
  if (views.file) {
    views.count = static_cast<std::uint32_t>(views.file->cameras.size());
    views.size = {views.file->width.value_or(views.size.width),
                  views.file->height.value_or(views.size.height)};
  } else {
    views.count = std::max(1u, options.orbit);
  }
  if (!options.size.empty()) views.size = parse_size(options.size);
  views.size.samples = options.samples;
  check_image_size(views.size);
  return views;
}

std::vector<Camera> make_cameras(const std::string &path, const VolumeInfo &info,
                                 const FrameOptions &options, const Views &views) {
  const std::optional<CameraFile> &file = views.file;
  if (file && file->dims && *file->dims != info.dims) {
    throw Error("{} is for a volume of {}, but {} has {}", options.cameras, dims_text(*file->dims),
                path, dims_text(info.dims));
  }
  if (file && file->spacing &&
      glm::any(glm::greaterThan(glm::abs(*file->spacing - info.spacing), 1e-3 * info.spacing))) {
    throw Error("{} is for a spacing of {} {} {}, but {} has {} {} {}: give --spacing",
                options.cameras, file->spacing->x, file->spacing->y, file->spacing->z, path,
                info.spacing.x, info.spacing.y, info.spacing.z);
  }
  if (file) return file->cameras;
  return orbit_cameras(info, views.count, up_of(options.view),
                       double(views.size.width) / views.size.height);
}

VolumeAndViews load_volume_and_views(const std::string &path, const VolumeOptions &volume,
                                     const FrameOptions &options, const Views &views,
                                     ocl::Device *device) {
  VolumeAndViews scene;
  scene.size = views.size;
  scene.volume = load_volume(path, to_overrides(volume), options.compression, device);
  scene.cameras = make_cameras(path, scene.volume.info, options, views);
  return scene;
}

CLI::Option *add_frame_options(CLI::App &command, FrameOptions &options) {
  CLI::Option *isovalue =
      command
          .add_option("--isovalue,-i", options.isovalues,
                      "isovalue; repeat it for more surfaces, each drawn from all views")
          ->check(fits_float32())
          ->allow_extra_args(false);  // one number each time: VOLUME may follow
  add_compression_options(command, options.compression);
  command
      .add_option(
          "--voxel-error", options.voxel_error,
          "largest difference of decoded voxels from the compressed volume's: decodes fewer "
          "bit planes")
      ->capture_default_str();
  command.add_option("--size", options.size, "picture size WxH [1280x720, or the camera file's]");
  CLI::Option *orbit =
      command.add_option("--orbit", options.orbit, "draw N views around the volume [1]")
          ->check(CLI::Range(1u, kMostViews));
  command.add_option("--cameras", options.cameras, "camera file (JSON)")->excludes(orbit);
  return isovalue;
}

}  // namespace isowave::core::tools
