#include "core/accuracy/certify.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"
#include "core/frame/surfaces.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/level_bounds.hpp"
#include "kernels_cl/portable/block_cells.h"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/layers.h"
#include "kernels_cl/portable/zfp_codec.h"

namespace isowave::core {

namespace {

constexpr float kNotCertain = std::numeric_limits<float>::infinity();
/// Parts that the t of a drawn hit and that of a bound's hit may have lost in float32 (make_hit()):
/// each half an ulp of itself, and eight roundings of the ray's length in the cell (two of the step
/// between its faces, one of the sum, and those of the root, ISO_ROOT_STEP).
constexpr double kDistanceRounding = 2 * 0x1p-24, kCellRounding = 2 * 0x1p-21;
/// The part of a slice's t that rounding may move, if the ray is along its normal: the ray's
/// direction has 16 roundings of numbers up to 1, here and in the space of the voxels. Oblique rays
/// lose more, by the cosine.
constexpr double kSliceRounding = 2 * 16 * 0x1p-24;

/// A level's decoded voxels, as far as this rank has them, block by block as they are asked for.
/// Not thread-safe.
class BlockValues {
 public:
  BlockValues(const CompressedVolume &volume, double voxel_error, const ValueOffset &upper)
      : volume_(volume), bound_(with_fewer_planes(volume.precision, voxel_error)), upper_(upper) {}

  /// Whether the cell is in one of this rank's own blocks; then it has all eight voxels. Cells are
  /// the whole volume's.
  bool owns(const glm::ivec3 &cell) const {
    const BrickOf &brick = volume_.info.brick;
    const glm::ivec3 block = in_brick(cell) >> 2;
    return glm::all(glm::greaterThanEqual(block, glm::ivec3(brick.before))) &&
           glm::all(glm::lessThan(block, glm::ivec3(volume_.num_blocks() - brick.behind)));
  }

  /// Both bounds of the field at a dual cell's corners, minus the isovalue, as kernels compute
  /// them.
  void corners(const glm::ivec3 &cell, float isovalue, std::array<float, 8> &lower,
               std::array<float, 8> &upper) {
    const glm::uvec3 blocks = volume_.num_blocks(), first(in_brick(cell));
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      const glm::uvec3 at = first + glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
      const std::uint32_t id = at.x / 4 + blocks.x * (at.y / 4 + blocks.y * (at.z / 4));
      const std::uint32_t voxel = at.x % 4 + 4 * (at.y % 4) + 16 * (at.z % 4);
      const float value = decoded(id)[voxel],
                  offset = offset_of_voxel(upper_, volume_.bounds, id, voxel);
      lower[corner] = value - offset - isovalue;
      upper[corner] = value + offset - isovalue;
    }
  }

 private:
  glm::ivec3 in_brick(const glm::ivec3 &cell) const {
    return cell - glm::ivec3(volume_.info.brick.first_voxel);
  }

  const std::array<float, 64> &decoded(std::uint32_t id) {
    const auto [entry, is_new] = blocks_.try_emplace(id);
    if (!is_new) return entry->second;
    const std::uint32_t bits = volume_.block_bits(id);
    std::array<std::uint32_t, ISO_MAX_BLOCK_BITS / 32 + 1 + kDecoderAhead> words{};
    volume_.read_words(volume_.block_begin(id),
                       std::span(words).first((bits + 31) / 32 + kDecoderAhead));
    std::array<float, 64> &values = entry->second;
    zfp_decode_any_block(words.data(), 0, bits, bound_.min_exponent, values.data());
    round_to(whole_numbers_of(volume_.info.type, bound_), values);
    clear_no_data(volume_.no_data.mask(id), values);
    return values;
  }

