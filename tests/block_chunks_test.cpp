// Volumes in chunks: what is drawn of them, chunk by chunk as rays come to them, has the bits of
// the volume that is there at once; damaged files are one line.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/host/block_pages.hpp"
#include "core/host/host_renderer.hpp"
#include "core/zfp/chunk_file.hpp"
#include "core/zfp/chunk_layout.hpp"
#include "core/zfp/make_levels.hpp"
#include "core/zfp/voxel_region.hpp"
#include "tests/api_support.hpp"
#include "tests/clip_scene.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::expect_same_hits;
using test::TemporaryFolder;
using testing::HasSubstr;

constexpr ImageSize kSize{61, 43};

/// A file of chunks, and what its reader has of it.
class Remote {
 public:
  explicit Remote(const CompressedVolume &volume) {
    std::vector<const CompressedVolume *> levels = {&volume};
    for (const CompressedVolume &level : volume.coarser_levels) levels.push_back(&level);
    std::vector<MacrocellRanges> ranges;
    for (const CompressedVolume *level : levels)
      ranges.push_back(HostBlocks(*level, HostBlocks::kNoLimit, 1).macrocell_ranges());
    AtomicFile file(folder_ / "volume.chunks");
    size = write_chunks(levels, ranges, file);
    file.commit();
    bytes = test::read_file(folder_ / "volume.chunks");
    here = read_chunks_head(part(0, size.head_bytes), bytes.size());
  }

  std::span<const std::byte> part(std::uint64_t begin, std::uint64_t end) const {
    return std::as_bytes(std::span(bytes)).subspan(begin, end - begin);
  }
  std::vector<BlockChunks *> chunks() const {
    std::vector<BlockChunks *> all = {here.chunks.get()};
    for (const CompressedVolume &level : here.coarser_levels) all.push_back(level.chunks.get());
    return all;
  }
  /// Fetches what is missing. Returns how many chunks that was.
  std::size_t supply() {
    std::size_t count = 0;
    for (BlockChunks *of : chunks()) {
      for (const FilePart &missing : of->take_missing()) {
        of->give(missing.begin, part(missing.begin, missing.end));
        fetched += missing.end - missing.begin;
        ++count;
      }
    }
    return count;
  }

  ChunkFileSize size;
  std::string bytes;      ///< of the file
  CompressedVolume here;  ///< as far as it is here
  std::uint64_t fetched = 0;

 private:
  TemporaryFolder folder_;
};

/// How a frame was drawn.
struct Drawn {
  std::uint32_t passes = 0;
  std::uint64_t rays_hit = 0, layer_hits = 0;  ///< of all passes
};

/// Draws a frame pass by pass.
Drawn draw(HostRenderer &renderer, Remote &remote, const FrameRequest &request) {
  Drawn drawn;
  for (bool waits = true; waits && drawn.passes < 100; ++drawn.passes) {
    renderer.go_on(drawn.passes != 0);
    const FrameStats stats = renderer.render(request);
    waits = stats.cancelled;
    EXPECT_EQ(remote.supply() != 0, waits);
    drawn.rays_hit += stats.rays_hit;
    drawn.layer_hits += stats.layers.hits;
  }
  return drawn;
}

/// Each kind of blocks, with voxels without data, and with levels of detail.
std::vector<CompressedVolume> volumes() {
  std::vector<CompressedVolume> all;
  const glm::uvec3 dims(83, 70, 94);
  VolumeInfo placed = test::grid_info(dims, {1, 1.3, 0.8});
  placed.origin = {-20, 35, 7};
  const std::vector<float> gyroid = test::sample(dims, test::gyroid_field(24));
  ArrayReader at_rate(placed, gyroid), bounded(test::grid_info(dims), gyroid);
  all.push_back(compress(at_rate, {.rate = 7}));
  all.push_back(compress(bounded, {.precision = BlockPrecision{.min_exponent = -9}, .levels = 0}));
  VolumeInfo whole = test::grid_info({50, 67, 41});
  whole.type = VoxelType::kUint8;
  all.push_back(test::TestVolume(whole,
                                 test::sample(whole.dims,
                                              [](const glm::dvec3 &at) {
                                                return std::floor(128 +
                                                                  60 * test::gyroid_field(30)(at));
                                              }),
                                 ErrorGoal{.exact = true})
                    .compressed);
  const glm::uvec3 of_holes(45, 36, 29);
  all.push_back(test::compressed(
      of_holes, test::with_hole(
                    of_holes, test::sample(of_holes, test::gyroid_field(15)),
                    [](const glm::uvec3 &at) { return (at.x + 3 * at.y + 7 * at.z) % 97 == 0; })));
  return all;
}

