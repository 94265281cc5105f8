#pragma once
// The `.zfp` file, which README.md of this folder describes byte by byte: zfp's header and stream,
// and behind them index, bounds, levels of detail and trailer (zfp_trailer.hpp). The functions that
// read it are declared in zfp_stream.hpp.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "core/io/atomic_file.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "core/zfp/zfp_trailer.hpp"

namespace isowave::core {

/// Deflates index, bounds and masks. One process and a team of processes give the same bytes in the
/// same pieces.
class Deflater {
 public:
  using Sink = std::function<void(std::span<const std::byte>)>;
  explicit Deflater(Sink sink);
  ~Deflater();
  /// In pieces of kDeflatedAtOnce items, but for the last.
  void add(std::span<const std::byte> bytes) { deflate(bytes, false); }
  void finish() { deflate({}, true); }

 private:
  struct Stream;
  void deflate(std::span<const std::byte> bytes, bool last);

  Sink sink_;
  std::unique_ptr<Stream> stream_;
  std::vector<std::byte> out_;
};
inline constexpr std::size_t kDeflatedAtOnce = 1u << 15;

/// The version in the footer. has_levels: the file has coarser levels, too.
std::uint32_t zfp_version(const CompressedVolume &volume, bool has_levels);

/// Writes a `.zfp` file front to back, its levels of detail beside each other; nothing is left
/// behind without commit().
class ZfpFileWriter {
 public:
  /// Writes the headers of volume and of its coarser levels, from their info.dims and
  /// bits_per_block (a multiple of 64), or precision.
  ZfpFileWriter(const std::filesystem::path &path, const CompressedVolume &volume);
  /// Appends payload of the volume (level 0) or of coarser level `level`.
  void write(std::span<const std::byte> payload, std::size_t level = 0);
  /// Pads, writes indices and trailers from all fields but words, and renames the file into place.
  void commit(const CompressedVolume &volume);
  /// Instead of commit(): hands over the file's bytes. Nothing is left behind.
  void read_back(const CompressedVolume &volume, const PayloadSink &take);

 private:
  void finish(const CompressedVolume &volume);
  /// A level's file.
  struct Part {
    explicit Part(const std::filesystem::path &path) : file(path) {}
    void write(std::span<const std::byte> bytes);
    std::uint64_t write_index(const CompressedVolume &volume);
    std::uint64_t write_bounds(const CompressedVolume &volume);
    std::uint64_t write_no_data(const CompressedVolume &volume);
    ZfpLayout write_parts(const CompressedVolume &volume);
    void write_trailer(const std::string &text, std::uint32_t version);

    AtomicFile file;
    std::uint32_t crc = 0;
    std::uint64_t size = 0;
  };

  std::deque<Part> parts_;  ///< the coarser ones only until they are joined to the first
};

/// Hands over the bytes of the file that write_zfp_file() writes, piece by piece.
///
/// path    names a temporary file that is made and removed
/// Throws  Error: as write_zfp_file()
void give_zfp_file(const CompressedVolume &volume, const std::filesystem::path &path,
                   const PayloadSink &take);

}  // namespace isowave::core
