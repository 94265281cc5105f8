#include "core/stages/macrocells.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "core/view/frame.hpp"
#include "core/volume/range_thresholds.hpp"
#include "kernels_cl/portable/block_bound.h"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

/// The extremes of no values, as macrocell_extremes orders them.
constexpr std::array kNoExtremes = {std::numeric_limits<int>::max(),
                                    std::numeric_limits<int>::min()};

}  // namespace

ocl::BufferSizes MacrocellBuffers::sizes(const Limits &limits) {
  ocl::BufferSizes sizes{ocl::buffer_size<ushort>("block ranges", limits.num_blocks)};
  for (std::size_t i = 0; i < limits.num_selections; ++i)
    sizes.add({ocl::buffer_size<uint>("macrocell masks", 2 * limits.num_macrocells)});
  if (limits.no_data_words != 0)
    sizes.add({ocl::buffer_size<uint>("voxels without data", limits.no_data_words)});
  return sizes;
}

MacrocellBuffers::MacrocellBuffers(ocl::Device &device, const Limits &limits)
    : ranges(device, sizes(limits)["block ranges"]) {
  for (const ocl::BufferSize &size : sizes(limits).named("macrocell masks"))
    masks.emplace_back(device, size);
  if (limits.no_data_words != 0) no_data.emplace(device, sizes(limits)["voxels without data"]);
}

ocl::BufferSizes Macrocells::sizes(std::uint64_t num_macrocells, std::size_t num_selections,
                                   std::uint64_t label_blocks) {
  ocl::BufferSizes sizes{ocl::buffer_size<ushort>("macrocell ranges", num_macrocells),
                         ocl::buffer_size<uint>("active limits", ISO_BOUND_CODES)};
  for (std::size_t i = 0; i < num_selections; ++i)
    sizes.add({ocl::buffer_size<int>("active box", 6)});
  if (label_blocks != 0) sizes.add(layer_sizes(label_blocks));
  return sizes;
}

Macrocells::Macrocells(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream,
                       std::shared_ptr<MacrocellBuffers> buffers, std::vector<float> thresholds,
                       std::array<float, 2> *extremes)
    : num_coarse_(static_cast<std::uint32_t>(num_macrocells(frame.grid))),
      coarse_range_(ocl::Range::strided(num_coarse_, ocl::kGroupSize, device)),
      buffers_(buffers
                   ? std::move(buffers)
                   : std::make_shared<MacrocellBuffers>(
                         device, MacrocellBuffers::Limits{block_count(frame.grid), num_coarse_})),
      coarse_ranges_(device, own_sizes()["macrocell ranges"]),
      limits_(device, own_sizes()["active limits"]),
      thresholds_(std::move(thresholds)),
      masks_kernel_(device, stream.defines()) {
  for (const ocl::BufferSize &size : own_sizes().named("active box"))
    selections_.push_back({.box = ocl::Buffer<int>(device, size)});
  if (!stream.has_groups()) {
    build(device, frame, stream, extremes);
    return;
  }
  of_labels_ = std::make_unique<OfLabels>(device, stream.defines(),
                                          std::uint64_t{frame.grid.blocks_x} * frame.grid.blocks_y);
  compile(device, stream, of_labels_->kernels, false);
}

