#include "core/stages/active_blocks.hpp"

#include <array>

namespace isowave::core {

ocl::BufferSizes ActiveBlocks::sizes(std::uint64_t num_macrocells) {
  ocl::BufferSizes sizes{ocl::buffer_size<uint>("listed masks", 2 * num_macrocells),
                         ocl::buffer_size<uint>("listed offsets", num_macrocells + 1)};
  return sizes.add(PrefixSum::sizes(num_macrocells, ocl::kGroupSize));
}

ActiveBlocks::ActiveBlocks(ocl::Device &device, std::uint64_t num_macrocells)
    : num_macrocells_(static_cast<std::uint32_t>(num_macrocells)),
      range_(ocl::Range::strided(num_macrocells, ocl::kGroupSize, device)),
      masks_(device, sizes(num_macrocells)["listed masks"]),
      offsets_(device, sizes(num_macrocells)["listed offsets"]),
      sum_(device, num_macrocells, ocl::kGroupSize),
      masks_kernel_(device),
      list_kernel_(device) {}

std::uint32_t ActiveBlocks::count(const FrameParams &frame, const ocl::Buffer<uint> &masks) {
  masks_kernel_(range_, frame, num_macrocells_, masks, masks_, offsets_);
  sum_(offsets_, num_macrocells_);
  std::array<uint, 1> total{};
  offsets_.read(total, num_macrocells_);
  return total[0];
}

void ActiveBlocks::list(const FrameParams &frame, ocl::Buffer<uint> &block_ids) {
  list_kernel_(range_, frame, num_macrocells_, masks_, offsets_, block_ids);
}

}  // namespace isowave::core
