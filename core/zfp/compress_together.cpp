#include "core/zfp/compress_together.hpp"

#include <algorithm>
#include <bit>
#include <functional>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/pyramid_coder.hpp"
#include "core/zfp/slabs.hpp"
#include "core/zfp/team_list.hpp"
#include "core/zfp/zfp_file.hpp"
#include "core/zfp/zfp_trailer.hpp"

namespace isowave::core {

namespace {

/// A rank's slab of a level after compression.
struct CodedSlab {
  CompressedVolume volume;                 ///< of the layers worked on
  std::vector<float> errors;               ///< of its own blocks, if they are kept
  std::optional<SectionWriter> payload{};  ///< its own, at a fixed rate
  std::uint64_t payload_bytes = 0;         ///< that were coded, its own or not
};

/// A level on its way from one step to the next.
struct LevelData {
  std::vector<float> voxels;   ///< of the layers worked on
  std::vector<float> made;     ///< of their blocks: LevelBounds::Off
  std::vector<float> decoded;  ///< of its own blocks
};

/// So many layers of voxels of a level, not compressed yet.
CompressedVolume slab_of(const CompressedVolume &level, std::uint32_t layers) {
  CompressedVolume slab;
  slab.info = level.info;
  slab.info.dims.z = layers;
  slab.bits_per_block = level.bits_per_block;
  slab.precision = level.precision;
  return slab;
}

class TeamCompressor {
 public:
  TeamCompressor(Team &team, const OpenReader &open, const CompressOptions &options,
                 SharedFile &file, CompressedVolume &volume)
      : team_(team), open_(open), options_(options), file_(file) {
    levels_.push_back(&volume);
    for (CompressedVolume &level : volume.coarser_levels) levels_.push_back(&level);
    std::vector<VolumeInfo> grids;
    for (const CompressedVolume *level : levels_) grids.push_back(level->info);
    cuts_ = cut_levels(grids, team.size());
  }

  void run() {
    FileSection all;
    ZfpLayout layout;
    for (level_ = 0; level_ < levels_.size(); ++level_) {
      const std::uint64_t begin = all.bytes;
      LevelData next;
      CodedSlab slab = code(begin, next);
      FileSection section = write_payload(begin, slab);
      ZfpLayout own_layout;
      section.add(write_tables(begin + section.bytes, section.bytes, slab, own_layout));
      if (level_ == 0) {
        layout = own_layout;
      } else {
        section.add(write_trailer(begin + section.bytes, section, own_layout, false));
        layout.level_bytes.push_back(section.bytes);
      }
      all.add(section);
      data_ = std::move(next);
      if (level_ + 1 < levels_.size()) fetch_neighbours();
    }
    level_ = 0;
    write_trailer(all.bytes, all, layout, levels_.size() > 1);
  }

 private:
  CompressedVolume &level() { return *levels_[level_]; }
  /// Whether this rank has a part of the next level.
  bool has_next() const {
    return level_ + 1 < levels_.size() && !cuts_[level_ + 1].own[team_.rank()].empty();
  }
  const LayerRange &own() const { return cuts_[level_].own[team_.rank()]; }
  const LayerRange &worked() const { return cuts_[level_].worked[team_.rank()]; }
  bool is_first() const { return team_.rank() == 0; }
  /// Number of blocks in a layer of the level.
  std::size_t blocks_of_layer(std::size_t level) const {
    const glm::uvec3 blocks = levels_[level]->num_blocks();
    return std::size_t{blocks.x} * blocks.y;
  }
  /// Payload of a layer of the level's blocks, at a fixed rate.
  std::size_t layer_bytes() { return blocks_of_layer(level_) * level().bits_per_block / 8; }
  std::size_t voxels_of_layer(std::size_t level) const {
    const glm::uvec3 &dims = levels_[level]->info.dims;
    return std::size_t{dims.x} * dims.y;
  }