/// Launches every kernel without a block to work on.
void Macrocells::compile(ocl::Device &device, const DeviceStream &stream, BuildKernels &kernels,
                         bool with_extremes) {
  const auto compiling = device.compiling();
  const FrameParams no_blocks{};
  const ocl::Range range{1, ocl::kGroupSize};
  ocl::Buffer<VoxelRange> partials(device, sampling_sizes(1)["range samples"]);
  const ocl::Buffer<float> thresholds(device, layer_sizes(1)["range thresholds"]);
  // limits_ stands in for words that are not read.
  kernels.partials(range, no_blocks, limits_, limits_, limits_, limits_, limits_, stream.layout, 0,
                   0, 0, 0, partials);
  kernels.ranges(range, no_blocks, 0, partials, partials, thresholds, buffers_->ranges);
  kernels.coarse_ranges(coarse_range_, no_blocks, 0, buffers_->ranges, coarse_ranges_);
  if (with_extremes) {
    ocl::Buffer<int> extremes(device, layer_sizes(1)["extremes"]);
    extremes.write(kNoExtremes);
    kernels.extremes(range, 0, partials, extremes);
  }
  masks_kernel_(coarse_range_, no_blocks, 0, buffers_->ranges, coarse_ranges_, limits_, 0, limits_,
                0, buffers_->masks[0], selections_[0].box);
}

void Macrocells::build(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream,
                       std::array<float, 2> *extremes) {
  const auto stage = device.timer().stage("macrocells");
  BuildKernels kernels(device, stream.defines());
  compile(device, stream, kernels, extremes != nullptr);
  Partials decode{device, frame, stream, kernels.partials};
  if (thresholds_.empty()) {
    thresholds_ =
        sample_thresholds(device, static_cast<std::uint32_t>(block_count(frame.grid)), decode);
  }
  LayerScratch scratch(device, std::uint64_t{frame.grid.blocks_x} * frame.grid.blocks_y);
  scratch.thresholds.write(thresholds_);
  scratch.extremes.write(kNoExtremes);
  make_ranges(device, frame, stream, kernels, scratch, extremes != nullptr);
  if (extremes != nullptr) {
    const std::vector<int> bits = scratch.extremes.read();
    std::ranges::transform(bits, extremes->begin(), [](int of_value) {
      return std::bit_cast<float>(of_value < 0 ? of_value ^ 0x7FFFFFFF : of_value);
    });
  }
  device.finish();
}

void Macrocells::make_ranges(ocl::Device &device, const FrameParams &frame,
                             const DeviceStream &stream, BuildKernels &kernels,
                             LayerScratch &scratch, bool with_extremes) {
  Partials decode{device, frame, stream, kernels.partials};
  const std::uint32_t layer_blocks = frame.grid.blocks_x * frame.grid.blocks_y;
  const ocl::Range layer_range = ocl::Range::strided(layer_blocks, ocl::kGroupSize, device);
  constexpr std::uint32_t kBlocksPerItem = 64;
  const ocl::Range few_items = ocl::Range::strided(
      (layer_blocks + kBlocksPerItem - 1) / kBlocksPerItem, ocl::kGroupSize, device);
  decode(0, 1, layer_blocks, scratch.below);
  for (std::uint32_t layer = 0; layer < frame.grid.blocks_z; ++layer) {
    if (layer + 1 < frame.grid.blocks_z)
      decode((layer + 1) * layer_blocks, 1, layer_blocks, scratch.above);
    if (with_extremes) kernels.extremes(few_items, layer_blocks, scratch.below, scratch.extremes);
    kernels.ranges(layer_range, frame, layer, scratch.below, scratch.above, scratch.thresholds,
                   buffers_->ranges);
    std::swap(scratch.below, scratch.above);
  }
  kernels.coarse_ranges(coarse_range_, frame, num_coarse_, buffers_->ranges, coarse_ranges_);
}

void Macrocells::choose_labels(const FrameParams &frame, const DeviceStream &stream) {
  const auto stage = of_labels_->device.timer().stage("macrocells");
  make_ranges(of_labels_->device, frame, stream, of_labels_->kernels, of_labels_->scratch, false);
  for (Selection &selected : selections_) selected.of.reset();
}

std::uint64_t Macrocells::setup_scratch_bytes(const glm::uvec3 &num_blocks) {
  const std::uint64_t blocks = std::uint64_t{num_blocks.x} * num_blocks.y * num_blocks.z;
  const std::uint64_t layer_blocks = std::uint64_t{num_blocks.x} * num_blocks.y;
  return std::max(sampling_sizes(blocks).bytes(), layer_sizes(layer_blocks).bytes());
}

