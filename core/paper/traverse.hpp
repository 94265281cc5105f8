#pragma once
// Rays -> the next N_Spec blocks of each ray that may hold the isosurface (Sec. 3.3, 4.1).

#include <optional>

#include "core/paper/scan.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/traverse.hpp"

namespace isowave::core {

class Traverse {
 public:
  /// scanned_pairs: as Wavefront::Limits has it. Without, it has no buffers.
  static ocl::BufferSizes sizes(std::uint64_t num_rays, std::uint32_t group_size,
                                bool scanned_pairs);
  Traverse(ocl::Device &device, std::uint64_t num_rays, std::uint32_t group_size,
           bool scanned_pairs = false);

  /// With Schedule::scanned_pairs, places that rays leave go to others, and N_Spec becomes as large
  /// as that allows.
  ///
  /// In     rays.active_ray_ids; ray_block_ids, where each ray goes on from; counts.spec_count
  /// Out    rays.pair_block_ids; ray_block_ids, the first block not looked at; counts.pair_count;
  ///        with scanned pairs pair_begins, pair_rays; counts.spec_count, pair_slot_count
  /// Waits  no
  void operator()(const Macrocells &macrocells, Wavefront &rays);

 private:
  struct Scanned {
    Scanned(ocl::Device &device, const ocl::BufferSizes &sizes, std::uint32_t group_size);
    void operator()(const ocl::Range &range, const Macrocells &macrocells, Wavefront &rays);

    std::uint32_t tile;           ///< rays per tile
    ocl::Buffer<uint> histogram;  ///< [ISO_MAX_SPECULATION + 1] 0 between passes
    ocl::Buffer<uint> tile_sums;
    ExclusiveScan scan;
    ocl::Kernel<kernels::traverse_count> count;
    ocl::Kernel<kernels::traverse_share> share;
    ocl::Kernel<kernels::traverse_tiles> tiles;
    ocl::Kernel<kernels::traverse_begins> begins;
    ocl::Kernel<kernels::traverse_scanned> find;
  };

  ocl::Range range_;
  ocl::Kernel<kernels::traverse> kernel_;
  std::optional<Scanned> scanned_;
};

}  // namespace isowave::core
