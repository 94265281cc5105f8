// isowave export: a page that shows a volume in any browser, or a site of it for a server of files.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "core/api/volume_implementation.hpp"
#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/atomic_file.hpp"
#include "isowave/page.hpp"
#include "tools/isowave/annotate.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/help_groups.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

struct ExportArgs {
  std::string input, scene, output, site;
  std::optional<double> isovalue;
  VolumeOptions volume;
  CompressionOptions compression;
  isowave::PageOptions page;
};

bool is_scene_name(const std::string &path) {
  return std::filesystem::path(path).extension() == ".json";
}

/// The scene of the command line, whose volume is what is drawn.
Scene read_scene_of(const CLI::App &command, ExportArgs &options) {
  if (is_scene_name(options.input)) {
    if (!options.scene.empty())
      throw Error("--scene {}: {} is a scene already", options.scene, options.input);
    options.scene = options.input;
    options.input.clear();
  }
  Scene scene;
  if (options.scene.empty()) {
    scene.volume = options.input;
    return scene;
  }
  refuse_options(command, {"--isovalue"}, "the scene says what is drawn: leave it out");
  scene = isowave::read_scene(options.scene);
  if (!options.input.empty()) scene.volume = options.input;
  if (scene.volume.empty())
    throw Error("{}: the scene names no volume: give it before --scene", options.scene);
  if (options.input.empty() && options.volume.index.empty()) {
    scene_volume(scene);  // or throws
    options.volume.index = scene.index;
  }
  return scene;
}

/// The second volume; null: the scene's colours are by none.
std::shared_ptr<const Volume> load_field(const Scene &scene,
                                         const CompressionOptions &compression) {
  const std::string field = scene.field.string();
  if (!scene.appearance.color_by_field || field.empty() || field == "volume") return {};
  VolumeOptions options;
  scene_field(scene);  // or throws
  options.index = scene.field_index;
  return std::make_shared<Volume>(std::make_unique<Volume::Implementation>(
      load_volume(field, to_overrides(options),
                  is_zfp_name(field) ? CompressionOptions{} : compression),
      std::vector<std::string>{}));
}

/// Looks at the outputs before any work, and sets the page's name if there is none.
void check_outputs(const CLI::App &command, ExportArgs &options, const Scene &scene) {
  Outputs outputs;
  outputs.read_volume(scene.volume.string());
  outputs.read(options.scene);
  if (!options.site.empty()) {
    refuse_options(command, {"--output"}, "--site names the folder of all files: leave it out");
    check_site(scene, options.page);
    std::error_code failure;
    if (!std::filesystem::is_directory(options.site, failure)) {
      outputs.write_folder("--site", options.site);
      return outputs.make_folder();
    }
    for (const std::filesystem::path &file : isowave::site_files(options.site))
      outputs.write("--site", file);
    return;
  }
  if (options.output.empty()) options.output = volume_stem(scene.volume.string()) + ".html";
  outputs.write("--output", options.output);
  check_page(scene, options.output, options.page);
}

void tell_of(const std::string &file, const char *more) {
  fmt::print("wrote {}: {} bytes{}\n", one_line(file),
             with_commas(OutputGroup::current()->bytes_of(file)), more);
}

void run_export(const CLI::App &command, ExportArgs options) {
  Scene scene = read_scene_of(command, options);
  const std::string input = scene.volume.string();
  const bool names_output = options.output.empty();
  check_outputs(command, options, scene);

  const auto volume = std::make_shared<Volume>(std::make_unique<Volume::Implementation>(
      load_volume(input, to_overrides(options.volume), options.compression),
      std::vector<std::string>{}));
  const CompressedVolume &compressed = volume->implementation().volume;
  print_compression(input, compressed);
  if (scene.surfaces.empty()) {
    const double isovalue = options.isovalue ? *options.isovalue : suggested_isovalue(compressed);
    scene.surfaces = {{.isovalue = isovalue}};
  }
  for (const isowave::Surface &surface : scene.surfaces) {
    if (surface.labels.empty()) warn_of_isovalue(compressed, surface.isovalue);
  }
  if (can_annotate()) {
    options.page.annotate = [](Frame &frame, const std::vector<isowave::AnnotationGroup> &groups) {
      draw_annotations(frame, groups);
    };
  } else if (scene.annotations) {
    warn("without Cairo, the picture that shows without JavaScript has no annotations");
  }
  if (options.site.empty()) {
    options.page.field = load_field(scene, options.compression);
    save_page(volume, scene, options.output, options.page);
    tell_of(options.output, names_output ? "; --output names another file" : "");
    return;
  }
  save_site(volume, scene, options.site, options.page);
  for (const std::filesystem::path &file : isowave::site_files(options.site))
    tell_of(file.string(), "");
}

}  // namespace

void add_export(CLI::App &app) {
  const auto options = std::make_shared<ExportArgs>();
  CLI::App *command = app.add_subcommand(
      "export", "Write a page that shows a volume in any browser, without a server");
  command
      ->add_option(
          "VOLUME", options->input,
          "a scene file (.json) that names its volume, a .zfp file, or " + std::string(kVolumeHelp))
      ->required();
  command
      ->add_option("-i,--isovalue", options->isovalue,
                   "value of the field on the surface [the first that `isowave info` suggests]")
      ->check(fits_float32());
  command->add_option("--scene", options->scene, "scene file (JSON): what is drawn of VOLUME");
  command->add_option("--output,-o", options->output,
                      "file that ends in .html; it holds the volume and all that draws it "
                      "[VOLUME.html in the current folder]");
  command->add_option("--site", options->site,
                      "folder that is made for a server of files: the page, index.html, and the "
                      "volume, of any size, which the page reads in parts by HTTP range requests");
  command->add_option("--title", options->page.title, "the page's title [the volume's name]");
  command->add_option("--engine", options->page.engine,
                      "page.html.gz, which tools/wasm makes [ISOWAVE_PAGE, or the one that was "
                      "built or installed with this program]");
  add_volume_options(*command, options->volume);
  add_compression_options(*command, options->compression);
  group_options(*command, "Options of every day",
                {"--help", "--isovalue", "--scene", "--output", "--site", "--title", "--engine"});
  group_volume_options(*command);
  group_compression_options(*command);
  command->callback([command, options] { run_export(*command, *options); });
}

}  // namespace isowave::core::tools