ocl::BufferSizes Macrocells::sampling_sizes(std::uint64_t num_blocks) {
  return {ocl::buffer_size<VoxelRange>("range samples",
                                       8 * std::uint64_t{range_sample(num_blocks).count})};
}

ocl::BufferSizes Macrocells::layer_sizes(std::uint64_t layer_blocks) {
  return {ocl::buffer_size<float>("range thresholds", kNumThresholds),
          ocl::buffer_size<VoxelRange>("range partials, layer below", 8 * layer_blocks),
          ocl::buffer_size<VoxelRange>("range partials, layer above", 8 * layer_blocks),
          ocl::buffer_size<int>("extremes", 2)};
}

void Macrocells::Partials::operator()(std::uint32_t first, std::uint32_t stride,
                                      std::uint32_t count, ocl::Buffer<VoxelRange> &partials) {
  if (!stream.window) {
    kernel(ocl::Range::strided(count, ocl::kGroupSize, device), frame, stream.part(0),
           stream.part(1), stream.part(2), stream.part(3), stream.index(), stream.layout, first,
           stride, count, 0, partials);
    return;
  }
  std::vector<uint> block_ids(count);
  for (std::uint32_t i = 0; i < count; ++i)
    block_ids[i] = sampled_block(first + i * stride, stride);
  stream.window->bring(block_ids, [&](const ocl::Buffer<uint> &words, std::uint32_t run_first,
                                      std::uint32_t run_count) {
    kernel(ocl::Range::strided(run_count, ocl::kGroupSize, device), frame, words, words, words,
           words, stream.index(words), stream.layout, first + run_first * stride, stride, run_count,
           run_first, partials);
  });
}

/// From the block minima and maxima of an even sample of blocks.
std::vector<float> Macrocells::sample_thresholds(ocl::Device &device, std::uint32_t num_blocks,
                                                 Partials &decode) {
  const RangeSample sample = range_sample(num_blocks);
  ocl::Buffer<VoxelRange> partials(device, sampling_sizes(num_blocks)["range samples"]);
  decode(0, sample.stride, sample.count, partials);
  const std::vector<VoxelRange> samples = partials.read();
  std::vector<float> values;
  values.reserve(2 * std::size_t{sample.count});
  for (std::size_t i = 0; i < samples.size(); i += 8) {  // entry 0 of 8: the whole block
    values.push_back(samples[i].min);
    values.push_back(samples[i].max);
  }
  return range_thresholds(std::move(values));
}

void Macrocells::select(const FrameParams &frame, double voxel_error, const DeviceStream *moved) {
  const auto index_of = [&](double value) { return threshold_index(thresholds_, value); };
  const double isovalue = double{frame.surface.isovalue};
  const StreamLayout layout = moved == nullptr ? StreamLayout{} : moved->layout;
  const uint group = frame.surface.isovalue_index;
  const std::array of = {of_labels_ ? static_cast<double>(group) : isovalue, voxel_error,
                         double{layout.value_offset}, double{layout.bound_unit}};
  Selection &selected = selection();
  if (selected.of == of) return;
  selected.of.reset();  // until the masks are there
  selected.isovalue_index = of_labels_ ? group : index_of(isovalue);
  selected.active_box.reset();
  std::array<uint, ISO_BOUND_CODES> limits{};
  limits[0] = group;
  for (std::uint32_t code = 0; code < ISO_BOUND_CODES && !of_labels_; ++code) {
    const double offset =
        double{layout.value_offset} + double{layout.bound_unit} * double{block_bound(code)};
    const double error = voxel_error + std::abs(offset);
    const double rounded = error == 0 ? 0.0 : voxel_error + 0x1p-20 * (std::abs(isovalue) + error);
    const std::uint32_t below = index_of(isovalue + rounded + std::max(-offset, 0.0)),
                        above = index_of(isovalue - rounded - std::max(offset, 0.0));
    limits[code] = below | above << 16;
  }
  limits_.write(limits);
  const bool has_bounds = layout.bound_unit != 0;
  constexpr int kNone = std::numeric_limits<int>::max();
  static constexpr std::array<int, 6> kEmptyBox = {kNone, kNone, kNone, 0, 0, 0};
  selected.box.write_async(kEmptyBox);
  masks_kernel_(coarse_range_, frame, num_coarse_, buffers_->ranges, coarse_ranges_, limits_,
                has_bounds ? 1 : 0, has_bounds ? moved->index() : limits_, layout.bounds_begin,
                buffers_->masks[buffers_->selection], selected.box);
  selected.of = of;
}

