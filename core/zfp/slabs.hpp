#pragma once
// How a team shares out a volume that it compresses: each process has a slab of whole layers of
// blocks, and of each level of detail the part that is made of the slab.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/team.hpp"
#include "core/volume/volume.hpp"
#include "core/volume/voxel_chunks.hpp"

namespace isowave::core {

/// Layers of blocks, or of voxels; end is not included.
struct LayerRange {
  std::uint32_t begin = 0, end = 0;

  std::uint32_t count() const { return end - begin; }
  bool empty() const { return begin == end; }
};

/// The layers that both ranges have.
LayerRange common_layers(const LayerRange &a, const LayerRange &b);

std::uint32_t num_block_layers(const VolumeInfo &info);
/// The layers of voxels of these layers of blocks of a level.
LayerRange voxel_layers(const VolumeInfo &info, const LayerRange &blocks);

/// The values of layers `some` from `values`, which has per_layer values for each layer of `all`.
template <class Value>
std::span<Value> values_of(std::span<Value> values, std::size_t per_layer, const LayerRange &all,
                           const LayerRange &some) {
  return values.subspan((some.begin - all.begin) * per_layer, some.count() * per_layer);
}

/// How a level is cut into slabs.
struct LevelCuts {
  /// Layers of blocks of each rank's slab, and the layers that the rank works on: also those of its
  /// neighbours that the next level's slab depends on.
  std::vector<LayerRange> own, worked;
};

/// The cuts of each level, for `size` ranks.
///
/// levels  the grids, the finest first
std::vector<LevelCuts> cut_levels(std::span<const VolumeInfo> levels, std::uint32_t size);

/// This process's share of the volume's layers of blocks, for InputOptions; none if there are fewer
/// layers than processes.
VolumePart own_part(Team &team, const VolumeInfo &whole);

/// A reader of so many layers from part.begin on. All processes make the same call.
///
/// open    gives the whole volume's
/// Throws  Error at all of them
std::unique_ptr<VolumeReader> open_part(const VolumePart &part, std::uint32_t num_layers,
                                        const OpenReader &open);

}  // namespace isowave::core
