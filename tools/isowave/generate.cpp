#include <cmath>
#include <limits>
#include <type_traits>

// isowave generate: writes a synthetic volume in the Open-SciVis naming.

#include "core/sources/generate.hpp"
#include "core/sources/noise_on_device.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>

#include "core/base/error.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/raw_reader.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

struct GenerateArgs {
  std::string field, type = "uint8", output = ".";
  std::vector<std::uint32_t> dims;
  std::optional<std::string> device;
  GenerateOptions generate;
};

/// Refuses what could only end with a full disk.
void check_space(const GenerateOptions &options, const std::filesystem::path &output) {
  const double bytes =
      double(options.dims.x) * options.dims.y * options.dims.z * double(size_of(options.type));
  const std::filesystem::path folder =
      std::filesystem::is_directory(output) ? output : output.parent_path();
  std::error_code failure;
  const auto space = std::filesystem::space(folder.empty() ? "." : folder, failure);
  if (!failure && bytes > double(space.available))
    throw Error("{}: {:.0f} bytes are to be written, {} are free", output.string(), bytes,
                space.available);
}

/// The facts that a raw file's name does not state.
std::string raw_options(const GenerateOptions &options, const std::filesystem::path &path) {
  if (path.extension() != ".raw" || parse_raw_name(path.stem().string())) return {};
  return fmt::format(" --dims {} {} {} --type {}", options.dims.x, options.dims.y, options.dims.z,
                     to_string(options.type));
}

/// Half of the largest value that fields have.
double middle_of(VoxelType type) {
  return with_voxel_type(type, [](auto zero) {
    using T = decltype(zero);
    if constexpr (std::is_integral_v<T>) {
      return std::floor(0.5 * static_cast<double>(std::numeric_limits<T>::max()));
    } else {
      return 0.5;
    }
  });
}

void run_generate(const CLI::App &command, const GenerateArgs &options) {
  GenerateOptions generate = options.generate;
  generate.field = field_from_string(options.field);
  generate.type = voxel_type_from_string(options.type);
  generate.dims = to_dims(options.dims);
  if (!has_seed(generate.field))
    refuse_options(command, {"--seed"}, "is of noise, and this field has none");
  if (options.device) generate.noise = noise_on(ocl::choose_device(*options.device));
  check_space(generate, options.output);
  const std::filesystem::path path =
      generate_to_file(generate, options.output, make_progress_bar("generating"));
  fmt::print("{}: {}x{}x{} {}, {} bytes\n", one_line(path.string()), generate.dims.x,
             generate.dims.y, generate.dims.z, to_string(generate.type),
             with_commas(OutputGroup::current()->bytes_of(path)));
  fmt::print("draw it: isowave render {}{} -i {}\n", one_line(path.string()),
             raw_options(generate, path), middle_of(generate.type));
}

}  // namespace

void add_generate(CLI::App &app) {
  const auto options = std::make_shared<GenerateArgs>();
  CLI::App *command = app.add_subcommand("generate", "Write a synthetic volume as raw voxels");
  command
      ->add_option("FIELD", options->field,
                   fmt::format("one of {}", fmt::join(field_names(), ", ")))
      ->required();
  command->add_option("--dims", options->dims, "number of voxels: X Y Z, or N for a cube")
      ->expected(1, 3)
      ->required();
  command->add_option("--type", options->type, "voxel type")->capture_default_str();
  command->add_option("--seed", options->generate.seed, "seed of fields of noise")
      ->capture_default_str();
  command->add_option("--device", options->device,
                      "device that makes fields of noise, if it is no CPU and has doubles: index, "
                      "gpu, or a part of its name; the file is the same [the host's processors]");
  command
      ->add_option("--num-threads", options->generate.num_threads,
                   "number of threads; 0: one per processor")
      ->capture_default_str();
  command
      ->add_option("-o,--output", options->output,
                   "file (.raw, .nrrd), or folder for a file FIELD_XxYxZ_TYPE.raw")
      ->capture_default_str();
  command->callback([command, options] { run_generate(*command, *options); });
}

}  // namespace isowave::core::tools