  const CompressedVolume &volume_;
  BlockPrecision bound_;
  ValueOffset upper_;
  std::unordered_map<std::uint32_t, std::array<float, 64>> blocks_;
};

/// From where to where a ray is in the finest level's domain [world units]; empty if it misses it.
std::array<double, 2> way_through(const FrameParams &finest, std::uint32_t pixel) {
  const Ray ray = make_ray(&finest, pixel);
  const LastPlanes last = last_planes(&finest), zero{};
  RayEvent enter = start_event(), exit = border_event(std::numeric_limits<float>::infinity());
  if (!clip_to_box(&ray, zero, last, &enter, &exit)) return {1, 0};
  return {double{enter.t.hi} * double{finest.view.t_scale},
          double{exit.t.hi} * double{finest.view.t_scale}};
}

/// Whether a ray begins between the bounds: inside of one, outside of the other. Not where it
/// misses the finest level's domain, or begins in another rank's block.
///
/// frames  of the whole volume's levels
/// values  of the levels that may be drawn
bool starts_between(std::span<const FrameParams> frames, std::span<BlockValues> values,
                    std::uint32_t pixel) {
  if (const auto [begin, end] = way_through(frames[0], pixel); begin > end) return false;
  for (std::size_t level = 0; level < values.size(); ++level) {
    const FrameParams &frame = frames[level];
    if (!draws(frame)) continue;
    const Ray ray = make_ray(&frame, pixel);
    const LastPlanes last = last_planes(&frame), zero{};
    RayEvent enter = border_event(frame.band.begin_t), exit = border_event(frame.band.end_t);
    if (!clip_to_box(&ray, zero, last, &enter, &exit)) continue;
    const glm::ivec3 cell(locate(ray.x, 0, enter, 1, 0, last.x - 1),
                          locate(ray.y, 1, enter, 1, 0, last.y - 1),
                          locate(ray.z, 2, enter, 1, 0, last.z - 1));
    if (!values[level].owns(cell)) return false;
    std::array<float, 8> lower{}, upper{};
    values[level].corners(cell, frame.surface.isovalue, lower, upper);
    return inside_at(&ray, lower.data(), enter, cell.x, cell.y, cell.z, 0) !=
           inside_at(&ray, upper.data(), enter, cell.x, cell.y, cell.z, 0);
  }
  return false;
}

/// The cells of a block (bit x + 4y + 16z) with a corner without data.
std::uint64_t cells_without_data(const FrameParams &frame, const NoData &no_data, BlockCoords b) {
  std::array<std::uint64_t, 8> missing{}, of_corners{};
  bool any = false;
  for (std::uint32_t corner = 0; corner < 8; ++corner) {
    const uint id = dual_grid_block(&frame, b, corner);
    missing[corner] = id == ISO_INVALID_ID ? 0 : no_data.mask(id);
    any = any || missing[corner] != 0;
  }
  if (!any) return 0;
  corners_inside(missing.data(), of_corners.data());
  std::uint64_t cells = 0;
  for (const std::uint64_t of_corner : of_corners) cells |= of_corner;
  return cells;
}

/// Calls visit(cell, enter) for each cell of the finest level that a ray enters out of one without
/// data, and that has all its data itself, until visit returns true.
template <class Visit>
void visit_cells_behind_gaps(const FrameParams &frame, const NoData &no_data, const Ray &ray,
                             const Visit &visit) {
  const LastPlanes last = last_planes(&frame);
  RayEvent enter;
  if (!domain_entry(&ray, last, &enter)) return;
  const auto walk_at = [&](int size) {
    return walk_from(&ray, locate(ray.x, 0, enter, size, 0, (last.x - 1) / size),
                     locate(ray.y, 1, enter, size, 0, (last.y - 1) / size),
                     locate(ray.z, 2, enter, size, 0, (last.z - 1) / size), size, last);
  };
  const auto is_within = [&](const GridWalk &at, int size) {
    return at.x >= 0 && at.x <= (last.x - 1) / size && at.y >= 0 && at.y <= (last.y - 1) / size &&
           at.z >= 0 && at.z <= (last.z - 1) / size;
  };
  bool in_gap = false;
  for (GridWalk block = walk_at(4); is_within(block, 4);) {
    const BlockCoords b{static_cast<uint>(block.x), static_cast<uint>(block.y),
                        static_cast<uint>(block.z)};
    const std::uint64_t lacking = cells_without_data(frame, no_data, b);
    enter = region_entry(&ray, block.x, block.y, block.z, 4, last);
    if (lacking != 0 || in_gap) {
      const auto is_here = [&](const GridWalk &cell) {
        return is_within(cell, 1) && cell.x >> 2 == block.x && cell.y >> 2 == block.y &&
               cell.z >> 2 == block.z;
      };
      for (GridWalk cell = walk_from(
               &ray, locate(ray.x, 0, enter, 1, 4 * block.x, std::min(4 * block.x + 3, last.x - 1)),
               locate(ray.y, 1, enter, 1, 4 * block.y, std::min(4 * block.y + 3, last.y - 1)),
               locate(ray.z, 2, enter, 1, 4 * block.z, std::min(4 * block.z + 3, last.z - 1)), 1,
               last);
           is_here(cell);) {
        const bool lacks =
            (lacking >> ((cell.x & 3) + 4 * (cell.y & 3) + 16 * (cell.z & 3)) & 1u) != 0;
        if (in_gap && !lacks && visit(glm::ivec3(cell.x, cell.y, cell.z), enter)) return;
        in_gap = lacks;
        if (lacking == 0) break;
        enter = walk_exit(&cell, &ray);
        walk_step(&cell, &ray, enter, 1, last);
      }
    }
    walk_step(&block, &ray, walk_exit(&block, &ray), 4, last);
  }
}

/// Whether gaps make a ray uncertain: what its first hits with the two bounds prove is proven
/// within a stretch of cells with data, in which it begins anew. So it is if it begins between the
/// bounds in any of them that is not behind both hits, or begins one anew between these.
///
/// hits  with the bounds, the nearer first [world units]
bool is_uncertain_beside_gaps(const FrameParams &frame, const NoData &no_data, BlockValues &values,
                              std::uint32_t pixel, const std::array<double, 2> &hits,
                              double cell_rounding) {
  const Ray ray = make_ray(&frame, pixel);
  bool is_uncertain = false;
  visit_cells_behind_gaps(frame, no_data, ray, [&](const glm::ivec3 &cell, RayEvent enter) {
    const double t = double{enter.t.hi} * double{frame.view.t_scale};
    const double rounding = kDistanceRounding * t + cell_rounding;
    if (t > hits[1] + rounding) return true;
    is_uncertain = t >= hits[0] - rounding;
    if (!is_uncertain) {
      std::array<float, 8> lower{}, upper{};
      values.corners(cell, frame.surface.isovalue, lower, upper);
      is_uncertain = inside_at(&ray, lower.data(), enter, cell.x, cell.y, cell.z, 0) !=
                     inside_at(&ray, upper.data(), enter, cell.x, cell.y, cell.z, 0);
    }
    return is_uncertain;
  });
  return is_uncertain;
}

/// Throws  Error: coarser levels draw, which have data in other places than the finest
void check_gaps(const NoData &no_data, std::size_t coarsest) {
  if (no_data.empty() || coarsest == 0) return;
  throw Error(
      "{} {} no data: the error of coarser levels of detail has no bound beside them, "
      "leave out the distance between voxels",
      no_data.num_voxels(), plural(no_data.num_voxels(), "voxel has", "voxels have"));
}

/// A bit for each ray: whether says(values of the levels, ray).
template <class Says>
std::vector<std::uint64_t> rays_of_which(const CompressedVolume &volume, bool with_levels,
                                         const FrameRequest &request,
                                         std::span<const FrameParams> frames, const Says &says) {
  const std::vector<const CompressedVolume *> levels = levels_of(volume, with_levels);
  std::vector<ValueOffset> offsets;
  std::vector<double> voxel_errors;
  for (const CompressedVolume *level : levels) {
    voxel_errors.push_back(voxel_error_of(request.voxel_error, voxel_errors.size()));
    offsets.push_back(value_offset({*level, level == &volume}, FieldBound::kUpper,
                                   plane_error(level->precision, voxel_errors.back()),
                                   volume.value_range));
  }
  constexpr std::uint32_t kWords = 128;  // of rays, that share decoded blocks
  const std::uint32_t num_rays = frames[0].view.width * frames[0].view.height;
  std::vector<std::uint64_t> bits((num_rays + 63) / 64);
  parallel_for((bits.size() + kWords - 1) / kWords, 0, [&](std::uint64_t part, std::uint32_t) {
    std::vector<BlockValues> values;
    for (std::size_t i = 0; i < levels.size(); ++i)
      values.emplace_back(*levels[i], voxel_errors[i], offsets[i]);
    const auto first = static_cast<std::uint32_t>(part * kWords * 64),
               end = std::min(first + kWords * 64, num_rays);
    for (std::uint32_t ray = first; ray < end; ++ray)
      bits[ray / 64] |= std::uint64_t{says(std::span(values), ray)} << ray % 64;
  });
  return bits;
}

/// The part of a ray in which its first hit with the true surfaces is [world units]. It has none if
/// both are infinity, and may have none if `last` is.
struct HitRange {
  double first = INFINITY, last = INFINITY;

