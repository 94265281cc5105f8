#include "core/io/voxel_data_check.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <map>
#include <system_error>

#include "core/error.hpp"
#include "core/io/raw_reader.hpp"

namespace isowave {
namespace fs = std::filesystem;

namespace {

enum class Encoding { kRaw, kDeflate, kHex, kText };

struct DataLocation {
  fs::path file;
  Encoding encoding = Encoding::kRaw;
  std::uint64_t bytes_per_voxel = 0;  ///< as stored
};

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  return text;
}

std::string trim(const std::string &text) {
  constexpr const char *kSpace = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

/// The `key separator value` lines of a text header up to its end: an empty line, or the key `last`.
/// Keys in lower case. A header of more than 1 MiB is cut there.
std::map<std::string, std::string> read_fields(const fs::path &path, char separator, std::string_view last) {
  std::ifstream stream(path, std::ios::binary);
  std::string text(std::size_t(1) << 20, '\0');
  stream.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(stream.gcount()));
  std::map<std::string, std::string> fields;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    if (trim(line).empty()) break;
    if (const std::size_t at = line.find(separator); at != std::string::npos) {
      const std::string key = lower(trim(line.substr(0, at)));
      fields.emplace(key, trim(line.substr(at + 1)));
      if (key == last) break;
    }
    begin = end + 1;
  }
  return fields;
}

std::string value_of(const std::map<std::string, std::string> &fields, const std::string &key) {
  const auto found = fields.find(key);
  return found == fields.end() ? std::string() : found->second;
}

[[noreturn]] void fail_several_files(const fs::path &path) {
  throw Error("{}: its voxels lie in several files, which is not supported: convert it to one file",
              path.string());
}

DataLocation locate_nrrd(const fs::path &path) {
  const auto fields = read_fields(path, ':', "");
  DataLocation location{path, Encoding::kRaw, 0};
  const std::string encoding = lower(value_of(fields, "encoding"));
  if (encoding == "gzip" || encoding == "gz") {
    location.encoding = Encoding::kDeflate;
  } else if (encoding == "hex") {
    location.encoding = Encoding::kHex;
  } else if (encoding == "ascii" || encoding == "text" || encoding == "txt") {
    location.encoding = Encoding::kText;
  } else if (encoding != "raw") {
    throw Error("{}: encoding '{}' is not supported: use raw or gzip", path.string(), encoding);
  }
  std::string file = value_of(fields, "data file");
  if (file.empty()) file = value_of(fields, "datafile");
  if (lower(file).starts_with("list") || file.find('%') != std::string::npos) fail_several_files(path);
  if (!file.empty()) location.file = path.parent_path() / file;
  return location;
}

DataLocation locate_meta_image(const fs::path &path) {
  const auto fields = read_fields(path, '=', "elementdatafile");
  DataLocation location{path, Encoding::kRaw, 0};
  if (lower(value_of(fields, "binarydata")) == "false") location.encoding = Encoding::kText;
  if (lower(value_of(fields, "compresseddata")) == "true") location.encoding = Encoding::kDeflate;
  const std::string file = value_of(fields, "elementdatafile");
  if (file.empty()) throw Error("{}: broken header: no ElementDataFile", path.string());
  if (lower(file).starts_with("list") || file.find('%') != std::string::npos) fail_several_files(path);
  if (lower(file) != "local") location.file = path.parent_path() / file;
  return location;
}

/// Scaled NIfTI voxels are stored in another type than ITK delivers: the size is in the header itself.
DataLocation locate_nifti(const fs::path &path) {
  constexpr std::size_t kHeaderBytes = 348, kBitsPerVoxelAt = 72;
  std::array<std::byte, kHeaderBytes> header{};
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(::gzopen(path.c_str(), "rb"), &::gzclose);
  if (!file || ::gzread(file.get(), header.data(), kHeaderBytes) != int(kHeaderBytes)) {
    throw Error("{}: broken header: shorter than a NIfTI header", path.string());
  }
  std::int32_t header_bytes = 0;
  std::uint16_t bits = 0;
  std::memcpy(&header_bytes, header.data(), sizeof(header_bytes));
  std::memcpy(&bits, header.data() + kBitsPerVoxelAt, sizeof(bits));
  if (header_bytes != int(kHeaderBytes)) bits = std::uint16_t(bits << 8 | bits >> 8);
  return {path, lower(path.extension().string()) == ".gz" ? Encoding::kDeflate : Encoding::kRaw, bits / 8u};
}

/// The least length of a file that holds `voxels` voxels of `bytes` bytes each.
std::uint64_t least_file_size(Encoding encoding, std::uint64_t voxels, std::uint64_t bytes) {
  switch (encoding) {
    case Encoding::kRaw:
      return voxels * bytes;
    case Encoding::kDeflate:
      return voxels * bytes / kMaxDeflateRatio;
    case Encoding::kHex:
      return voxels * bytes * 2;
    case Encoding::kText:
      return voxels * 2 - 1;  // one digit each, and a space between
  }
  return 0;
}

}  // namespace

bool check_voxel_data(const fs::path &path, ItkFormat format, const VolumeInfo &info) {
  DataLocation location;
  switch (format) {
    case ItkFormat::kNrrd:
      location = locate_nrrd(path);
      break;
    case ItkFormat::kMetaImage:
      location = locate_meta_image(path);
      break;
    case ItkFormat::kNifti:
      location = locate_nifti(path);
      break;
  }
  if (location.bytes_per_voxel == 0) location.bytes_per_voxel = size_of(info.type);

  std::error_code error;
  const std::uint64_t size = fs::file_size(location.file, error);
  if (error) throw Error("{}: its data file {}: {}", path.string(), location.file.string(), error.message());
  const std::uint64_t least = least_file_size(location.encoding, info.num_voxels(), location.bytes_per_voxel);
  if (size < least) {
    throw Error("{}: truncated: {}x{}x{} voxels need at least {} bytes, {} has {}", path.string(),
                info.dims.x, info.dims.y, info.dims.z, least, location.file.filename().string(), size);
  }
  return location.encoding == Encoding::kRaw;
}

}  // namespace isowave
