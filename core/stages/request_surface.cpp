#include "core/stages/request_surface.hpp"

#include "core/view/frame.hpp"

namespace isowave::core {

RequestSurface::RequestSurface(ocl::Device &device, Gradients gradients)
    : device_(device),
      with_gradients_(gradients == Gradients::kSmooth ? 1 : 0),
      request_(device),
      count_(device) {}

ocl::BufferSizes RequestSurface::count_sizes(std::uint64_t num_macrocells) {
  return {ocl::buffer_size<uint>("needed blocks", 2 * num_macrocells),
          ocl::buffer_size<uint>("needed block count", 1)};
}

std::uint32_t RequestSurface::count_needed(const FrameParams &frame,
                                           const ocl::Buffer<uint> &block_ids,
                                           std::uint32_t count) {
  const ocl::BufferSizes scratch = count_sizes(num_macrocells(frame.grid));
  ocl::Buffer<uint> marks(device_, scratch["needed blocks"]);
  ocl::Buffer<uint> num_needed(device_, scratch["needed block count"]);
  count_(ocl::Range::strided(count, ocl::kGroupSize, device_), frame, count, with_gradients_,
         block_ids, marks, num_needed);
  return num_needed.read().front();
}

void RequestSurface::operator()(const ocl::Buffer<uint> &block_ids, std::uint32_t begin,
                                std::uint32_t end, BlockCache &cache, Wavefront &rays) {
  request_(ocl::Range::strided(end - begin, ocl::kGroupSize, device_), rays.frame, begin, end,
           with_gradients_, block_ids, rays.counts, cache.table, cache.slot_stamps,
           cache.requested_bits, cache.request_block_ids, cache.capacity, cache.state);
}

}  // namespace isowave::core
