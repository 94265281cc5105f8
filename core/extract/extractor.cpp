#include "core/extract/extractor.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/stages/prefix_sum.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

namespace {

/// Listed blocks whose triangles are counted in one go, so that progress shows.
constexpr std::uint32_t kMostBlocks = 1u << 17;
/// A closed surface has about twice as many triangles as vertices.
constexpr std::uint64_t kTrianglesPerVertex = 2;
/// Blocks uploaded at a time from a volume that stays on the host.
constexpr std::uint32_t kWindowBlocks = 1u << 12;

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

OnHost window_for(const CompressedVolume &volume) {
  return {static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(volume.block_count(), 1, kWindowBlocks))};
}

/// All buffers but those of the compressed volume that live as long as the extractor.
ocl::BufferSizes own_sizes(const CompressedVolume &volume) {
  const BlockGrid grid = make_grid(volume.info);
  const std::uint64_t macrocells = num_macrocells(grid);
  return MacrocellBuffers::sizes({block_count(grid), macrocells})
      .add(Macrocells::sizes(macrocells, 1))
      .add(ActiveBlocks::sizes(macrocells))
      .add(MarchingCubes::sizes())
      .add(Wavefront::sizes({.num_rays = 1, .with_pairs = false}));
}

std::uint64_t budget_for(const ocl::Device &device, const ExtractorOptions &options) {
  return options.memory_budget != 0 ? options.memory_budget
                                    : device.capabilities().global_memory / 4 * 3;
}

/// On the device, where that leaves a quarter of the budget; or as asked for.
DeviceStream make_stream(ocl::Device &device, const CompressedVolume &volume,
                         const ExtractorOptions &options) {
  check_volume_info(volume.info, "the volume");
  check_drawable(volume.info, "the volume");
  const std::uint64_t budget = budget_for(device, options), own = own_sizes(volume).bytes(),
                      scratch = Macrocells::setup_scratch_bytes(volume.num_blocks());
  const StreamSplit split = split_stream(volume, device.capabilities().largest_allocation);
  const std::uint64_t whole = DeviceStream::sizes(volume, split, false).bytes(),
                      window = DeviceStream::sizes(volume, window_for(volume), false).bytes();
  const bool fits = split.num_parts != 0 && whole + own + scratch <= budget / 4 * 3;
  const bool on_device =
      options.stream == StreamPlace::kDevice ||
      (options.stream == StreamPlace::kAuto && (fits || (split.num_parts != 0 && whole <= window)));
  const std::uint64_t least = (on_device ? whole : window) + own + scratch;
  if (least > budget) {
    throw Error(
        "a memory budget of {} bytes is too small: {} of them are needed before a surface "
        "is looked for",
        budget, least);
  }
  return on_device ? DeviceStream(device, volume)
                   : DeviceStream(device, volume, window_for(volume));
}

std::uint64_t stream_bytes(const CompressedVolume &volume, const DeviceStream &stream,
                           const ocl::Device &device) {
  if (stream.window) return DeviceStream::sizes(volume, window_for(volume), false).bytes();
  return DeviceStream::sizes(volume, split_stream(volume, device.capabilities().largest_allocation),
                             false)
      .bytes();
}

/// The sum of counts of which there are 32-bit prefix sums, which may have wrapped around.
std::uint64_t total_of(const std::vector<uint> &offsets) {
  std::uint64_t total = 0;
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) total += uint{offsets[i + 1] - offsets[i]};
  return total;
}

/// Batches of blocks: as many at a time as the cache has turned out to hold.
class BatchSize {
 public:
  BatchSize(std::uint32_t num_slots, std::uint64_t num_needed)
      : size_(num_slots >= num_needed ? kMostBlocks : std::min(kMostBlocks, num_slots / 2)) {}

  std::uint32_t size() const { return std::max(size_, 1u); }
  void served() { size_ = std::min(kMostBlocks, size_ + size_ / 8); }
  /// A batch of so many did not fit.
  void refused(std::uint32_t size) {
    if (size == 1) throw std::logic_error("a cache too small for one block of a surface");
    size_ = size / 2;
  }

 private:
  std::uint32_t size_;
};

}  // namespace

/// An extraction at work.
struct Extractor::Run {
  std::uint32_t num_listed;
  SurfaceCounts surface;
  PrefixSum sum;
  MeshSink &sink;
  const Progress &progress;
  Plan plan{};
  ExtractStats stats{};
  std::vector<uint> block_ids{}, vertex_offsets{}, triangle_offsets{};  ///< on the host
  std::vector<MeshVertex> vertices{};                                   ///< of a part
  std::vector<float> gradients{};
  std::vector<MeshTriangle> triangles{};

