// What sizes() states of each class that makes device buffers is what the device books when one is
// made alone: neither more nor less, under the same names.

#include "core/ocl/buffer_sizes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "core/paper/block_triangles.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/paper/rasterise.hpp"
#include "core/paper/resident.hpp"
#include "core/paper/traverse.hpp"
#include "core/render/pass_readback.hpp"
#include "core/render/ray_waves.hpp"
#include "core/stages/active_blocks.hpp"
#include "core/stages/ambient.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/stages/marching_cubes.hpp"
#include "core/stages/shade.hpp"
#include "core/stages/zfp_encode.hpp"
#include "tests/stage_world.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(BufferSizes, AreFoundByNameAndAddedUp) {
  const ocl::BufferSizes sizes = ocl::BufferSizes{ocl::buffer_size<std::uint16_t>("a", 3)}.add(
      {ocl::buffer_size<std::uint32_t>("b", 0), ocl::buffer_size<double>("a", 5)});
  EXPECT_EQ(sizes.size(), 3u);
  EXPECT_EQ(sizes["a"].bytes(), 6u);
  EXPECT_EQ(sizes["b"].bytes(), 1u) << "OpenCL has no empty buffers";
  EXPECT_EQ(sizes.named("a").bytes(), 46u);
  EXPECT_EQ(sizes.named("none").size(), 0u);
  EXPECT_EQ(sizes.bytes(), 47u);
  EXPECT_EQ(ocl::BufferSizes().bytes(), 0u);
  EXPECT_THAT([&] { sizes["c"]; }, ThrowsMessage<std::invalid_argument>(HasSubstr("'c'")));
}

TEST(BufferSizes, ThoseOfTheSameNameAreResized) {
  ocl::BufferSizes sizes{ocl::buffer_size<std::uint32_t>("a", 3),
                         ocl::buffer_size<std::uint32_t>("b", 4),
                         ocl::buffer_size<std::uint32_t>("a", 3)};
  sizes.resize({ocl::buffer_size<std::uint32_t>("a", 7), ocl::buffer_size<std::uint32_t>("c", 1)});
  EXPECT_EQ(sizes.named("a").bytes(), 2 * 28u);
  EXPECT_EQ(sizes["b"].bytes(), 16u);
  EXPECT_EQ(sizes.size(), 3u);
}

TEST(BufferSizes, BytesDoNotOverflow) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  EXPECT_EQ(ocl::buffer_size<std::uint32_t>("", kMost / 4).bytes(), kMost / 4 * 4);
  EXPECT_EQ(ocl::buffer_size<std::uint32_t>("", kMost / 4 + 1).bytes(), kMost);
}

using Bytes = std::map<std::string, std::uint64_t>;

Bytes booked_on(ocl::Device &device) {
  Bytes booked;
  for (const auto &[name, entry] : device.ledger().by_name()) {
    if (entry.current != 0) booked[name] = entry.current;
  }
  return booked;
}

/// What make() makes books `sizes` beside what there is, and gives it all back.
void expect_books(ocl::Device &device, const ocl::BufferSizes &sizes, const auto &make) {
  const Bytes before = booked_on(device);
  Bytes expected;
  for (const ocl::BufferSize &size : sizes) expected[size.name] += size.bytes();
  {
    [[maybe_unused]] const auto made = make();
    Bytes booked = booked_on(device);
    for (const auto &[name, bytes] : before) {
      if ((booked[name] -= bytes) == 0) booked.erase(name);
    }
    EXPECT_EQ(booked, expected);
  }
  EXPECT_EQ(booked_on(device), before) << "what is left when it is gone";
}

/// 5 x 2 x 3 blocks, 2 of its macrocells along x; with bounds of its blocks' errors.
CompressedVolume small_volume(bool indexed) {
  const glm::uvec3 dims(17, 8, 10);
  CompressedVolume volume =
      compress_with_libzfp(random_voxels(dims, 0, 1, 5), dims, indexed ? 0 : 256, -8);
  volume.bounds.codes.assign(volume.block_count(), 1);
  return volume;
}

/// Makes a class by several limits.
struct Maker {
  const char *name;
  void (*check)(ocl::Device &device);
};

void check_wavefront(ocl::Device &device) {
  for (const Wavefront::Limits &limits :
       {Wavefront::Limits{1},
        {.num_rays = 1000, .with_pairs = false},
        {333, true, 4},
        {.num_rays = 50, .with_given = true},
        {.num_rays = 70, .scanned_pairs = true},
        {.num_rays = 60, .with_pairs = false, .with_walks = false}})
    expect_books(device, Wavefront::sizes(limits), [&] { return Wavefront(device, limits); });
}