float isovalue_of(const CompressedVolume &volume) {
  return volume.info.type == VoxelType::kUint8 ? 141.5f : 0.3f;
}

TEST(BlockChunks, FramesHaveTheBitsOfTheWholeVolume) {
  for (const CompressedVolume &volume : volumes()) {
    SCOPED_TRACE(fmt::format("{} voxels along x", volume.info.dims.x));
    HostRenderer whole(volume, {.num_threads = 1});
    for (const double voxel_pixels : {0.0, 1.5}) {
      if (voxel_pixels != 0 && volume.coarser_levels.empty()) continue;
      Remote remote(volume);
      HostRenderer renderer(remote.here, {.num_threads = 1});
      std::uint32_t passes = 0;
      for (const Camera &camera : orbit_cameras(volume.info, 2)) {
        const FrameRequest request{.camera = camera,
                                   .isovalue = isovalue_of(volume),
                                   .size = kSize,
                                   .voxel_pixels = voxel_pixels,
                                   .ambient_rays = 2};
        const std::uint64_t rays_hit = whole.render(request).rays_hit;
        const Drawn drawn = draw(renderer, remote, request);
        passes += drawn.passes;
        EXPECT_EQ(drawn.rays_hit, rays_hit);
        expect_same_hits(renderer.hits(), whole.hits(), kSize.width);
        EXPECT_EQ(renderer.open().counts, whole.open().counts);
        EXPECT_EQ(draw(renderer, remote, request).passes, 1u) << "all is here";
      }
      EXPECT_GE(passes, 3u);
      EXPECT_LT(remote.fetched, remote.bytes.size());
      EXPECT_LT(remote.fetched, remote.bytes.size() / (voxel_pixels != 0 ? 3 : 1));
    }
  }
}

TEST(BlockChunks, LayersAndCapsHaveTheBitsOfTheWholeVolume) {
  const CompressedVolume volume = std::move(volumes()[1]);
  Remote remote(volume);
  HostRenderer whole(volume, {.num_threads = 1}), renderer(remote.here, {.num_threads = 1});
  FrameRequest request{.camera = orbit_cameras(volume.info, 3)[2], .size = kSize};
  request.surfaces = {{0.3f, {1, 0, 0}, 0.4f}, {-0.5f, {0, 1, 0}, 1}};
  request.clip.planes = {{{0, 0, 1}, 0.5 * volume.info.dims.z}};
  const FrameStats expected = whole.render(request);
  const Drawn drawn = draw(renderer, remote, request);
  EXPECT_GT(drawn.passes, 1u);
  EXPECT_EQ(drawn.rays_hit, expected.rays_hit);
  EXPECT_EQ(drawn.layer_hits, expected.layers.hits);
  expect_same_hits(renderer.hits(), whole.hits(), kSize.width);
  EXPECT_EQ(std::memcmp(renderer.colors().data(), whole.colors().data(),
                        whole.colors().size() * sizeof(RayColor)),
            0);
}

/// Light is kept for the tiles that have theirs, and so are layers that are blended again.
TEST(BlockChunks, LightThatBouncesHasTheBitsOfTheWholeVolume) {
  const CompressedVolume volume = std::move(volumes()[1]);
  for (const bool has_layers : {false, true}) {
    Remote remote(volume);
    HostRenderer whole(volume, {.num_threads = 1}), renderer(remote.here, {.num_threads = 1});
    FrameRequest request{.camera = orbit_cameras(volume.info, 3)[1],
                         .isovalue = 0.3f,
                         .size = kSize,
                         .ambient_rays = 4};
    request.bounce_rays = 4;
    request.light.towards_light = glm::dvec3(0.3, 0.5, 1);
    if (has_layers) request.surfaces = {{0.3f, {1, 0, 0}, 0.4f}, {-0.5f, {0, 1, 0}, 1}};
    whole.render(request);
    EXPECT_GT(draw(renderer, remote, request).passes, 2u);
    const WantedArrays wanted{.picture = true};
    const FrameArrays expected = whole.fetch(wanted, {}), got = renderer.fetch(wanted, {});
    EXPECT_TRUE(std::ranges::equal(got.picture, expected.picture)) << has_layers;
  }
}

