#pragma once
// Code that the subcommands share about volumes: options, opening any kind of volume, and the
// progress bar.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/ocl/device.hpp"
#include "core/sources/load_volume.hpp"
#include "core/volume/block_box.hpp"
#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core::ocl {
class Device;
}

namespace isowave::core::tools {

/// Options as typed; to_overrides() checks them.
struct VolumeOptions {
  std::vector<std::uint32_t> dims;  ///< one number (a cube) or three
  std::string type;
  std::vector<double> spacing;  ///< one number or three
  std::string index;            ///< t=N: of a file with a fourth axis
};

/// Adds --dims, --type, --spacing and --index.
void add_volume_options(CLI::App &command, VolumeOptions &options);
/// Throws Error in one line on two numbers, unknown types, other axes.
RawOverrides to_overrides(const VolumeOptions &options);
/// N or X Y Z. Throws Error on another count.
glm::uvec3 to_dims(const std::vector<std::uint32_t> &numbers);

/// How a volume is compressed: see Storage.
struct CompressionOptions {
  std::optional<std::uint32_t> rate{};  ///< bits per voxel; any of the next three replaces it
  std::optional<double> tolerance{}, tolerance_relative{};
  bool exact = false;
  std::uint32_t levels = 1;                    ///< of detail; 0: all there can be
  bool measure_error = false;                  ///< at a fixed rate, too
  std::optional<double> no_data{};             ///< see InputOptions
  std::vector<const CLI::Option *> options{};  ///< those on the command line that say all this
};

/// Adds --rate, --tolerance, --tolerance-relative and --exact, of which one may be given, --levels
/// and --no-data.
void add_compression_options(CLI::App &command, CompressionOptions &options);
/// Adds --no-data.
CLI::Option *add_no_data_option(CLI::App &command, std::optional<double> &no_data);
/// Throws Error where an option of how to compress was given for volumes that are compressed
/// already.
void refuse_compression(const CompressionOptions &options, const std::string &path);
/// Whether the command line says how many levels there are to be.
bool says_levels(const CompressionOptions &options);
/// As core::find_precision(), of options. Throws Error.
std::optional<BlockPrecision> find_precision(const std::string &path, const RawOverrides &overrides,
                                             const CompressionOptions &options,
                                             const InputOptions &input = {});

/// The volume's name for files that are named after it: without folder and endings, and of a
/// generator without the word "generate".
std::string volume_stem(const std::string &path);

/// Warns of what VolumeReader::notices() says of a file's header; of a generator, nothing.
void warn_of_header(const std::string &path, const RawOverrides &overrides);

/// Prints how a volume was compressed that was not compressed yet.
void print_compression(const std::string &path, const CompressedVolume &volume);

/// The first suggested isovalue, which is printed (core/zfp/isovalue_suggestions.hpp).
///
/// Throws  Error: there is none; it asks for --isovalue
double suggested_isovalue(const CompressedVolume &volume);

/// Warns of an isovalue without a surface: see isovalue_notice().
void warn_of_isovalue(const CompressedVolume &volume, double isovalue);

/// The help text of an argument that open_any_volume() takes.
inline constexpr const char *kVolumeHelp =
    "a volume: .raw, .raw.gz, .nrrd, .nhdr, .mha, .mhd, .nii, .nii.gz, or "
    "generate:FIELD_XxYxZ_TYPE[:SEED]";

/// Opens a .zfp file (its spacing may be overridden; options of how to compress are refused), or
/// compresses any other volume, at a rate on `device` if one is given. Clears that device's
/// stage times. Throws Error also on what cannot be drawn.
CompressedVolume load_volume(const std::string &path, const RawOverrides &overrides,
                             const CompressionOptions &compression, ocl::Device *device = nullptr);

/// How that volume is compressed. Throws Error if it is compressed already, and options say how.
Storage storage_for(const std::string &path, const CompressionOptions &compression,
                    ocl::Device *device);

/// A bar on stderr while it is a terminal; silent elsewhere. Copies share the bar, which ends with
/// the last.
Progress make_progress_bar(std::string_view label);
/// The same for a frame, by percent; shown after two seconds.
std::function<void(double percent)> make_frame_bar();

/// 1,234,567
std::string with_commas(std::uint64_t number);

}  // namespace isowave::core::tools
