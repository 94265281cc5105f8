#pragma once
// The bytes of a file in order, as they are or unpacked.

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace isowave {

/// A regular file, open for reading. Anything else, such as a pipe, is refused without waiting for it.
class InputFile {
 public:
  /// what: how messages name the file. Throws Error when it cannot be opened.
  InputFile(const std::filesystem::path &path, std::string what);
  ~InputFile();
  InputFile(const InputFile &) = delete;
  InputFile &operator=(const InputFile &) = delete;

  const std::string &what() const { return what_; }
  /// In bytes, when the file was opened.
  std::uint64_t size() const { return size_; }
  /// Reads up to bytes.size() bytes from `offset` on; fewer only at the end of the file. Throws Error.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  std::string what_;
  std::uint64_t size_ = 0;
  int descriptor_ = -1;
};

class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// Reads up to bytes.size() bytes; fewer only at the end of the data. Throws Error.
  virtual std::size_t read(std::span<std::byte> bytes) = 0;
};

/// A file from byte `offset` on.
class FileSource : public ByteSource {
 public:
  FileSource(std::shared_ptr<const InputFile> file, std::uint64_t offset)
      : file_(std::move(file)), offset_(offset) {}
  std::size_t read(std::span<std::byte> bytes) override;

 private:
  std::shared_ptr<const InputFile> file_;
  std::uint64_t offset_;
};

/// gzip: one or more members, as the gzip tool writes and joins them. zlib: one stream.
enum class Packing { kGzip, kGzipOrZlib };

/// Unpacks a compressed file from byte `offset` to its end, where the compressed data must end too. read() throws
/// Error where it is broken, ends early, has a wrong checksum, or is followed by anything else.
class InflateSource : public ByteSource {
 public:
  InflateSource(std::shared_ptr<const InputFile> file, std::uint64_t offset, Packing packing);
  ~InflateSource() override;
  InflateSource(const InflateSource &) = delete;
  InflateSource &operator=(const InflateSource &) = delete;

  std::size_t read(std::span<std::byte> bytes) override;

 private:
  /// Makes packed bytes available, unless some are left or the file has ended.
  void refill();
  void end_stream();

  std::shared_ptr<const InputFile> file_;
  FileSource packed_;
  std::vector<std::byte> buffer_;
  z_stream stream_{};
  bool is_gzip_ = true;
  bool ended_ = false;
};

/// deflate cannot shrink data more than this: a bound on what a compressed file may unpack to.
inline constexpr std::uint64_t kMaxDeflateRatio = 1032;

}  // namespace isowave
