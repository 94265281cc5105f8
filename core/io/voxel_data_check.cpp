#include "core/io/voxel_data_check.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/error.hpp"
#include "core/io/raw_reader.hpp"

namespace isowave {
namespace fs = std::filesystem;

namespace {

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

/// The `key separator value` lines of a text header, keys in lower case, and where it ends.
struct TextHeader {
  std::map<std::string, std::string> fields;
  std::uint64_t bytes = 0;

  std::string operator[](const std::string &key) const {
    const auto found = fields.find(key);
    return found == fields.end() ? std::string() : found->second;
  }
};

/// Reads up to an empty line, or the line of the key `last`; at most 1 MiB.
TextHeader read_text_header(const fs::path &path, char separator, std::string_view last) {
  std::ifstream stream(path, std::ios::binary);
  std::string text(std::size_t(1) << 20, '\0');
  stream.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(stream.gcount()));
  TextHeader header;
  while (header.bytes < text.size()) {
    const std::size_t end = std::min(text.find('\n', header.bytes), text.size());
    const std::string line = text.substr(header.bytes, end - header.bytes);
    header.bytes = std::min(end + 1, text.size());
    if (trim(line).empty()) break;
    const std::size_t at = line.find(separator);
    if (at == std::string::npos) continue;
    const std::string key = lower(trim(line.substr(0, at)));
    header.fields.emplace(key, trim(line.substr(at + 1)));
    if (key == last) break;
  }
  return header;
}

/// Points `data` at the file that a header names, which must be one file.
void apply_file_name(const fs::path &header_path, const std::string &name, VoxelData &data) {
  if (lower(name).starts_with("list") || name.find('%') != std::string::npos) {
    throw Error("{}: its voxels lie in several files, which is not supported: convert it to one file",
                header_path.string());
  }
  data.file = header_path.parent_path() / name;
  data.offset = 0;
}

VoxelData locate_nrrd(const fs::path &path) {
  const TextHeader header = read_text_header(path, ':', "");
  VoxelData data{path, VoxelEncoding::kRaw, header.bytes, 0};
  const std::string encoding = lower(header["encoding"]);
  if (encoding == "gzip" || encoding == "gz") {
    data.encoding = VoxelEncoding::kDeflate;
  } else if (encoding == "hex") {
    data.encoding = VoxelEncoding::kHex;
  } else if (encoding == "ascii" || encoding == "text" || encoding == "txt") {
    data.encoding = VoxelEncoding::kText;
  } else if (encoding != "raw") {
    throw Error("{}: encoding '{}' is not supported: use raw or gzip", path.string(), encoding);
  }
  if (!header["line skip"].empty() || !header["lineskip"].empty()) {
    throw Error("{}: 'line skip' is not supported", path.string());
  }
  const std::string file = header["data file"] + header["datafile"];
  if (!file.empty()) apply_file_name(path, file, data);
  return data;
}

VoxelData locate_meta_image(const fs::path &path) {
  const TextHeader header = read_text_header(path, '=', "elementdatafile");
  VoxelData data{path, VoxelEncoding::kRaw, header.bytes, 0};
  if (lower(header["binarydata"]) == "false") data.encoding = VoxelEncoding::kText;
  if (lower(header["compresseddata"]) == "true") data.encoding = VoxelEncoding::kDeflate;
  const std::string file = header["elementdatafile"];
  if (file.empty()) throw Error("{}: broken header: no ElementDataFile", path.string());
  if (lower(file) != "local") apply_file_name(path, file, data);
  return data;
}

/// The fields of a NIfTI-1 header that matter here.
struct NiftiHeader {
  std::uint64_t voxel_bytes = 0;  ///< as stored: scaled voxels have another type than ITK delivers
  std::uint64_t voxel_offset = 0;
};

NiftiHeader read_nifti_header(const fs::path &path) {
  constexpr std::int32_t kHeaderBytes = 348;
  constexpr std::size_t kDimsAt = 40, kDatatypeAt = 70, kBitsPerVoxelAt = 72, kVoxelOffsetAt = 108;
  std::array<std::byte, kHeaderBytes> header{};
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(::gzopen(path.c_str(), "rb"), &::gzclose);
  if (!file || ::gzread(file.get(), header.data(), kHeaderBytes) != kHeaderBytes) {
    throw Error("{}: broken header: shorter than a NIfTI header", path.string());
  }
  bool swapped = false;
  const auto read = [&]<class T>(std::size_t at, T value) {
    std::array<std::byte, sizeof(T)> bytes;
    std::memcpy(bytes.data(), header.data() + at, sizeof(T));
    if (swapped) std::reverse(bytes.begin(), bytes.end());
    std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  };
  swapped = read(0, std::int32_t()) != kHeaderBytes;
  if (read(0, std::int32_t()) != kHeaderBytes) throw Error("{}: not a NIfTI-1 file", path.string());

  const int num_axes = read(kDimsAt, std::int16_t());
  if (num_axes < 3 || num_axes > 7)
    throw Error("{}: an image of {} axes, need a volume of 3", path.string(), num_axes);
  for (int axis = 1; axis <= num_axes; ++axis) {
    const int count = read(kDimsAt + 2 * std::size_t(axis), std::int16_t());
    if (count <= 0) throw Error("{}: broken header: {} voxels along axis {}", path.string(), count, axis);
  }
  // uint8, int16, int32, float32, float64, int8, uint16, uint32
  constexpr std::array<int, 8> kDatatypes{2, 4, 8, 16, 64, 256, 512, 768};
  const int datatype = read(kDatatypeAt, std::int16_t());
  if (std::find(kDatatypes.begin(), kDatatypes.end(), datatype) == kDatatypes.end()) {
    throw Error(
        "{}: NIfTI datatype {} is not supported: need one number of at most 32 bits, or float64, per voxel",
        path.string(), datatype);
  }
  const float offset = read(kVoxelOffsetAt, float());
  if (!(offset >= float(kHeaderBytes) && offset < 1e9f)) {
    throw Error("{}: broken header: voxels at byte {}", path.string(), offset);
  }
  return {read(kBitsPerVoxelAt, std::uint16_t()) / 8u, std::uint64_t(offset)};
}

VoxelData locate_nifti(const fs::path &path, std::uint64_t &voxel_bytes) {
  const NiftiHeader header = read_nifti_header(path);
  voxel_bytes = header.voxel_bytes;
  const bool gzipped = lower(path.extension().string()) == ".gz";
  return {path, gzipped ? VoxelEncoding::kDeflate : VoxelEncoding::kRaw, header.voxel_offset, 0};
}

}  // namespace