void check_block_cache(ocl::Device &device) {
  const FrameParams grid = grid_frame({65, 9, 30});
  for (const auto &[slots, rays] : {std::pair(8u, 1u), {100u, 1u}, {100u, 50u}, {777u, 5000u}}) {
    const BlockCache::Limits limits = BlockCache::limits_for(grid.grid, slots, rays);
    expect_books(device, BlockCache::sizes(limits), [&] { return BlockCache(device, limits, 8); });
  }
}

void check_macrocell_buffers(ocl::Device &device) {
  for (const MacrocellBuffers::Limits &limits : {MacrocellBuffers::Limits{1, 1}, {100, 7, 3}})
    expect_books(device, MacrocellBuffers::sizes(limits),
                 [&] { return MacrocellBuffers(device, limits); });
}

void check_macrocells(ocl::Device &device) {
  for (const bool indexed : {false, true}) {
    const CompressedVolume volume = small_volume(indexed);
    const FrameParams grid = make_grid_params(volume.info);
    const DeviceStream stream(device, volume);
    const MacrocellBuffers::Limits limits{volume.block_count(), num_macrocells(grid.grid), 3};
    const auto buffers = std::make_shared<MacrocellBuffers>(device, limits);
    expect_books(device, Macrocells::sizes(limits.num_macrocells, 3),
                 [&] { return Macrocells(device, grid, stream, buffers); });
    ocl::BufferSizes with_own = MacrocellBuffers::sizes({limits.num_blocks, limits.num_macrocells});
    expect_books(device, with_own.add(Macrocells::sizes(limits.num_macrocells, 1)),
                 [&] { return Macrocells(device, grid, stream); });
    const DeviceStream of_labels(device, volume, 0, ByteTable::kGroups);
    expect_books(device,
                 Macrocells::sizes(limits.num_macrocells, 3,
                                   std::uint64_t{grid.grid.blocks_x} * grid.grid.blocks_y),
                 [&] { return Macrocells(device, grid, of_labels, buffers); });
  }
}

void check_device_stream(ocl::Device &device) {
  for (const bool indexed : {false, true}) {
    const CompressedVolume volume = small_volume(indexed);
    const std::uint64_t bytes = volume.word_count() * sizeof(uint);
    for (const ByteTable table : {ByteTable::kNone, ByteTable::kBounds, ByteTable::kGroups}) {
      for (const std::uint64_t largest : {bytes, bytes / 2}) {
        const StreamSplit split = split_stream(volume, largest);
        ASSERT_EQ(split.num_parts > 1, largest < bytes);
        expect_books(device, DeviceStream::sizes(volume, split, table),
                     [&] { return DeviceStream(device, volume, largest, table); });
      }
      const OnHost host{11};
      expect_books(device, DeviceStream::sizes(volume, host, table),
                   [&] { return DeviceStream(device, volume, host, table); });
    }
  }
}

void check_stream_window(ocl::Device &device) {
  for (const bool indexed : {false, true}) {
    const CompressedVolume volume = small_volume(indexed);
    for (const uint window_blocks : {1u, 8u, 100u})
      expect_books(device, StreamWindow::sizes(volume, window_blocks),
                   [&] { return StreamWindow(device, volume, window_blocks); });
  }
}

void check_zfp_decode(ocl::Device &device) {
  const CompressedVolume volume = small_volume(false);
  const DeviceStream whole(device, volume), window(device, volume, OnHost{8});
  for (const bool levels : {false, true}) {
    for (const DeviceStream *stream : {&whole, &window})
      expect_books(device, ZfpDecode::sizes(30, stream == &window, levels),
                   [&] { return ZfpDecode(device, 30, stream->defines(), levels); });
  }
  EXPECT_EQ(ZfpDecode::sizes(30, true, true).bytes(), 120u);
}

void check_compaction(ocl::Device &device) {
  for (const auto &[count, group_size] : {std::pair(1u, 8u), {64u, 8u}, {65u, 8u}, {5000u, 64u}})
    expect_books(device, Compaction::sizes(count, group_size),
                 [&] { return Compaction(device, count, group_size); });
}

void check_prefix_sum(ocl::Device &device) {
  for (const auto &[count, group_size] : {std::pair(1u, 8u), {65u, 8u}, {5000u, 64u}})
    expect_books(device, PrefixSum::sizes(count, group_size),
                 [&] { return PrefixSum(device, count, group_size); });
}

