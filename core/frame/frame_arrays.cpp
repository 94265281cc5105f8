#include "core/frame/frame_arrays.hpp"

#include <stdexcept>

#include "core/view/detail.hpp"
#include "core/volume/pyramid.hpp"
#include "core/volume/world_positions.hpp"

namespace isowave::core {

void check_arrays(const WantedArrays &wanted, ImageSize size) {
  if (wanted.picture && size.stride != 1)
    throw std::logic_error("a sample of a frame's rays has no picture");
}

HitMap make_hit_map(std::span<const VolumeInfo> levels) {
  static_assert(ISO_MAX_LEVELS == kMaxLevels);
  HitMap map{};
  map.map = make_world_map(levels.front());
  map.is_float32 = float32_holds_positions(levels.front()) ? 1 : 0;
  set_level_places(levels, map);
  return map;
}

Image8 image_of(ImageSize size, const HostArray<std::uint8_t> &picture) {
  const std::size_t channels = picture.size() / size.num_pixels();
  return {size.width, size.height, static_cast<std::uint32_t>(channels), picture.copy()};
}

void add_hit_arrays(const WantedArrays &wanted, std::span<const HitRecord> hits,
                    const ShadeParams &shading, const HitMap *map, HostMemory &memory,
                    FrameArrays &arrays) {
  if (wanted.hits) {
    arrays.hits = memory.array<HitRecord>(hits.size());
    fill_from_hits(arrays.hits, hits, [](const HitRecord &hit) { return hit; });
  }
  if (wanted.depth) {
    arrays.depth = memory.array<float>(hits.size());
    fill_from_hits(arrays.depth, hits, [](const HitRecord &hit) { return hit.t; });
  }
  if (wanted.normals) {
    arrays.normals = memory.array<std::array<float, 3>>(hits.size());
    fill_from_hits(arrays.normals, hits, [&](const HitRecord &hit) {
      const AmbientDirection normal = world_normal(&shading, hit);
      return std::array{normal.x, normal.y, normal.z};
    });
  }
  if (wanted.positions && map != nullptr) {
    arrays.positions = memory.array<std::array<double, 3>>(hits.size());
    fill_from_hits(arrays.positions, hits, [&](const HitRecord &hit) {
      std::array<double, 3> position;
      hit_position(map, hit, position.data());
      return position;
    });
  }
}

}  // namespace isowave::core
