#include "core/volume/voxel_chunks.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"
#include "core/platform/threads.hpp"
#include "core/volume/block_errors.hpp"

namespace isowave::core {

namespace {

constexpr std::uint64_t kChunkVoxels = 1ull << 22;  // enough to keep threads busy, 16 MiB

/// Memory that stays untouched until voxels are read into it. A packed file may claim a thousand
/// times more voxels than it has; reading fails before their memory is touched.
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

/// Facts about a run of voxels.
struct Findings {
  std::uint64_t bad_count = 0, first_bad = ~std::uint64_t(0);  ///< infinite; linear voxel index
  std::uint64_t no_data_count = 0;
  std::uint64_t too_large_count = 0, first_too_large = ~std::uint64_t(0);
  float min = std::numeric_limits<float>::infinity(), max = -std::numeric_limits<float>::infinity();
  double source_min = std::numeric_limits<double>::infinity(),
         source_max = -std::numeric_limits<double>::infinity();

  bool others_refused = false;  ///< of voxels that another process counts

  bool refused() const { return bad_count > 0 || too_large_count > 0 || others_refused; }

  void add(const Findings &other) {
    bad_count += other.bad_count;
    no_data_count += other.no_data_count;
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
/// become 0, all of it. Those without data become NaN; those that will be mapped or refused stay
/// NaN or infinite, or become kMaxMagnitude.
void cast_line(const Line &line, const InputOptions &options, Findings &found) {
  for (std::size_t x = 0; x < line.source.size(); ++x) {
    const double source = line.source[x];
    float &value = line.voxels[x];
    if (source == options.no_data) {
      value = std::numeric_limits<float>::quiet_NaN();
    } else if (!std::isfinite(source) && options.no_data && options.map_nan) {
      value = *options.map_nan;
      found.add_source(double{value}, double{value});
    } else if (!std::isfinite(source)) {
      value = static_cast<float>(source);
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

/// Sets voxels of the value that says "no data" to NaN, and maps NaN before that.
void mark_line(std::span<float> voxels, const InputOptions &options) {
  const double largest = double{std::numeric_limits<float>::max()};
  const bool fits = !(std::abs(*options.no_data) > largest) || std::isinf(*options.no_data);
  const float no_data = fits ? static_cast<float>(*options.no_data)
                             : std::numeric_limits<float>::quiet_NaN();  // equal to none
  for (float &value : voxels) {
    if (value == no_data) {
      value = std::numeric_limits<float>::quiet_NaN();
    } else if (options.map_nan && !std::isfinite(value)) {
      value = *options.map_nan;
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

/// Checks a line: maps NaN, flushes tiny voxels, notes what cannot be compressed. Voxels without
/// data become NaN.
void check_line(const Line &line, const InputOptions &options, Findings &found) {
  cast_line(line, options, found);
  if (line.source.empty() && options.no_data) mark_line(line.voxels, options);
  if (add_plain_values(line, found)) return;
  for (std::size_t x = 0; x < line.voxels.size(); ++x) {
    float &value = line.voxels[x];
    const bool is_mapped = options.map_nan && !options.no_data && !std::isfinite(value);
    if (is_mapped) {
      value = *options.map_nan;
    } else if (std::isnan(value)) {
      ++found.no_data_count;
      continue;
    } else if (std::isinf(value)) {
      ++found.bad_count;
      found.first_bad = std::min(found.first_bad, line.first + x);
      continue;
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
    return fmt::format("x={}, y={}, z={}", voxel % x, voxel / x % y, voxel / (x * y));
  };
  if (found.bad_count > 0) {
    throw Error(
        "{} of {} voxels {} infinite, the first at {}: replace them, or say that voxels of this "
        "value have no data",
        found.bad_count, info.num_voxels(), plural(found.bad_count, "is", "are"),
        position(found.first_bad));
  }
  if (found.too_large_count > 0) {
    throw Error(
        "{} of {} voxels {} beyond +-{:.4g}, the first at {}: they cannot be drawn, scale the "
        "volume down",
        found.too_large_count, info.num_voxels(), plural(found.too_large_count, "is", "are"),
        kMaxMagnitude, position(found.first_too_large));
  }
}

/// The voxels of a block x + 4y + 16z, as far as they are known.
struct KnownVoxels {
  std::array<double, 64> values{};
  std::uint64_t known = 0;

  /// At (x,y,z), moved by `steps` along an axis; nothing beyond the block.
  std::optional<double> at(std::array<int, 3> place, std::size_t axis, int steps) const {
    place.at(axis) += steps;
    if (place.at(axis) < 0 || place.at(axis) > 3) return {};
    const int voxel = place[0] + 4 * place[1] + 16 * place[2];
    if ((known >> voxel & 1u) == 0) return {};
    return values.at(static_cast<std::size_t>(voxel));
  }
};

/// The value that a smooth field would have at an unknown voxel: the mean, over the axes, of the
/// parabola through the three other voxels of its row; else of the middle of two neighbours; else
/// of the line through two voxels on one side; else of single neighbours.
std::optional<double> smooth_guess(const KnownVoxels &block, const std::array<int, 3> &place) {
  std::array<double, 4> sums{};
  std::array<int, 4> counts{};
  const auto add = [&](std::size_t kind, double value) {
    sums.at(kind) += value;
    ++counts.at(kind);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::optional<double> below = block.at(place, axis, -1), above = block.at(place, axis, 1);
    if (below && above) add(1, 0.5 * (*below + *above));
    for (const int side : {-1, 1}) {
      const std::optional<double> next = side < 0 ? below : above,
                                  second = block.at(place, axis, 2 * side),
                                  third = block.at(place, axis, 3 * side),
                                  other = side < 0 ? above : below;
      if (next && second && third) add(0, 3 * (*next - *second) + *third);
      if (next && second && other) add(0, *next + (*other - *second) / 3);
      if (next && second) add(2, 2 * *next - *second);
      if (next) add(3, *next);
    }
  }
  for (std::size_t kind = 0; kind < counts.size(); ++kind) {
    if (counts.at(kind) != 0) return sums.at(kind) / counts.at(kind);
  }
  return {};
}

/// Makes up the unknown voxels of a block, so that the others are compressed as well as they can
/// be: a smooth continuation, not far beyond their range; whole numbers if they are.
void fill_unknown(KnownVoxels &block) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  bool all_whole = true;
  const std::uint64_t given = block.known;
  for (std::size_t voxel = 0; voxel < 64; ++voxel) {
    if ((given >> voxel & 1u) == 0) continue;
    const double value = block.values.at(voxel);
    least = std::min(least, value);
    most = std::max(most, value);
    all_whole = all_whole && value == std::trunc(value);
  }
  const double slack = 0.5 * (most - least), end = double{std::nextafter(kMaxMagnitude, 0.0f)};
  while (block.known != ~std::uint64_t{0}) {
    KnownVoxels next = block;
    for (int voxel = 0; voxel < 64; ++voxel) {
      if ((block.known >> voxel & 1u) != 0) continue;
      const std::optional<double> guess =
          smooth_guess(block, {voxel % 4, voxel / 4 % 4, voxel / 16});
      if (!guess) continue;
      const double value = std::clamp(std::clamp(*guess, least - slack, most + slack), -end, end);
      next.values.at(static_cast<std::size_t>(voxel)) = all_whole ? std::rint(value) : value;
      next.known |= std::uint64_t{1} << voxel;
    }
    block = next;
  }
}

/// Notes which voxels of a row of blocks are NaN, and fills them.
///
/// voxels   the row's first; a layer of the volume has nx * ny
/// no_data  of the row's blocks
void fill_no_data(const BlockRow &row, float *voxels, std::uint32_t nx, std::uint64_t layer,
                  std::uint64_t *no_data) {
  for (std::uint32_t begin = 0; begin < nx; begin += kBlockEdge) {
    const std::uint32_t size = std::min(kBlockEdge, nx - begin);
    const auto each = [&](const auto &use) {
      for (std::uint32_t z = 0; z < row.nz; ++z) {
        for (std::uint32_t y = 0; y < row.ny; ++y) {
          for (std::uint32_t x = 0; x < size; ++x)
            use(voxels[z * layer + std::uint64_t{y} * nx + begin + x], x + 4 * y + 16 * z);
        }
      }
    };
    std::uint64_t mask = 0;
    KnownVoxels block;
    each([&](float value, std::uint32_t voxel) {
      const std::uint64_t bit = std::uint64_t{1} << voxel;
      block.values.at(voxel) = double{value};
      (std::isnan(value) ? mask : block.known) |= bit;
    });
    if (mask == 0) continue;
    no_data[begin / kBlockEdge] = block.known == 0 ? ~std::uint64_t{0} : mask;
    if (block.known != 0) fill_unknown(block);
    each([&](float &value, std::uint32_t voxel) {
      if ((mask >> voxel & 1u) == 0) return;
      value = static_cast<float>(block.known == 0 ? 0.0 : block.values.at(voxel));
      if (std::abs(value) < kMinMagnitude) value = 0.0f;
    });
  }
}

/// Whether this process counts a layer of its reader.
bool is_own(const VolumePart *part, std::uint32_t z) {
  return part == nullptr || (part->begin + z >= part->own_begin && part->begin + z < part->own_end);
}

/// Checks the rows of a chunk and has them coded, unless a voxel was refused: what follows is only
/// counted then. source: its voxels, if they are still to be cast.
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
    std::uint64_t *no_data = chunk.no_data.data() + index * blocks_x;
    const BlockRow row{index,
                       chunk.voxels.data() + begin,
                       std::min(kBlockEdge, dims.y - y),
                       std::min(kBlockEdge, chunk.num_layers - z),
                       lost,
                       no_data};
    Findings found;
    for (std::uint64_t i = 0; i < std::uint64_t(row.ny) * row.nz; ++i) {
      const std::uint64_t at = begin + i / row.ny * layer + i % row.ny * dims.x;
      check_line({options.keeps_tiny ? 0.0f : kMinMagnitude, chunk.voxels.subspan(at, dims.x),
                  source.empty() ? source : source.subspan(at, dims.x), first_z * layer + at, lost},
                 options, found);
    }
    if (found.no_data_count != 0)
      fill_no_data(row, chunk.voxels.data() + begin, dims.x, layer, no_data);
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
  std::vector<std::uint64_t> no_data(lost.size());
  chunk.lost = lost;
  chunk.no_data = no_data;
  coder.begin_chunk(chunk);
  code_rows(chunk, {}, dims, options, coder);
  coder.end_chunk(chunk);
}

ValueRange read_in_chunks(VolumeReader &reader, const InputOptions &options, ChunkCoder &coder) {
  check_volume_info(options.part != nullptr ? options.part->whole : reader.info(), "volume");
  if (options.map_nan && !(std::abs(*options.map_nan) < kMaxMagnitude)) {
    throw Error("a value for NaN of {}: must be finite and below {:.4g}", *options.map_nan,
                kMaxMagnitude);
  }
  if (options.map_nan && options.no_data && !std::isfinite(*options.no_data)) {
    throw Error("voxels of {} cannot both be replaced by {} and have no data: give one of the two",
                *options.no_data, *options.map_nan);
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
    return std::async(platform::kBeside, [&, z] {
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
  std::vector<std::uint64_t> no_data;
  const auto read_all = [&] {
    std::future<void> pending = read_ahead(0, next);
    for (std::uint32_t z = 0; z < dims.z; z += chunk_layers) {
      pending.get();
      std::swap(current, next);
      pending = read_ahead(std::uint64_t(z) + chunk_layers, next);
      Chunk chunk = make_chunk(dims, z, current.voxels);
      lost.assign(chunk.num_rows * ((dims.x + 3u) / 4u), 0.0f);
      no_data.assign(lost.size(), 0);
      chunk.lost = lost;
      chunk.no_data = no_data;
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
  if (!(total.min <= total.max)) return {};
  // + 0: not -0; of equal values, the one met first would depend on the threads
  return {{total.min + 0.0f, total.max + 0.0f}, {total.source_min + 0.0, total.source_max + 0.0}};
}

}  // namespace isowave::core
