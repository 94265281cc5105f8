#pragma once
// Series of volumes, such as the time steps of a simulation: opened one by one, while a thread
// prepares the next one.
//
//   isowave::Series series("step_*.nrrd");
//   for (std::size_t step = 0; step < series.size(); ++step) {
//     const std::shared_ptr<const isowave::Volume> volume = series.open(step);
//     series.prepare(step + 1);
//     // draw the volume
//   }

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "isowave/volume.hpp"

namespace isowave {

/// Volumes on one grid, in an order. Each is in memory only as long as a pointer to it lives, and
/// the prepared one. Not thread-safe.
class Series {
 public:
  /// Looks at all headers.
  ///
  /// path         A pattern of files, as in a shell (*, ?, [a-z]), taken in natural order: step_2
  ///              before step_10. Or a file of a format that open_volume() takes; NIfTI and NRRD
  ///              files with a fourth axis have a step for each of its places.
  /// compression  of steps that are not compressed yet
  /// Throws       Error: no file; one that cannot be opened; one whose grid is not the first's
  explicit Series(const std::filesystem::path &path, const Compression &compression = {},
                  const RawFile &raw = {});
  /// The same of files in the order given.
  explicit Series(const std::vector<std::filesystem::path> &paths,
                  const Compression &compression = {}, const RawFile &raw = {});
  ~Series();
  Series(Series &&) noexcept;
  Series &operator=(Series &&) noexcept;

  std::size_t size() const;
  /// What messages call a step: "step_3.nrrd", "run.nii, step 3".
  std::string name(std::size_t step) const;
  /// The grid of all steps.
  const Grid &grid() const;
  /// Volume::notices() of the first step.
  const std::vector<std::string> &notices() const;

  /// Opens a step as open_volume() does; waits if prepare() is at work for it.
  ///
  /// Throws  Error: as open_volume(); there is no such step
  std::shared_ptr<const Volume> open(std::size_t step);
  /// Returns at once: a thread opens the step, for open() to return it. Does nothing if there is no
  /// such step. If another step is being prepared, waits for that one and forgets it.
  void prepare(std::size_t step);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
