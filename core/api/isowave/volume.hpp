#pragma once
// Compressed volumes: opened from files of many formats, or made from an array in memory.

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <ranges>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "isowave/camera.hpp"

namespace isowave {

enum class VoxelType {
  kUint8,
  kInt8,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kFloat32,
  kFloat64,
  kUint64,  ///< 64-bit integers that float64 does not hold are refused
  kInt64    ///< as kUint64
};

/// Places of voxels: world = origin + direction * (spacing * index), index (i,j,k) of a voxel.
struct Grid {
  std::array<std::uint32_t, 3> dims{};  ///< voxels along x, y, z: 2 to 65,536 each
  Vector3 spacing{1, 1, 1};             ///< world units between voxels along x, y, z; above 0
  Vector3 origin{0, 0, 0};              ///< world position of voxel (0,0,0)
  /// Unit world direction of the index axes x, y, z.
  std::array<Vector3, 3> direction{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  /// World space is a patient's, LPS: +x left, +y posterior, +z superior. Files say so: NIfTI, NRRD
  /// in space LPS, RAS or LAS, MetaImage with an AnatomicalOrientation. Only views depend on it.
  bool is_anatomical = false;
};

/// Voxels of a grid: begin, begin + step, ... below end, along x, y, z.
struct Region {
  std::array<std::uint32_t, 3> begin{};
  std::array<std::uint32_t, 3> end{};
  std::array<std::uint32_t, 3> step{1, 1, 1};
};

/// How voxels are compressed: by at most one of rate, tolerance, tolerance_relative and exact. By
/// default, voxels are kept as float32 holds them: integers below 2^24 and float32 have no error.
/// Compression takes memory for the result and a few layers of voxels.
struct Compression {
  std::optional<std::uint32_t> rate{};         ///< bits per voxel, 1 to 32
  std::optional<double> tolerance{};           ///< no voxel is off by more [voxel values]
  std::optional<double> tolerance_relative{};  ///< the same, as a part of the range of values
  bool exact = false;          ///< refuses voxels that float32 does not hold; else as by default
  bool measure_error = false;  ///< decodes all, for Volume::max_voxel_error() at a rate, too
  std::uint32_t levels = 1;    ///< levels of detail, with the volume itself; 0: all it can have
  std::optional<float> map_nan{};  ///< value that replaces NaN and infinite voxels
  /// Value of voxels without data, compared in the volume's own type. NaN voxels have no data,
  /// either: no surface touches voxels without data. Infinite voxels are refused unless map_nan or
  /// no_data is given.
  std::optional<double> no_data{};
  std::uint32_t num_threads = 0;  ///< 0: one per processor. The result is the same for any number
  /// Called from the calling thread: what compress() is doing, and how much of it is done, 0 to 1.
  std::function<void(std::string_view what, double done)> progress{};
};

/// Facts that a file does not state, or states wrongly. `NAME_XxYxZ_TYPE.raw` and `.raw.gz` state
/// dims and type.
struct RawFile {
  std::optional<std::array<std::uint32_t, 3>> dims{};
  std::optional<VoxelType> type{};
  std::optional<Vector3> spacing{};  ///< replaces the spacing of a file of any format
  std::optional<std::uint32_t>
      step{};  ///< volume of a NIfTI or NRRD file with a fourth axis, from 0
};

/// A compressed volume in memory or in a file. It cannot be changed, so any number of renderers and
/// threads may share one.
class Volume {
 public:
  ~Volume();
  Volume(const Volume &) = delete;
  Volume &operator=(const Volume &) = delete;

  const Grid &grid() const;
  VoxelType source_type() const;  ///< type of voxels before compression
  /// [least, largest] voxel of the source; infinite if a file does not say.
  std::array<float, 2> value_range() const;
  /// How blocks are stored: "reversible" (all bits of float32), "whole numbers" (rounded to the
  /// source's integers), "fixed accuracy" or "fixed rate".
  std::string_view compression() const;
  double bits_per_voxel() const;
  std::uint64_t compressed_bytes() const;
  /// Largest |decoded - source|, if it was measured.
  std::optional<double> max_voxel_error() const;
  /// A line for users if the source has no surface at this isovalue: it says the range of values,
  /// and whether errors of compression can make a surface. Else nothing.
  std::string isovalue_notice(double isovalue) const;
  /// Lines for users that say how the header of the opened file was understood: units that were
  /// converted, a qform that contradicts the sform. Empty if the file was compressed already.
  const std::vector<std::string> &notices() const;
  /// Whether a `.zfp` file states the errors of voxels and levels, and value_range(). They cannot
  /// be checked without the source, so bounds of frames hold if the file's writer is right. false:
  /// they were measured when this volume was compressed.
  bool errors_are_stated() const;
  std::uint32_t num_levels() const;  ///< levels of detail, with the volume itself
  /// Whether float32 holds positions in the volume's box within 1/4096 of a voxel. If so, vertices
  /// of meshes and positions of hits are rounded to float32, and files of meshes have float32.
  bool float32_positions() const;

  /// The grid of a level of detail; 0: that of the volume.
  ///
  /// Throws  Error: there is no such level
  Grid level_grid(std::uint32_t level) const;

