// isowave info: what is known of a volume file, as text or JSON.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <system_error>

#include "core/base/error.hpp"
#include "core/io/json_list.hpp"
#include "core/io/open_volume.hpp"
#include "core/zfp/isovalue_suggestions.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/stated_errors.hpp"
#include "core/zfp/voxel_sample.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/histogram_text.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

struct InfoArgs {
  std::string input;
  VolumeOptions volume;
  std::optional<double> no_data;
  bool json = false, no_scan = false;
};

ordered_json describe_grid(const VolumeInfo &info) {
  ordered_json result = ordered_json::object();
  result["dims"] = {info.dims.x, info.dims.y, info.dims.z};
  result["type"] = to_string(info.type);
  result["voxels"] = info.num_voxels();
  result["voxel_bytes"] = info.num_voxels() * size_of(info.type);
  result["spacing"] = {info.spacing.x, info.spacing.y, info.spacing.z};
  result["origin"] = {info.origin.x, info.origin.y, info.origin.z};
  for (int column = 0; column < 3; ++column) {
    const glm::dvec3 axis = info.direction[column];
    add_to_list<ordered_json>(result, "direction", {axis.x, axis.y, axis.z});
  }
  return result;
}

/// What is known of a volume, and isovalues if its voxels were looked at.
struct Description {
  ordered_json json{};
  std::optional<IsovalueSuggestions> suggestions{};
};

/// Reads all of a `.zfp` file and, if it says anything of its voxels, decodes them.
CompressedVolume scan_zfp(const std::string &path) {
  const CompressedVolume head = read_zfp_file_info(path);
  if (!std::isfinite(head.value_range[0]) && head.coarser_levels.empty())
    return check_zfp_file(path);
  CompressedVolume volume = open_zfp_file(path);
  check_stated_errors(volume, make_progress_bar("checking"));
  return volume;
}

Description describe_zfp(const std::string &path, const RawOverrides &overrides, bool no_scan) {
  if (overrides.dims || overrides.type)
    throw Error("{}: --dims and --type are for raw files", path);
  check_has_step(path, overrides.step);
  CompressedVolume volume = no_scan ? read_zfp_file_info(path) : scan_zfp(path);
  if (overrides.spacing) {
    set_spacing(volume, *overrides.spacing);
    check_volume_info(volume.info, path);
  }
  ordered_json result = describe_grid(volume.info);
  const glm::uvec3 blocks = volume.num_blocks();
  result["blocks"] = {blocks.x, blocks.y, blocks.z};
  result["block_count"] = volume.block_count();
  const bool reversible = volume.precision.is_reversible();
  result["format"] = reversible            ? "zfp, reversible"
                     : volume.is_indexed() ? "zfp, fixed accuracy"
                                           : "zfp, fixed rate";
  if (volume.is_indexed()) {
    if (!reversible) result["zfp_tolerance"] = std::ldexp(1.0, volume.precision.min_exponent);
    result["exact"] = known_voxel_error(volume) == 0;
  } else {
    result["bits_per_block"] = volume.bits_per_block;
  }
  result["rate"] = volume.rate();
  if (std::isfinite(volume.value_range[0])) result["value_range"] = volume.value_range;
  if (!volume.no_data.empty()) result["no_data_voxels"] = volume.no_data.num_voxels();
  if (volume.max_voxel_error) result["max_voxel_error"] = *volume.max_voxel_error;
  for (const CompressedVolume &level : volume.coarser_levels) {
    const glm::uvec3 dims = level.info.dims;
    add_to_list<ordered_json>(result, "coarser", {dims.x, dims.y, dims.z});
    if (!level.bounds.codes.empty())
      add_to_list<ordered_json>(result, "level_errors", largest_bound(level.bounds));
  }
  if (known_voxel_error(volume)) result["errors"] = "stated";
  if (no_scan) return {result};
  try {
    return {result, suggest_isovalues(open_compressed_volume(path, overrides))};
  } catch (const std::bad_alloc &) {  // the index of a stream that has none
    result["isovalues"] = "not known: finding the blocks needs more memory";
    return {result};
  }
}

void read(VolumeReader &reader, std::uint32_t z, std::uint32_t num_layers, std::span<float> out) {
  reader.read_layers(z, num_layers, out);
}
void read(VolumeReader &reader, std::uint32_t z, std::uint32_t num_layers, std::span<double> out) {
  reader.read_exact_layers(z, num_layers, out);
}

