#include "tools/isowave/volume_options.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/generate/generate.hpp"
#include "core/io/open_volume.hpp"
#include "core/io/raw_reader.hpp"
#include "core/ocl/device.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

constexpr std::string_view kGenerate = "generate:";

GenerateOptions parse_generator(std::string_view text) {
  const auto fail = [&] {
    throw Error("'{}{}': write generate:FIELD_XxYxZ_TYPE or generate:FIELD_XxYxZ_TYPE:SEED",
                kGenerate, text);
  };
  const std::size_t colon = text.find(':');
  const std::optional<RawName> name = parse_raw_name(text.substr(0, colon));
  if (!name) fail();
  GenerateOptions options;
  options.field = field_from_string(name->name);
  options.dims = name->dims;
  options.type = name->type;
  if (colon != std::string_view::npos) {
    const auto seed = parse_all<decltype(options.seed)>(text.substr(colon + 1));
    if (!seed) fail();
    options.seed = *seed;
    if (options.field != Field::kMixingLayer)
      throw Error("'{}{}': a seed is of mixing_layer's noise alone: leave it out", kGenerate, text);
  }
  return options;
}

/// Gives a generated volume the spacing asked for.
class RespacedReader : public VolumeReader {
 public:
  RespacedReader(std::unique_ptr<VolumeReader> source, const glm::dvec3 &spacing)
      : source_(std::move(source)) {
    info_ = source_->info();
    info_.spacing = spacing;
  }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    source_->read_layers(z_begin, num_layers, out);
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    source_->read_exact_layers(z_begin, num_layers, out);
  }

 private:
  std::unique_ptr<VolumeReader> source_;
};

}  // namespace

void add_volume_options(CLI::App &command, VolumeOptions &options) {
  command
      .add_option("--dims", options.dims,
                  "voxels of a raw file whose name does not say: X Y Z, or N for a cube")
      ->expected(1, 3);
  command.add_option("--type", options.type,
                     "voxel type of a raw file: uint8, int8, ... float32, float64");
  command
      .add_option("--spacing", options.spacing, "world units between voxels: X Y Z or one for all")
      ->expected(1, 3);
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
  const std::vector<double> &spacing = options.spacing;
  if (spacing.size() == 1) overrides.spacing = glm::dvec3(spacing[0]);
  if (spacing.size() == 2)
    throw Error("--spacing: need X Y Z, or one number for all, got 2 numbers");
  if (spacing.size() == 3) overrides.spacing = {spacing[0], spacing[1], spacing[2]};
  return overrides;
}

std::unique_ptr<VolumeReader> open_any_volume(const std::string &path,
                                              const RawOverrides &overrides) {
  if (!path.starts_with(kGenerate)) return open_volume(path, overrides);
  if (overrides.dims || overrides.type)
    throw Error("{}: it says dims and type itself: leave --dims and --type", path);
  std::unique_ptr<VolumeReader> reader =
      open_generated(parse_generator(std::string_view(path).substr(kGenerate.size())));
  if (!overrides.spacing) return reader;
  return std::make_unique<RespacedReader>(std::move(reader), *overrides.spacing);
}

bool is_zfp_name(const std::string &path) {
  return path.ends_with(".zfp");
}

void add_compression_options(CLI::App &command, CompressionOptions &options) {
  CLI::Option *rate = command
                          .add_option("--rate", options.rate,
                                      "bits per voxel of a volume that is compressed, 1 to 32")
                          ->capture_default_str();
  CLI::Option *tolerance = command.add_option(
      "--tolerance", options.tolerance,
      "instead: as few bits as keep each voxel within this error of the input's");
  CLI::Option *relative = command.add_option("--tolerance-relative", options.relative_tolerance,
                                             "the same, as a part of the range of values");
  CLI::Option *exact = command.add_flag(
      "--exact", options.exact,
      "the same, with no error: decoded values are the input's (integers below 2^24 only)");
  CLI::Option *levels = command
                            .add_option("--levels", options.levels,
                                        "levels of detail of a volume that is compressed, each of "
                                        "half the voxels along each axis, "
                                        "itself among them: a number, or all")
                            ->transform(count_or_all())
                            ->type_name("N|all")
                            ->capture_default_str();
  tolerance->excludes(rate, relative, exact);
  relative->excludes(rate, exact);
  exact->excludes(rate);
  options.options = {rate, tolerance, relative, exact, levels};
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

std::optional<BlockPrecision> find_error_bound(const std::string &path,
                                               const RawOverrides &overrides,
                                               const CompressionOptions &options,
                                               InputOptions input) {
  if (!options.bounded()) return {};
  const auto check = [](const char *option, const std::optional<double> &tolerance) {
    if (tolerance && !(*tolerance > 0)) throw Error("{} {}: must be above 0", option, *tolerance);
  };
  check("--tolerance", options.tolerance);
  check("--tolerance-relative", options.relative_tolerance);
  ErrorGoal goal{options.tolerance.value_or(0), options.exact};
  if (options.relative_tolerance) {
    ChunkCoder nothing;
    input.progress = make_progress_bar("reading the value range");
    const std::array<double, 2> range =
        read_in_chunks(*open_any_volume(path, overrides), input, nothing).source;
    if (range[0] == range[1])
      throw Error("{}: all voxels are {}: there is no range that an error is relative to", path,
                  range[0]);
    goal.tolerance = *options.relative_tolerance * (range[1] - range[0]);
    if (!(goal.tolerance > 0 && std::isfinite(goal.tolerance)))
      throw Error(
          "--tolerance-relative {}: of values from {} to {}, that is {}: need above 0 and finite",
          *options.relative_tolerance, range[0], range[1], goal.tolerance);
  }
  input.progress = make_progress_bar("measuring errors");
  return choose_precision(*open_any_volume(path, overrides), goal, input);
}

CompressedVolume load_volume(const std::string &path, const RawOverrides &overrides,
                             const CompressionOptions &compression, ocl::Device *device) {
  if (is_zfp_name(path)) {
    if (overrides.dims || overrides.type)
      throw Error("{}: --dims and --type are for raw files", path);
    refuse_compression(compression, path);
    VolumeInfo info = read_zfp_file_info(path).info;
    if (overrides.spacing) info.spacing = *overrides.spacing;
    check_volume_info(info, path);
    check_drawable(info, path);  // before an index of all blocks is built
    CompressedVolume volume = open_zfp_file(path);
    if (overrides.spacing) set_spacing(volume, *overrides.spacing);
    return volume;
  }
  const std::unique_ptr<VolumeReader> reader = open_any_volume(path, overrides);
  check_drawable(reader->info(), path);
  CompressOptions options;
  options.rate = compression.rate;
  options.precision = find_error_bound(path, overrides, compression);
  options.levels = compression.levels;
  options.measure_error = compression.measure_error;
  options.input.progress = make_progress_bar("compressing");
  options.device = options.precision ? nullptr : device;
  CompressedVolume volume = compress(*reader, options);
  if (device) device->timer().collect();  // they belong to no frame
  return volume;
}

Progress make_progress_bar(std::string_view label) {
  if (::isatty(STDERR_FILENO) == 0) return {};
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

std::string with_commas(std::uint64_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, 1, ',');
  return text;
}

}  // namespace isowave::core::tools
