#pragma once
// Voxels in several files, such as one for each layer, that a header lists or names by a pattern.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/input_file.hpp"

namespace isowave::core {

class HeaderFields;
class HeaderLines;

/// What a header says of the files that have its voxels: a list of names, or a pattern and numbers
/// to put into it.
struct VoxelFileNames {
  std::vector<std::string> list{};
  std::string before{}, after{};  ///< of the pattern, around the number
  std::uint32_t width = 0;        ///< least length of the number
  char fill = ' ';                ///< what makes it as long
  std::int64_t first = 0, step = 1;
  std::uint64_t count = 0;
  std::optional<std::int64_t> num_axes{};  ///< of each file's array; none: all but the slowest axis

  std::string name(std::uint64_t index) const;
};

/// Reads the value of the field that names the voxels' file:
///
///   LIST [AXES]                       names in the lines that follow, up to an empty one
///   slice%03d.raw FIRST LAST STEP [AXES]
///   anything else                     none: it names one file
///
/// lines    stands at the field's line, the last one of the header if it is a list
/// field    its name
/// Throws   Error: numbers that make no such list
std::optional<VoxelFileNames> read_voxel_file_names(const HeaderFields &fields,
                                                    std::string_view field, HeaderLines &lines);

/// Files that have the voxels of a volume, or of a series, one after the other, each as many. A
/// file is opened when its voxels are read, and closed behind them.
class VoxelFiles {
 public:
  /// header  the file that names them, relative to its folder
  /// sizes   of the array's axes, the fastest first
  /// field   for messages
  /// Throws  Error: the files cannot share these axes
  VoxelFiles(std::shared_ptr<const InputFile> header, VoxelFileNames names,
             std::span<const std::int64_t> sizes, std::string_view field);

  std::uint64_t size() const { return names_.count; }
  std::uint64_t voxels_each() const { return voxels_each_; }
  /// Throws  Error that names header and file: as InputFile()
  std::shared_ptr<const InputFile> open(std::uint64_t index) const;

 private:
  std::shared_ptr<const InputFile> header_;
  VoxelFileNames names_;
  std::uint64_t voxels_each_ = 0;
};

}  // namespace isowave::core
