#pragma once
// Opens uncompressed volumes of every format that is read here.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "core/io/raw_reader.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core {

/// Opens Open-SciVis raw (`NAME_XxYxZ_TYPE.raw`, `.raw.gz`), NRRD (.nrrd, .nhdr), MetaImage (.mha,
/// .mhd) or NIfTI (.nii, .nii.gz), by its extension in any case. Reads and judges the whole header;
/// layers are read as they are asked for, in bounded memory.
///
/// Throws  Error: unknown extension, missing file or none but a regular one, bad name, a header
///         that is not understood, zero dims, truncated or oversized data, more than one component;
///         there is no such step
///
/// step  of a file with a fourth axis; none: that of the overrides, or the file's only volume
std::unique_ptr<VolumeReader> open_volume(const std::filesystem::path &path,
                                          const RawOverrides &overrides = {},
                                          std::optional<std::uint32_t> step = {});
/// Number of volumes that the file has along its fourth axis; none if its header has no such axis.
///
/// Throws  Error: it has no header that is understood
std::optional<std::uint32_t> num_steps(const std::filesystem::path &path);
/// Visits the files that have the voxels: those that the volume's header names, or else its own.
///
/// Throws  Error as open_volume()
void visit_voxel_files(const std::filesystem::path &path,
                       const std::function<void(const std::filesystem::path &)> &visit);
/// Throws  Error: a step, other than the first, of a file that has one volume
void check_has_step(const std::filesystem::path &path, std::optional<std::uint32_t> step);

}  // namespace isowave::core
