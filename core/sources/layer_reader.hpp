#pragma once
// Volumes whose voxels a function gives, layer by layer.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "core/platform/file.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core {

/// Fills `out` [num_layers][ny][nx] with voxels of the source's type, layers from z_begin on.
using ReadLayers =
    std::function<void(std::uint32_t z_begin, std::uint32_t num_layers, std::span<std::byte> out)>;

/// A file without a name, in the folder for temporary files; gone when this is.
class TemporaryFile {
 public:
  /// Throws  Error: it cannot be made
  TemporaryFile();

  /// Throws  Error: the disk is full, and such
  void append(std::span<const std::byte> bytes);
  /// Throws  Error: the bytes from `offset` on are not all there
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  platform::File file_;
};

/// The part that several readers of one volume share: the function, and the layers it has given.
class LayerSource {
 public:
  /// keep: layers that were read are kept in a temporary file, so that each is asked for once,
  /// however many readers follow one another. Needs the disk space of the whole volume.
  ///
  /// Throws  Error: a bad grid; no temporary file can be made
  LayerSource(const VolumeInfo &info, ReadLayers read, bool keep);

  const VolumeInfo &info() const { return info_; }
  /// Layers ascend, but for a reader that begins anew.
  ///
  /// Throws  what the function throws; Error: the temporary file cannot be written or read
  void read(std::uint32_t z_begin, std::uint32_t num_layers, std::span<std::byte> out);

 private:
  VolumeInfo info_;
  ReadLayers read_;
  std::unique_ptr<TemporaryFile> kept_;
  std::uint32_t num_kept_ = 0;  ///< layers
};

class LayerReader : public VolumeReader {
 public:
  explicit LayerReader(std::shared_ptr<LayerSource> source);

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override;
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override;

 private:
  std::span<const std::byte> bytes_of(std::uint32_t z_begin, std::uint32_t num_layers);

  std::shared_ptr<LayerSource> source_;
  std::vector<std::byte> bytes_;
};

}  // namespace isowave::core
