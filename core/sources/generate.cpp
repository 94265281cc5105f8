#include "core/sources/generate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/raw_reader.hpp"
#include "core/sources/field_rows.hpp"
#include "core/sources/noise_field.hpp"

namespace isowave::core {
namespace fs = std::filesystem;

namespace {

constexpr std::array<std::string_view, 11> kFieldNames{
    "sphere",       "plane",      "saddle", "marschner_lobb", "gyroid",    "shell",
    "mixing_layer", "turbulence", "jet",    "scan",           "noisy_scan"};
constexpr std::uint64_t kChunkBytes = 1u << 24;

VolumeInfo info_of(const GenerateOptions &options) {
  VolumeInfo info;
  info.dims = options.dims;
  info.type = options.type;
  check_volume_info(info, to_string(options.field));
  return info;
}

template <class T>
void store_as(std::span<const double> row, std::byte *out) {
  for (std::size_t x = 0; x < row.size(); ++x) {
    T voxel;
    if constexpr (std::is_floating_point_v<T>) {
      voxel = static_cast<T>(row[x]);
    } else {
      constexpr auto kLargest = static_cast<double>(std::numeric_limits<T>::max());
      voxel = static_cast<T>(std::floor(row[x] * kLargest + 0.5));
    }
    std::memcpy(out + x * sizeof(T), &voxel, sizeof(T));
  }
}

void store(VoxelType type, std::span<const double> row, std::byte *out) {
  with_voxel_type(type, [&]<class T>(T) { store_as<T>(row, out); });
}

class GeneratedReader : public VolumeReader {
 public:
  explicit GeneratedReader(const GenerateOptions &options)
      : options_(options), rows_(make_field_rows(options.field, options.dims, options.seed)) {
    info_ = info_of(options);
    const auto noise = make_noise_field(options.field, options.dims, options.seed);
    if (noise && options.noise) made_ = options.noise(*noise, options.dims, options.type);
  }

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    check_range(z_begin, num_layers, out.size());
    for_rows(z_begin, num_layers, [&](std::uint64_t row, std::span<const std::byte> voxels) {
      convert_to_float(info_.type, voxels, out.subspan(row * info_.dims.x, info_.dims.x));
    });
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    check_range(z_begin, num_layers, out.size());
    for_rows(z_begin, num_layers, [&](std::uint64_t row, std::span<const std::byte> voxels) {
      convert_to_double(info_.type, voxels, out.subspan(row * info_.dims.x, info_.dims.x));
    });
  }

  DeviceVoxels *on_device() override { return made_ ? made_->in_place() : nullptr; }

  /// The voxels in their own type.
  void read_stored(std::uint32_t z_begin, std::uint32_t num_layers, std::span<std::byte> out) {
    check_range(z_begin, num_layers, out.size() / size_of(info_.type));
    for_rows(z_begin, num_layers, [&](std::uint64_t row, std::span<const std::byte> voxels) {
      std::memcpy(out.data() + row * voxels.size(), voxels.data(), voxels.size());
    });
  }

 private:
  void check_range(std::uint32_t z_begin, std::uint32_t num_layers,
                   std::uint64_t num_voxels) const {
    if (num_layers > info_.dims.z || z_begin > info_.dims.z - num_layers ||
        num_voxels != std::uint64_t(info_.dims.x) * info_.dims.y * num_layers) {
      throw std::invalid_argument(
          "GeneratedReader: layers outside the volume, or out of a wrong size");
    }
  }

  /// Calls consume(row index from z_begin, stored voxels) for each row, from many threads.
  template <class Consume>
  void for_rows(std::uint32_t z_begin, std::uint32_t num_layers, const Consume &consume) {
    const std::uint64_t num_rows = std::uint64_t(info_.dims.y) * num_layers;
    if (made_) {
      const std::size_t row_bytes = info_.dims.x * size_of(info_.type);
      stored_.resize(num_rows * row_bytes);
      made_->evaluate(z_begin, num_layers, stored_);
      return parallel_for(num_rows, options_.num_threads, [&](std::uint64_t row, std::uint32_t) {
        consume(row, std::span<const std::byte>(stored_).subspan(row * row_bytes, row_bytes));
      });
    }
    struct Scratch {
      std::vector<double> values;
      std::vector<std::byte> voxels;
    };
    std::vector<Scratch> scratch(thread_count(options_.num_threads));
    parallel_for(num_rows, options_.num_threads, [&](std::uint64_t row, std::uint32_t thread) {
      auto &[values, voxels] = scratch[thread];
      values.resize(info_.dims.x);
      voxels.resize(info_.dims.x * size_of(info_.type));
      const auto y = std::uint32_t(row % info_.dims.y),
                 z = std::uint32_t(z_begin + row / info_.dims.y);
      rows_->evaluate(y, z, values);
      store(info_.type, values, voxels.data());
      consume(row, std::span<const std::byte>(voxels));
    });
  }

