// isowave generate: writes a synthetic volume in the Open-SciVis naming.

#include "core/sources/generate.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <system_error>

#include "core/base/error.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

struct GenerateArgs {
  std::string field, type = "uint8", output = ".";
  std::vector<std::uint32_t> dims;
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

void run_generate(const CLI::App &command, const GenerateArgs &options) {
  GenerateOptions generate = options.generate;
  generate.field = field_from_string(options.field);
  generate.type = voxel_type_from_string(options.type);
  generate.dims = to_dims(options.dims);
  if (generate.field != Field::kMixingLayer)
    refuse_options(command, {"--seed"}, "is of mixing_layer's noise alone");
  check_space(generate, options.output);
  const std::filesystem::path path =
      generate_to_file(generate, options.output, make_progress_bar("generating"));
  fmt::print("{}: {}x{}x{} {}, {} bytes\n", one_line(path.string()), generate.dims.x,
             generate.dims.y, generate.dims.z, to_string(generate.type),
             with_commas(std::filesystem::file_size(path)));
}

}  // namespace

void add_generate(CLI::App &app) {
  const auto options = std::make_shared<GenerateArgs>();
  CLI::App *command = app.add_subcommand("generate", "Write a synthetic volume as raw voxels");
  command
      ->add_option("FIELD", options->field,
                   fmt::format("one of {}", fmt::join(field_names(), ", ")))
      ->required();
  command->add_option("--dims", options->dims, "voxels: X Y Z, or N for a cube")
      ->expected(1, 3)
      ->required();
  command->add_option("--type", options->type, "voxel type")->capture_default_str();
  command->add_option("--seed", options->generate.seed, "of mixing_layer's noise")
      ->capture_default_str();
  command->add_option("--threads", options->generate.num_threads, "0: one per processor")
      ->capture_default_str();
  command
      ->add_option("-o,--output", options->output,
                   "file (.raw), or a folder for a file FIELD_XxYxZ_TYPE.raw")
      ->capture_default_str();
  command->callback([command, options] { run_generate(*command, *options); });
}

}  // namespace isowave::core::tools
