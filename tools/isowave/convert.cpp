// isowave convert: compresses a volume to a zfp file, at a fixed rate or within an error.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "core/error.hpp"
#include "core/ocl/device.hpp"
#include "core/zfp_accuracy.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::tools {

namespace {

struct ConvertArgs {
  std::string input, output;
  std::optional<std::string> device;
  VolumeOptions volume;
  CompressOptions compress;
  std::optional<double> tolerance, relative_tolerance;
  bool exact = false, no_verify = false;
};

/// How little of the volume must be kept, where an error is given instead of a rate. Reads all of it.
std::optional<ErrorBound> error_bound_for(const ConvertArgs &args) {
  const auto open = [&] { return open_any_volume(args.input, to_overrides(args.volume)); };
  InputOptions input = args.compress.input;
  ErrorGoal goal{0, args.exact};
  if (args.tolerance) goal.tolerance = *args.tolerance;
  if (args.relative_tolerance) {
    ChunkCoder nothing;
    input.progress = make_progress_bar("reading the value range");
    const std::array<float, 2> range = read_in_chunks(*open(), input, nothing);
    goal.tolerance = *args.relative_tolerance * (double{range[1]} - double{range[0]});
    if (range[0] == range[1])
      throw Error("{}: all voxels are {}: there is no range that an error is relative to", args.input,
                  range[0]);
  }
  if (!args.tolerance && !args.relative_tolerance && !args.exact) return {};
  input.progress = make_progress_bar("measuring errors");
  return choose_error_bound(*open(), goal, input);
}

void run(const ConvertArgs &options) {
  if (!is_zfp_name(options.output)) throw Error("{}: end the output's name in .zfp", options.output);
  if (is_zfp_name(options.input)) throw Error("{}: is compressed already", options.input);
  const std::unique_ptr<VolumeReader> reader = open_any_volume(options.input, to_overrides(options.volume));
  CompressOptions compress = options.compress;
  compress.measure_error = !options.no_verify;
  compress.error_bound = error_bound_for(options);
  compress.input.progress = make_progress_bar("compressing");
  std::optional<ocl::Device> device;
  if (options.device) compress.device = &device.emplace(ocl::choose_device(*options.device));
  const CompressedVolume volume = compress_to_file(*reader, compress, options.output);

  const glm::uvec3 dims = volume.info.dims;
  const std::uint64_t bytes_in = volume.info.num_voxels() * size_of(volume.info.type);
  const std::uint64_t bytes_out = std::filesystem::file_size(options.output);
  fmt::print("{}: {}x{}x{} {}, {} -> {} bytes, {:.4g} bits per voxel{}\n", options.output, dims.x, dims.y,
             dims.z, to_string(volume.info.type), with_commas(bytes_in), with_commas(bytes_out),
             volume.rate(), volume.max_error ? fmt::format(", max error {:.6g}", *volume.max_error) : "");
}

}  // namespace

void add_convert(CLI::App &app) {
  const auto options = std::make_shared<ConvertArgs>();
  CLI::App *command = app.add_subcommand("convert", "Compress a volume to a zfp file");
  command->add_option("IN", options->input, kVolumeHelp)->required();
  command->add_option("-o,--output", options->output, "the .zfp file to write")->required();
  CLI::Option *rate =
      command->add_option("--rate", options->compress.rate, "bits per voxel, 1 to 32")->capture_default_str();
  CLI::Option *tolerance =
      command->add_option("--tolerance", options->tolerance,
                          "instead: as few bits as keep each voxel within this error of the input's");
  CLI::Option *relative = command->add_option("--tolerance-relative", options->relative_tolerance,
                                              "the same, as a part of the range of values");
  CLI::Option *exact =
      command->add_flag("--exact", options->exact,
                        "the same, with no error: decoded values are the input's (integers below 2^24 only)");
  tolerance->excludes(rate, relative, exact);
  relative->excludes(rate, exact);
  exact->excludes(rate);
  command->add_option("--map-nan", options->compress.input.map_nan,
                      "replace NaN and infinite voxels by this value");
  command->add_option("--device", options->device,
                      "compress on this device, at a fixed rate: index, cpu, gpu, or a part of its name [the "
                      "host's processors]; the "
                      "file is the same");
  command->add_option("--threads", options->compress.input.num_threads, "0: one per processor")
      ->capture_default_str();
  command->add_flag("--no-verify", options->no_verify, "do not decode again to measure the largest error");
  add_volume_options(*command, options->volume);
  command->callback([options] { run(*options); });
}

}  // namespace isowave::tools
