// isowave convert: compresses a volume to a fixed-rate zfp file.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "core/error.hpp"
#include "core/ocl/device.hpp"
#include "core/zfp_stream.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::tools {

namespace {

struct ConvertArgs {
  std::string input, output;
  std::optional<std::string> device;
  VolumeOptions volume;
  CompressOptions compress;
  bool no_verify = false;
};

void run(const ConvertArgs &options) {
  if (!is_zfp_name(options.output)) throw Error("{}: end the output's name in .zfp", options.output);
  if (is_zfp_name(options.input)) throw Error("{}: is compressed already", options.input);
  const std::unique_ptr<VolumeReader> reader = open_any_volume(options.input, to_overrides(options.volume));
  CompressOptions compress = options.compress;
  compress.measure_error = !options.no_verify;
  compress.progress = make_progress_bar("compressing");
  std::optional<ocl::Device> device;
  if (options.device) compress.device = &device.emplace(ocl::choose_device(*options.device));
  const CompressedVolume volume = compress_to_file(*reader, compress, options.output);

  const glm::uvec3 dims = volume.info.dims;
  const std::uint64_t bytes_in = volume.info.num_voxels() * size_of(volume.info.type);
  const std::uint64_t bytes_out = std::filesystem::file_size(options.output);
  fmt::print("{}: {}x{}x{} {}, {} -> {} bytes, {} bits per voxel{}\n", options.output, dims.x, dims.y, dims.z,
             to_string(volume.info.type), with_commas(bytes_in), with_commas(bytes_out), volume.rate(),
             volume.max_error ? fmt::format(", max error {:.6g}", *volume.max_error) : "");
}

}  // namespace

void add_convert(CLI::App &app) {
  const auto options = std::make_shared<ConvertArgs>();
  CLI::App *command = app.add_subcommand("convert", "Compress a volume to a fixed-rate zfp file");
  command->add_option("IN", options->input, kVolumeHelp)->required();
  command->add_option("-o,--output", options->output, "the .zfp file to write")->required();
  command->add_option("--rate", options->compress.rate, "bits per voxel, 1 to 32")->capture_default_str();
  command->add_option("--map-nan", options->compress.map_nan,
                      "replace NaN and infinite voxels by this value");
  command->add_option(
      "--device", options->device,
      "compress on this device: index, cpu, gpu, or a part of its name [the host's processors]; the file "
      "is the same");
  command->add_option("--threads", options->compress.num_threads, "0: one per processor")
      ->capture_default_str();
  command->add_flag("--no-verify", options->no_verify, "do not decode again to measure the largest error");
  add_volume_options(*command, options->volume);
  command->callback([options] { run(*options); });
}

}  // namespace isowave::tools
