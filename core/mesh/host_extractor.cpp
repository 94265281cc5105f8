#include "core/mesh/host_extractor.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/host/host_blocks.hpp"
#include "core/mesh/cell_triangles.hpp"
#include "core/platform/memory.hpp"
#include "core/view/frame.hpp"
#include "kernels_cl/portable/cells_with_data.h"

namespace isowave::core {

namespace {

/// Listed blocks that a thread takes at a time, and that are counted before progress is reported.
constexpr std::size_t kRunBlocks = 64, kBatchBlocks = std::size_t{1} << 17;

std::uint64_t least_bytes(const VolumeInfo &info) {
  return HostBlocks::bytes(info) + ISO_MESH_NEIGHBOURS * platform::page_bytes();
}

std::uint64_t limit_or_default(std::uint64_t limit) {
  return limit != 0 ? limit : platform::host_memory() / 4;
}

std::uint64_t checked_limit(const VolumeInfo &info, std::uint64_t given) {
  const std::uint64_t least = least_bytes(info), limit = limit_or_default(given);
  if (least <= limit) return limit;
  throw Error(
      "extracting on the host takes {} bytes of memory at least, for value ranges of all blocks, "
      "and {} are allowed: raise the limit",
      least, limit);
}

/// A block that the surface passes, or that has edges of such a block's cells.
struct Entry {
  BlockCoords block;
  BlockEdges edges{};  ///< with a vertex
  std::uint32_t num_triangles = 0;
  std::uint64_t first_vertex = 0, first_triangle = 0;
};

class HostExtractor {
 public:
  HostExtractor(const CompressedVolume &volume, float isovalue, const HostExtractorOptions &options)
      : options_(options),
        frame_(make_grid_params(volume.info)),
        isovalue_(isovalue),
        placement_(volume.info, options.vertices),
        blocks_(volume, checked_limit(volume.info, options.memory_limit), options.num_threads) {
    const std::span<const std::uint32_t> table = volume.no_data.table();
    if (!table.empty()) no_data_ = {table.data(), 0};
    blocks_.select(isovalue);
    field_ = blocks_.field();
    list();
  }

  HostExtractStats run(MeshSink &sink, const Progress &progress) {
    const auto report = [&](std::uint32_t step, std::size_t done) {
      const std::uint64_t all = 2 * entries_.size();
      if (progress)
        progress(static_cast<std::uint32_t>((entries_.size() * step + done) * 1000 / all), 1000);
    };
    for (std::size_t begin = 0; begin < entries_.size(); begin += kBatchBlocks) {
      const std::size_t end = std::min(begin + kBatchBlocks, entries_.size());
      for_entries(begin, end, [this](Entry &entry) { count(entry); });
      report(0, end);
    }
    const MeshSize size = sum_up();
    if (size.num_vertices > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(
          "the surface at {} has {} vertices, more than triangles of 32-bit numbers can name: take "
          "a coarser level of detail",
          isovalue_, size.num_vertices);
    }
    sink.begin(size);
    for (std::size_t begin = 0; begin < entries_.size();) {
      begin = write(begin, sink);
      report(1, begin);
    }
    return {entries_.size(), blocks_.num_decoded(), blocks_.bytes()};
  }

 private:
  /// Eight words, of the blocks of a dual grid or of a cell's corners.
  using Words = std::array<ulong, 8>;

  /// A part of the mesh, of entries from one on.
  struct Part {
    std::uint64_t first_vertex, first_triangle;
    std::vector<glm::dvec3> vertices{};
    std::vector<glm::vec3> normals{};
    std::vector<Triangle> triangles{};
  };

  glm::uvec3 num_blocks() const {
    return {frame_.grid.blocks_x, frame_.grid.blocks_y, frame_.grid.blocks_z};
  }
  glm::uvec3 dims() const { return {frame_.grid.dims_x, frame_.grid.dims_y, frame_.grid.dims_z}; }
  /// The macrocell of a block, and the block's bit in it.
  std::size_t macrocell_of(const glm::uvec3 &block) const {
    const glm::uvec3 at = block / 4u, count = (num_blocks() + 3u) / 4u;
    return at.x + count.x * (at.y + std::size_t{count.y} * at.z);
  }
  static std::uint32_t bit_of(const glm::uvec3 &block) {
    return (block.x & 3) + 4 * (block.y & 3) + 16 * (block.z & 3);
  }
  std::uint32_t id_of(const glm::uvec3 &block) const {
    return block_id_at(&frame_, block.x, block.y, block.z);
  }

