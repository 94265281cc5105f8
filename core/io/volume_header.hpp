#pragma once
// Contents of a volume file's header: its grid, and where and how its voxels lie. The readers of
// headers (nrrd_header.hpp, meta_image_header.hpp, nifti_header.hpp) make it, open_voxels() in
// raw_reader.hpp reads by it.
//
// World space of all formats: millimetres, and if the format is anatomical LPS (+x left, +y
// posterior, +z superior), so that the same head has the same world coordinates from any of the
// formats. Lengths in a unit that the file names are converted. A negative spacing is stored as a
// flipped direction.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/input_file.hpp"
#include "core/io/voxel_files.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core {

enum class VoxelEncoding { kRaw, kGzip, kGzipOrZlib, kHex, kText };

/// Voxels fill their file from where they begin to its end, the volumes of a series one after the
/// other.
struct VoxelLayout {
  std::shared_ptr<const InputFile> file;  ///< the header's own or the one it names
  /// Files that have the voxels, instead of `file`, each as what follows says.
  std::shared_ptr<const VoxelFiles> files;
  VoxelEncoding encoding = VoxelEncoding::kRaw;
  std::uint64_t offset = 0;  ///< bytes of the file before the voxels, but for what is skipped:
  std::uint64_t lines_to_skip = 0;  ///< lines of the file, and then
  std::uint64_t bytes_to_skip = 0;  ///< bytes of it, unpacked if it is compressed
  bool from_end =
      false;  ///< raw: the voxels are the last bytes of the file, whatever is before them
  std::optional<std::uint64_t> packed_bytes;  ///< compressed bytes, if the header states them
  VoxelType type = VoxelType::kFloat32;       ///< as stored
  std::uint32_t num_steps = 1;  ///< volumes in the file: above 1 if it has a fourth axis
  std::uint32_t step = 0;       ///< the one that is read
  bool big_endian = false;
  /// A voxel's value is slope * stored + intercept.
  double slope = 1.0, intercept = 0.0;

  bool is_scaled() const { return slope != 1.0 || intercept != 0.0; }
};

struct VolumeHeader {
  VolumeInfo info;  ///< type: of the values: float32, or of 32 bits float64, where stored integers
                    ///< are scaled
  VoxelLayout voxels;
  std::vector<std::string> notices;  ///< VolumeReader::notices()
};

/// The millimetres in a unit of lengths by its name or symbol: "um", "micrometer", "mm". Nothing
/// for other words.
std::optional<double> millimetres_in(std::string_view unit);

/// Millimetres in each of the units that a header names; 1 for what names no unit of lengths. Adds
/// a line to notices() unless all are millimetres or unknown.
///
/// field  of the header: "space units"
std::vector<double> millimetres_in(std::span<const std::string> units, std::string_view field,
                                   const std::string &what, VolumeHeader &header);

/// Sets direction and spacing of index axis `axis` from a spacing that may be negative and a world
/// direction.
void set_axis(VolumeInfo &info, int axis, double spacing, const glm::dvec3 &direction);

/// Opens the data file that a detached header names, relative to the header's folder.
///
/// Throws  Error that names both
std::shared_ptr<const InputFile> open_data_file(const InputFile &header, const std::string &name);

}  // namespace isowave::core
