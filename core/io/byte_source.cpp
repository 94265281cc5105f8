#include "core/io/byte_source.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <utility>

#include "core/error.hpp"

namespace isowave {

InputFile::InputFile(const std::filesystem::path &path, std::string what) : what_(std::move(what)) {
  descriptor_ =
      ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // opening a pipe must not wait for a writer
  if (descriptor_ < 0) {
    if (errno == ENOENT) throw Error("{}: no such file", what_);
    throw Error("{}: cannot open: {}", what_, std::strerror(errno));
  }
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor_);
    throw Error("{}: not a regular file", what_);
  }
  size_ = std::uint64_t(status.st_size);
}

InputFile::~InputFile() {
  ::close(descriptor_);
}

std::size_t InputFile::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count =
        ::pread(descriptor_, bytes.data() + done, bytes.size() - done, off_t(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error("{}: cannot read: {}", what_, std::strerror(errno));
    if (count == 0) break;
    done += std::size_t(count);
  }
  return done;
}

std::size_t FileSource::read(std::span<std::byte> bytes) {
  const std::size_t count = file_->read_at(offset_, bytes);
  offset_ += count;
  return count;
}

InflateSource::InflateSource(std::shared_ptr<const InputFile> file, std::uint64_t offset, Packing packing)
    : file_(std::move(file)), packed_(file_, offset), buffer_(1u << 17) {
  constexpr std::size_t kMagicBytes = 2;
  refill();
  is_gzip_ = stream_.avail_in >= kMagicBytes && stream_.next_in[0] == 0x1f && stream_.next_in[1] == 0x8b;
  if (!is_gzip_ && packing == Packing::kGzip)
    throw Error("{}: not a gzip file, as it should be", file_->what());
  constexpr int kLargestWindow = 15, kGzipHeader = 16;
  if (::inflateInit2(&stream_, kLargestWindow + (is_gzip_ ? kGzipHeader : 0)) != Z_OK) throw std::bad_alloc();
}

InflateSource::~InflateSource() {
  ::inflateEnd(&stream_);
}

void InflateSource::refill() {
  if (stream_.avail_in > 0) return;
  stream_.avail_in = uInt(packed_.read(buffer_));
  stream_.next_in = reinterpret_cast<Bytef *>(buffer_.data());
}

std::size_t InflateSource::read(std::span<std::byte> bytes) {
  constexpr std::size_t kLargestStep = 1u << 30;
  std::size_t done = 0;
  while (done < bytes.size() && !ended_) {
    refill();
    const std::size_t room = std::min(bytes.size() - done, kLargestStep);
    stream_.next_out = reinterpret_cast<Bytef *>(bytes.data() + done);
    stream_.avail_out = uInt(room);
    const int code = ::inflate(&stream_, Z_NO_FLUSH);
    done += room - stream_.avail_out;
    const char *name = is_gzip_ ? "gzip" : "zlib";
    if (code == Z_STREAM_END) {
      end_stream();
    } else if (code == Z_BUF_ERROR) {  // no progress: all input is used up
      if (stream_.avail_in == 0)
        throw Error("{}: truncated: its {} stream ends too early", file_->what(), name);
    } else if (code != Z_OK) {
      throw Error("{}: broken {} stream ({})", file_->what(), name,
                  stream_.msg != nullptr ? stream_.msg : ::zError(code));
    }
  }
  return done;
}

void InflateSource::end_stream() {
  refill();
  if (stream_.avail_in == 0) {
    ended_ = true;
  } else if (is_gzip_ && stream_.next_in[0] == 0x1f) {
    ::inflateReset(&stream_);  // the next member
  } else {
    throw Error("{}: bytes that do not belong to its {} stream follow it", file_->what(),
                is_gzip_ ? "gzip" : "zlib");
  }
}

}  // namespace isowave
