#pragma once
// The bytes of a file in order, as they are or unpacked.

#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/io/input_file.hpp"

namespace isowave::core {

class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// Reads up to bytes.size() bytes; fewer only at the end of the data.
  ///
  /// Throws  Error
  virtual std::size_t read(std::span<std::byte> bytes) = 0;
};

/// A part of a file, or all that it has from byte `offset` on.
class FileSource : public ByteSource {
 public:
  FileSource(std::shared_ptr<const InputFile> file, std::uint64_t offset, std::uint64_t size);
  FileSource(const std::shared_ptr<const InputFile> &file, std::uint64_t offset)
      : FileSource(file, offset, file->size() - std::min(offset, file->size())) {}

  std::size_t read(std::span<std::byte> bytes) override;
  /// Bytes that are still to be read.
  std::uint64_t left() const { return left_; }
  const InputFile &file() const { return *file_; }

 private:
  std::shared_ptr<const InputFile> file_;
  std::uint64_t offset_, left_;
};

/// gzip: one or more members, as the gzip tool writes and joins them. zlib: one stream.
enum class Packing { kGzip, kZlib, kGzipOrZlib };

/// Unpacks compressed data, which must end where the part of the file does.
///
/// Throws  Error: the data are broken, end early, have a wrong checksum, or are followed by
///         anything else
class InflateSource : public ByteSource {
 public:
  InflateSource(FileSource packed, Packing packing);
  ~InflateSource() override;
  InflateSource(const InflateSource &) = delete;
  InflateSource &operator=(const InflateSource &) = delete;

  std::size_t read(std::span<std::byte> bytes) override;

 private:
  /// Makes packed bytes available, unless some are left or there are no more.
  void refill();
  void end_stream();
  const std::string &what() const { return packed_.file().what(); }

  FileSource packed_;
  std::vector<std::byte> buffer_;
  z_stream stream_{};
  bool is_gzip_ = false, ended_ = false;
};

/// deflate cannot shrink data more than this: a bound on what a compressed file may unpack to.
inline constexpr std::uint64_t kMaxDeflateRatio = 1032;

}  // namespace isowave::core