TEST(BlockChunks, AFrameGoesOnWithoutWhatWasDropped) {
  const CompressedVolume volume = std::move(volumes()[0]);
  Remote remote(volume);
  HostRenderer renderer(remote.here, {.num_threads = 1});
  const FrameRequest request{
      .camera = orbit_cameras(volume.info, 1)[0], .isovalue = 0.3f, .size = kSize};
  draw(renderer, remote, request);
  const std::vector<HitRecord> expected = renderer.hits();
  BlockChunks &chunks = *remote.here.chunks;
  EXPECT_GT(chunks.bytes(), 0u);
  chunks.drop_unused(0);
  EXPECT_EQ(chunks.bytes(), remote.fetched) << "all were used";
  chunks.drop_unused(0);
  EXPECT_EQ(chunks.bytes(), 0u);
  EXPECT_EQ(draw(renderer, remote, request).passes, 1u) << "blocks stay decoded";
  renderer.clear_cache();
  EXPECT_GT(draw(renderer, remote, request).passes, 1u);
  expect_same_hits(renderer.hits(), expected, kSize.width);
}

/// Rays that go on past missing chunks need few passes, and read little that no ray needs.
TEST(BlockChunks, FewPassesReadLittleInVain) {
  const glm::uvec3 dims(120, 120, 120);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::gyroid_field(9)));
  const CompressedVolume volume = compress(reader, {.rate = 7});
  // From the side, at a value that many macrocells hold and few rays meet at once.
  const FrameRequest request{
      .camera = orbit_cameras(volume.info, 4)[1], .isovalue = 1.3f, .size = kSize};
  Remote all(volume), remote(volume);
  HostRenderer knowing(all.here, {.num_threads = 1}), renderer(remote.here, {.num_threads = 1});
  draw(knowing, all, request);
  knowing.clear_cache();
  BlockChunks &chunks = *all.here.chunks;
  chunks.drop_unused(all.bytes.size());
  EXPECT_EQ(draw(knowing, all, request).passes, 1u);
  chunks.drop_unused(0);
  const std::uint64_t needed = chunks.bytes();
  EXPECT_LE(draw(renderer, remote, request).passes, 7u);
  EXPECT_LT(remote.fetched, 2 * needed);
  EXPECT_GT(needed, remote.bytes.size() / 10);
}

TEST(BlockChunks, VoxelsAreThoseOfTheWholeVolume) {
  for (const CompressedVolume &volume : volumes()) {
    Remote remote(volume);
    const VoxelRegion region{{3, 5, 7}, {9, 30, 8}, {1, 2, 1}};
    std::vector<float> expected(6 * 13), got(expected.size());
    EXPECT_THROW(decode_region(remote.here, region, got), ChunkIsMissing);
    while (remote.supply() != 0) {
      try {
        decode_region(remote.here, region, got);
      } catch (const ChunkIsMissing &) {
      }
    }
    decode_region(volume, region, expected);
    EXPECT_EQ(std::memcmp(got.data(), expected.data(), got.size() * sizeof(float)), 0);
    EXPECT_EQ(remote.here.value_range, volume.value_range);
    EXPECT_EQ(remote.here.info.origin, volume.info.origin);
  }
}