  /// step: 0 counts, 1 writes; done: of its blocks.
  void report(std::uint32_t step, std::uint32_t done) const {
    const std::uint64_t all = 2 * std::uint64_t{num_listed};
    const std::uint64_t now = std::uint64_t{num_listed} * step + done;
    if (progress) progress(static_cast<std::uint32_t>(now * 1000 / all), 1000);
  }
};

Extractor::Extractor(ocl::Device &device, const CompressedVolume &volume,
                     const ExtractorOptions &options)
    : device_(device),
      options_(options),
      info_(volume.info),
      frame_(make_grid_params(volume.info)),
      gradients_(options.with_normals ? Gradients::kSmooth : Gradients::kNone),
      budget_(budget_for(device, options)),
      stream_(make_stream(device, volume, options)),
      macrocells_(device, frame_, stream_),
      listed_(device, num_macrocells(frame_.grid)),
      request_(device, gradients_),
      marching_cubes_(device, gradients_),
      rays_(device, {.num_rays = 1, .with_pairs = false}) {
  if (options.cache_slots != 0 && options.cache_slots < blocks_of_block(gradients_)) {
    throw Error("a cache of {} blocks cannot be used: a block of the surface needs {}",
                options.cache_slots, blocks_of_block(gradients_));
  }
  fixed_bytes_ = own_sizes(volume).bytes() + stream_bytes(volume, stream_, device);
}

BlockCache::Limits Extractor::cache_limits(std::uint32_t num_slots) const {
  return BlockCache::limits_for(frame_.grid, num_slots, num_slots);
}

std::uint64_t Extractor::cache_bytes(std::uint32_t num_slots) const {
  const BlockCache::Limits limits = cache_limits(num_slots);
  return BlockCache::sizes(limits).bytes() +
         ZfpDecode::sizes(limits.max_requests(), stream_.window != nullptr, false).bytes();
}

Extractor::Plan Extractor::plan_for(std::uint64_t num_listed, std::uint64_t num_needed,
                                    float isovalue) const {
  const auto mesh_bytes = [&](std::uint64_t vertices) {
    return MeshBuffers::sizes(vertices, kTrianglesPerVertex * vertices, gradients_).bytes();
  };
  const std::uint64_t largest = device_.capabilities().largest_allocation;
  const std::uint64_t surface = fixed_bytes_ + SurfaceCounts::sizes(num_listed).bytes() +
                                PrefixSum::sizes(num_listed, ocl::kGroupSize).bytes();
  const std::uint32_t least_slots = blocks_of_block(gradients_);
  const std::uint64_t least = surface + cache_bytes(least_slots) + mesh_bytes(kBlockVertices);
  if (least > budget_) {
    throw Error(
        "a memory budget of {} bytes is too small for the {} blocks of the surface at {}: {} would "
        "do",
        budget_, num_listed, isovalue, least);
  }
  Plan plan;
  const std::uint64_t left = budget_ - surface - cache_bytes(least_slots);
  std::uint64_t vertices =
      std::min<std::uint64_t>(options_.part_vertices, kBlockVertices * num_listed);
  while (vertices > kBlockVertices && mesh_bytes(vertices) > left / 4) vertices /= 2;
  plan.part_vertices = std::max<std::uint64_t>(vertices, kBlockVertices);
  plan.part_triangles = kTrianglesPerVertex * plan.part_vertices;
  const std::uint64_t beside = surface + mesh_bytes(plan.part_vertices);
  const auto fits = [&](std::uint32_t slots) {
    return beside + cache_bytes(slots) <= budget_ &&
           ISO_BLOCK_VOXELS * sizeof(float) * std::uint64_t{slots} <= largest;
  };
  const std::uint64_t most = options_.cache_slots != 0 ? options_.cache_slots : ISO_MAX_CACHE_SLOTS;
  const auto wanted = static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
      num_needed, least_slots, std::max<std::uint64_t>(most, least_slots)));
  plan.cache_slots = wanted;
  if (!fits(wanted)) {
    std::uint32_t fitting = least_slots, too_many = wanted;
    while (too_many - fitting > 1) {
      const std::uint32_t middle = fitting + (too_many - fitting) / 2;
      (fits(middle) ? fitting : too_many) = middle;
    }
    plan.cache_slots = fitting;
  }
  if (cache_ && cache_->num_slots > plan.cache_slots && fits(cache_->num_slots))
    plan.cache_slots = cache_->num_slots;
  plan.bytes = beside + cache_bytes(plan.cache_slots);
  return plan;
}

