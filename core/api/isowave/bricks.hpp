#pragma once
// Draws a volume that several processes share: each has a brick of it, on a device of its own. The
// pictures have the bits of one renderer's.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// The processes that draw together, over MPI or anything else: the library itself needs none. All
/// make the same calls of a renderer in the same order, which then calls these in the same order at
/// all.
class Processes {
 public:
  virtual ~Processes() = default;
  virtual std::uint32_t rank() const = 0;  ///< of this process, 0 to size() - 1
  virtual std::uint32_t size() const = 0;
  /// Number of this process among those of its machine, which share out its devices.
  virtual std::uint32_t local_rank() const = 0;
  /// The bytes of all processes, by rank.
  virtual std::vector<std::string> all_gather(const std::string &bytes) = 0;

  enum class Reduction {
    kMin,          ///< MPI_MIN: the smallest word
    kMinOfHalves,  ///< MPI_MIN of twice as many MPI_UINT32_T
    kOr            ///< MPI_BOR: the bits of all
  };
  /// Makes one word of those of all processes at each place, which rank 0 then has in `words`, or
  /// all have.
  virtual void reduce(std::span<std::uint64_t> words, Reduction how, bool for_all) = 0;
};

struct BrickOptions {
  std::string device{};        ///< open_device()'s selector; or several with commas, one a process
  std::string bricks{};        ///< XxYxZ, how many along each axis; empty: as fits
  RendererOptions renderer{};  ///< of each process
};

/// A renderer for several processes, each with a brick. All make the same calls; rank 0 gets
/// the frames of the whole volume, the others frames of statistics alone. Statistics are this
/// process's, except hits. What goes wrong at one process is thrown at all, so that none waits.
/// Requests have no positions and hits.
///
/// Loads this process's brick: the blocks of a `.zfp` file that it needs; the layers of other
/// volumes, which it compresses. With bounds, the error is measured.
///
/// path, compression, raw  as open_volume()'s
/// processes               must outlive the renderer
/// Throws  Error: as open_volume() and Renderer; processes that ask for different things, or have
///         different volumes; more processes than can have bricks; levels of detail that are not in
///         the file
Renderer make_team_renderer(Processes &processes, const std::filesystem::path &path,
                            const Compression &compression = {}, const RawFile &raw = {},
                            const BrickOptions &options = {});

}  // namespace isowave
