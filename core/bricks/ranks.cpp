#include "core/bricks/ranks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>

#include "core/base/error.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/surface_work.hpp"
#include "core/io/input_file.hpp"
#include "core/zfp/zfp_trailer.hpp"

namespace isowave::core {

namespace {

std::vector<std::string> split(const std::string &list) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    parts.push_back(list.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

}  // namespace

ocl::DeviceInfo choose_local_device(const std::string &selector, std::uint32_t local_rank) {
  const std::vector<std::string> parts = split(selector);
  if (parts.size() > 1) return ocl::choose_device(parts[local_rank % parts.size()]);
  const ocl::DeviceInfo first = ocl::choose_device(selector);
  std::vector<ocl::DeviceInfo> alike = ocl::list_devices();
  std::erase_if(alike, [&](const ocl::DeviceInfo &info) {
    return info.name != first.name || info.platform != first.platform;
  });
  return alike[local_rank % alike.size()];
}

std::string fingerprint(const std::string &path, const VolumeInfo &info) {
  std::string grid = fmt::format("{}x{}x{} {} {} {} {} {} {} {}", info.dims.x, info.dims.y,
                                 info.dims.z, info.spacing.x, info.spacing.y, info.spacing.z,
                                 info.origin.x, info.origin.y, info.origin.z, to_string(info.type));
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return grid;  // it is made
  const InputFile file(path);
  std::vector<std::byte> end(std::min<std::uint64_t>(file.size(), 1u << 16));
  file.read(0, end);
  std::uint32_t crc = update_crc(0, end);
  file.read(file.size() - end.size(), end);
  crc = update_crc(crc, end);
  return fmt::format("{} {} {:x}", grid, file.size(), crc);
}

std::size_t num_cut_levels(const VolumeInfo &whole, std::size_t num_levels, std::uint32_t bricks) {
  const auto num_units = [&](std::size_t levels) {
    const int unit = cut_unit(levels);
    return num_blocks({glm::ivec3(0), (blocks_along(whole) + (unit - 1)) / unit});
  };
  while (num_levels > 1 && num_units(num_levels) < bricks) --num_levels;
  return num_levels;
}

Cuts cut_for(const Team &team, const VolumeInfo &whole, const std::string &bricks, int unit) {
  if (bricks.empty()) return {blocks_along(whole), team.size(), num_blocks, unit};
  const glm::uvec3 along = parse_bricks(bricks);
  if (std::uint64_t{along.x} * along.y * along.z != team.size())
    throw Error("bricks {}: {} processes draw a brick each", bricks, team.size());
  return {blocks_along(whole), along, unit};
}

Cuts cut_by_surfaces(Team &team, const VolumeInfo &whole, std::span<const float> isovalues,
                     int unit, const std::function<CompressedVolume(const BlockBox &)> &load) {
  const glm::ivec3 blocks = blocks_along(whole);
  // Each rank counts in a slab of its own.
  const Cuts slabs(blocks, glm::uvec3(1, 1, team.size()), kWorkUnit);
  std::vector<std::uint32_t> counts;
  together(team, [&] { counts = count_touched(load(slabs.bricks()[team.rank()]), isovalues); });
  const SurfaceWork work(blocks, gather(team, counts));
  return {blocks, team.size(), work, std::max(unit, kWorkUnit)};
}

double agree_on_voxels(Team &team, CompressedVolume &brick) {
  struct Voxels {
    std::array<float, 2> range;
    double error;                            ///< -1: not known
    std::uint64_t bits = 0, num_blocks = 0;  ///< of own blocks
  };
  const bool has_data = brick.no_data.num_voxels() < brick.info.num_voxels();
  Voxels own{has_data ? brick.value_range : std::array{kUnknownRange[1], kUnknownRange[0]},
             brick.max_voxel_error.value_or(-1)};
  const glm::u64vec3 kept(brick.num_blocks()), begin(brick.info.brick.before),
      end = kept - glm::u64vec3(brick.info.brick.behind);
  for (std::uint64_t z = begin.z; z < end.z; ++z) {
    for (std::uint64_t y = begin.y; y < end.y; ++y) {
      const std::uint64_t row = kept.x * (y + kept.y * z);
      own.bits += brick.block_begin(row + end.x) - brick.block_begin(row + begin.x);
      own.num_blocks += end.x - begin.x;
    }
  }
  Voxels all{own.range, own.error};
  for (const Voxels &each : gather(team, std::vector{own})) {
    all.range = {std::min(all.range[0], each.range[0]), std::max(all.range[1], each.range[1])};
    all.error = std::max(all.error, each.error);
    all.bits += each.bits;
    all.num_blocks += each.num_blocks;
  }
  if (all.range[0] <= all.range[1]) brick.value_range = all.range;
  if (all.error >= 0) brick.max_voxel_error = all.error;
  return double(all.bits) / (64.0 * double(all.num_blocks));
}

std::optional<BlockBox> gather_box(Team &team, const VolumeInfo &brick,
                                   const std::optional<BlockBox> &own) {
  std::string text;
  if (own) {
    const glm::ivec3 first(brick.brick.first_voxel / 4u);
    const BlockBox box{own->begin + first, own->end + first};
    text.resize(sizeof(box));
    std::memcpy(text.data(), &box, sizeof(box));
  }
  std::optional<BlockBox> all;
  for (const std::string &each : team.all_gather(text)) {
    if (each.empty()) continue;
    BlockBox box{};
    std::memcpy(&box, each.data(), sizeof(box));
    if (!all) all = box;
    all->begin = glm::min(all->begin, box.begin);
    all->end = glm::max(all->end, box.end);
  }
  return all;
}

}  // namespace isowave::core
