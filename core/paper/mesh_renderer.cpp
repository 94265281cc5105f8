#include "core/paper/mesh_renderer.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/host/host_renderer.hpp"

namespace isowave::core {

namespace {

/// Triangles of a part of a mesh, at most.
constexpr std::uint64_t kPartTriangles = 1u << 20;
/// Kernels find a vertex by 32 bits.
constexpr std::uint64_t kMostTriangles = std::numeric_limits<std::uint32_t>::max() / 3;
/// So many blocks have fewer than 2^32 triangles.
constexpr std::uint32_t kBlocksThatSum =
    std::numeric_limits<std::uint32_t>::max() / kBlockTriangles;
/// Blocks written by a launch, which watchdogs would end if it took long.
constexpr std::uint32_t kWrittenPerLaunch = 1u << 20;

std::uint64_t vertex_bytes(std::uint64_t num_triangles) {
  return ocl::buffer_size<BlockVertex>("", 3 * num_triangles).bytes();
}

ImageSize checked_size(ImageSize size) {
  check_image_size(size);
  return size;
}

SurfaceBlocks::Options block_options(const ocl::Device &device,
                                     const MeshRendererOptions &options) {
  const std::uint64_t num_rays = checked_size(options.size).num_rays();
  ocl::BufferSizes beside = BlockTriangles::sizes();
  beside.add(Rasterise::sizes(num_rays)).add(Shade::sizes(num_rays));
  return {.gradients = Gradients::kNone,
          .memory_budget = options.memory_budget != 0 ? options.memory_budget
                                                      : device.capabilities().global_memory,
          .stream = options.stream,
          .beside = beside,
          .num_rays = num_rays};
}

}  // namespace

MeshRenderer::Lists::Lists(ocl::Device &device, std::uint64_t num_listed)
    : block_ids(device, sizes(num_listed)["listed blocks"]),
      offsets(device, sizes(num_listed)["triangle offsets"]),
      sum(device, num_listed, ocl::kGroupSize) {}

ocl::BufferSizes MeshRenderer::Lists::sizes(std::uint64_t num_listed) {
  ocl::BufferSizes sizes{ocl::buffer_size<uint>("listed blocks", num_listed),
                         ocl::buffer_size<uint>("triangle offsets", num_listed + 1)};
  return sizes.add(PrefixSum::sizes(num_listed, ocl::kGroupSize));
}

MeshRenderer::MeshRenderer(ocl::Device &device, const CompressedVolume &volume,
                           const MeshRendererOptions &options)
    : device_(device),
      options_(options),
      volume_(volume),
      blocks_(device, volume, block_options(device, options)),
      block_triangles_(device, blocks_.cache().slot_type),
      rasterise_(device, options.size.num_rays()),
      shade_(device, options.size.num_rays()),
      size_(options.size) {}

void MeshRenderer::clear_cache() {
  isovalue_.reset();
  blocks_.clear_cache();
  device_.finish();
}

/// Gives back what an unfinished frame has left.
void MeshRenderer::drop_all() {
  isovalue_.reset();
  mesh_.reset();
  lists_.reset();
  blocks_.drop_cache();
}

std::uint64_t MeshRenderer::mesh_bytes() const {
  return mesh_ ? mesh_->bytes() : 0;
}

std::uint64_t MeshRenderer::bytes_in_use() const {
  return blocks_.fixed_bytes() + mesh_bytes() +
         (lists_ ? Lists::sizes(lists_->block_ids.size()).bytes() : 0) +
         blocks_.cache_bytes(blocks_.num_slots());
}

/// Lists the blocks of the surface; the lists grow, or within a budget are made as long as needed.
void MeshRenderer::make_lists() {
  const bool is_bounded = options_.memory_budget != 0;
  if (is_bounded) {
    mesh_.reset();
    lists_.reset();
    const std::uint64_t least = blocks_.fixed_bytes() + list_bytes() +
                                blocks_.cache_bytes(blocks_.least_slots()) +
                                std::max(blocks_.count_bytes(), vertex_bytes(kBlockTriangles));
    if (least > blocks_.budget()) {
      throw Error(
          "a memory budget of {} bytes is too small for the {} blocks of the surface at {}: {} "
          "would do",
          blocks_.budget(), num_listed_, *isovalue_, least);
    }
    if (bytes_in_use() + list_bytes() + blocks_.count_bytes() > blocks_.budget())
      blocks_.drop_cache();
  }
  if (!lists_ || lists_->block_ids.size() < num_listed_) {
    lists_.reset();
    lists_.emplace(device_, num_listed_);
  }
  blocks_.list(lists_->block_ids);
}

/// A cache for the surface, or for as much of it as the budget allows beside a part of the mesh.
void MeshRenderer::plan_within_budget() {
  const std::uint64_t fixed = blocks_.fixed_bytes() + list_bytes(),
                      left = blocks_.budget() - fixed - blocks_.cache_bytes(blocks_.least_slots());
  const std::uint64_t part =
      std::clamp<std::uint64_t>(left / 4 / vertex_bytes(1), kBlockTriangles, kPartTriangles);
  const std::uint64_t beside = fixed + vertex_bytes(part);
  std::uint32_t slots = blocks_.most_slots(static_cast<std::uint32_t>(num_needed_), beside);
  const std::uint32_t there = blocks_.num_slots();
  if (there > slots && beside + blocks_.cache_bytes(there) <= blocks_.budget()) slots = there;
  blocks_.open_cache(slots);
}

/// Caches all blocks that the surface needs, if there are as many slots. In one pass, since only
/// blocks that the same pass needs are never evicted.
void MeshRenderer::bring_all() {
  const auto stage = device_.timer().stage("surface");
  if (!blocks_.bring(lists_->block_ids, 0, num_listed_))
    throw std::logic_error("a cache too small for a surface that it was made for");
}

/// Leaves the prefix sums of all blocks in lists_->offsets.
std::uint64_t MeshRenderer::count_all() {
  const auto stage = device_.timer().stage("surface");
  block_triangles_.count(blocks_.frame(), blocks_.cache(), lists_->block_ids, {0, num_listed_, 0},
                         lists_->offsets, blocks_.stream().no_data());
  lists_->sum(lists_->offsets, num_listed_);
  if (num_listed_ > kBlocksThatSum) {  // the sums may have wrapped around
    std::vector<uint> offsets(std::size_t{num_listed_} + 1);
    lists_->offsets.read(offsets);
    std::uint64_t total = 0;
    for (std::size_t i = 0; i < num_listed_; ++i) total += uint{offsets[i + 1] - offsets[i]};
    return total;
  }
  std::array<uint, 1> total{};
  lists_->offsets.read(total, num_listed_);
  return total[0];
}

/// Writes all triangles.
void MeshRenderer::make_mesh(std::uint64_t num_triangles) {
  if (!mesh_ || mesh_->size() < 3 * num_triangles) {
    mesh_.reset();
    mesh_.emplace(device_, ocl::buffer_size<BlockVertex>("mesh vertices", 3 * num_triangles));
  }
  const auto stage = device_.timer().stage("surface");
  for (std::uint32_t begin = 0; begin < num_listed_; begin += kWrittenPerLaunch) {
    const std::uint32_t end = begin + std::min(kWrittenPerLaunch, num_listed_ - begin);
    block_triangles_.write(blocks_.frame(), blocks_.cache(), lists_->block_ids, {begin, end, 0},
                           lists_->offsets, 0, *mesh_, blocks_.stream().no_data());
  }
}

/// Finds the blocks of the isovalue, and makes its mesh if the mesh can be kept.
void MeshRenderer::find_surface(float isovalue) {
  const bool is_bounded = options_.memory_budget != 0;
  is_kept_ = false;
  num_needed_ = num_triangles_ = 0;
  isovalue_ = isovalue;
  num_listed_ = blocks_.find(isovalue);
  if (num_listed_ == 0) {
    is_kept_ = true;
    return;
  }
  make_lists();
  num_needed_ = blocks_.count_needed(lists_->block_ids, num_listed_);
  const std::uint64_t slots = std::max<std::uint64_t>(num_needed_, blocks_.num_slots());
  const auto refuse = [&](std::uint64_t bytes) {
    throw Error(
        "the surface at {} takes {} bytes on the device, more than it has, or in one buffer: "
        "within a memory budget it is drawn in batches",
        isovalue, bytes);
  };
  if (is_bounded) {
    plan_within_budget();
  } else {
    if (slots > ISO_MAX_CACHE_SLOTS || !blocks_.can_have(static_cast<std::uint32_t>(slots)))
      refuse(slots * ISO_BLOCK_VOXELS * sizeof(float));
    blocks_.open_cache(static_cast<std::uint32_t>(slots));
  }
  if (blocks_.num_slots() < num_needed_) return;
  bring_all();
  num_triangles_ = count_all();
  const std::uint64_t bytes = bytes_in_use() - mesh_bytes() + vertex_bytes(num_triangles_);
  const bool fits = num_triangles_ <= kMostTriangles && bytes <= blocks_.budget() &&
                    vertex_bytes(num_triangles_) <= device_.capabilities().largest_allocation;
  if (!fits && is_bounded) return;
  if (!fits) refuse(bytes);
  make_mesh(num_triangles_);
  is_kept_ = true;
}

/// Goes through the surface, and draws it part by part.
void MeshRenderer::draw_batches() {
  if (!mesh_) {
    const std::uint64_t part =
        std::min({(blocks_.budget() - bytes_in_use()) / vertex_bytes(1), kPartTriangles,
                  std::uint64_t{kBlockTriangles} * num_listed_});
    mesh_.emplace(device_, ocl::buffer_size<BlockVertex>("mesh vertices", 3 * part));
  }
  const std::uint64_t part = mesh_->size() / 3;
  num_triangles_ = 0;
  std::vector<uint> offsets;
  BatchSize batch(blocks_.num_slots(), num_needed_);
  for (std::uint32_t first = 0; first < num_listed_;) {
    const std::uint32_t size = std::min(batch.size(), num_listed_ - first), last = first + size;
    {
      const auto stage = device_.timer().stage("surface");
      if (!blocks_.bring(lists_->block_ids, first, last)) {
        batch.refused(size);
        continue;
      }
      block_triangles_.count(blocks_.frame(), blocks_.cache(), lists_->block_ids,
                             {first, last, first}, lists_->offsets, blocks_.stream().no_data());
      lists_->sum(lists_->offsets, size);
    }
    offsets.resize(size + 1);
    lists_->offsets.read(offsets);
    num_triangles_ += offsets.back();
    for (std::uint32_t begin = 0; begin < size;) {
      std::uint32_t end = begin + 1;
      while (end < size && offsets[end + 1] - offsets[begin] <= part) ++end;
      {
        const auto stage = device_.timer().stage("surface");
        block_triangles_.write(blocks_.frame(), blocks_.cache(), lists_->block_ids,
                               {first + begin, first + end, first}, lists_->offsets, offsets[begin],
                               *mesh_, blocks_.stream().no_data());
      }
      const auto stage = device_.timer().stage("rasterise");
      blocks_.rays().frame = frame_;
      rasterise_(*mesh_, offsets[end] - offsets[begin], blocks_.rays());
      ++num_parts_;
      begin = end;
    }
    first = last;
    batch.served();
  }
}

Abilities MeshRenderer::abilities() const {
  Abilities abilities;
  abilities.largest = options_.size;
  abilities.most_rays = options_.size.num_rays();
  abilities.parallel = false;
  return abilities;
}

FrameStats MeshRenderer::render(const FrameRequest &request) {
  const auto begin = std::chrono::steady_clock::now();
  check(request, abilities());
  const ImageSize picture = size_of(request, abilities());
  const FrameParams frame =
      make_frame_params(volume_.info, request.camera, picture, request.isovalue);
  const std::uint64_t decoded_before = blocks_.num_decoded();
  MeshFrameStats mesh;
  has_picture_ = false;
  try {
    mesh.is_new_surface = isovalue_ != request.isovalue;
    if (mesh.is_new_surface) {
      find_surface(request.isovalue);
      if (is_kept_) {
        device_.finish();
        mesh.surface_ms = ms_since(begin);
      }
    }
    draw(frame);
    device_.finish();
  } catch (...) {  // blocks may have slots, but no values
    drop_all();
    throw;
  }
  size_ = picture;
  has_picture_ = true;
  mesh.is_kept = is_kept_;
  mesh.listed_blocks = num_listed_;
  mesh.needed_blocks = num_needed_;
  mesh.cached_blocks = blocks_.num_cached();
  mesh.decoded_blocks = blocks_.num_decoded() - decoded_before;
  mesh.cache_slots = blocks_.num_slots();
  mesh.num_triangles = num_triangles_;
  mesh.num_parts = num_parts_;
  mesh.device_bytes = bytes_in_use();
  FrameStats stats;
  PassStats &pass = stats.passes.emplace_back();
  pass.counts.decoded_count = static_cast<uint>(mesh.decoded_blocks);
  pass.completed_percent = 100;
  stats.total_ms = ms_since(begin);
  mesh.draw_ms = stats.total_ms - mesh.surface_ms;
  last_ = mesh;
  if (request.on_pass) request.on_pass(pass);
  return stats;
}

/// Draws the surface at hand.
void MeshRenderer::draw(const FrameParams &frame) {
  frame_ = frame;
  num_parts_ = 0;
  {
    const auto stage = device_.timer().stage("rasterise");
    blocks_.rays().frame = frame_;
    rasterise_.clear(blocks_.rays());
    if (is_kept_ && num_triangles_ != 0) {
      rasterise_(*mesh_, static_cast<std::uint32_t>(num_triangles_), blocks_.rays());
      num_parts_ = 1;
    }
  }
  if (!is_kept_) draw_batches();
  blocks_.rays().frame = frame_;  // for shading
}

std::vector<HitRecord> MeshRenderer::cast_rays(std::span<const WorldRay>, float, Normals) {
  throw Error("drawn triangles answer no rays of any origin: draw by a ray pipeline");
}

Camera MeshRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size,
                            const Viewpoint &from) {
  return HostRenderer(volume_).camera(isovalues, size.value_or(options_.size), from);
}

std::vector<HitRecord> MeshRenderer::hits() {
  if (!has_picture_) throw Error("there is no picture: no frame has been drawn");
  std::vector<HitRecord> hits(size_.num_rays());
  blocks_.rays().hits.read(hits);
  return hits;
}

std::uint64_t MeshRenderer::num_hits(const FrameStats &) {
  return static_cast<std::uint64_t>(
      std::ranges::count_if(hits(), [](const HitRecord &hit) { return std::isfinite(hit.t); }));
}

FrameArrays MeshRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  if (!has_picture_) throw Error("there is no picture: no frame has been drawn");
  return shade_(wanted, make_shading(volume_.info, appearance), make_hit_map({&volume_.info, 1}),
                blocks_.rays(), nullptr, size_.samples);
}

}  // namespace isowave::core