/// The seams of the file: any byte that is another is an error of one line, and no chunk is taken
/// from another place or file.
TEST(BlockChunks, DamagedFilesAreOneLine) {
  const std::vector<CompressedVolume> all = volumes();
  Remote remote(all[1]), other(all[0]);
  const std::string &bytes = remote.bytes;
  const auto head_with = [&](std::size_t at) {
    std::string head = bytes.substr(0, remote.size.head_bytes);
    head[at] = static_cast<char>(head[at] ^ 4);
    return error_of([&] { read_chunks_head(std::as_bytes(std::span(head)), bytes.size()); });
  };
  for (std::size_t at = 0; at < remote.size.head_bytes; at += 7)
    EXPECT_THAT(head_with(at), HasSubstr("damaged")) << at;
  EXPECT_THAT(error_of([&] { read_chunks_head(remote.part(0, 9), bytes.size()); }),
              HasSubstr("damaged"));
  EXPECT_THAT(
      error_of([&] { read_chunks_head(remote.part(0, remote.size.head_bytes), bytes.size() - 1); }),
      HasSubstr("damaged"));

  BlockChunks &chunks = *remote.here.chunks;
  EXPECT_FALSE(chunks.is_there(0));
  const FilePart first = chunks.take_missing().at(0);
  EXPECT_TRUE(chunks.has_chunk_at(first.begin));
  EXPECT_FALSE(chunks.has_chunk_at(first.begin + 1));
  std::string chunk = bytes.substr(first.begin, first.end - first.begin);
  const auto given = [&](std::uint64_t begin, const std::string &text) {
    return error_of([&] { chunks.give(begin, std::as_bytes(std::span(text))); });
  };
  EXPECT_THAT(given(first.begin + 1, chunk), HasSubstr("damaged"));
  EXPECT_THAT(given(first.begin, chunk.substr(1)), HasSubstr("damaged"));
  chunk[chunk.size() / 2] ^= 1;
  EXPECT_THAT(given(first.begin, chunk), HasSubstr("damaged"));
  EXPECT_FALSE(chunks.is_there(0));
  EXPECT_EQ(chunks.bytes(), 0u);
}

TEST(BlockChunks, HalvesOfRangesHoldTheRanges) {
  for (const float value : {0.0f, 1.0f, 255.0f, 257.0f, 1e-40f, 3.14159f, 6.1e37f, 65535.0f}) {
    for (const float of : {value, -value}) {
      EXPECT_LE(from_half(half_below(of)), of);
      EXPECT_GE(from_half(half_above(of)), of);
      EXPECT_LE(from_half(half_above(of)) - from_half(half_below(of)), std::abs(of) / 64 + 1e-38f);
    }
  }
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(from_half(half_below(infinity)), infinity);
  EXPECT_EQ(from_half(half_above(-infinity)), -infinity);
}

/// A level that is made of a lossless volume is the one that is made with it.
TEST(MakeLevels, AreThoseThatAreMadeWithTheVolume) {
  VolumeInfo info = test::grid_info({50, 67, 41});
  ArrayReader reader(info, test::sample(info.dims, test::gyroid_field(30)));
  const BlockPrecision lossless{.min_exponent = ISO_REVERSIBLE};
  CompressedVolume volume = compress(reader, {.precision = lossless, .levels = 0});
  const std::vector<CompressedVolume> expected = std::move(volume.coarser_levels);
  volume.coarser_levels.clear();
  const std::vector<CompressedVolume> got = make_levels(volume);
  ASSERT_EQ(got.size(), expected.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].info.dims, expected[i].info.dims);
    EXPECT_EQ(got[i].info.spacing, expected[i].info.spacing);
    EXPECT_EQ(got[i].words, expected[i].words) << "level " << i + 1;
  }
}

TEST(BlockPages, TablesHoldWhatPagesHold) {
  BlockPages<float, false> pages(10'000);
  const BlockItems<float, false> items = pages.items();
  EXPECT_EQ(items[9'999], 0);
  EXPECT_FALSE(pages.is_taken(700));
  EXPECT_TRUE(pages.take(700));
  EXPECT_FALSE(pages.take(700));
  EXPECT_TRUE(pages.is_taken(767));
  EXPECT_FALSE(pages.is_taken(768));
  items[700] = 7;
  for (std::size_t item = 0; item < 10'000; item += 256) {
    pages.take(item);
    items[item] = static_cast<float>(item);
  }
  for (std::size_t item = 0; item < 10'000; item += 256)
    EXPECT_EQ(items[item], static_cast<float>(item));
  EXPECT_EQ(items[700], 7);
  EXPECT_EQ(pages.release(), 40u);
  EXPECT_EQ(pages.items()[700], 0);
}

}  // namespace
}  // namespace isowave::core
