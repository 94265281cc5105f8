#pragma once
// A compressed volume from whatever a user names: a file of any format, or a synthetic volume.

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/io/open_volume.hpp"
#include "core/sources/generate.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// How voxels are compressed: by one of rate, tolerance, tolerance_relative and exact. By default
/// they keep all that float32 holds of them: find_precision().
struct Storage {
  std::optional<std::uint32_t> rate{};         ///< bits per voxel
  std::optional<double> tolerance{};           ///< largest error of a voxel
  std::optional<double> tolerance_relative{};  ///< the same, as a part of the range of values
  bool exact = false;                          ///< no error: refuses what float32 does not hold
  std::uint32_t levels = 1;                    ///< of detail; 0: all there can be
  bool measure_error = false;                  ///< at a fixed rate, too
  std::optional<float> map_nan{};              ///< see InputOptions
  std::optional<double> no_data{};             ///< see InputOptions
  std::uint32_t num_threads = 0;               ///< see InputOptions
  CoderMaker encoder{};                        ///< at a fixed rate: encoder_on() a device
  NoiseMaker noise{};                          ///< of generators: noise_on() a device
  const VolumePart *part = nullptr;            ///< see InputOptions
  /// Makes the progress of each step, which it is told: "compressing".
  std::function<Progress(std::string_view step)> progress{};

  /// Whether a volume of this type is read more than once.
  bool reads_again(VoxelType type) const {
    return !rate && (tolerance || tolerance_relative || exact || type != VoxelType::kFloat32);
  }
};

/// The precision that was asked for, or the default; none: the rate. May read the whole volume, for
/// a relative tolerance twice.
///
/// Throws  Error, which names the volume `what`: see choose_precision()
std::optional<BlockPrecision> find_precision(const OpenReader &open, std::string_view what,
                                             const Storage &storage);
/// Compresses into memory.
///
/// Throws  Error also on what cannot be drawn
CompressedVolume compress_volume(const OpenReader &open, std::string_view what,
                                 const Storage &storage);

/// As compress_volume(), but straight into a `.zfp` file, which is then opened: in memory, a few
/// layers of voxels, and what compress_to_file() says of levels.
///
/// Throws  Error also if the file cannot be written, or its name does not end in .zfp
CompressedVolume compress_volume_to_file(const OpenReader &open, std::string_view what,
                                         const Storage &storage, const std::filesystem::path &path);

/// Whether the name ends in .zfp.
bool is_zfp_name(std::string_view path);
/// Throws  Error: is_zfp_name() says no
void check_zfp_name(std::string_view path);
/// Opens a `.zfp` file, whose spacing may be overridden; the payload stays in the file. Throws
/// Error also on what cannot be drawn.
CompressedVolume open_compressed_volume(const std::string &path, const RawOverrides &overrides);

/// How names of generated volumes begin.
inline constexpr std::string_view kGenerate = "generate:";

/// Opens a file (open_volume), or the generator that `generate:FIELD_XxYxZ_TYPE[:SEED]` names.
///
/// noise  see GenerateOptions
/// step   see open_volume()
std::unique_ptr<VolumeReader> open_any_volume(const std::string &path,
                                              const RawOverrides &overrides,
                                              const NoiseMaker &noise = {},
                                              std::optional<std::uint32_t> step = {});

}  // namespace isowave::core