  /// The same for the nearer of two hits.
  void add_other(const HitRange &other) {
    first = std::min(first, other.first);
    last = std::min(last, other.last);
  }
};

/// The frames of both bounds of one surface.
struct BoundFrames {
  std::vector<float> lower, upper;       ///< depth of the rays, at rank 0
  std::vector<std::uint64_t> uncertain;  ///< bit of each ray, at rank 0: they prove nothing

  /// The range that they prove.
  ///
  /// way  of the ray through the volume
  HitRange range(std::uint32_t ray, const std::array<double, 2> &way) const {
    const auto [first, last] = std::minmax({double{lower[ray]}, double{upper[ray]}});
    const bool is_uncertain = (uncertain[ray / 64] >> ray % 64 & 1) != 0;
    if (is_uncertain || first < way[0]) return {way[0], INFINITY};
    return {first, last > way[1] ? INFINITY : last};
  }
};

/// The slices of a frame. They are where they are drawn, but for rounding.
struct SlicesOfFrame {
  SlicesOfFrame(const FrameRequest &request, const VolumeInfo &finest, const FrameParams &of)
      : frame(of),
        layers(
            make_layer_params(request.surfaces, request.slices, finest, of.view, request.camera)) {
    frame.band = {.begin_t = 0, .end_t = INFINITY};  // all levels have a slice at the same t
  }

