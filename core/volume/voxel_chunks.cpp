#include "core/volume/voxel_chunks.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/volume/block_errors.hpp"

namespace isowave::core {

namespace {

constexpr std::uint64_t kChunkVoxels = 1ull << 22;  // enough to keep threads busy, 16 MiB

/// Memory that nobody touches before voxels are read into it: a packed file may claim a thousand
/// times more of them than it has, and ends before they are missed.
template <class Value>
class Untouched {
 public:
  /// Room for so many values; what was there is lost.
  std::span<Value> take(std::size_t size) {
    if (size > values_.size()) {
      memory_ = std::make_unique_for_overwrite<Value[]>(size);
      values_ = {memory_.get(), size};
    }
    return values_.first(size);
  }

 private:
  std::unique_ptr<Value[]> memory_;
  std::span<Value> values_;  ///< all of it
};

/// What is learnt of a run of voxels.
struct Findings {
  std::uint64_t bad_count = 0, first_bad = ~std::uint64_t(0);  ///< NaN, Inf; linear voxel index
  std::uint64_t too_large_count = 0, first_too_large = ~std::uint64_t(0);
  float min = std::numeric_limits<float>::infinity(), max = -std::numeric_limits<float>::infinity();
  double source_min = std::numeric_limits<double>::infinity(),
         source_max = -std::numeric_limits<double>::infinity();

  bool others_refused = false;  ///< of voxels that another process counts

  bool refused() const { return bad_count > 0 || too_large_count > 0 || others_refused; }

