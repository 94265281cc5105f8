#include "core/paper/resident.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "core/base/ms_since.hpp"
#include "core/stages/solver_defines.hpp"

namespace isowave::core {

namespace {

constexpr std::uint32_t kTilePixels = 32;  ///< of tiled_pixel(): 8 x 4
constexpr std::uint32_t kBlocksPerLaunch =
    1u << 22;  ///< some milliseconds: watchdogs end long launches

ocl::Defines resident_defines(Solver solver) {
  ocl::Defines defines = group_defines(ocl::kGroupSize);
  defines.merge(solver_defines(solver));
  return defines;
}

}  // namespace

ocl::BufferSizes Resident::sizes(std::uint64_t num_blocks, ImageSize size) {
  return {ocl::buffer_size<float>("decoded volume", ISO_BLOCK_VOXELS * num_blocks),
          ocl::buffer_size<ulong>("voxels inside", num_blocks),
          ocl::buffer_size<ulong>("changing cells", num_blocks),
          ocl::buffer_size<HitRecord>("hits", size.num_rays())};
}

Resident::Resident(ocl::Device &device, const CompressedVolume &volume, ImageSize size,
                   Solver solver)
    : Resident(device, volume, size, solver, DeviceStream(device, volume),
               sizes(volume.block_count(), size)) {}

Resident::Resident(ocl::Device &device, const CompressedVolume &volume, ImageSize size,
                   Solver solver, const DeviceStream &stream, const ocl::BufferSizes &sizes)
    : device_(device),
      info_(volume.info),
      size_(size),
      num_blocks_(static_cast<std::uint32_t>(volume.block_count())),
      macrocells_(device, make_grid_params(volume.info), stream),
      values_(device, sizes["decoded volume"]),
      inside_(device, sizes["voxels inside"]),
      changing_(device, sizes["changing cells"]),
      hits_(device, sizes["hits"]),
      inside_kernel_(device, resident_defines(solver)),
      changing_kernel_(device, resident_defines(solver)),
      kernel_(device, resident_defines(solver)) {
  ocl::Defines decode_defines = resident_defines(solver);
  decode_defines.merge(stream.defines());
  ocl::Kernel<kernels::resident_decode> decode(device, decode_defines);
  for (std::uint32_t first = 0; first < num_blocks_; first += kBlocksPerLaunch) {
    const std::uint32_t count = std::min(kBlocksPerLaunch, num_blocks_ - first);
    decode(ocl::Range::strided(count, ocl::kGroupSize, device), stream.part(0), stream.part(1),
           stream.part(2), stream.part(3), stream.index(), stream.layout, first, count, values_);
  }
  device.finish();
}

std::optional<std::string> Resident::obstacle(const ocl::Device &device,
                                              const CompressedVolume &volume, ImageSize size) {
  const std::uint64_t blocks = volume.block_count(),
                      macrocells = num_macrocells(make_grid(volume.info));
  const ocl::Capabilities &can = device.capabilities();
  ocl::BufferSizes buffers = sizes(blocks, size);
  const std::uint64_t values = buffers["decoded volume"].bytes();
  buffers.add(MacrocellBuffers::sizes({blocks, macrocells}))
      .add(Macrocells::sizes(macrocells, 1))
      .add(DeviceStream::sizes(volume, split_stream(volume, can.largest_allocation),
                               ByteTable::kNone));
  const std::uint64_t all = buffers.bytes() + Macrocells::setup_scratch_bytes(volume.num_blocks());
  if (values > can.largest_allocation) {
    return fmt::format("the decoded volume is {} bytes, the device's largest allocation {}", values,
                       can.largest_allocation);
  }
  if (all > can.global_memory) {
    return fmt::format("the decoded volume and what belongs to it are {} bytes, the device has {}",
                       all, can.global_memory);
  }
  return std::nullopt;
}

double Resident::render(const Camera &camera, float isovalue) {
  const auto begin = std::chrono::steady_clock::now();
  FrameParams frame = make_frame_params(info_, camera, size_, isovalue);
  if (selected_isovalue_ != isovalue) {
    macrocells_.select(frame);
    const ocl::Range blocks = ocl::Range::strided(num_blocks_, ocl::kGroupSize, device_);
    inside_kernel_(blocks, frame, num_blocks_, values_, inside_);
    changing_kernel_(blocks, frame, num_blocks_, inside_, changing_);
  }
  frame.surface = macrocells_.surface(frame);
  frame.screen = make_screen_box(frame);
  selected_isovalue_ = isovalue;
  const std::size_t tiles = std::size_t{(frame.view.width + 7) / 8} * ((frame.view.height + 3) / 4);
  // One work-item per pixel: rays differ too much in length for strides over them to keep a device
  // busy.
  kernel_(ocl::Range::covering(tiles * kTilePixels, ocl::kGroupSize), frame, macrocells_.masks(),
          values_, changing_, hits_);
  device_.finish();
  return ms_since(begin);
}

}  // namespace isowave::core