/// Keeps the cache of the last extraction where that is as large as wanted.
void Extractor::open_cache(const Plan &plan, float isovalue) {
  rays_.frame = frame_;
  if (cache_ && cache_->num_slots == plan.cache_slots) {
    rays_.frame.schedule.table_groups = cache_->table_groups;
    if (cached_isovalue_ != isovalue) cache_->classify(rays_);
  } else {
    cache_.reset();  // before the next one takes its memory
    decode_.reset();
    cache_.emplace(device_, cache_limits(plan.cache_slots), ocl::kGroupSize);
    decode_.emplace(device_, cache_->capacity, stream_.defines());
    rays_.frame.schedule.table_groups = cache_->table_groups;
    num_free_ = cache_->num_slots;
  }
  cached_isovalue_ = isovalue;
}

/// Has what the entries [begin, end) need cached. Returns false where that is more than there are
/// slots.
bool Extractor::bring(const SurfaceCounts &surface, std::uint32_t begin, std::uint32_t end) {
  ++pass_;
  // Each batch is a frame of its own, so that slots are freed in the order in which they were used.
  PassCounts counts{};
  counts.ray_count = 1;
  counts.pass = counts.frame_pass = counts.last_frame_pass = pass_;
  counts.free_count = num_free_;
  rays_.counts.write({&counts, 1});
  request_(surface.block_ids, begin, end, *cache_, rays_);
  const std::uint32_t num_requested = rays_.counts.read().front().requested_count;
  if (num_requested == 0) return true;
  if (num_requested > num_free_) cache_->evict(rays_.counts, rays_);
  cache_->assign(rays_.counts, rays_);
  (*decode_)({stream_, rays_.frame}, {stream_, rays_.frame}, rays_.counts, *cache_);
  counts = rays_.counts.read().front();
  num_free_ = counts.free_count;
  num_decoded_ += counts.decoded_count;
  return counts.decoded_count == num_requested;
}

void Extractor::count(Run &run) {
  const auto begin_time = Clock::now();
  BatchSize batch(run.plan.cache_slots, run.stats.needed_blocks);
  for (std::uint32_t begin = 0; begin < run.num_listed;) {
    const std::uint32_t size = std::min(batch.size(), run.num_listed - begin);
    if (!bring(run.surface, begin, begin + size)) {
      batch.refused(size);
      continue;
    }
    marching_cubes_.count(rays_.frame, *cache_, begin, begin + size, run.surface);
    begin += size;
    batch.served();
    ++run.stats.count_batches;
    run.report(0, begin);
  }
  run.sum(run.surface.vertex_offsets, run.num_listed);
  run.sum(run.surface.triangle_offsets, run.num_listed);
  run.vertex_offsets = run.surface.vertex_offsets.read();
  run.triangle_offsets = run.surface.triangle_offsets.read();
  run.stats.count_ms = ms_since(begin_time);
}

void Extractor::write(Run &run) {
  MeshBuffers mesh(device_, run.plan.part_vertices, run.plan.part_triangles, gradients_);
  run.block_ids = run.surface.block_ids.read();
  BatchSize batch(run.plan.cache_slots, run.stats.needed_blocks);
  for (std::uint32_t begin = 0; begin < run.num_listed;) {
    const auto num_in = [&](const std::vector<uint> &offsets, std::uint32_t end) {
      return uint{offsets[end] - offsets[begin]};
    };
    const std::uint32_t most =
        begin + std::min({batch.size(), run.num_listed - begin, kMaxWrittenBlocks});
    std::uint32_t end = begin + 1;
    while (end < most && num_in(run.vertex_offsets, end + 1) <= run.plan.part_vertices &&
           num_in(run.triangle_offsets, end + 1) <= run.plan.part_triangles)
      ++end;
    if (!bring(run.surface, begin, end)) {
      batch.refused(end - begin);
      continue;
    }
    marching_cubes_.write(rays_.frame, *cache_, listed_, begin, end, run.surface, mesh);
    run.vertices.resize(num_in(run.vertex_offsets, end));
    run.triangles.resize(num_in(run.triangle_offsets, end));
    mesh.vertices.read(run.vertices);
    mesh.triangles.read(run.triangles);
    if (options_.with_normals) {
      run.gradients.resize(3 * run.vertices.size());
      mesh.gradients.read(run.gradients);
    }
    give(run, begin);
    begin = end;
    batch.served();
    ++run.stats.write_batches;
    run.report(1, begin);
  }
}