  void add(const Findings &other) {
    bad_count += other.bad_count;
    first_bad = std::min(first_bad, other.first_bad);
    too_large_count += other.too_large_count;
    first_too_large = std::min(first_too_large, other.first_too_large);
    min = std::min(min, other.min);
    max = std::max(max, other.max);
    others_refused |= other.others_refused;
    add_source(other.source_min, other.source_max);
  }
  void add_source(double least, double largest) {
    source_min = std::min(source_min, least);
    source_max = std::max(source_max, largest);
  }
};

/// A run of voxels along x, from x = 0 on.
struct Line {
  float least = kMinMagnitude;  ///< smaller magnitudes become 0
  std::span<float> voxels{};
  std::span<const double> source{};  ///< none: voxels are
  std::uint64_t first = 0;           ///< linear voxel index of the first
  float *lost = nullptr;             ///< of the blocks that they are in: Chunk::lost
};

void raise_lost(float &lost, double error) {
  if (error > double{lost}) lost = rounded_up(error);
}

/// Sets voxels to their source as float32, and notes what that loses; of tiny ones, which will
/// become 0, all of it. Those that will be mapped or refused become NaN, or kMaxMagnitude.
void cast_line(const Line &line, Findings &found) {
  for (std::size_t x = 0; x < line.source.size(); ++x) {
    const double source = line.source[x];
    float &value = line.voxels[x];
    if (!std::isfinite(source)) {
      value = std::numeric_limits<float>::quiet_NaN();
    } else if (std::abs(source) >= double{kMaxMagnitude}) {
      value = kMaxMagnitude;
    } else {
      value = static_cast<float>(source);
      const float stored = std::abs(value) < line.least ? 0.0f : value;
      raise_lost(line.lost[x / kBlockEdge], std::abs(double{stored} - source));
      found.add_source(source, source);
    }
  }
}

/// Adds the range of the line to `found` if each of its voxels is compressed as it is. Else returns
/// false. Made for vector instructions: no branches, and the bits of floats as integers of the same
/// order.
bool add_plain_values(const Line &line, Findings &found) {
  constexpr std::int32_t kMagnitudeBits = 0x7FFFFFFF;
  const auto least_plain = std::bit_cast<std::int32_t>(line.least);
  constexpr auto kEnd = std::bit_cast<std::int32_t>(kMaxMagnitude);
  const auto ordered = [](std::int32_t bits) {
    return bits ^ ((bits >> 31) & kMagnitudeBits);
  };  // its own inverse
  std::int32_t min = std::numeric_limits<std::int32_t>::max(),
               max = std::numeric_limits<std::int32_t>::min();
  std::uint32_t others = 0;
  for (const float value : line.voxels) {
    const auto bits = std::bit_cast<std::int32_t>(value);
    const std::int32_t magnitude = bits & kMagnitudeBits, order = ordered(bits);
    others |= std::uint32_t(magnitude != 0) &
              (std::uint32_t(magnitude < least_plain) | std::uint32_t(magnitude >= kEnd));
    min = std::min(min, order);
    max = std::max(max, order);
  }
  if (others != 0) return false;
  const auto least = std::bit_cast<float>(ordered(min)),
             largest = std::bit_cast<float>(ordered(max));
  found.min = std::min(found.min, least);
  found.max = std::max(found.max, largest);
  if (line.source.empty()) found.add_source(double{least}, double{largest});
  return true;
}

/// Checks a line: maps NaN, flushes tiny voxels, notes what cannot be compressed.
void check_line(const Line &line, const std::optional<float> &map_nan, Findings &found) {
  cast_line(line, found);
  if (add_plain_values(line, found)) return;
  for (std::size_t x = 0; x < line.voxels.size(); ++x) {
    float &value = line.voxels[x];
    const bool is_mapped = !std::isfinite(value);
    if (is_mapped) {
      if (!map_nan) {
        ++found.bad_count;
        found.first_bad = std::min(found.first_bad, line.first + x);
        continue;
      }
      value = *map_nan;
    }
    if (is_mapped || line.source.empty()) found.add_source(double{value}, double{value});
    found.min = std::min(found.min, value);
    found.max = std::max(found.max, value);
    const float magnitude = std::abs(value);
    if (magnitude != 0 && magnitude < line.least) {
      raise_lost(line.lost[x / kBlockEdge], double{magnitude});
      value = 0.0f;
    } else if (magnitude >= kMaxMagnitude) {
      ++found.too_large_count;
      found.first_too_large = std::min(found.first_too_large, line.first + x);
    }
  }
}

void refuse_bad_voxels(const Findings &found, const VolumeInfo &info) {
  const auto position = [&](std::uint64_t voxel) {
    const std::uint64_t x = info.dims.x, y = info.dims.y;
    return fmt::format("({},{},{})", voxel % x, voxel / x % y, voxel / (x * y));
  };
  if (found.bad_count > 0) {
    throw Error(
        "{} of {} voxels are NaN or infinite, the first at {}: give a value for them with "
        "--map-nan",
        found.bad_count, info.num_voxels(), position(found.first_bad));
  }
  if (found.too_large_count > 0) {
    throw Error(
        "{} of {} voxels are beyond +-{:.4g}, the first at {}: zfp cannot hold them, scale the "
        "volume down",
        found.too_large_count, info.num_voxels(), kMaxMagnitude, position(found.first_too_large));
  }
}

/// Whether this process counts a layer of its reader.
bool is_own(const VolumePart *part, std::uint32_t z) {
  return part == nullptr || (part->begin + z >= part->own_begin && part->begin + z < part->own_end);
}

/// Checks the rows of a chunk and has them coded, unless a voxel was refused: what follows is only
/// counted then. source: of its voxels, where they are still to be cast.
Findings code_rows(const Chunk &chunk, std::span<const double> source, const glm::uvec3 &dims,
                   const InputOptions &options, ChunkCoder &coder) {
  const std::uint64_t layer = std::uint64_t(dims.x) * dims.y, rows_per_slab = (dims.y + 3u) / 4u;
  const std::uint64_t blocks_x = (dims.x + 3u) / 4u;
  const std::uint32_t first_z = chunk.z + (options.part != nullptr ? options.part->begin : 0);
  std::vector<Findings> findings(thread_count(options.num_threads));
  parallel_for(chunk.num_rows, options.num_threads, [&](std::uint64_t index, std::uint32_t thread) {
    const auto y = std::uint32_t(index % rows_per_slab) * kBlockEdge,
               z = std::uint32_t(index / rows_per_slab) * kBlockEdge;
    const std::uint64_t begin = z * layer + std::uint64_t(y) * dims.x;
    float *lost = chunk.lost.data() + index * blocks_x;
    const BlockRow row{index, chunk.voxels.data() + begin, std::min(kBlockEdge, dims.y - y),
                       std::min(kBlockEdge, chunk.num_layers - z), lost};
    Findings found;
    for (std::uint64_t i = 0; i < std::uint64_t(row.ny) * row.nz; ++i) {
      const std::uint64_t at = begin + i / row.ny * layer + i % row.ny * dims.x;
      check_line({options.keeps_tiny ? 0.0f : kMinMagnitude, chunk.voxels.subspan(at, dims.x),
                  source.empty() ? source : source.subspan(at, dims.x), first_z * layer + at, lost},
                 options.map_nan, found);
    }
    if (!is_own(options.part, chunk.z + z)) {
      const bool refused = found.refused();
      found = {};
      found.others_refused = refused;
    }
    Findings &all = findings[thread];
    all.add(found);
    if (!all.refused()) coder.code_row(row, thread);
  });
  Findings total;
  for (const Findings &found : findings) total.add(found);
  return total;
}

}  // namespace

std::uint32_t layers_per_chunk(const glm::uvec3 &dims) {
  const std::uint64_t layer = std::uint64_t(dims.x) * dims.y;
  const std::uint64_t slabs = std::max<std::uint64_t>(1, kChunkVoxels / (kBlockEdge * layer));
  return std::uint32_t(std::min<std::uint64_t>(slabs * kBlockEdge, (dims.z + 3u) / 4u * 4u));
}

Chunk make_chunk(const glm::uvec3 &dims, std::uint32_t z, std::span<float> voxels) {
  const auto num_layers = std::uint32_t(voxels.size() / (std::uint64_t(dims.x) * dims.y));
  return {z, num_layers, voxels, std::uint64_t((dims.y + 3u) / 4u) * ((num_layers + 3u) / 4u)};
}

void code_chunk(Chunk chunk, const glm::uvec3 &dims, const InputOptions &options,
                ChunkCoder &coder) {
  std::vector<float> lost(chunk.num_rows * ((dims.x + 3u) / 4u));
  chunk.lost = lost;
  coder.begin_chunk(chunk);
  code_rows(chunk, {}, dims, options, coder);
  coder.end_chunk(chunk);
}

ValueRange read_in_chunks(VolumeReader &reader, const InputOptions &options, ChunkCoder &coder) {
  check_volume_info(options.part != nullptr ? options.part->whole : reader.info(), "volume");
  if (options.map_nan && !(std::abs(*options.map_nan) < kMaxMagnitude)) {
    throw Error("--map-nan {}: must be finite and below {:.4g}", *options.map_nan, kMaxMagnitude);
  }
  const glm::uvec3 dims = reader.info().dims;
  const std::uint64_t layer = std::uint64_t(dims.x) * dims.y;
  const std::uint32_t chunk_layers = layers_per_chunk(dims);
  const auto layers_at = [&](std::uint64_t z) {
    return z < dims.z ? std::uint32_t(std::min<std::uint64_t>(chunk_layers, dims.z - z)) : 0;
  };
  // Float64, and integers of 32 bits, are read as they are, and cast where what that loses can be
  // noted.
  struct Layers {
    Untouched<float> floats;
    Untouched<double> doubles;
    std::span<float> voxels;
    std::span<double> source;
  };
  const bool is_exact = fits_float32(reader.info().type);
  const auto read_ahead = [&](std::uint64_t z, Layers &layers) {
    return std::async(std::launch::async, [&, z] {
      layers.voxels = layers.floats.take(layer * layers_at(z));
      if (!is_exact) layers.source = layers.doubles.take(layers.voxels.size());
      if (layers_at(z) == 0) return;
      if (is_exact) {
        reader.read_layers(std::uint32_t(z), layers_at(z), layers.voxels);
      } else {
        reader.read_exact_layers(std::uint32_t(z), layers_at(z), layers.source);
      }
    });
  };
  Findings total;
  Layers current, next;
  std::vector<float> lost;
  const auto read_all = [&] {
    std::future<void> pending = read_ahead(0, next);
    for (std::uint32_t z = 0; z < dims.z; z += chunk_layers) {
      pending.get();
      std::swap(current, next);
      pending = read_ahead(std::uint64_t(z) + chunk_layers, next);
      Chunk chunk = make_chunk(dims, z, current.voxels);
      lost.assign(chunk.num_rows * ((dims.x + 3u) / 4u), 0.0f);
      chunk.lost = lost;
      coder.begin_chunk(chunk);
      total.add(code_rows(chunk, current.source, dims, options, coder));
      if (!total.refused()) coder.end_chunk(chunk);
      if (options.progress) options.progress(z + layers_at(z), dims.z);
    }
  };
  if (options.part == nullptr) {
    read_all();
    refuse_bad_voxels(total, reader.info());
  } else {
    Team &team = *options.part->team;
    together(team, read_all);
    const std::vector<Findings> of_ranks = gather(team, std::vector{total});
    total = {};
    for (const Findings &found : of_ranks) total.add(found);
    refuse_bad_voxels(total, options.part->whole);
  }
  // + 0: not -0; of equal values, the one met first would depend on the threads
  return {{total.min + 0.0f, total.max + 0.0f}, {total.source_min + 0.0, total.source_max + 0.0}};
}

}  // namespace isowave::core