  GenerateOptions options_;
  std::unique_ptr<FieldRows> rows_;
  std::unique_ptr<NoiseVoxels> made_{};  ///< null: the rows make the voxels
  std::vector<std::byte> stored_{};      ///< layers of made_
};

/// The file to write: a folder gets the Open-SciVis name, and a name in that pattern must tell the
/// truth.
fs::path output_path(const GenerateOptions &options, const fs::path &path) {
  if (path.filename().empty() || fs::is_directory(path)) {
    return path / fmt::format("{}_{}x{}x{}_{}.raw", to_string(options.field), options.dims.x,
                              options.dims.y, options.dims.z, to_string(options.type));
  }
  if (path.extension() == ".nrrd") return path;
  if (path.extension() != ".raw")
    throw Error("{}: generate writes raw voxels or NRRD: end the name in .raw or .nrrd",
                path.string());
  const std::optional<RawName> name = parse_raw_name(path.stem().string());
  if (name && (name->dims != options.dims || name->type != options.type)) {
    throw Error("{}: the name says {}x{}x{} {}, the voxels are {}x{}x{} {}", path.string(),
                name->dims.x, name->dims.y, name->dims.z, to_string(name->type), options.dims.x,
                options.dims.y, options.dims.z, to_string(options.type));
  }
  return path;
}

/// The header before raw voxels in a NRRD file [teem.sourceforge.net/nrrd/format.html].
std::string nrrd_header(const VolumeInfo &info) {
  const std::string_view type = info.type == VoxelType::kFloat32   ? "float"
                                : info.type == VoxelType::kFloat64 ? "double"
                                                                   : to_string(info.type);
  return fmt::format(
      "NRRD0004\ntype: {}\ndimension: 3\nsizes: {} {} {}\nendian: little\nencoding: raw\n\n", type,
      info.dims.x, info.dims.y, info.dims.z);
}

}  // namespace

std::string_view to_string(Field field) {
  return kFieldNames.at(std::size_t(field));
}

Field field_from_string(std::string_view name) {
  const auto found = std::find(kFieldNames.begin(), kFieldNames.end(), name);
  if (found != kFieldNames.end()) return Field(found - kFieldNames.begin());
  throw Error("unknown field '{}': use one of {}", name, fmt::join(kFieldNames, ", "));
}

bool has_seed(Field field) {
  return make_noise_field(field, glm::uvec3(2), 0).has_value();
}

std::vector<std::string> field_names() {
  return {kFieldNames.begin(), kFieldNames.end()};
}

std::unique_ptr<VolumeReader> open_generated(const GenerateOptions &options) {
  info_of(options);  // before a field is set up for bad dims
  return std::make_unique<GeneratedReader>(options);
}

fs::path generate_to_file(const GenerateOptions &options, const fs::path &path,
                          const Progress &progress) {
  const VolumeInfo info = info_of(options);
  fs::path target = output_path(options, path);
  AtomicFile file(target);
  GeneratedReader reader(options);
  const std::uint64_t layer_bytes = std::uint64_t(info.dims.x) * info.dims.y * size_of(info.type);
  const auto chunk =
      std::uint32_t(std::clamp<std::uint64_t>(kChunkBytes / layer_bytes, 1, info.dims.z));
  std::vector<std::byte> voxels;
  const std::string header = target.extension() == ".nrrd" ? nrrd_header(info) : "";
  file.write(std::as_bytes(std::span(header)));
  for (std::uint32_t z = 0; z < info.dims.z; z += chunk) {
    const std::uint32_t layers = std::min(chunk, info.dims.z - z);
    voxels.resize(layer_bytes * layers);
    reader.read_stored(z, layers, voxels);
    file.write(voxels);
    if (progress) progress(z + layers, info.dims.z);
  }
  file.commit();
  return target;
}

}  // namespace isowave::core
