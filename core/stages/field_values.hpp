#pragma once
// Hits get the values of a second volume, the field (kernels_cl/field_values.cl).

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/stages/block_cache.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/field_values.hpp"
#include "kernels_cl/portable/field_value.h"

namespace isowave::core {

class FieldValues {
 public:
  /// num_labels  ISO_NUM_LABELS, if the map may have ISO_FIELD_OWN_LABELS; else 0
  /// num_maps    1, or levels of detail that may have values of their own
  static ocl::BufferSizes sizes(std::uint32_t num_labels, std::size_t num_maps = 1) {
    return {ocl::buffer_size<FieldMap>("map of a field", num_maps),
            ocl::buffer_size<uint>("labels of surfaces", std::max(1u, num_labels / 4)),
            ocl::buffer_size<uint>("range of field values", 2)};
  }

  /// slots                 of the field's cache
  /// num_labels, num_maps  as sizes()
  FieldValues(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
              SlotType slots, std::uint32_t num_labels = 0, std::size_t num_maps = 1);

  /// Sets the map from hits to the field. Waits, if it is another one than before.
  ///
  /// label_table  FieldReading::label_table
  void set_map(const FieldMap &map, const std::vector<uint> &label_table = {}) {
    set_maps({&map, 1}, label_table);
  }
  /// Sets a map for each level of detail that draws, from its hits to itself.
  void set_maps(std::span<const FieldMap> maps, const std::vector<uint> &label_table = {});

  /// The hits whose blocks of the field are cached get their values; rays of the others ask for
  /// blocks, as far as they are in the pass's window.
  ///
  /// frame   view and screen of the frame at work; grid and schedule of the field. With several
  ///         maps, the finest level that draws
  /// cache   of the field
  /// begins  all hits. Not begins: of the rays that the pass before has left, when its requests
  ///         have been provided
  /// In      rays.hits; previous_counts: of the pass before; counts: opened; active_ray_ids, unless
  ///         it begins
  /// Out     rays.field_values of the hits; as SmoothNormals: next_active_ray_ids, counts, and the
  ///         cache's requests
  /// Waits   no
  void operator()(const FrameParams &frame, BlockCache &cache, Wavefront &rays, bool begins);

  /// The least and the largest of the first rays.field_values; none if there is no value.
  ///
  /// Waits  yes
  std::optional<std::array<float, 2>> range(const Wavefront &rays, std::size_t num_rays);

 private:
  ocl::Device &device_;
  ocl::Range range_of_hits_;
  std::vector<FieldMap> maps_on_device_{};
  std::vector<uint> labels_on_device_{};
  ocl::Buffer<FieldMap> map_;
  ocl::Buffer<uint> label_table_;
  ocl::Buffer<uint> range_;
  LevelledKernel<kernels::field_values> kernel_;
  ocl::Kernel<kernels::field_range> range_kernel_;
};

}  // namespace isowave::core