  CodedSlab code(std::uint64_t begin, LevelData &next);
  void read_finest(PyramidCoder &coder);
  void keep_next(const Chunk &chunk, LevelData &next) const;
  void take_payload(std::span<const std::byte> payload, CodedSlab &slab);
  void code_made(const glm::uvec3 &dims, PyramidCoder &coder);
  LevelData empty_next() const;
  void keep_bounds(const LevelBounds::Off &off, const VolumeInfo &made, LevelData &next) const;
  void agree_on_error(const CodedSlab &slab);
  FileSection write_payload(std::uint64_t begin, const CodedSlab &slab);
  FileSection write_bits(std::uint64_t begin, const CompressedVolume &coded);
  FileSection write_tables(std::uint64_t begin, std::uint64_t size, const CodedSlab &slab,
                           ZfpLayout &layout);
  std::uint64_t write_list(SectionWriter &out, std::span<const std::byte> own,
                           std::size_t item_size);
  std::uint64_t write_no_data(SectionWriter &out, const CodedSlab &slab);
  FileSection write_trailer(std::uint64_t begin, const FileSection &before, const ZfpLayout &layout,
                            bool has_levels);
  FileSection of_first(const std::function<FileSection()> &write);
  void fetch_neighbours();

  Team &team_;
  const OpenReader &open_;
  const CompressOptions &options_;
  SharedFile &file_;
  std::vector<CompressedVolume *> levels_;
  std::vector<LevelCuts> cuts_;
  std::size_t level_ = 0;
  LevelData data_;  ///< of the present level, but the finest
};

/// Rank 0 writes, and all get to know what.
FileSection TeamCompressor::of_first(const std::function<FileSection()> &write) {
  FileSection section;
  together(team_, [&] {
    if (is_first()) section = write();
  });
  return gather(team_, is_first() ? std::vector{section} : std::vector<FileSection>()).front();
}

/// The next level's layers that are this rank's own.
void TeamCompressor::keep_next(const Chunk &chunk, LevelData &next) const {
  const LevelCuts &cuts = cuts_[level_ + 1];
  const VolumeInfo &info = levels_[level_ + 1]->info;
  const std::uint32_t rank = team_.rank(), first = 2 * worked().begin + chunk.z;
  const LayerRange kept =
      common_layers(voxel_layers(info, cuts.own[rank]), {first, first + chunk.num_layers});
  const std::uint32_t begin = voxel_layers(info, cuts.worked[rank]).begin;
  const std::size_t size = voxels_of_layer(level_ + 1);
  for (std::uint32_t z = kept.begin; z < kept.end; ++z)
    std::ranges::copy(chunk.voxels.subspan((z - first) * size, size),
                      next.voxels.begin() + std::ptrdiff_t((z - begin) * size));
}

void TeamCompressor::read_finest(PyramidCoder &coder) {
  VolumePart part = own_part(team_, level().info);
  const LayerRange layers = voxel_layers(level().info, worked());
  part.begin = layers.begin;
  InputOptions input = input_of(options_);
  input.part = &part;
  const std::unique_ptr<VolumeReader> reader = open_part(part, layers.count(), open_);
  level().value_range = read_in_chunks(*reader, input, coder).coded;
}

/// Codes the layers worked on; at a fixed rate, writes what is the rank's own.
CodedSlab TeamCompressor::code(std::uint64_t begin, LevelData &next) {
  CompressOptions options = options_;
  if (worked().empty()) options.encoder = {};
  CodedSlab slab;
  CompressedVolume coarse;
  std::optional<PyramidCoder> coder;
  std::vector<CompressedVolume *> volumes = {&slab.volume};
  const std::vector<PayloadSink> sinks = {
      [&](std::span<const std::byte> payload) { take_payload(payload, slab); },
      [](std::span<const std::byte>) {}};
  together(team_, [&] {
    slab.volume = slab_of(level(), voxel_layers(level().info, worked()).count());
    slab.payload.emplace(file_, begin + sizeof(ZfpHeader) + own().begin * layer_bytes());
    if (has_next()) {
      coarse = slab_of(*levels_[level_ + 1], slab.volume.info.dims.z / 2 + 1);
      volumes.push_back(&coarse);
      next = empty_next();
    }
    coder.emplace(options, volumes, std::span(sinks).first(volumes.size()), level_ == 0,
                  level_ == 0 && levels_.size() > 1,
                  [&](const Chunk &chunk) { keep_next(chunk, next); });
  });
  if (level_ == 0) read_finest(*coder);
  together(team_, [&] {
    if (level_ > 0) code_made(slab.volume.info.dims, *coder);
    slab.errors = coder->finish_level();
    if (!slab.errors.empty()) {
      const std::span<const float> errors =
          values_of(std::span<const float>(slab.errors), blocks_of_layer(level_), worked(), own());
      slab.errors = std::vector<float>(errors.begin(), errors.end());
    }
    if (has_next()) keep_bounds(coder->finish_bounds(data_.made), coarse.info, next);
  });
  agree_on_error(slab);
  return slab;
}

/// Keeps payload in memory where blocks have lengths of their own, since their place is not known
/// yet; at a fixed rate, writes what is the rank's own.
void TeamCompressor::take_payload(std::span<const std::byte> payload, CodedSlab &slab) {
  if (level().is_indexed()) {
    std::vector<std::uint32_t> &words = slab.volume.words;
    const std::size_t size = words.size();
    words.resize(size + payload.size() / sizeof(std::uint32_t));
    std::ranges::copy(payload, std::as_writable_bytes(std::span(words)).begin() +
                                   std::ptrdiff_t(size * sizeof(std::uint32_t)));
    return;
  }
  const std::uint64_t done = slab.payload_bytes,
                      own_begin = (own().begin - worked().begin) * layer_bytes(),
                      own_end = (own().end - worked().begin) * layer_bytes(),
                      from = std::max(done, own_begin),
                      to = std::min(done + payload.size(), own_end);
  if (from < to) slab.payload->write(payload.subspan(from - done, to - from));
  slab.payload_bytes += payload.size();
}

/// Codes the voxels of a coarser level, which were made of the finer one's.
void TeamCompressor::code_made(const glm::uvec3 &dims, PyramidCoder &coder) {
  const std::uint32_t chunk_layers = layers_per_chunk(dims);
  const std::size_t layer = voxels_of_layer(level_);
  for (std::uint32_t z = 0; z < dims.z; z += chunk_layers) {
    const std::size_t count = std::min(chunk_layers, dims.z - z) * layer;
    code_chunk(make_chunk(dims, z, std::span(data_.voxels).subspan(z * layer, count)), dims,
               input_of_coarser(options_), coder);
  }
}

/// Room for the next level's layers that this rank works on.
LevelData TeamCompressor::empty_next() const {
  const LayerRange &worked = cuts_[level_ + 1].worked[team_.rank()];
  LevelData next;
  next.voxels.resize(voxel_layers(levels_[level_ + 1]->info, worked).count() *
                     voxels_of_layer(level_ + 1));
  next.made.resize(worked.count() * blocks_of_layer(level_ + 1));
  return next;
}

/// Keeps how far the next level's blocks that are this rank's own are from the source.
///
/// made  the grid of the blocks that `off` is of
void TeamCompressor::keep_bounds(const LevelBounds::Off &off, const VolumeInfo &made,
                                 LevelData &next) const {
  if (off.made.empty()) {
    next.made.clear();
    return;
  }
  const std::uint32_t rank = team_.rank(), first = worked().begin / 2;
  const LayerRange &next_own = cuts_[level_ + 1].own[rank];
  const std::size_t per_layer = blocks_of_layer(level_ + 1);
  const auto of_own = [&](const std::vector<float> &values) {
    return values_of(std::span(values), per_layer, {first, first + num_block_layers(made)},
                     next_own);
  };
  std::ranges::copy(
      of_own(off.made),
      values_of(std::span(next.made), per_layer, cuts_[level_ + 1].worked[rank], next_own).begin());
  const std::span<const float> decoded = of_own(off.decoded);
  next.decoded.assign(decoded.begin(), decoded.end());
}

void TeamCompressor::agree_on_error(const CodedSlab &slab) {
  CompressedVolume &volume = level();
  const std::vector<double> errors =
      gather(team_, std::vector{slab.volume.max_voxel_error.value_or(-1)});
  const double largest = std::ranges::max(errors);
  if (largest >= 0) volume.max_voxel_error = largest;
  if (volume.is_indexed()) volume.precision.max_voxel_error = volume.max_voxel_error;
}

FileSection TeamCompressor::write_payload(std::uint64_t begin, const CodedSlab &slab) {
  FileSection section = of_first([&] {
    SectionWriter out(file_, begin);
    const ZfpHeader header =
        make_zfp_header(level().info.dims, level().bits_per_block, level().precision.min_exponent);
    out.write(std::as_bytes(std::span(header)));
    return out.section();
  });
  const FileSection own = level().is_indexed() ? write_bits(begin + section.bytes, slab.volume)
                                               : slab.payload->section();
  for (const FileSection &of_rank : gather(team_, std::vector{own})) section.add(of_rank);
  return section;
}

/// A slab's bits at their place in a payload. A byte that several ranks have bits of is written by
/// the one that has its first.
FileSection TeamCompressor::write_bits(std::uint64_t begin, const CompressedVolume &coded) {
  struct Bits {
    std::uint64_t first, count;  ///< in the payload
    std::uint64_t in_first_byte;
  };
  const std::uint64_t layer = blocks_of_layer(level_);
  const std::uint64_t source = coded.block_begin((own().begin - worked().begin) * layer),
                      count = coded.block_begin((own().end - worked().begin) * layer) - source;
  const std::vector<std::uint64_t> counts = gather(team_, std::vector{count});
  const std::uint32_t rank = team_.rank();
  const std::uint64_t first =
      std::accumulate(counts.begin(), counts.begin() + rank, std::uint64_t{0});
  level().indexed_bits = std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
  const std::span<const std::byte> bytes = std::as_bytes(std::span(coded.words));
  // Bits of the byte that a rank before this one writes.
  const std::uint64_t shared = std::min((8 - first % 8) % 8, count);
  std::uint32_t head = 0;
  if (shared != 0) copy_bits(bytes, source, shared, {&head, 1});
  const std::vector<Bits> all = gather(team_, std::vector{Bits{first, count, head << first % 8}});
  SectionWriter out(file_, begin + (first + 7) / 8);
  together(team_, [&] {
    constexpr std::uint64_t kPieceWords = 1u << 18;
    const std::uint64_t end = first + count;
    std::vector<std::uint32_t> words;
    for (std::uint64_t at = first + shared; at < end;) {
      const std::uint64_t num_bits = std::min(32 * kPieceWords, end - at);
      words.resize((num_bits + 31) / 32);
      copy_bits(bytes, source + (at - first), num_bits, words);
      at += num_bits;
      const std::span<std::byte> piece =
          std::as_writable_bytes(std::span(words)).first((num_bits + 7) / 8);
      for (std::size_t other = rank + 1; at == end && end % 8 != 0 && other < all.size(); ++other) {
        if (all[other].count != 0 && all[other].first / 8 == end / 8)
          piece.back() |= static_cast<std::byte>(all[other].in_first_byte);
      }
      out.write(piece);
    }
  });
  return out.section();
}

/// Writes what follows a level's stream: padding, index, bounds, voxels without data.
///
/// size  of the stream [bytes]
FileSection TeamCompressor::write_tables(std::uint64_t begin, std::uint64_t size,
                                         const CodedSlab &slab, ZfpLayout &layout) {
  const std::uint64_t layer = blocks_of_layer(level_), num_own = own().count() * layer,
                      first = (own().begin - worked().begin) * layer;
  std::vector<std::uint16_t> lengths;
  if (level().is_indexed()) {
    for (std::uint64_t block = first; block < first + num_own; ++block)
      lengths.push_back(static_cast<std::uint16_t>(slab.volume.block_bits(block)));
  }
  const std::vector<float> &bounds = level_ == 0 ? slab.errors : data_.decoded;
  const std::vector<float> largest =
      gather(team_, bounds.empty() ? std::vector<float>() : std::vector{std::ranges::max(bounds)});
  const BlockBounds coded =
      encode_bounds(bounds, largest.empty() ? 0.0f : std::ranges::max(largest));
  level().bounds.exponent = coded.exponent;
  level().bounds.by_place = level_ == 0 && !largest.empty();
  SectionWriter out(file_, begin);
  together(team_, [&] {
    if (is_first()) out.write(std::vector<std::byte>((8 - size % 8) % 8));
  });
  if (level().is_indexed())
    layout.index_bytes = write_list(out, std::as_bytes(std::span(lengths)), sizeof(std::uint16_t));
  if (!largest.empty())
    layout.bounds_bytes = write_list(out, std::as_bytes(std::span(coded.codes)), 1);
  layout.no_data_bytes = write_no_data(out, slab);
  return gather(team_, is_first() ? std::vector{out.section()} : std::vector<FileSection>())
      .front();
}

/// A list with an item for each block. Returns its size as written, at rank 0.
std::uint64_t TeamCompressor::write_list(SectionWriter &out, std::span<const std::byte> own_bytes,
                                         std::size_t item_size) {
  const std::uint64_t per_layer = blocks_of_layer(level_) * item_size;
  std::vector<Stretch> stretches;
  for (std::uint32_t rank = 0; rank < team_.size(); ++rank) {
    const LayerRange &slab = cuts_[level_].own[rank];
    stretches.push_back({rank, slab.begin * per_layer, slab.end * per_layer});
  }
  return write_deflated(team_, out, stretches, {{own_bytes}}, kDeflatedAtOnce * item_size);
}

/// The level's voxels without data, and how many they are. A group of blocks that several ranks
/// have blocks of is written by the one that has its first. Returns the size as written, at rank 0.
std::uint64_t TeamCompressor::write_no_data(SectionWriter &out, const CodedSlab &slab) {
  struct Group {
    std::uint64_t number = 0;
    std::uint32_t some = 0, all = 0;  ///< a bit for each block: no_data.h
  };
  struct Found {
    std::uint64_t num_voxels = 0, num_masks = 0;
    Group shared{};  ///< that a rank before this one writes
  };
  const std::uint64_t layer = blocks_of_layer(level_), first = own().begin * layer,
                      end = own().end * layer;
  std::vector<std::uint32_t> groups;  // of those that begin here, as no_data_groups()
  std::vector<std::uint64_t> masks;
  Found found{.shared = {first / ISO_NO_DATA_BLOCKS}};
  for (std::uint64_t block = first; block < end; ++block) {
    const std::uint64_t mask = slab.volume.no_data.mask(block - worked().begin * layer),
                        missing = mask & voxels_of_block(level().info.dims, block);
    const std::uint32_t bit = 1u << (block % ISO_NO_DATA_BLOCKS);
    if (block % ISO_NO_DATA_BLOCKS == 0) groups.insert(groups.end(), {0u, 0u});
    const bool is_all = mask == ~std::uint64_t{0};
    std::uint32_t &some = groups.empty() ? found.shared.some : groups.end()[-2],
                  &all = groups.empty() ? found.shared.all : groups.end()[-1];
    found.num_voxels += static_cast<std::uint64_t>(std::popcount(missing));
    if (is_all) {
      all |= bit;
    } else if (missing != 0) {
      some |= bit;
      masks.push_back(missing);
    }
  }
  found.num_masks = masks.size();
  const std::vector<Found> of_ranks = gather(team_, std::vector{found});
  std::uint64_t num_voxels = 0;
  for (const Found &of : of_ranks) num_voxels += of.num_voxels;
  level().no_data = NoData(num_voxels);
  if (num_voxels == 0) return 0;
  if (!groups.empty()) {
    const std::uint64_t last = (end - 1) / ISO_NO_DATA_BLOCKS;
    for (std::uint32_t rank = team_.rank() + 1; rank < team_.size(); ++rank) {
      const Group &shared = of_ranks[rank].shared;
      if (shared.number != last) continue;
      groups.end()[-2] |= shared.some;
      groups.end()[-1] |= shared.all;
    }
  }
  const auto num_groups = [](std::uint64_t blocks) {
    return (blocks + ISO_NO_DATA_BLOCKS - 1) / ISO_NO_DATA_BLOCKS;
  };
  constexpr std::uint64_t kGroupBytes = 2 * sizeof(std::uint32_t),
                          kMaskBytes = sizeof(std::uint64_t);
  std::vector<Stretch> stretches;
  for (std::uint32_t rank = 0; rank < team_.size(); ++rank) {
    const LayerRange &of = cuts_[level_].own[rank];
    stretches.push_back({rank, kGroupBytes * num_groups(of.begin * layer),
                         kGroupBytes * num_groups(of.end * layer)});
  }
  for (std::uint32_t rank = 0; rank < team_.size(); ++rank) {
    const std::uint64_t begin = stretches.back().end;
    stretches.push_back({rank, begin, begin + kMaskBytes * of_ranks[rank].num_masks});
  }
  return write_deflated(team_, out, stretches,
                        {{std::as_bytes(std::span(groups)), std::as_bytes(std::span(masks))}},
                        kDeflatedAtOnce * sizeof(std::uint32_t));
}

FileSection TeamCompressor::write_trailer(std::uint64_t begin, const FileSection &before,
                                          const ZfpLayout &layout, bool has_levels) {
  return of_first([&] {
    const std::string text = zfp_trailer_text(level(), layout);
    ZfpFooter footer{zfp_version(level(), has_levels), std::uint32_t(text.size()), before.crc, 0,
                     kZfpFooterMagic};
    footer.json_crc = json_crc(text, footer);
    SectionWriter out(file_, begin);
    out.write(std::as_bytes(std::span(text)));
    out.write(std::as_bytes(std::span(&footer, 1)));
    return out.section();
  });
}

/// Fetches the layers of the next level that this rank works on and other ranks own.
void TeamCompressor::fetch_neighbours() {
  const std::size_t next = level_ + 1;
  const LevelCuts &cuts = cuts_[next];
  const VolumeInfo &info = levels_[next]->info;
  const std::uint32_t self = team_.rank();
  const auto slices = [&](const LayerRange &some, const auto &use) {
    const LayerRange all = cuts.worked[self];
    use(std::as_writable_bytes(values_of(std::span(data_.voxels), voxels_of_layer(next),
                                         voxel_layers(info, all), voxel_layers(info, some))));
    if (!data_.made.empty())
      use(std::as_writable_bytes(
          values_of(std::span(data_.made), blocks_of_layer(next), all, some)));
  };
  std::vector<Outgoing> sent;
  std::vector<Incoming> received;
  for (std::uint32_t rank = 0; rank < team_.size(); ++rank) {
    if (rank == self) continue;
    const LayerRange for_it = common_layers(cuts.own[self], cuts.worked[rank]),
                     for_us = common_layers(cuts.own[rank], cuts.worked[self]);
    if (!for_it.empty())
      slices(for_it, [&](std::span<std::byte> bytes) { sent.push_back({rank, bytes}); });
    if (!for_us.empty())
      slices(for_us, [&](std::span<std::byte> bytes) { received.push_back({rank, bytes}); });
  }
  team_.exchange(sent, received);
}

}  // namespace

CompressedVolume compress_together(Team &team, const OpenReader &open,
                                   const CompressOptions &options, SharedFile &file) {
  VolumeInfo info;
  together(team, [&] { info = open()->info(); });
  CompressedVolume volume = describe_compressed(info, options);
  TeamCompressor(team, open, options, file, volume).run();
  file.commit();
  return volume;
}

}  // namespace isowave::core
