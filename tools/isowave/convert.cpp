// isowave convert: compresses a volume to a zfp file.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.hpp"
#include "core/bricks/ranks.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/open_volume.hpp"
#include "core/ocl/device.hpp"
#include "core/sources/noise_on_device.hpp"
#include "core/stages/zfp_encode.hpp"
#include "core/zfp/compress_together.hpp"
#include "core/zfp/describe_compression.hpp"
#include "core/zfp/slabs.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compile_report.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

struct ConvertArgs {
  std::string path, output;
  std::optional<std::string> device;
  VolumeOptions volume;
  CompressionOptions compression;
  InputOptions input;
  bool no_verify = false;
};

void check_output(const ConvertArgs &options) {
  Outputs outputs;
  outputs.read_volume(options.path);
  outputs.write("--output", options.output);
}

/// Each process of a team writes its slab. Returns what the file then has.
CompressedVolume convert_together(const ConvertArgs &options, const RawOverrides &overrides,
                                  CompressOptions &compress, Team &team) {
  agree_on(team, "version", program_name());
  agree_on(team, "command line", MpiJob::command_line());
  std::optional<ocl::Device> device;
  NoiseMaker noise;
  VolumeInfo info;
  together(team, [&] {
    if (team.rank() == 0) check_output(options);
    if (options.device) {
      device.emplace(choose_local_device(*options.device, MpiJob::local_rank()));
      compress.encoder = encoder_on(*device);
      noise = noise_on(*device);
    }
    info = open_any_volume(options.path, overrides, noise)->info();
    warn_of_header(options.path, overrides);
  });
  agree_on(team, "volume", fingerprint(options.path, info));
  const VolumePart part = own_part(team, info);
  InputOptions input = options.input;
  input.part = &part;
  compress.precision = find_precision(options.path, overrides, options.compression, input);
  compress.input.progress = make_progress_bar("compressing");
  const std::unique_ptr<SharedFile> file = MpiJob::create_file(options.output);
  return compress_together(
      team, [&] { return open_any_volume(options.path, overrides, noise); }, compress, *file);
}

CompressedVolume convert_alone(const ConvertArgs &options, const RawOverrides &overrides,
                               CompressOptions &compress) {
  check_output(options);
  std::optional<ocl::Device> device;
  NoiseMaker noise;
  if (options.device) {
    device.emplace(ocl::choose_device(*options.device));
    compress.encoder = encoder_on(*device);
    noise = noise_on(*device);
  }
  const std::unique_ptr<VolumeReader> reader = open_any_volume(options.path, overrides, noise);
  warn_of_header(options.path, overrides);
  std::optional<CompileReport> compiling;
  if (device) compiling.emplace(*device);
  compress.precision = find_precision(options.path, overrides, options.compression, options.input);
  compress.input.progress = make_progress_bar("compressing");
  CompressedVolume volume = compress_to_file(*reader, compress, options.output);
  if (compiling) compiling->finish();
  return volume;
}

void print_summary(const ConvertArgs &options, const CompressedVolume &volume) {
  const glm::uvec3 dims = volume.info.dims;
  const std::uint64_t bytes_in = volume.info.num_voxels() * size_of(volume.info.type);
  const std::uint64_t bytes_out = OutputGroup::current()->bytes_of(options.output);
  fmt::print("{}: {}x{}x{} {}, {} -> {} bytes, {}\n", one_line(options.output), dims.x, dims.y,
             dims.z, to_string(volume.info.type), with_commas(bytes_in), with_commas(bytes_out),
             describe_compression(volume));
  for (const CompressedVolume &level : volume.coarser_levels) {
    const glm::uvec3 coarse = level.info.dims;
    fmt::print("  level of detail {}x{}x{}: {} bytes\n", coarse.x, coarse.y, coarse.z,
               with_commas((level.payload_bits() + 7) / 8));
  }
}

void run_convert(const CLI::App &command, const ConvertArgs &options) {
  if (!is_zfp_name(options.output))
    throw Error("{}: end the output's name in .zfp", options.output);
  if (is_zfp_name(options.path)) throw Error("{}: is compressed already", options.path);
  if (options.device && !options.compression.rate)
    throw Error("--device compresses at a fixed rate only: leave it out, or give --rate");
  if (!options.compression.rate)
    refuse_options(command, {"--no-verify"}, "the error is measured except at a fixed --rate");
  const RawOverrides overrides = to_overrides(options.volume);
  CompressOptions compress{.rate = options.compression.rate.value_or(0),
                           .measure_error = !options.no_verify,
                           .levels = options.compression.levels,
                           .input = options.input};
  compress.input.no_data = options.compression.no_data;
  Team *team = MpiJob::team();
  const CompressedVolume volume = team != nullptr
                                      ? convert_together(options, overrides, compress, *team)
                                      : convert_alone(options, overrides, compress);
  if (team == nullptr || team->rank() == 0) print_summary(options, volume);
}

}  // namespace

void add_convert(CLI::App &app) {
  const auto options = std::make_shared<ConvertArgs>();
  CLI::App *command = app.add_subcommand("convert", "Compress a volume to a zfp file");
  command->add_option("IN", options->path, kVolumeHelp)->required();
  command->add_option("-o,--output", options->output, "the .zfp file to write")->required();
  add_compression_options(*command, options->compression);
  command
      ->add_option("--map-nan", options->input.map_nan,
                   "value that replaces NaN and infinite voxels")
      ->check(fits_float32());
  command->add_option("--device", options->device,
                      "device that compresses at a fixed rate, and makes generated voxels: index, "
                      "cpu, gpu, or a part of its name; the file is the same [the host's "
                      "processors]");
  command
      ->add_option("--num-threads", options->input.num_threads,
                   "number of threads; 0: one per processor")
      ->capture_default_str();
  command->add_flag("--no-verify", options->no_verify,
                    "do not decode again to measure the largest error");
  add_volume_options(*command, options->volume);
  command->callback([command, options] { run_convert(*command, *options); });
}

}  // namespace isowave::core::tools
