#pragma once
// The blocks that may hold the isosurface (Sec. 3.1): value ranges of blocks and of coarse
// macrocells of 4^3 blocks, built once per volume from decoded data, and one bit per block for the
// isovalue at hand. See kernels_cl/macrocells.cl.

#include <array>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "core/stages/device_counts.hpp"
#include "core/stream/device_stream.hpp"
#include "core/volume/block_box.hpp"
#include "kernels/macrocells.hpp"

namespace isowave::core {

/// Ranges and masks of one level of detail or of several, one behind the other:
/// LevelPlace::ranges_begin, masks_begin.
struct MacrocellBuffers {
  /// Limits that the lengths of its buffers follow from.
  struct Limits {
    std::uint64_t num_blocks = 0, num_macrocells = 0;  ///< of all levels together
    /// Selections whose masks are kept: a renderer draws the volume, and its lower and upper bound,
    /// by turns.
    std::size_t num_selections = 1;
    std::uint64_t no_data_words = 0;  ///< see joined_no_data() in core/view/detail.hpp
  };
  static ocl::BufferSizes sizes(const Limits &limits);

  MacrocellBuffers(ocl::Device &device, const Limits &limits);

  ocl::Buffer<ushort> ranges;
  std::vector<ocl::Buffer<uint>> masks;        ///< [selections]
  std::optional<ocl::Buffer<uint>> no_data{};  ///< of several levels
  std::size_t selection = 0;                   ///< the one in use, at all levels
};

class Macrocells {
 public:
  /// Buffers without those of its MacrocellBuffers.
  ///
  /// num_macrocells  macrocells of its level of detail
  /// num_selections  selections of its MacrocellBuffers
  /// label_blocks    blocks of a z layer of a volume of labels, which keeps the scratch of
  ///                 choose_labels(); 0: of another volume
  static ocl::BufferSizes sizes(std::uint64_t num_macrocells, std::size_t num_selections,
                                std::uint64_t label_blocks = 0);
  /// Bytes that building needs beside the buffers that stay.
  static std::uint64_t setup_scratch_bytes(const glm::uvec3 &num_blocks);

  /// Decodes every block once, beside a sample for the quantile table. Needs 128 bytes of scratch
  /// for each block of one z layer.
  ///
  /// frame       its grid and place are used
  /// buffers     shared with other levels; none: its own
  /// thresholds  see thresholds(); none: of a sample of the blocks
  /// extremes    becomes the least and the largest of all voxels, padding left out
  /// Waits       yes
  Macrocells(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream,
             std::shared_ptr<MacrocellBuffers> buffers = {}, std::vector<float> thresholds = {},
             std::array<float, 2> *extremes = nullptr);

  /// Makes the ranges anew, once labels have been put into other groups. Before the first call, the
  /// ranges of a volume of labels are not there.
  ///
  /// frame   as for the constructor
  /// stream  the constructor's: DeviceStream::has_groups()
  /// Waits   if the stream stays on the host
  void choose_labels(const FrameParams &frame, const DeviceStream &stream);

  /// Makes masks() for an isovalue, unless they are those in use. Ranges were made of voxels of all
  /// bit planes, and blocks may since be decoded to other values. So ranges are taken to be wider,
  /// by voxel_error and by the offsets of `moved`.
  ///
  /// frame        its grid, place and surface.isovalue are used; of labels, surface.isovalue_index
  ///              instead: the group
  /// voxel_error  how far a decoded voxel may be from the one that the ranges were made of
  /// moved        the stream, if its layout raises or lowers voxels; none: it does not
  /// Waits        no
  void select(const FrameParams &frame, double voxel_error = 0,
              const DeviceStream *moved = nullptr);
  /// The surface that select() found: that of the frame it was called with last.
  ///
  /// Waits  at the first call for an isovalue
  Surface surface(const FrameParams &frame);

  /// The box around the active blocks of the isovalue selected last.
  ///
  /// Returns  nothing if no block is active
  /// Waits    yes
  std::optional<BlockBox> active_blocks(const FrameParams &frame) const;

  /// Switches to other masks, at all levels that share the buffers, for select() and later calls.
  void use(std::size_t selection) { buffers_->selection = selection; }

