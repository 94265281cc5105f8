#include "core/io/byte_source.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "core/base/error.hpp"

namespace isowave::core {

FileSource::FileSource(std::shared_ptr<const InputFile> file, std::uint64_t offset,
                       std::uint64_t size)
    : file_(std::move(file)), offset_(offset), left_(size) {}

std::size_t FileSource::read(std::span<std::byte> bytes) {
  const auto count = std::size_t(std::min<std::uint64_t>(bytes.size(), left_));
  file_->read(offset_, bytes.first(count));
  offset_ += count;
  left_ -= count;
  return count;
}

InflateSource::InflateSource(FileSource packed, Packing packing)
    : packed_(std::move(packed)), buffer_(1u << 17) {
  constexpr std::size_t kMagicBytes = 2;
  refill();
  const bool has_magic =
      stream_.avail_in >= kMagicBytes && stream_.next_in[0] == 0x1f && stream_.next_in[1] == 0x8b;
  if (packing == Packing::kGzip && !has_magic)
    throw Error("{}: not a gzip file, as it should be", what());
  is_gzip_ = has_magic && packing != Packing::kZlib;
  constexpr int kLargestWindow = 15, kGzipHeader = 16;
  if (::inflateInit2(&stream_, kLargestWindow + (is_gzip_ ? kGzipHeader : 0)) != Z_OK)
    throw std::bad_alloc();
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
        throw Error("{}: truncated: its {} stream ends too early", what(), name);
    } else if (code != Z_OK) {
      throw Error("{}: broken {} stream ({})", what(), name,
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
    throw Error("{}: bytes that do not belong to its {} stream follow it", what(),
                is_gzip_ ? "gzip" : "zlib");
  }
}

}  // namespace isowave::core