void check_active_blocks(ocl::Device &device) {
  for (const uint macrocells : {1u, 1000u})
    expect_books(device, ActiveBlocks::sizes(macrocells),
                 [&] { return ActiveBlocks(device, macrocells); });
}

void check_traverse(ocl::Device &device) {
  for (const bool scanned : {false, true}) {
    for (const uint rays : {1u, 1000u})
      expect_books(device, Traverse::sizes(rays, 8, scanned),
                   [&] { return Traverse(device, rays, 8, scanned); });
  }
}

void check_marching_cubes(ocl::Device &device) {
  for (const Gradients gradients : {Gradients::kNone, Gradients::kSmooth}) {
    expect_books(device, MarchingCubes::sizes(), [&] { return MarchingCubes(device, gradients); });
    expect_books(device, MeshBuffers::sizes(100, 333, gradients),
                 [&] { return MeshBuffers(device, 100, 333, gradients); });
  }
  expect_books(device, SurfaceCounts::sizes(77), [&] { return SurfaceCounts(device, 77); });
}

void check_block_triangles(ocl::Device &device) {
  expect_books(device, BlockTriangles::sizes(), [&] { return BlockTriangles(device); });
}

void check_rasterise(ocl::Device &device) {
  for (const uint rays : {1u, 1000u})
    expect_books(device, Rasterise::sizes(rays), [&] { return Rasterise(device, rays); });
}

void check_radix_sort(ocl::Device &device) {
  for (const auto &[count, group_size] : {std::pair(1u, 8u), {128u, 8u}, {129u, 8u}, {5000u, 64u}})
    expect_books(device, RadixSort::sizes(count, group_size),
                 [&] { return RadixSort(device, count, group_size); });
}

void check_group(ocl::Device &device) {
  for (const Grouping grouping : {Grouping::kRadix, Grouping::kCounting}) {
    for (const Group::Limits &limits :
         {Group::Limits{1, 8, 8, grouping}, {100, 1000, 64, grouping}, {1000, 100, 8, grouping}})
      expect_books(device, Group::sizes(limits), [&] { return Group(device, limits); });
  }
}

void check_shade(ocl::Device &device) {
  for (const uint pixels : {1u, 1000u})
    expect_books(device, Shade::sizes(pixels), [&] { return Shade(device, pixels); });
}

void check_ambient(ocl::Device &device) {
  expect_books(device, Ambient::sizes(), [&] { return Ambient(device, 1000); });
}

void check_kept_picture(ocl::Device &device) {
  for (const uint rays : {1u, 1000u})
    expect_books(device, KeptPicture::sizes(rays), [&] { return KeptPicture(device, rays); });
}

void check_pass_readback(ocl::Device &device) {
  expect_books(device, PassReadback::sizes(), [&] { return PassReadback(device); });
}

/// With all stages that they are made of, also those that have no buffers.
void check_pipelines(ocl::Device &device) {
  const CompressedVolume volume = small_volume(false);
  const FrameParams grid = make_grid_params(volume.info);
  for (const Grouping grouping : {Grouping::kRadix, Grouping::kCounting}) {
    const WaveLimits limits{100, 20, 8};
    const PipelinePtr pipeline = blocks_pipeline({.grouping = grouping});
    BlockStore blocks(device, volume, DeviceStream(device, volume),
                      BlockCache::limits_for(grid.grid, 20, 100), 8);
    Wavefront rays(device, {limits.num_rays});
    expect_books(device, pipeline->sizes(limits),
                 [&] { return pipeline->make_wave(blocks, rays, limits, {}); });
    for (const RaySource source : {RaySource::kCamera, RaySource::kGiven}) {
      expect_books(device, rays_pipeline()->sizes(limits), [&] {
        return std::make_unique<RaysWave>(blocks, rays, 8, kDefaultSolver, source,
                                          RayPackets::kAuto, DecodeOnDemand::kAuto);
      });
    }
    rays = Wavefront(device, {.num_rays = limits.num_rays, .scanned_pairs = true});
    const PipelinePtr scanned = blocks_pipeline({.grouping = grouping, .scanned_pairs = true});
    expect_books(device, scanned->sizes(limits),
                 [&] { return scanned->make_wave(blocks, rays, limits, {}); });
  }
}