/// Reads all voxels, a few layers at a time, as what holds them.
template <class Value>
void scan_voxels(VolumeReader &reader, const std::optional<double> &no_data, Description &result) {
  const glm::uvec3 dims = reader.info().dims;
  const std::uint64_t layer_size = std::uint64_t(dims.x) * dims.y;
  const auto chunk = std::uint32_t(std::clamp<std::uint64_t>((1u << 22) / layer_size, 1, dims.z));
  const Progress progress = make_progress_bar("reading");
  const auto memory = std::make_unique_for_overwrite<Value[]>(
      layer_size * chunk);  // a file may have fewer than it claims
  const auto no_data_value = static_cast<Value>(no_data.value_or(0));
  LayerSampler sampler(dims, kMostSuggestionVoxels);
  std::uint64_t no_data_count = 0, infinite_count = 0;
  Value min = std::numeric_limits<Value>::infinity(), max = -min;
  for (std::uint32_t z = 0; z < dims.z; z += chunk) {
    const std::uint32_t layers = std::min(chunk, dims.z - z);
    const std::span voxels(memory.get(), layer_size * layers);
    read(reader, z, layers, voxels);
    for (Value &value : voxels) {
      if (std::isnan(value) || (no_data && value == no_data_value)) {
        ++no_data_count;
        value = std::numeric_limits<Value>::quiet_NaN();
        continue;
      }
      if (std::isinf(value)) {
        ++infinite_count;
        value = std::numeric_limits<Value>::quiet_NaN();
        continue;
      }
      min = std::min(min, value);
      max = std::max(max, value);
    }
    for (std::uint32_t layer = 0; layer < layers; ++layer)
      sampler.add_layer<Value>(z + layer, voxels.subspan(layer_size * layer, layer_size));
    if (progress) progress(z + layers, dims.z);
  }
  if (min <= max) result.json["value_range"] = {min, max};
  if (no_data_count > 0) result.json["no_data_voxels"] = no_data_count;
  if (infinite_count > 0) result.json["infinite_voxels"] = infinite_count;
  const std::array range = {static_cast<float>(min), static_cast<float>(max)};
  result.suggestions = suggest_isovalues(reader.info(), range, sampler.voxels());
}

Description describe_voxels(const InfoArgs &options, const RawOverrides &overrides) {
  Description result{{{"format", "voxels"}}};
  const std::unique_ptr<VolumeReader> reader = open_any_volume(options.input, overrides);
  warn_of_header(options.input, overrides);
  result.json.update(describe_grid(reader->info()));
  if (options.no_scan) return result;
  if (fits_float32(reader->info().type)) {
    scan_voxels<float>(*reader, options.no_data, result);
  } else {
    scan_voxels<double>(*reader, options.no_data, result);
  }
  return result;
}

void add_suggestions(const IsovalueSuggestions &suggestions, ordered_json &result) {
  result["histogram"] = {{"range", suggestions.range}, {"counts", suggestions.counts}};
  for (const SuggestedIsovalue &suggested : suggestions.isovalues) {
    add_to_list(result, "suggested_isovalues",
                ordered_json{{"isovalue", suggested.isovalue}, {"by", to_string(suggested.by)}});
  }
}

std::string to_text(const ordered_json &value) {
  if (value.is_string()) return one_line(value.get<std::string>());
  if (value.is_number_unsigned()) return with_commas(value.get<std::uint64_t>());
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const ordered_json &element : value) {
    const bool is_row = element.is_array();
    if (!text.empty()) text += is_row ? " | " : " ";
    text += is_row ? to_text(element) : element.dump();
  }
  return text;
}

void run(const InfoArgs &options) {
  const RawOverrides overrides = to_overrides(options.volume);
  ordered_json result = ordered_json::object();
  result["file"] = options.input;
  std::error_code failure;
  if (std::filesystem::is_regular_file(options.input, failure))
    result["file_bytes"] = std::filesystem::file_size(options.input, failure);
  if (is_zfp_name(options.input)) {
    if (options.no_data)
      throw Error("--no-data: {} is compressed already: leave out the option", options.input);
  }
  const Description description = is_zfp_name(options.input)
                                      ? describe_zfp(options.input, overrides, options.no_scan)
                                      : describe_voxels(options, overrides);
  result.update(description.json);
  const std::optional<IsovalueSuggestions> &suggestions = description.suggestions;
  const bool has_isovalues = suggestions && !suggestions->isovalues.empty();
  if (options.json) {
    if (has_isovalues) add_suggestions(*suggestions, result);
    fmt::print("{}", json_text(result));
    return;
  }
  for (const auto &[key, value] : result.items()) fmt::print("{:<16}{}\n", key, to_text(value));
  if (!has_isovalues) return;
  fmt::print("{:<16}{}\n{}", "isovalues", suggestions_line(*suggestions),
             histogram_text(*suggestions, prints_utf8()));
}

}  // namespace

void add_info(CLI::App &app) {
  const auto options = std::make_shared<InfoArgs>();
  CLI::App *command =
      app.add_subcommand("info", "Print everything known of a volume file, and isovalues to draw");
  command->add_option("FILE", options->input, std::string(kVolumeHelp) + ", or .zfp")->required();
  command->add_flag("--json", options->json, "print JSON");
  command->add_flag("--no-scan", options->no_scan,
                    "look only at the header: no value range, no isovalues, no checksum of the "
                    "data, no check that a .zfp "
                    "file's trailer agrees with its voxels");
  add_volume_options(*command, options->volume);
  add_no_data_option(*command, options->no_data);
  command->callback([options] { run(*options); });
}

}  // namespace isowave::core::tools
