#pragma once
// Series of volumes on one grid: files by a pattern, or a file with a fourth axis.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "core/sources/load_volume.hpp"
#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// One volume of a series.
struct SeriesStep {
  std::string path;
  std::optional<std::uint32_t> step{};  ///< of a file with a fourth axis

  /// For messages: "run.nii, step 3".
  std::string what() const;
};

/// Whether a name of a volume stands for several files: it has *, ? or [, and there is no such
/// file.
bool is_pattern(const std::string &path);
/// The steps that a name stands for: files of a pattern in natural order (2 before 10), the steps
/// of a file with a fourth axis, or none if it is one volume.
///
/// Throws  Error: no file matches; a header that is not understood
std::vector<SeriesStep> find_steps(const std::string &path);
/// The steps of files in the order given: of one file as find_steps(), of several files one each.
///
/// Throws  Error: no file
std::vector<SeriesStep> steps_of_files(const std::vector<std::string> &paths);

/// Opens the steps of a series. Memory: the volumes that the caller keeps, and the one that
/// prepare() makes. Not thread-safe.
class Series {
 public:
  /// Reads all headers.
  ///
  /// storage  how steps are compressed that are not; each by this host
  /// Throws   Error: no step; a file cannot be opened; a step whose grid is not that of the first
  Series(std::vector<SeriesStep> steps, const RawOverrides &overrides, Storage storage);
  ~Series();
  Series(const Series &) = delete;
  Series &operator=(const Series &) = delete;

  std::size_t size() const { return steps_.size(); }
  const SeriesStep &step(std::size_t index) const { return steps_.at(index); }
  /// The grid of all steps, and the type of the first one's voxels.
  const VolumeInfo &info() const { return info_; }
  /// VolumeReader::notices() of the first step.
  const std::vector<std::string> &notices() const { return notices_; }

  /// The volume of a step; waits if prepare() is at work for it.
  ///
  /// Throws  Error: as compress_volume(); there is no such step
  CompressedVolume open(std::size_t index);
  /// Has a thread open a step, whose volume open() then returns; nothing if there is no such step.
  /// If another step is being prepared, waits for it and forgets it.
  void prepare(std::size_t index);

 private:
  CompressedVolume load(std::size_t index) const;

  std::vector<SeriesStep> steps_;
  RawOverrides overrides_;
  Storage storage_;
  VolumeInfo info_;
  std::vector<std::string> notices_;
  std::optional<std::size_t> prepared_;  ///< the step that next_ is
  std::future<CompressedVolume> next_;
};

}  // namespace isowave::core