/// Turns a part of the mesh, of entries from `begin` on, to the world, and hands it on.
void Extractor::give(Run &run, std::uint32_t begin) {
  constexpr std::size_t kAtOnce = 1u << 14;
  const MeshPlacement placement(info_);
  const std::size_t num_vertices = run.vertices.size(), num_triangles = run.triangles.size();
  std::vector<glm::vec3> positions(num_vertices), normals(options_.with_normals ? num_vertices : 0);
  std::vector<Triangle> triangles(num_triangles);
  const auto each = [&](std::size_t count, const auto &work) {
    parallel_for((count + kAtOnce - 1) / kAtOnce, 0, [&](std::uint64_t piece, std::uint32_t) {
      for (std::size_t i = piece * kAtOnce; i < std::min(count, (piece + 1) * kAtOnce); ++i)
        work(i);
    });
  };
  each(num_vertices, [&](std::size_t i) {
    const MeshVertex &vertex = run.vertices[i];
    const uint id = run.block_ids[begin + (vertex.edge >> ISO_VERTEX_BLOCK_SHIFT)];
    const BlockCoords b = block_coords(&frame_, id);
    positions[i] = placement.position({b.x, b.y, b.z}, vertex);
    if (options_.with_normals) {
      const float *g = &run.gradients[3 * i];
      normals[i] = placement.normal({g[0], g[1], g[2]});
    }
  });
  each(num_triangles, [&](std::size_t i) { triangles[i] = placement.triangle(run.triangles[i]); });
  run.sink.add({positions, normals, triangles});
}

ExtractStats Extractor::extract(float isovalue, MeshSink &sink, const Progress &progress) {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  const auto begin = Clock::now();
  frame_.surface.isovalue = isovalue;
  num_decoded_ = 0;
  ExtractStats stats;
  stats.size.has_normals = options_.with_normals;
  macrocells_.select(frame_);
  const std::uint32_t num_listed = listed_.count(frame_, macrocells_.masks());
  stats.listed_blocks = num_listed;
  stats.device_bytes = fixed_bytes_;
  if (num_listed == 0) {
    sink.begin(stats.size);
    stats.total_ms = ms_since(begin);
    return stats;
  }
  // Throws where not even the least fits, before any of it is taken.
  plan_for(num_listed, blocks_of_block(gradients_), isovalue);
  if (cache_ && fixed_bytes_ + cache_bytes(cache_->num_slots) +
                        SurfaceCounts::sizes(num_listed).bytes() +
                        RequestSurface::count_sizes(num_macrocells(frame_.grid)).bytes() +
                        PrefixSum::sizes(num_listed, ocl::kGroupSize).bytes() >
                    budget_)
    cache_.reset();
  Run run{.num_listed = num_listed,
          .surface = SurfaceCounts(device_, num_listed),
          .sum = PrefixSum(device_, num_listed, ocl::kGroupSize),
          .sink = sink,
          .progress = progress,
          .stats = stats};
  listed_.list(frame_, run.surface.block_ids);
  run.stats.needed_blocks = request_.count_needed(frame_, run.surface.block_ids, num_listed);
  run.plan = plan_for(num_listed, run.stats.needed_blocks, isovalue);
  run.stats.cache_slots = run.plan.cache_slots;
  run.stats.device_bytes = run.plan.bytes;
  run.stats.list_ms = ms_since(begin);
  try {
    open_cache(run.plan, isovalue);
    count(run);
    MeshSize &size = run.stats.size;
    size.num_vertices = total_of(run.vertex_offsets);
    size.num_triangles = total_of(run.triangle_offsets);
    if (size.num_vertices > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(
          "the surface at {} has {} vertices, more than triangles of 32-bit numbers can name: take "
          "a coarser level of detail",
          isovalue, size.num_vertices);
    }
    const auto begin_write = Clock::now();
    sink.begin(size);
    write(run);
    run.stats.write_ms = ms_since(begin_write);
  } catch (...) {  // blocks may have slots, but no values
    cache_.reset();
    throw;
  }
  run.stats.decoded_blocks = num_decoded_;
  run.stats.total_ms = ms_since(begin);
  return run.stats;
}

}  // namespace isowave::core