  /// Adds a ray's hits with slices. If the volume lacks voxels, the drawn hit alone is known to be
  /// seen: that of a slice, if no surface can be there.
  ///
  /// drawn          the ray's drawn hit [world units]
  /// cell_rounding  see kCellRounding
  void add(std::uint32_t ray, bool has_gaps, double drawn, double cell_rounding,
           HitRange &range) const {
    const ClipParams whole{};
    const RayOfView view = ray_of_view(&frame.view, ray);
    for (uint slice = 0; slice < layers.slices.num_planes; ++slice) {
      const double t = double{slice_hit(&frame, &whole, &layers, slice, ray).t};
      if (std::isinf(t)) continue;
      const RayAxis along = make_plane_axis(
          &frame.view, &layers.slices, &layers.slices.planes[slice], view.u, view.v, view.length);
      const double rounding = kSliceRounding * t / std::abs(double{along.d});
      const bool is_drawn = t == drawn && t + rounding + cell_rounding < range.first;
      if (!has_gaps || is_drawn) range.add_other({t - rounding, t + rounding});
    }
  }

  FrameParams frame;  ///< of the finest level
  LayerParams layers;
};

/// Draws the frames of both bounds of a frame's surfaces.
class BoundDrawer {
 public:
  BoundDrawer(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
              ImageSize size)
      : renderer_(renderer),
        volume_(volume),
        request_(without_calls(without_light_rays(request))),
        levels_(renderer.levels()),
        frames_(make_level_frames(levels_, request.camera, size, request.isovalue,
                                  request.voxel_pixels)),
        coarsest_(levels_.size() - 1) {
    request_.surfaces.clear();
    request_.slices = {};
    request_.field_values = false;
    request_.normals = Normals::kCell;
    while (!draws(frames_[coarsest_])) --coarsest_;
    const glm::dmat3 voxel = levels_[coarsest_].index_to_world();
    cell_rounding_ =
        kCellRounding * (glm::length(voxel[0]) + glm::length(voxel[1]) + glm::length(voxel[2]));
  }

