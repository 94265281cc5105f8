#include "tools/isowave/volume_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/text.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/io/raw_reader.hpp"
#include "core/ocl/device.hpp"
#include "core/platform/streams.hpp"
#include "core/sources/generate.hpp"
#include "core/sources/noise_on_device.hpp"
#include "core/sources/series.hpp"
#include "core/stages/zfp_encode.hpp"
#include "core/zfp/describe_compression.hpp"
#include "core/zfp/isovalue.hpp"
#include "core/zfp/isovalue_suggestions.hpp"
#include "core/zfp/slabs.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

void add_volume_options(CLI::App &command, VolumeOptions &options) {
  command
      .add_option("--dims", options.dims,
                  "number of voxels of a raw file, unless its name says it: X Y Z, or N for a cube")
      ->expected(1, 3);
  command.add_option(
      "--type", options.type,
      "voxel type of a raw file, unless its name says it: uint8, int8, ... float32, float64");
  command
      .add_option("--spacing", options.spacing, "world units between voxels: X Y Z or one for all")
      ->expected(1, 3);
  command
      .add_option("--index", options.index,
                  "volume of a NIfTI or NRRD file with a fourth axis, counted from 0, such as t=3")
      ->type_name("t=N");
}

glm::uvec3 to_dims(const std::vector<std::uint32_t> &numbers) {
  if (numbers.size() == 1) return glm::uvec3(numbers[0]);
  if (numbers.size() == 3) return {numbers[0], numbers[1], numbers[2]};
  throw Error("--dims: need X Y Z, or N for a cube, got {} numbers", numbers.size());
}

RawOverrides to_overrides(const VolumeOptions &options) {
  RawOverrides overrides;
  if (!options.dims.empty()) overrides.dims = to_dims(options.dims);
  if (!options.type.empty()) overrides.type = voxel_type_from_string(options.type);
  overrides.step = parse_index("--index", options.index);
  const std::vector<double> &spacing = options.spacing;
  if (spacing.size() == 1) overrides.spacing = glm::dvec3(spacing[0]);
  if (spacing.size() == 2)
    throw Error("--spacing: need X Y Z, or one number for all, got 2 numbers");
  if (spacing.size() == 3) overrides.spacing = {spacing[0], spacing[1], spacing[2]};
  return overrides;
}

CLI::Option *add_no_data_option(CLI::App &command, std::optional<double> &no_data) {
  return command
      .add_option(
          "--no-data", no_data,
          "value of voxels without data, which no surface touches; NaN voxels have no data, "
          "either. Compared in the volume's own type, after scaling; may be inf or -inf")
      ->check(any_number())
      ->type_name("NUMBER");
}

void add_compression_options(CLI::App &command, CompressionOptions &options) {
  CLI::Option *rate =
      command.add_option("--rate", options.rate,
                         "compress to this many bits per voxel, 1 to 32 [as many as float32 values "
                         "need: integers below 2^24 and float32 have no error]");
  CLI::Option *tolerance = command.add_option(
      "--tolerance", options.tolerance,
      "compress to as few bits as possible, with each voxel within this error of the input's");
  CLI::Option *relative = command.add_option("--tolerance-relative", options.tolerance_relative,
                                             "as --tolerance, but a part of the range of values");
  CLI::Option *exact = command.add_flag(
      "--exact", options.exact,
      "compress without any error; a volume whose values float32 does not hold is refused");
  CLI::Option *levels = command
                            .add_option("--levels", options.levels,
                                        "number of levels of detail to make, or all: 1 is the "
                                        "volume alone, each further level halves the voxels along "
                                        "each axis")
                            ->transform(count_or_all())
                            ->type_name("N|all")
                            ->capture_default_str();
  CLI::Option *no_data = add_no_data_option(command, options.no_data);
  tolerance->excludes(rate, relative, exact);
  relative->excludes(rate, exact);
  exact->excludes(rate);
  options.options = {rate, tolerance, relative, exact, no_data, levels};
}

void refuse_compression(const CompressionOptions &options, const std::string &path) {
  for (const CLI::Option *option : options.options) {
    if (option->count() > 0)
      throw Error("{}: {} is compressed already, and is drawn as it is: leave out the option",
                  option->get_name(), path);
  }
}

bool says_levels(const CompressionOptions &options) {
  return !options.options.empty() && options.options.back()->count() > 0;
}

namespace {

Storage to_storage(const CompressionOptions &options) {
  Storage storage;
  if (!options.tolerance && !options.tolerance_relative && !options.exact)
    storage.rate = options.rate;
  storage.tolerance = options.tolerance;
  storage.tolerance_relative = options.tolerance_relative;
  storage.exact = options.exact;
  storage.levels = options.levels;
  storage.measure_error = options.measure_error;
  storage.no_data = options.no_data;
  storage.progress = make_progress_bar;
  return storage;
}

}  // namespace