void check_resident(ocl::Device &device) {
  const CompressedVolume volume = small_volume(false);
  const ImageSize size{10, 7, 2};
  const FrameParams grid = make_grid_params(volume.info);
  ocl::BufferSizes sizes = Resident::sizes(volume.block_count(), size);
  sizes.add(MacrocellBuffers::sizes({volume.block_count(), num_macrocells(grid.grid)}))
      .add(Macrocells::sizes(num_macrocells(grid.grid), 1));
  expect_books(device, sizes, [&] { return Resident(device, volume, size); });
}

void check_layer_encoder(ocl::Device &device) {
  for (const bool measure : {false, true}) {
    for (const glm::uvec3 &dims : {glm::uvec3(5, 4, 3), glm::uvec3(65, 66, 67)})
      expect_books(device, LayerEncoder::sizes(dims, 128, measure),
                   [&] { return LayerEncoder(device, dims, 128, measure); });
  }
}

constexpr std::array kMakers = {Maker{"Wavefront", check_wavefront},
                                Maker{"BlockCache", check_block_cache},
                                Maker{"MacrocellBuffers", check_macrocell_buffers},
                                Maker{"Macrocells", check_macrocells},
                                Maker{"DeviceStream", check_device_stream},
                                Maker{"StreamWindow", check_stream_window},
                                Maker{"ZfpDecode", check_zfp_decode},
                                Maker{"Compaction", check_compaction},
                                Maker{"PrefixSum", check_prefix_sum},
                                Maker{"ActiveBlocks", check_active_blocks},
                                Maker{"Traverse", check_traverse},
                                Maker{"MarchingCubes", check_marching_cubes},
                                Maker{"BlockTriangles", check_block_triangles},
                                Maker{"Rasterise", check_rasterise},
                                Maker{"RadixSort", check_radix_sort},
                                Maker{"Group", check_group},
                                Maker{"Shade", check_shade},
                                Maker{"Ambient", check_ambient},
                                Maker{"KeptPicture", check_kept_picture},
                                Maker{"PassReadback", check_pass_readback},
                                Maker{"Pipelines", check_pipelines},
                                Maker{"Resident", check_resident},
                                Maker{"LayerEncoder", check_layer_encoder}};

void PrintTo(const Maker &maker, std::ostream *out) {
  *out << maker.name;
}

class BufferSizesOnDevice : public testing::TestWithParam<std::tuple<ocl::DeviceInfo, Maker>> {
 protected:
  ocl::Device device_{std::get<0>(GetParam())};
};
INSTANTIATE_TEST_SUITE_P(Devices, BufferSizesOnDevice,
                         testing::Combine(testing::ValuesIn(devices_under_test()),
                                          testing::ValuesIn(kMakers)),
                         [](const auto &param) {
                           return device_test_name({std::get<0>(param.param), param.index}) + "_" +
                                  std::get<1>(param.param).name;
                         });

TEST_P(BufferSizesOnDevice, AreWhatIsBooked) {
  std::get<1>(GetParam()).check(device_);
}

class BufferSizesMakeBuffersOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, BufferSizesMakeBuffersOnDevice,
                         testing::ValuesIn(devices_under_test()), device_test_name);

TEST_P(BufferSizesMakeBuffersOnDevice, SmallOfTheirElementsAlone) {
  ocl::Device device(GetParam());
  const ocl::BufferSize size = ocl::buffer_size<uint>("words", 5);
  EXPECT_EQ(ocl::Buffer<uint>(device, size).size(), 5u);
  EXPECT_EQ(ocl::PinnedBuffer(device, size).words().size(), 5u);
  EXPECT_THAT([&] { ocl::Buffer<ulong>(device, size); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("'words' has elements of 8 bytes")));
  EXPECT_THAT([&] { ocl::PinnedBuffer(device, ocl::buffer_size<ulong>("longs", 5)); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("'longs'")));
  EXPECT_EQ(device.ledger().current(), 0u);
}

/// The scratch of macrocells' build, too: what is booked at the most is what is stated.
TEST_P(BufferSizesMakeBuffersOnDevice, SetupScratchIsTheRestOfThePeak) {
  for (const glm::uvec3 &dims : {glm::uvec3(1), glm::uvec3(70, 33, 9), glm::uvec3(4, 4, 800)}) {
    const CompressedVolume volume = compress_with_libzfp(random_voxels(dims, 0, 1, 6), dims, 64);
    ocl::Device device(GetParam());
    const DeviceStream stream(device, volume);
    const Macrocells macrocells(device, make_grid_params(volume.info), stream);
    EXPECT_EQ(device.ledger().peak(),
              device.ledger().current() + Macrocells::setup_scratch_bytes(volume.num_blocks()));
  }
}

}  // namespace
}  // namespace isowave::core