  /// Surfaces share decoded blocks: all are drawn with one bound, and then with the other.
  std::vector<BoundFrames> draw(std::span<const float> isovalues) {
    std::vector<BoundFrames> all(isovalues.size());
    for (std::size_t i = 0; i < all.size(); ++i)
      all[i].lower = draw_bound(isovalues[i], FieldBound::kLower);
    for (std::size_t i = 0; i < all.size(); ++i)
      all[i].upper = draw_bound(isovalues[i], FieldBound::kUpper);
    for (std::size_t i = 0; i < all.size(); ++i) find_uncertain(isovalues[i], all[i]);
    return all;
  }

  const VolumeInfo &finest_info() const { return levels_.front(); }
  const FrameParams &finest() const { return frames_.front(); }
  double cell_rounding() const { return cell_rounding_; }
  std::uint64_t decoded_blocks() const { return decoded_blocks_; }  ///< by this rank

 private:
  std::vector<float> draw_bound(float isovalue, FieldBound bound) {
    request_.isovalue = isovalue;
    request_.bound = bound;
    for (const PassStats &pass : renderer_.render(request_).passes)
      decoded_blocks_ += pass.counts.decoded_count;
    return renderer_.depth();
  }

  void find_uncertain(float isovalue, BoundFrames &bounds) {
    for (FrameParams &frame : frames_) frame.surface.isovalue = isovalue;
    const NoData &no_data = volume_.no_data;
    Team &team = renderer_.team();
    together(team, [&] {
      check_gaps(no_data, coarsest_);
      bounds.uncertain =
          rays_of_which(volume_, renderer_.abilities().levels, request_, frames_,
                        [&](std::span<BlockValues> values, std::uint32_t ray) {
                          if (starts_between(frames_, values, ray)) return true;
                          if (no_data.empty()) return false;
                          const auto [first, last] =
                              std::minmax({double{bounds.lower[ray]}, double{bounds.upper[ray]}});
                          return is_uncertain_beside_gaps(frames_[0], no_data, values[0], ray,
                                                          {first, last}, cell_rounding_);
                        });
    });
    const auto [make, take] = in_place(bounds.uncertain);
    team.reduce(bounds.uncertain.size(), Reduction::kOr, Receiver::kRank0, make, take);
  }