  /// [2 * coarse macrocells]: bit x + 4y + 16z of each block in its macrocell, 32 bits a word.
  const ocl::Buffer<uint> &masks() const { return buffers_->masks[buffers_->selection]; }
  /// [blocks]: low in bits 0..7, high in bits 8..15, indices into thresholds(); low > high: owns no
  /// dual cell.
  const ocl::Buffer<ushort> &ranges() const { return buffers_->ranges; }
  /// The table for all levels, if they are several (MacrocellBuffers).
  NoDataOnDevice no_data() const {
    if (!buffers_->no_data) return {};
    return {&*buffers_->no_data, 0};
  }
  /// [256], ascending from -inf to +inf.
  const std::vector<float> &thresholds() const { return thresholds_; }

 private:
  /// Decodes blocks sampled_block(first + i * stride, stride), i in [0, count): partials [8 *
  /// count].
  struct Partials {
    void operator()(std::uint32_t first, std::uint32_t stride, std::uint32_t count,
                    ocl::Buffer<VoxelRange> &partials);
    ocl::Device &device;
    const FrameParams &frame;
    const DeviceStream &stream;
    ocl::Kernel<kernels::macrocell_partials> &kernel;
  };

  /// The values that masks are made from, and the masks' box.
  struct Selection {
    /// Isovalue, voxel_error, uniform and per-block offset of the layout; none: nothing yet.
    std::optional<std::array<double, 4>> of{};
    std::uint32_t isovalue_index = 0;
    ocl::Buffer<int> box;
    /// Begin x, y, z, end x, y, z [macrocells]; none: still on the device.
    std::optional<std::array<int, 6>> active_box{};
  };
  Selection &selection() { return selections_[buffers_->selection]; }

  ocl::BufferSizes own_sizes() const { return sizes(num_coarse_, buffers_->masks.size()); }
  /// Scratch of the build: while it samples blocks for the quantile table ...
  static ocl::BufferSizes sampling_sizes(std::uint64_t num_blocks);
  /// ... and then, while it makes the blocks' ranges one z layer after the other.
  static ocl::BufferSizes layer_sizes(std::uint64_t layer_blocks);

  struct BuildKernels {
    BuildKernels(ocl::Device &device, const ocl::Defines &defines)
        : partials(device, defines),
          ranges(device, defines),
          coarse_ranges(device, defines),
          extremes(device, defines) {}
    ocl::Kernel<kernels::macrocell_partials> partials;
    ocl::Kernel<kernels::macrocell_ranges> ranges;
    ocl::Kernel<kernels::macrocell_coarse_ranges> coarse_ranges;
    ocl::Kernel<kernels::macrocell_extremes> extremes;
  };
  /// Scratch of one z layer.
  struct LayerScratch {
    LayerScratch(ocl::Device &device, std::uint64_t layer_blocks)
        : LayerScratch(device, layer_sizes(layer_blocks)) {}
    LayerScratch(ocl::Device &device, const ocl::BufferSizes &sizes)
        : thresholds(device, sizes["range thresholds"]),
          below(device, sizes["range partials, layer below"]),
          above(device, sizes["range partials, layer above"]),
          extremes(device, sizes["extremes"]) {}
    ocl::Buffer<float> thresholds;
    ocl::Buffer<VoxelRange> below, above;
    ocl::Buffer<int> extremes;
  };
  /// What choose_labels() needs.
  struct OfLabels {
    OfLabels(ocl::Device &of, const ocl::Defines &defines, std::uint64_t layer_blocks)
        : device(of), kernels(of, defines), scratch(of, layer_blocks) {}
    ocl::Device &device;
    BuildKernels kernels;
    LayerScratch scratch;
  };
  void compile(ocl::Device &device, const DeviceStream &stream, BuildKernels &kernels,
               bool with_extremes);
  void make_ranges(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream,
                   BuildKernels &kernels, LayerScratch &scratch, bool with_extremes);
  void build(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream,
             std::array<float, 2> *extremes);
  std::vector<float> sample_thresholds(ocl::Device &device, std::uint32_t num_blocks,
                                       Partials &decode);

  std::uint32_t num_coarse_;
  ocl::Range coarse_range_;
  std::shared_ptr<MacrocellBuffers> buffers_;
  ocl::Buffer<ushort> coarse_ranges_;
  ocl::Buffer<uint> limits_;
  std::vector<Selection> selections_;
  std::vector<float> thresholds_;
  std::unique_ptr<OfLabels> of_labels_;  ///< null: the volume has no labels
  ocl::Kernel<kernels::macrocell_masks> masks_kernel_;
};

}  // namespace isowave::core