  /// Lists the blocks in the order of kernels_cl/active_blocks.cl: those with cells that change,
  /// and those of one layer of voxels beside them, which own no cell but edges of theirs.
  void list() {
    const glm::uvec3 blocks = num_blocks(), macrocells = (blocks + 3u) / 4u,
                     one_layer(glm::equal(4u * blocks - 3u, dims()));
    listed_.resize(std::size_t{macrocells.x} * macrocells.y * macrocells.z);
    first_entry_.resize(listed_.size());
    for (std::size_t cell = 0; cell < listed_.size(); ++cell) {
      const glm::uvec3 first =
          4u * glm::uvec3(cell % macrocells.x, cell / macrocells.x % macrocells.y,
                          cell / macrocells.x / macrocells.y);
      first_entry_[cell] = entries_.size();
      for (std::uint32_t bit = 0; bit < 64; ++bit) {
        const glm::uvec3 block = first + glm::uvec3(bit & 3, bit >> 2 & 3, bit >> 4);
        if (!glm::all(glm::lessThan(block, blocks))) continue;
        const glm::uvec3 owner = block - one_layer * glm::uvec3(glm::equal(block, blocks - 1u));
        if ((field_.masks[macrocell_of(owner)] >> bit_of(owner) & 1) == 0) continue;
        listed_[cell] |= ulong{1} << bit;
        entries_.push_back({.block = {block.x, block.y, block.z}});
      }
    }
  }

  const Entry *entry_at(const glm::uvec3 &block) const {
    const std::size_t cell = macrocell_of(block);
    const ulong before = (ulong{1} << bit_of(block)) - 1;
    if ((listed_[cell] >> bit_of(block) & 1) == 0) return nullptr;
    return &entries_[first_entry_[cell] + count_bits(listed_[cell] & before)];
  }

  template <class Work>
  void for_entries(std::size_t begin, std::size_t end, const Work &work) {
    blocks_.run((end - begin + kRunBlocks - 1) / kRunBlocks, [&](std::uint64_t run, bool) {
      const std::size_t from = begin + run * kRunBlocks;
      for (std::size_t i = from; i < std::min(from + kRunBlocks, end); ++i) work(entries_[i]);
    });
  }

  /// Decodes the blocks that an entry needs.
  void decode(const glm::uvec3 &block, bool with_normals) const {
    std::array<std::size_t, ISO_MESH_NEIGHBOURS> ids{};
    std::size_t count = 0;
    for (int i = 0; i < 27; ++i) {
      const glm::ivec3 step(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      const glm::uvec3 at = block + glm::uvec3(step);  // below 0: beyond the grid
      if (mesh_needs_neighbour(step.x, step.y, step.z, int{with_normals}) != 0 &&
          glm::all(glm::lessThan(at, num_blocks())))
        ids.at(count++) = id_of(at);
    }
    field_.maker->decode(std::span(ids).first(count));
  }

  /// The voxels of a decoded dual grid that are inside.
  Words inside(const Entry &entry) const {
    Words result{};
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      const uint id = dual_grid_block(&frame_, entry.block, corner);
      if (id != ISO_INVALID_ID)
        result.at(corner) =
            host_loops().inside(&field_.values[std::uint64_t{ISO_BLOCK_VOXELS} * id], isovalue_);
    }
    return result;
  }

  /// The cells of an entry that have triangles.
  ulong crossed_cells(const Entry &entry, const Words &inside) const {
    return changing_cells(inside.data()) &
           cells_with_data(&frame_, &frame_.grid, no_data_, entry.block);
  }

  void count(Entry &entry) const {
    decode({entry.block.x, entry.block.y, entry.block.z}, false);
    const Words of_blocks = inside(entry);
    Words signs{};
    corners_inside(of_blocks.data(), signs.data());
    entry.edges = edges_with_data(&frame_, &frame_.grid, no_data_, entry.block,
                                  crossed_edges(&frame_.grid, entry.block, signs.data()));
    entry.num_triangles = 0;
    for (ulong cells = crossed_cells(entry, of_blocks); cells != 0; cells &= cells - 1)
      entry.num_triangles += triangles_of(signs, cells)[0];
  }

  /// The triangles of the first of some cells, in cell_triangles().
  static const uchar *triangles_of(const Words &signs, ulong cells) {
    const auto cell = static_cast<uint>(std::countr_zero(cells));
    return &cell_triangles().at(std::size_t{ISO_CASE_BYTES} * cell_signs(signs.data(), cell));
  }

  MeshSize sum_up() {
    MeshSize size{.has_normals = options_.with_normals};
    for (Entry &entry : entries_) {
      entry.first_vertex = size.num_vertices;
      entry.first_triangle = size.num_triangles;
      size.num_vertices += vertex_count(entry.edges);
      size.num_triangles += entry.num_triangles;
    }
    return size;
  }

  /// Hands on the entries from `begin` on that fit a part. Returns the entry after these.
  std::size_t write(std::size_t begin, MeshSink &sink) {
    Part part{.first_vertex = entries_[begin].first_vertex,
              .first_triangle = entries_[begin].first_triangle};
    std::uint64_t num_vertices = 0, num_triangles = 0;
    std::size_t end = begin;
    do {
      num_vertices += vertex_count(entries_[end].edges);
      num_triangles += entries_[end].num_triangles;
      ++end;
    } while (end < entries_.size() &&
             num_vertices + vertex_count(entries_[end].edges) <= options_.part_vertices);
    part.vertices.resize(num_vertices);
    part.normals.resize(options_.with_normals ? num_vertices : 0);
    part.triangles.resize(num_triangles);
    for_entries(begin, end, [&](const Entry &entry) {
      if (vertex_count(entry.edges) == 0 && entry.num_triangles == 0) return;
      decode({entry.block.x, entry.block.y, entry.block.z}, options_.with_normals);
      write_vertices(entry, part);
      write_triangles(entry, part);
    });
    sink.add({part.vertices, part.normals, part.triangles});
    return end;
  }