  Renderer &renderer_;
  const CompressedVolume &volume_;
  FrameRequest request_;
  std::vector<VolumeInfo> levels_;
  std::vector<FrameParams> frames_;
  std::size_t coarsest_;  ///< level that draws
  double cell_rounding_ = 0;
  std::uint64_t decoded_blocks_ = 0;
};

/// How far a drawn hit may be off [pixels], kNotCertain if the true one has no range.
///
/// t  drawn
float bound_of_hit(double t, const HitRange &range, double cell_rounding, double pixel_size) {
  if (std::isinf(t) && std::isinf(range.first)) return 0;
  if (std::isinf(t) || std::isinf(range.last)) return kNotCertain;
  const double rounding = kDistanceRounding * range.last + cell_rounding;
  const double distance = std::max(t - range.first, range.last - t) + rounding;
  return std::nextafter(static_cast<float>(distance / pixel_size), kNotCertain);
}

/// The isovalues of a frame's surfaces.
std::vector<float> isovalues_of(const FrameRequest &request) {
  return request.surfaces.empty() ? std::vector{request.isovalue}
                                  : isovalues_of_layers(request.surfaces);
}

/// Throws  Error, at all ranks
void check_drawn(Renderer &renderer, const FrameRequest &request, std::span<const float> drawn) {
  const Abilities abilities = renderer.abilities();
  if (!finds_all(abilities.solver)) {
    throw Error(
        "the error of frames drawn with solver {} has no bound, since it may miss a surface: take "
        "bernstein",
        to_string(abilities.solver));
  }
  check(request, abilities);
  if (!request.surfaces.empty() && !request.surfaces.front().labels.empty())
    throw Error("labels are drawn without an error: it has no bound");
  together(renderer.team(), [&] {
    const std::uint64_t num_rays = size_of(request, abilities).num_rays();
    if (renderer.team().rank() == 0 && drawn.size() != num_rays)
      throw Error("{} hits are not those of {} rays", drawn.size(), num_rays);
  });
}

/// Calls work(ray) for all rays of a frame.
template <class Work>
void for_rays(ImageSize size, const Work &work) {
  parallel_for(size.ray_rows(), 0, [&](std::uint64_t row, std::uint32_t) {
    const auto first = static_cast<std::uint32_t>(row * size.ray_columns());
    for (std::uint32_t ray = first; ray < first + size.ray_columns(); ++ray) work(ray);
  });
}

}  // namespace

Certificate certify(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
                    std::span<const float> drawn) {
  const auto begin = std::chrono::steady_clock::now();
  check_drawn(renderer, request, drawn);
  const ImageSize size = size_of(request, renderer.abilities());
  Team &team = renderer.team();
  BoundDrawer drawer(renderer, volume, request, size);
  const std::vector<BoundFrames> surfaces = drawer.draw(isovalues_of(request));
  Certificate certificate;
  for (const std::uint64_t of_rank : gather(team, std::vector{drawer.decoded_blocks()}))
    certificate.decoded_blocks += of_rank;
  if (team.rank() != 0) return certificate;
  const FrameParams &finest = drawer.finest();
  const SlicesOfFrame slices(request, drawer.finest_info(), finest);
  certificate.bounds.assign(drawn.size(), kNotCertain);
  for_rays(size, [&](std::uint32_t ray) {
    const double t = double{drawn[ray]};
    const std::array<double, 2> way = way_through(finest, ray);
    HitRange range;
    for (const BoundFrames &surface : surfaces) range.add_other(surface.range(ray, way));
    slices.add(ray, !volume.no_data.empty(), t, drawer.cell_rounding(), range);
    certificate.bounds[ray] = bound_of_hit(t, range, drawer.cell_rounding(),
                                           pixel_size_at(request.camera, size.height, t));
  });
  certificate.total_ms = ms_since(begin);
  return certificate;
}

Certificate certify(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
                    std::span<const HitRecord> drawn) {
  std::vector<float> depth(drawn.size());
  std::ranges::transform(drawn, depth.begin(), &HitRecord::t);
  return certify(renderer, volume, request, std::span<const float>(depth));
}

CertificateSummary summarize(std::span<const float> bounds, double limit) {
  CertificateSummary summary;
  std::vector<float> certain;
  for (const float bound : bounds) {
    if (bound == 0) continue;
    ++summary.num_pixels;
    if (std::isinf(bound)) {
      ++summary.num_uncertain;
    } else {
      certain.push_back(bound);
    }
    summary.num_certified += double{bound} <= limit;
  }
  if (certain.empty()) return summary;
  std::ranges::sort(certain);
  summary.median = double{certain[certain.size() / 2]};
  summary.p99 = double{certain[(certain.size() - 1) * 99 / 100]};
  summary.max = double{certain.back()};
  return summary;
}

}  // namespace isowave::core
