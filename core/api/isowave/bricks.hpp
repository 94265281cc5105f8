#pragma once
// Draws a volume that several processes share: each has a brick of the volume, on its own device.
// The pictures have the bits that one renderer would draw.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// The processes that draw together, over MPI or anything else. All processes make the same calls
/// of a renderer in the same order. The renderer then calls these functions in the same order in
/// all processes.
class Processes {
 public:
  virtual ~Processes() = default;
  virtual std::uint32_t rank() const = 0;  ///< number of this process, 0 to size() - 1
  virtual std::uint32_t size() const = 0;  ///< number of processes
  /// Number of this process among the processes of its machine, which share the machine's devices.
  virtual std::uint32_t local_rank() const = 0;
  /// The bytes of all processes, by rank.
  virtual std::vector<std::string> all_gather(const std::string &bytes) = 0;

  enum class Reduction {
    kMin,          ///< MPI_MIN: the smallest word
    kMinOfHalves,  ///< MPI_MIN of twice as many MPI_UINT32_T
    kOr            ///< MPI_BOR: the bits of all
  };
  /// Reduces the words of all processes to one word at each place. Rank 0 then has the results in
  /// `words`; for_all: all processes have them.
  virtual void reduce(std::span<std::uint64_t> words, Reduction how, bool for_all) = 0;
};

struct BrickOptions {
  std::string device{};  ///< open_device()'s selector; or several with commas, one a process
  std::string bricks{};  ///< XxYxZ: bricks along each axis; empty: bricks of equal size
  /// File of the field for Appearance::color_by_field, which may be that of the volume. Each
  /// process keeps what its brick needs. A file that is not compressed is compressed like the
  /// volume.
  std::filesystem::path field{};
  RendererOptions renderer{};  ///< options of each process, without a field
};

/// Makes a renderer for several processes, each with a brick. All processes make the same calls.
/// Rank 0 gets the frames of the whole volume; the other ranks get frames with statistics only.
/// Statistics are this process's, except hits. An error of one process is thrown in all, so that
/// none waits. Requests have no positions and hits.
///
/// Loads this process's brick: its blocks from a `.zfp` file, or its layers of another volume,
/// which the process compresses. With bounds, the error is measured.
///
/// path, compression, raw  as open_volume()'s
/// processes               must outlive the renderer
/// Throws  Error: as open_volume() and Renderer; processes with different arguments or volumes;
///         more processes than there can be bricks; levels of detail that are not in the file
Renderer make_team_renderer(Processes &processes, const std::filesystem::path &path,
                            const Compression &compression = {}, const RawFile &raw = {},
                            const BrickOptions &options = {});

}  // namespace isowave
