#pragma once
// Draws a volume that several processes share: each has a brick of it, on a device of its own. The
// pictures have the bits of Renderer's.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "isowave/device.hpp"
#include "isowave/frame.hpp"
#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// The processes that draw together, over MPI or whatever they talk by: the library itself needs
/// none. All make the same calls of a BrickRenderer in the same order, which then calls these in
/// the same order at all.
class Processes {
 public:
  virtual ~Processes() = default;
  virtual std::uint32_t rank() const = 0;  ///< of this process, 0 to size() - 1
  virtual std::uint32_t size() const = 0;
  /// Number of this process among those of its machine, which share out its devices.
  virtual std::uint32_t local_rank() const = 0;
  /// Everybody's bytes, by rank.
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
  RendererOptions renderer{};  ///< of each process; without a time budget
};

/// All processes make the same calls. What goes wrong at one is thrown at all, so that none waits.
class BrickRenderer {
 public:
  /// Loads this process's brick: of a `.zfp` file, its blocks alone are read; of other volumes, its
  /// layers, and compressed. With bounds, the error is measured.
  ///
  /// path, compression, raw  as open_volume()'s
  /// processes               must outlive the renderer
  /// Throws  Error: as open_volume() and Renderer; processes that ask for different things, or have
  ///         different volumes; more processes than can have bricks; levels of detail that are not
  ///         in the file
  BrickRenderer(Processes &processes, const std::filesystem::path &path,
                const Compression &compression = {}, const RawFile &raw = {},
                const BrickOptions &options = {});
  ~BrickRenderer();
  BrickRenderer(const BrickRenderer &) = delete;
  BrickRenderer &operator=(const BrickRenderer &) = delete;

  /// Draws a frame. Statistics are this process's, but for hits.
  ///
  /// Returns  at rank 0, the frame of the whole volume; elsewhere one of statistics alone
  /// Throws   Error: as Renderer::render(); positions, hits, a time budget, on_pass; levels of
  ///          detail so coarse that the bricks cannot be cut at them
  Frame render(const FrameRequest &request);

  /// As Renderer's.
  Camera camera(double isovalue, std::optional<ImageSize> size = {});

  /// As Volume::notices() and Volume::isovalue_notice(), in each process.
  const std::vector<std::string> &notices() const;
  std::string isovalue_notice(double isovalue) const;

  const Grid &grid() const;          ///< of the whole volume
  const DeviceInfo &device() const;  ///< this process's

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
