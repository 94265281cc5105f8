#include "isowave/volume.hpp"

#include <limits>

#include "core/api/convert.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/sources/layer_reader.hpp"
#include "core/sources/load_volume.hpp"
#include "core/sources/memory_reader.hpp"
#include "core/view/detail.hpp"
#include "core/view/frame.hpp"
#include "core/volume/world_positions.hpp"
#include "core/zfp/describe_compression.hpp"
#include "core/zfp/isovalue.hpp"
#include "core/zfp/isovalue_suggestions.hpp"
#include "core/zfp/voxel_region.hpp"
#include "core/zfp/voxel_sample.hpp"

namespace isowave {

namespace {

using core::guarded;

// The two enumerations have the same types in the same order.
static_assert(static_cast<int>(VoxelType::kFloat64) == static_cast<int>(core::VoxelType::kFloat64));
static_assert(static_cast<int>(VoxelType::kInt64) == static_cast<int>(core::VoxelType::kInt64));

core::VoxelType core_type(VoxelType type) {
  if (type < VoxelType::kUint8 || type > VoxelType::kInt64)
    throw core::Error("{} is no type of voxels", static_cast<int>(type));
  return static_cast<core::VoxelType>(type);
}

core::VolumeInfo core_info(const Grid &grid, VoxelType type) {
  core::VolumeInfo info = core_grid(grid);
  info.type = core_type(type);
  return info;
}

glm::uvec3 to_uvec3(const std::array<std::uint32_t, 3> &values) {
  return {values[0], values[1], values[2]};
}

bool is_default(const Compression &compression) {
  return !compression.rate && !compression.tolerance && !compression.tolerance_relative &&
         !compression.exact && !compression.measure_error && compression.levels == 1 &&
         !compression.map_nan && !compression.no_data;
}

core::Storage to_storage(const Compression &compression) {
  const int num_ways = int{compression.rate.has_value()} + int{compression.tolerance.has_value()} +
                       int{compression.tolerance_relative.has_value()} + int{compression.exact};
  if (num_ways > 1)
    throw core::Error(
        "compression by more than one of rate, tolerance, relative tolerance, exact: give one");
  core::Storage storage;
  storage.rate = compression.rate;
  storage.tolerance = compression.tolerance;
  storage.tolerance_relative = compression.tolerance_relative;
  storage.exact = compression.exact;
  storage.measure_error = compression.measure_error;
  storage.levels = compression.levels;
  storage.map_nan = compression.map_nan;
  storage.no_data = compression.no_data;
  storage.num_threads = compression.num_threads;
  if (compression.progress) {
    storage.progress = [told = compression.progress](std::string_view step) -> core::Progress {
      return [told, step = std::string(step)](std::uint32_t done, std::uint32_t total) {
        told(step, double{1} * done / total);
      };
    };
  }
  return storage;
}

const core::CompressedVolume &level_of(const core::CompressedVolume &volume, std::uint32_t level) {
  const std::vector<const core::CompressedVolume *> levels = core::levels_of(volume, true);
  if (level >= levels.size())
    throw core::Error("level {} of a volume that has {}: count from 0", level, levels.size());
  return *levels[level];
}

core::OpenReader open_layers(const ReadLayers &read, VoxelType type, const Grid &grid, bool keep,
                             const core::Storage &storage) {
  const core::VolumeInfo info = core_info(grid, type);
  const auto source =
      std::make_shared<core::LayerSource>(info, read, keep && storage.reads_again(info.type));
  return [source] { return std::make_unique<core::LayerReader>(source); };
}

std::shared_ptr<const Volume> make_volume(core::CompressedVolume volume,
                                          std::vector<std::string> notices = {}) {
  return std::make_shared<const Volume>(
      std::make_unique<const Volume::Implementation>(std::move(volume), std::move(notices)));
}

}  // namespace

core::VolumeInfo core_grid(const Grid &grid) {
  core::VolumeInfo info;
  info.dims = {grid.dims[0], grid.dims[1], grid.dims[2]};
  info.spacing = to_glm(grid.spacing);
  info.origin = to_glm(grid.origin);
  for (int axis = 0; axis < 3; ++axis) info.direction[axis] = to_glm(grid.direction.at(axis));
  info.is_anatomical = grid.is_anatomical;
  return info;
}

Grid public_grid(const core::VolumeInfo &info) {
  Grid grid;
  grid.dims = {info.dims.x, info.dims.y, info.dims.z};
  grid.spacing = from_glm(info.spacing);
  grid.origin = from_glm(info.origin);
  for (int axis = 0; axis < 3; ++axis) grid.direction.at(axis) = from_glm(info.direction[axis]);
  grid.is_anatomical = info.is_anatomical;
  return grid;
}

core::RawOverrides to_overrides(const RawFile &raw) {
  core::RawOverrides overrides;
  if (raw.dims) overrides.dims = to_uvec3(*raw.dims);
  if (raw.type) overrides.type = core_type(*raw.type);
  if (raw.spacing) overrides.spacing = to_glm(*raw.spacing);
  overrides.step = raw.step;
  return overrides;
}

core::Storage storage_for(const std::string &path, const Compression &compression) {
  if (core::is_zfp_name(path) && !is_default(compression))
    throw core::Error("{}: is compressed already: leave out how to compress it", path);
  return to_storage(compression);
}

Volume::Implementation::Implementation(core::CompressedVolume compressed,
                                       std::vector<std::string> of_header)
    : volume(std::move(compressed)),
      grid(public_grid(volume.info)),
      notices(std::move(of_header)) {}

Volume::Volume(std::unique_ptr<const Implementation> implementation)
    : implementation_(std::move(implementation)) {}
Volume::~Volume() = default;

const Grid &Volume::grid() const {
  return implementation_->grid;
}
VoxelType Volume::source_type() const {
  return static_cast<VoxelType>(implementation_->volume.info.type);
}
std::array<float, 2> Volume::value_range() const {
  return implementation_->volume.value_range;
}
std::string Volume::isovalue_notice(double isovalue) const {
  return guarded("looking at an isovalue",
                 [&] { return core::isovalue_notice(implementation_->volume, isovalue); });
}
const std::vector<std::string> &Volume::notices() const {
  return implementation_->notices;
}
std::string_view Volume::compression() const {
  return core::compression_mode(implementation_->volume);
}
double Volume::bits_per_voxel() const {
  return implementation_->volume.rate();
}
std::uint64_t Volume::compressed_bytes() const {
  return (implementation_->volume.payload_bits() + 7) / 8;
}
std::optional<double> Volume::max_voxel_error() const {
  return implementation_->volume.max_voxel_error;
}
bool Volume::errors_are_stated() const {
  return implementation_->volume.errors_are_stated;
}
std::uint32_t Volume::num_levels() const {
  return static_cast<std::uint32_t>(implementation_->volume.coarser_levels.size() + 1);
}
bool Volume::float32_positions() const {
  return core::float32_holds_positions(implementation_->volume.info);
}

Grid Volume::level_grid(std::uint32_t level) const {
  return guarded("looking at a level",
                 [&] { return public_grid(level_of(implementation_->volume, level).info); });
}

std::vector<float> Volume::decode(std::uint32_t level) const {
  return decode(level, {.begin = {}, .end = level_grid(level).dims});
}

std::vector<float> Volume::decode(std::uint32_t level, const Region &region) const {
  return guarded("decoding", [&] {
    const core::CompressedVolume &volume = level_of(implementation_->volume, level);
    const core::VoxelRegion wanted{to_uvec3(region.begin), to_uvec3(region.end),
                                   to_uvec3(region.step)};
    core::check_region(wanted, volume.info.dims);
    const glm::u64vec3 dims(wanted.dims());
    const std::uint64_t count = dims.x * dims.y * dims.z;
    if (count > std::numeric_limits<std::size_t>::max() / sizeof(float))
      throw core::Error("{} voxels do not fit this build's addresses: decode fewer", count);
    std::vector<float> voxels(count);
    core::decode_region(volume, wanted, voxels);
    return voxels;
  });
}

std::vector<float> Volume::sample(std::uint64_t max_voxels) const {
  return guarded("decoding",
                 [&] { return core::sample_voxels(implementation_->volume, max_voxels); });
}

std::vector<double> Volume::suggested_isovalues() const {
  return guarded("suggesting isovalues", [&] {
    std::vector<double> isovalues;
    for (const auto &suggested : core::suggest_isovalues(implementation_->volume).isovalues)
      isovalues.push_back(suggested.isovalue);
    return isovalues;
  });
}

void Volume::save(const std::filesystem::path &path) const {
  guarded("saving", [&] {
    core::check_zfp_name(path.string());
    core::write_zfp_file(implementation_->volume, path);
  });
}

std::shared_ptr<const Volume> open_volume(const std::filesystem::path &path,
                                          const Compression &compression, const RawFile &raw) {
  const std::string name = path.string();
  return guarded("opening a volume", [&] {
    const core::RawOverrides overrides = to_overrides(raw);
    const core::Storage storage = storage_for(name, compression);
    if (core::is_zfp_name(name)) return make_volume(core::open_compressed_volume(name, overrides));
    std::vector<std::string> notices;
    const auto open = [&] {
      std::unique_ptr<core::VolumeReader> reader = core::open_any_volume(name, overrides);
      notices = reader->notices();
      return reader;
    };
    core::CompressedVolume volume = core::compress_volume(open, name, storage);
    return make_volume(std::move(volume), std::move(notices));
  });
}

std::shared_ptr<const Volume> compress(const void *voxels, VoxelType type, const Grid &grid,
                                       const Compression &compression) {
  return guarded("compressing", [&] {
    const core::VolumeInfo info = core_info(grid, type);
    core::check_volume_info(info, "the array");
    const std::span bytes(static_cast<const std::byte *>(voxels),
                          info.num_voxels() * core::size_of(info.type));
    return make_volume(
        core::compress_volume([&] { return std::make_unique<core::MemoryReader>(info, bytes); },
                              "the array", to_storage(compression)));
  });
}

std::shared_ptr<const Volume> compress(const ReadLayers &read, VoxelType type, const Grid &grid,
                                       const Compression &compression, bool keep) {
  return guarded("compressing", [&] {
    const core::Storage storage = to_storage(compression);
    return make_volume(
        core::compress_volume(open_layers(read, type, grid, keep, storage), "the array", storage));
  });
}

std::shared_ptr<const Volume> compress_to_file(const ReadLayers &read, VoxelType type,
                                               const Grid &grid, const std::filesystem::path &path,
                                               const Compression &compression, bool keep) {
  return guarded("compressing", [&] {
    const core::Storage storage = to_storage(compression);
    return make_volume(core::compress_volume_to_file(open_layers(read, type, grid, keep, storage),
                                                     "the array", storage, path));
  });
}

void check_num_voxels(std::uint64_t num_voxels, const Grid &grid) {
  const std::uint64_t of_grid = std::uint64_t{grid.dims[0]} * grid.dims[1] * grid.dims[2];
  if (num_voxels != of_grid) {
    throw core::Error("an array of {} voxels is no grid of {}x{}x{}", num_voxels, grid.dims[0],
                      grid.dims[1], grid.dims[2]);
  }
}

}  // namespace isowave
