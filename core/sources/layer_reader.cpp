#include "core/sources/layer_reader.hpp"

#include <system_error>
#include <utility>

#include "core/base/error.hpp"
#include "core/io/raw_reader.hpp"

namespace isowave::core {

namespace {

void check(const std::error_code &failure, const char *what) {
  if (!failure) return;
  throw Error(
      "{} a temporary file: {}; set TMPDIR to a folder with room for the whole volume, or compress "
      "at a rate, which needs none",
      what, failure.message());
}

}  // namespace

TemporaryFile::TemporaryFile() {
  std::error_code failure;
  file_ = platform::File::make_temporary(failure);
  check(failure, "cannot make");
}

void TemporaryFile::append(std::span<const std::byte> bytes) {
  std::error_code failure;
  file_.append(bytes, failure);
  check(failure, "cannot write to");
}

void TemporaryFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  std::error_code failure;
  const std::size_t count = file_.read(offset, bytes, failure);
  if (count < bytes.size() && !failure) failure = std::make_error_code(std::errc::io_error);
  check(failure, "cannot read");
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