Surface Macrocells::surface(const FrameParams &frame) {
  Selection &selected = selection();
  if (!selected.active_box) selected.box.read(selected.active_box.emplace());
  const std::array<int, 6> &macrocells = *selected.active_box;
  const auto begin = [](int first, uint dim) {
    return std::min(first, static_cast<int>(num_owning_blocks(dim))) * ISO_MACROCELL_BLOCKS;
  };
  // A ray that runs in the plane where a brick ends is in the block behind: in the box, too, or it
  // would be taken to be in the last of the brick's own.
  const auto end = [](int behind, uint dim, uint blocks, uint others) {
    const int last = static_cast<int>(num_owning_blocks(dim)),
              own = static_cast<int>(blocks - others);
    const int whole = std::min(behind * ISO_MACROCELL_BLOCKS, last);
    return whole == own && own < last ? own + 1 : whole;
  };
  const BlockGrid &grid = frame.grid;
  return {.isovalue = frame.surface.isovalue,
          .isovalue_index = selected.isovalue_index,
          .active_begin_x = begin(macrocells[0], grid.dims_x),
          .active_begin_y = begin(macrocells[1], grid.dims_y),
          .active_begin_z = begin(macrocells[2], grid.dims_z),
          .active_end_x = end(macrocells[3], grid.dims_x, grid.blocks_x, frame.brick.behind_x),
          .active_end_y = end(macrocells[4], grid.dims_y, grid.blocks_y, frame.brick.behind_y),
          .active_end_z = end(macrocells[5], grid.dims_z, grid.blocks_z, frame.brick.behind_z)};
}

std::optional<BlockBox> Macrocells::active_blocks(const FrameParams &frame) const {
  constexpr int kEdge = ISO_MACROCELL_BLOCKS;
  const auto macrocells = [](std::uint32_t blocks) {
    return (static_cast<int>(blocks) + kEdge - 1) / kEdge;
  };
  const glm::ivec3 dims(macrocells(frame.grid.blocks_x), macrocells(frame.grid.blocks_y),
                        macrocells(frame.grid.blocks_z));
  std::vector<uint> bits(2 * num_macrocells(frame.grid));
  masks().read(bits, frame.place.masks_begin);
  constexpr int kMost = std::numeric_limits<int>::max();
  BlockBox box{glm::ivec3(kMost), glm::ivec3(0)};
  for (std::size_t word = 0; word < bits.size(); ++word) {
    const int macrocell = static_cast<int>(word / 2);
    const glm::ivec3 first = kEdge * glm::ivec3(macrocell % dims.x, macrocell / dims.x % dims.y,
                                                macrocell / dims.x / dims.y);
    for (uint left = bits[word]; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left) + (word % 2 == 0 ? 0 : 32);
      const glm::ivec3 block = first + glm::ivec3(bit % 4, bit / 4 % 4, bit / 16);
      box.begin = glm::min(box.begin, block);
      box.end = glm::max(box.end, block + 1);
    }
  }
  if (box.end.x == 0) return {};
  return box;
}

}  // namespace isowave::core