  float voxel(const glm::ivec3 &at) const {
    const glm::uvec3 p(at);
    return field_.values[std::uint64_t{ISO_BLOCK_VOXELS} * id_of(p / 4u) + bit_of(p)];
  }

  /// The differences at a voxel; one-sided at the domain's border.
  std::array<float, 3> gradient(const glm::ivec3 &at) const {
    std::array<float, 3> result{};
    for (int axis = 0; axis < 3; ++axis) {
      const int last = static_cast<int>(dims()[axis]) - 1;
      glm::ivec3 below = at, above = at;
      below[axis] = std::max(at[axis] - 1, 0);
      above[axis] = std::min(at[axis] + 1, last);
      result.at(static_cast<std::size_t>(axis)) =
          derivative_with_data(voxel(below), voxel(at), voxel(above), at[axis], last);
    }
    return result;
  }

  void write_vertices(const Entry &entry, Part &part) const {
    const glm::uvec3 block(entry.block.x, entry.block.y, entry.block.z);
    std::size_t place = entry.first_vertex - part.first_vertex;
    std::uint32_t axis = 0;
    for (ulong edges : {entry.edges.x, entry.edges.y, entry.edges.z}) {
      for (; edges != 0; edges &= edges - 1) {
        const auto v = static_cast<uint>(std::countr_zero(edges));
        const glm::ivec3 lower(4u * block + glm::uvec3(v & 3, v >> 2 & 3, v >> 4));
        glm::ivec3 upper = lower;
        ++upper[static_cast<int>(axis)];
        const float low = voxel(lower), high = voxel(upper);
        const float t = edge_crossing(low, high, isovalue_);
        part.vertices[place] = placement_.position(block, {axis << 6 | v, t});
        if (options_.with_normals) {
          part.normals[place] = placement_.normal(
              vertex_gradient(gradient(lower).data(), gradient(upper).data(), t, axis, high - low));
        }
        ++place;
      }
      ++axis;
    }
  }

  void write_triangles(const Entry &entry, Part &part) const {
    const Words of_blocks = inside(entry);
    Words signs{};
    corners_inside(of_blocks.data(), signs.data());
    std::size_t place = entry.first_triangle - part.first_triangle;
    for (ulong cells = crossed_cells(entry, of_blocks); cells != 0; cells &= cells - 1) {
      const uchar *edges = triangles_of(signs, cells);
      const auto cell = static_cast<uint>(std::countr_zero(cells));
      for (uint i = 0; i < edges[0]; ++i) {
        const auto vertex = [&](uint k) { return vertex_of(entry, cell, edges[1 + 3 * i + k]); };
        part.triangles[place++] = placement_.triangle({vertex(0), vertex(1), vertex(2)});
      }
    }
  }

  /// The vertex on an edge of an entry's cell.
  uint vertex_of(const Entry &entry, uint cell, uint edge) const {
    const uint corner = edge_corner(edge);
    const glm::uvec3 voxel = glm::uvec3(entry.block.x, entry.block.y, entry.block.z) * 4u +
                             glm::uvec3(cell & 3, cell >> 2 & 3, cell >> 4) +
                             glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
    const Entry *owner = entry_at(voxel / 4u);
    return static_cast<uint>(owner->first_vertex) + vertex_rank(owner->edges.x, owner->edges.y,
                                                                owner->edges.z, edge_axis(edge),
                                                                bit_of(voxel));
  }

  HostExtractorOptions options_;
  FrameParams frame_;
  float isovalue_;
  MeshPlacement placement_;
  NoDataTable no_data_{nullptr, ISO_INVALID_ID};
  HostBlocks blocks_;
  HostField field_{};
  std::vector<ulong> listed_;             ///< [macrocell] bit x + 4y + 16z: is the block an entry?
  std::vector<std::size_t> first_entry_;  ///< [macrocell]
  std::vector<Entry> entries_;
};

}  // namespace

bool fits_host_extractor(const VolumeInfo &info, std::uint64_t memory_limit) {
  return least_bytes(info) <= limit_or_default(memory_limit);
}

HostExtractStats extract_on_host(const CompressedVolume &volume, float isovalue,
                                 const HostExtractorOptions &options, MeshSink &sink,
                                 const Progress &progress) {
  const auto begin = std::chrono::steady_clock::now();
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  check_volume_info(volume.info, "the volume");
  check_drawable(volume.info, "the volume");
  HostExtractStats stats = HostExtractor(volume, isovalue, options).run(sink, progress);
  stats.total_ms = ms_since(begin);
  return stats;
}

}  // namespace isowave::core
