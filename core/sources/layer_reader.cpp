#include "core/sources/layer_reader.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "core/base/error.hpp"
#include "core/io/raw_reader.hpp"

namespace isowave::core {

namespace {

/// Most bytes that one call of read() takes, with room to spare.
constexpr std::size_t kMostBytes = std::size_t{1} << 30;

[[noreturn]] void fail(const char *what) {
  throw Error(
      "{} a temporary file: {}; set TMPDIR to a folder with room for the whole volume, or compress "
      "at a rate, which needs none",
      what, std::strerror(errno));
}

}  // namespace

TemporaryFile::TemporaryFile() {
  const char *folder = std::getenv("TMPDIR");
  std::string name =
      std::string(folder != nullptr && *folder != 0 ? folder : "/tmp") + "/isowave_XXXXXX";
  file_ = ::mkstemp(name.data());
  if (file_ < 0) fail("cannot make");
  ::unlink(name.c_str());
}

TemporaryFile::~TemporaryFile() {
  ::close(file_);
}

void TemporaryFile::append(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), std::min(bytes.size(), kMostBytes));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail("cannot write to");
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

void TemporaryFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t got = ::pread(file_, bytes.data(), std::min(bytes.size(), kMostBytes),
                                static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) fail("cannot read");
    bytes = bytes.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
}

LayerSource::LayerSource(const VolumeInfo &info, ReadLayers read, bool keep)
    : info_(info), read_(std::move(read)) {
  check_volume_info(info, "the array");
  if (keep) kept_ = std::make_unique<TemporaryFile>();
}

void LayerSource::read(std::uint32_t z_begin, std::uint32_t num_layers, std::span<std::byte> out) {
  if (z_begin + num_layers <= num_kept_) {
    kept_->read(std::uint64_t{z_begin} * (out.size() / num_layers), out);
    return;
  }
  read_(z_begin, num_layers, out);
  if (!kept_) return;
  kept_->append(out);
  num_kept_ += num_layers;
}

LayerReader::LayerReader(std::shared_ptr<LayerSource> source) : source_(std::move(source)) {
  info_ = source_->info();
}

std::span<const std::byte> LayerReader::bytes_of(std::uint32_t z_begin, std::uint32_t num_layers) {
  bytes_.resize(std::size_t{info_.dims.x} * info_.dims.y * num_layers * size_of(info_.type));
  source_->read(z_begin, num_layers, bytes_);
  return bytes_;
}

void LayerReader::read_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                              std::span<float> out) {
  convert_to_float(info_.type, bytes_of(z_begin, num_layers), out);
}

void LayerReader::read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                                    std::span<double> out) {
  convert_to_double(info_.type, bytes_of(z_begin, num_layers), out);
}

}  // namespace isowave::core