void check_before_itk(const fs::path &path, ItkFormat format) {
  if (format == ItkFormat::kNifti) read_nifti_header(path);
}

VoxelData find_voxel_data(const fs::path &path, ItkFormat format, const VolumeInfo &info) {
  std::uint64_t voxel_bytes = size_of(info.type);
  VoxelData data;
  switch (format) {
    case ItkFormat::kNrrd:
      data = locate_nrrd(path);
      break;
    case ItkFormat::kMetaImage:
      data = locate_meta_image(path);
      break;
    case ItkFormat::kNifti:
      data = locate_nifti(path, voxel_bytes);
      break;
  }
  const std::uint64_t num_voxels = info.num_voxels();
  data.bytes = num_voxels * voxel_bytes;
  if (format == ItkFormat::kNifti && data.encoding == VoxelEncoding::kDeflate) {
    data.bytes += std::exchange(data.offset, 0);  // the header is in the stream
  }
  std::uint64_t least = data.offset;
  switch (data.encoding) {
    case VoxelEncoding::kRaw:
      least += data.bytes;
      break;
    case VoxelEncoding::kDeflate:
      least += data.bytes / kMaxDeflateRatio;
      break;
    case VoxelEncoding::kHex:
      least += data.bytes * 2;
      break;
    case VoxelEncoding::kText:
      least += num_voxels * 2 - 1;
      break;  // one digit each, and a space between
  }
  std::error_code error;
  const std::uint64_t size = fs::file_size(data.file, error);
  if (error) throw Error("{}: its data file {}: {}", path.string(), data.file.string(), error.message());
  if (size < least) {
    throw Error("{}: truncated: {}x{}x{} voxels need at least {} bytes, {} has {}", path.string(),
                info.dims.x, info.dims.y, info.dims.z, least, data.file.filename().string(), size);
  }
  return data;
}

void verify_deflated(const VoxelData &data) {
  if (data.encoding != VoxelEncoding::kDeflate) return;
  std::ifstream file(data.file, std::ios::binary);
  file.seekg(std::streamoff(data.offset));
  std::vector<char> packed(1u << 16);
  std::vector<Bytef> unpacked(1u << 18);
  z_stream stream{};
  constexpr int kZlibOrGzip = 15 + 32;
  if (::inflateInit2(&stream, kZlibOrGzip) != Z_OK) throw std::bad_alloc();
  const std::unique_ptr<z_stream, int (*)(z_stream *)> owner(&stream, &::inflateEnd);
  std::uint64_t bytes = 0;
  int code = Z_OK;
  while (code == Z_OK || bytes < data.bytes) {
    if (stream.avail_in == 0) {
      file.read(packed.data(), std::streamsize(packed.size()));
      stream.next_in = reinterpret_cast<Bytef *>(packed.data());
      stream.avail_in = uInt(file.gcount());
      if (stream.avail_in == 0) {
        throw Error("{}: truncated: its compressed voxels end after {} of {} bytes", data.file.string(),
                    bytes, data.bytes);
      }
    }
    if (code == Z_STREAM_END) ::inflateReset(&stream);  // another gzip member
    stream.next_out = unpacked.data();
    stream.avail_out = uInt(unpacked.size());
    code = ::inflate(&stream, Z_NO_FLUSH);
    bytes += unpacked.size() - stream.avail_out;
    if (code != Z_OK && code != Z_STREAM_END && code != Z_BUF_ERROR) {
      throw Error("{}: broken: its compressed voxels cannot be unpacked ({})", data.file.string(),
                  stream.msg != nullptr ? stream.msg : "zlib error");
    }
    if (code == Z_BUF_ERROR) code = Z_OK;  // wants more input
  }
}

}  // namespace isowave