std::optional<BlockPrecision> find_precision(const std::string &path, const RawOverrides &overrides,
                                             const CompressionOptions &options,
                                             const InputOptions &input) {
  Storage storage = to_storage(options);
  storage.map_nan = input.map_nan;
  storage.num_threads = input.num_threads;
  storage.part = input.part;
  const OpenReader open = [&] { return open_any_volume(path, overrides); };
  const VolumePart *part = input.part;
  if (part == nullptr) return core::find_precision(open, path, storage);
  return core::find_precision(
      [&] { return open_part(*part, part->own_end - part->own_begin, open); }, path, storage);
}

CompressedVolume load_volume(const std::string &path, const RawOverrides &overrides,
                             const CompressionOptions &compression, ocl::Device *device) {
  if (is_zfp_name(path)) {
    refuse_compression(compression, path);
    return open_compressed_volume(path, overrides);
  }
  warn_of_header(path, overrides);
  const Storage storage = storage_for(path, compression, device);
  return compress_volume([&] { return open_any_volume(path, overrides, storage.noise); }, path,
                         storage);
}

Storage storage_for(const std::string &path, const CompressionOptions &compression,
                    ocl::Device *device) {
  if (is_zfp_name(path)) refuse_compression(compression, path);
  Storage storage = to_storage(compression);
  if (device != nullptr) {
    storage.encoder = encoder_on(*device);
    storage.noise = noise_on(*device);
  }
  return storage;
}

void warn_of_header(const std::string &path, const RawOverrides &overrides) {
  if (path.starts_with(kGenerate)) return;
  const std::unique_ptr<VolumeReader> reader = open_volume(path, overrides);
  for (const std::string &notice : reader->notices()) warn(notice);
}

void print_compression(const std::string &path, const CompressedVolume &volume) {
  if (!is_zfp_name(path)) fmt::print("compressed in memory: {}\n", describe_compression(volume));
}

double suggested_isovalue(const CompressedVolume &volume) {
  const SuggestedIsovalue first = first_suggestion(volume, "--isovalue");
  fmt::print("isovalue {} is suggested ({}); choose another with --isovalue\n", first.isovalue,
             to_string(first.by));
  return first.isovalue;
}

void warn_of_isovalue(const CompressedVolume &volume, double isovalue) {
  if (const std::string notice = isovalue_notice(volume, isovalue); !notice.empty()) warn(notice);
}

/// The text of a pattern: "step" of "step_[0-9]*".
std::string stem_of_pattern(std::string name) {
  for (std::size_t at = 0; at < name.size();) {
    const std::size_t end = name[at] == '[' ? name.find(']', at) : at;
    if (end == name.npos || std::string_view("*?[").find(name[at]) == std::string_view::npos) {
      at += 1;
    } else {
      name.erase(at, end + 1 - at);
    }
  }
  const auto is_joint = [](char c) { return c == '_' || c == '-' || c == '.'; };
  while (!name.empty() && is_joint(name.back())) name.pop_back();
  return name.empty() ? "series" : name;
}

std::string volume_stem(const std::string &path) {
  std::string name = path.starts_with(kGenerate) ? path.substr(kGenerate.size())
                                                 : std::filesystem::path(path).filename().string();
  for (const std::string_view ending :
       {".gz", ".zfp", ".raw", ".nrrd", ".nhdr", ".mha", ".mhd", ".nii"}) {
    if (name.size() > ending.size() && lower_case(name).ends_with(ending))
      name.resize(name.size() - ending.size());
  }
  std::ranges::replace(name, ':', '_');
  return is_pattern(path) ? stem_of_pattern(name) : name;
}

Progress make_progress_bar(std::string_view label) {
  if (!platform::errors_go_to_terminal()) return {};
  // The line is erased when the last copy goes, be it after the work or after an error.
  const std::shared_ptr<void> eraser(nullptr, [](void *) { fmt::print(stderr, "\r\x1b[K"); });
  return [eraser, text = std::string(label), shown = -1](std::uint32_t done,
                                                         std::uint32_t total) mutable {
    constexpr int kWidth = 40;
    if (done == total) {
      fmt::print(stderr, "\r\x1b[K");
      return;
    }
    const int percent = int(std::uint64_t(done) * 100 / total);
    if (percent == std::exchange(shown, percent)) return;
    const int filled = percent * kWidth / 100;
    fmt::print(stderr, "\r{} [{:#<{}}{:.<{}}] {}%", text, "", filled, "", kWidth - filled, percent);
    std::fflush(stderr);
  };
}

std::function<void(double percent)> make_frame_bar() {
  const Progress bar = make_progress_bar("drawing");
  if (!bar) return {};
  return [bar, begin = std::chrono::steady_clock::now()](double percent) {
    constexpr double kQuietMs = 2000;
    if (ms_since(begin) >= kQuietMs) bar(static_cast<std::uint32_t>(percent), 100);
  };
}

std::string with_commas(std::uint64_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, 1, ',');
  return text;
}

}  // namespace isowave::core::tools