  /// Decodes all voxels, or those of a coarser level of detail: [nz][ny][nx] of its grid.
  ///
  /// Throws  Error: there is no such level
  std::vector<float> decode(std::uint32_t level = 0) const;
  /// Decodes the voxels of a level in a region: [nz][ny][nx]. Only blocks of 4^3 voxels that have
  /// some of these voxels are decoded, and read if the volume stays in a file.
  ///
  /// Throws  Error: there is no such level; a side of the region is empty, or ends outside
  std::vector<float> decode(std::uint32_t level, const Region &region) const;
  /// Decodes blocks that are spread over the volume, for histograms: about max_voxels voxels, the
  /// same ones each time; all voxels if there are no more.
  std::vector<float> sample(std::uint64_t max_voxels) const;
  /// Isovalues that are worth a first look, found in a sample of the blocks: the same ones each
  /// time. Otsu's threshold, which divides the histogram, comes first; up to three values follow
  /// where the mean gradient magnitude has a peak, the most prominent first. Empty if all voxels
  /// have the same value, or none has data. Takes about as long as decoding 4 million voxels.
  std::vector<double> suggested_isovalues() const;
  /// Writes a `.zfp` file to a temporary name and renames it.
  ///
  /// Throws  Error: the name does not end in .zfp, or the file cannot be written
  void save(const std::filesystem::path &path) const;

  struct Implementation;
  explicit Volume(std::unique_ptr<const Implementation> implementation);
  const Implementation &implementation() const { return *implementation_; }

 private:
  std::unique_ptr<const Implementation> implementation_;
};

/// Opens a volume.
///
/// path         .zfp: the volume stays in the file, which must not change, and is read when it is
///              needed.
///              .raw, .raw.gz, .nrrd, .nhdr, .mha, .mhd, .nii, .nii.gz: compressed into memory.
///              generate:FIELD_XxYxZ_TYPE: a synthetic volume (`isowave generate --help`)
/// compression  for a volume that is not compressed yet; refused with a .zfp file
/// Throws       Error: no such file, a header that is not understood, a wrong size, NaN, a volume
///              that cannot be drawn
std::shared_ptr<const Volume> open_volume(const std::filesystem::path &path,
                                          const Compression &compression = {},
                                          const RawFile &raw = {});

/// Compresses voxels in memory.
///
/// voxels  [nz][ny][nx] of `type`, x fastest; not needed afterwards
/// Throws  Error: a bad grid, infinite voxels, a tolerance that cannot be kept
std::shared_ptr<const Volume> compress(const void *voxels, VoxelType type, const Grid &grid,
                                       const Compression &compression = {});

/// Fills `out` [num_layers][ny][nx] with voxels, layers from z_begin on.
using ReadLayers =
    std::function<void(std::uint32_t z_begin, std::uint32_t num_layers, std::span<std::byte> out)>;

/// Compresses voxels that are read a few layers at a time, so that they need not be in memory all
/// at once: arrays in chunked stores, simulations.
///
/// read     called for ascending layers, by one thread at a time, not always the calling one
/// keep     Keeps layers that compression needs twice in a temporary file (TMPDIR) of the volume's
///          size; read() is then called once for each layer. false: read() is called again, from
///          front to back. At a rate, and with float32 by default, layers are needed once.
/// Throws   Error: as above; what read() throws, as Error
std::shared_ptr<const Volume> compress(const ReadLayers &read, VoxelType type, const Grid &grid,
                                       const Compression &compression = {}, bool keep = true);

/// The same, straight into a `.zfp` file, which is then opened. Memory holds a few layers of
/// voxels, and with levels of detail up to 9 bytes for each block of 4^3 voxels.
///
/// path    ends in .zfp; the file is written under a temporary name, and renamed
/// Throws  Error: as above; the file cannot be written
std::shared_ptr<const Volume> compress_to_file(const ReadLayers &read, VoxelType type,
                                               const Grid &grid, const std::filesystem::path &path,
                                               const Compression &compression = {},
                                               bool keep = true);

/// Throws  Error unless num_voxels is the grid's number of voxels
void check_num_voxels(std::uint64_t num_voxels, const Grid &grid);

/// The type of voxels T.
template <class T>
constexpr VoxelType voxel_type_of() {
  static_assert(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>,
                "voxels are integers, float or double");
  if constexpr (std::is_floating_point_v<T>) {
    static_assert(sizeof(T) == 4 || sizeof(T) == 8);
    return sizeof(T) == 4 ? VoxelType::kFloat32 : VoxelType::kFloat64;
  } else {
    constexpr bool kSigned = std::is_signed_v<T>;
    if (sizeof(T) == 1) return kSigned ? VoxelType::kInt8 : VoxelType::kUint8;
    if (sizeof(T) == 2) return kSigned ? VoxelType::kInt16 : VoxelType::kUint16;
    if (sizeof(T) == 4) return kSigned ? VoxelType::kInt32 : VoxelType::kUint32;
    return kSigned ? VoxelType::kInt64 : VoxelType::kUint64;
  }
}

/// The same for std::vector, std::span, std::array...
template <std::ranges::contiguous_range Voxels>
std::shared_ptr<const Volume> compress(const Voxels &voxels, const Grid &grid,
                                       const Compression &compression = {}) {
  check_num_voxels(std::ranges::size(voxels), grid);
  return compress(std::ranges::data(voxels), voxel_type_of<std::ranges::range_value_t<Voxels>>(),
                  grid, compression);
}

}  // namespace isowave
