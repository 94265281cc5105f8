#include "tests/fuzz/fuzz_target.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/open_volume.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core::fuzz {
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxErrorLength = 1024;  ///< more is no line that anybody reads

const char *kept_folder() {
  static const char *const name = std::getenv("ISOWAVE_FUZZ_KEEP");
  return name;
}

fs::path make_folder() {
  if (const char *kept = kept_folder()) {
    fs::create_directories(kept);
    return kept;
  }
  std::string name = (fs::temp_directory_path() / "isowave_fuzz_XXXXXX").string();
  demand(::mkdtemp(name.data()) != nullptr, "cannot make a temporary folder");
  return name;
}

struct Folder {
  fs::path path = make_folder();
  ~Folder() {
    std::error_code ignored;
    if (kept_folder() == nullptr) fs::remove_all(path, ignored);
  }
};

/// As compression reads them: float32 where that holds them, else exactly.
void read_some(VolumeReader &reader, std::uint32_t z, std::uint32_t num_layers,
               std::span<float> voxels) {
  if (fits_float32(reader.info().type)) return reader.read_layers(z, num_layers, voxels);
  std::vector<double> exact(voxels.size());
  reader.read_exact_layers(z, num_layers, exact);
  std::ranges::transform(exact, voxels.begin(),
                         [](double value) { return static_cast<float>(value); });
}

/// All voxels of a volume, or of a series' last step; empty if it is refused.
///
/// voxels_at_once  read by each call, at most, but whole layers
std::vector<float> read_voxels(const fs::path &path, std::uint64_t voxels_at_once) {
  std::vector<float> voxels;
  const bool whole = accepts([&] {
    std::optional<std::uint32_t> step = num_steps(path);
    if (step) step = *step - 1;
    const std::unique_ptr<VolumeReader> reader = open_volume(path, {}, step);
    const VolumeInfo info = reader->info();
    check_volume_info(info, path.string());
    const std::uint64_t layer = std::uint64_t(info.dims.x) * info.dims.y;
    const auto some =
        std::uint32_t(std::clamp<std::uint64_t>(voxels_at_once / layer, 1, info.dims.z));
    for (std::uint32_t z = 0; z < info.dims.z; z += some) {
      const std::uint32_t layers = std::min(some, info.dims.z - z);
      voxels.resize(layer * (z + layers));
      read_some(*reader, z, layers, std::span(voxels).subspan(layer * z));
    }
  });
  if (!whole) voxels.clear();
  return voxels;
}

}  // namespace

void demand(bool holds, std::string_view what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: %.*s\n", int(what.size()), what.data());
  std::abort();
}

const fs::path &folder() {
  static const Folder folder;
  return folder.path;
}

fs::path put(const std::string &name, std::string_view bytes) {
  fs::path path = folder() / name;
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  demand(file >= 0 && ::write(file, bytes.data(), bytes.size()) == ssize_t(bytes.size()) &&
             ::close(file) == 0,
         "cannot write " + path.string());
  return path;
}

std::string bytes_of(const fs::path &path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

bool accepts(const std::function<void()> &read) {
  try {
    read();
    return true;
  } catch (const Error &error) {
    const std::string_view line = error.what();
    if (kept_folder() != nullptr) std::fprintf(stderr, "refused: %s\n", error.what());
    const auto is_control = [](char c) { return (c >= 0 && c < ' ') || c == '\x7f'; };
    demand(!line.empty() && std::none_of(line.begin(), line.end(), is_control),
           "an Error is not a line of text: " + std::string(line));
    demand(line.size() <= kMaxErrorLength, "an Error is too long: " + std::string(line));
    return false;
  }
}

void read_volume(const fs::path &path) {
  const std::vector<float> some_layers = read_voxels(path, 1u << 22),
                           each_layer = read_voxels(path, 1);
  demand(same_bits(some_layers, each_layer), "voxels depend on how many layers are read at once");
}

bool same_bits(std::span<const float> a, std::span<const float> b) {
  return std::ranges::equal(std::as_bytes(a),
                            std::as_bytes(b));  // NaN equals itself here, and 0 not -0
}

std::string pack(std::string_view bytes, Packing packing) {
  z_stream stream{};
  constexpr int kMemoryLevel = 8;
  demand(::deflateInit2(&stream, 1, Z_DEFLATED, int(packing), kMemoryLevel, Z_DEFAULT_STRATEGY) ==
             Z_OK,
         "no memory for zlib");
  std::string packed(::deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef *>(const_cast<char *>(bytes.data()));
  stream.avail_in = uInt(bytes.size());
  stream.next_out = reinterpret_cast<Bytef *>(packed.data());
  stream.avail_out = uInt(packed.size());
  demand(::deflate(&stream, Z_FINISH) == Z_STREAM_END, "zlib cannot pack");
  packed.resize(stream.total_out);
  ::deflateEnd(&stream);
  return packed;
}

std::string unpack(std::string_view packed, std::size_t limit) {
  z_stream stream{};
  constexpr int kZlibOrGzip = 15 + 32;
  demand(::inflateInit2(&stream, kZlibOrGzip) == Z_OK, "no memory for zlib");
  std::string bytes(limit, '\0');
  stream.next_in = reinterpret_cast<Bytef *>(const_cast<char *>(packed.data()));
  stream.avail_in = uInt(packed.size());
  stream.next_out = reinterpret_cast<Bytef *>(bytes.data());
  stream.avail_out = uInt(bytes.size());
  ::inflate(&stream, Z_SYNC_FLUSH);
  bytes.resize(stream.total_out);
  ::inflateEnd(&stream);
  return bytes;
}

std::uint32_t crc_of(std::string_view bytes, std::uint32_t crc) {
  if (bytes.empty()) return crc;
  return std::uint32_t(::crc32_z(crc, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()));
}

std::string pack_by(char how, std::string_view bytes) {
  if (how == 'g') return pack(bytes, Packing::kGzip);
  if (how == 'z') return pack(bytes, Packing::kZlib);
  return std::string(bytes);
}

void mutate(std::string &bytes, std::size_t max_size) {
  const std::size_t size = std::min(bytes.size(), max_size);
  bytes.resize(max_size);
  bytes.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t *>(bytes.data()), size, max_size));
}

std::size_t replace(std::string_view bytes, std::uint8_t *data, std::size_t size,
                    std::size_t max_size) {
  if (bytes.empty() || bytes.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, bytes.data(), bytes.size());
  return bytes.size();
}

}  // namespace isowave::core::fuzz
