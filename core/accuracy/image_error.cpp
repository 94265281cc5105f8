#include "core/accuracy/image_error.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "core/accuracy/candidates.hpp"
#include "core/accuracy/flip.hpp"
#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/view/detail.hpp"
#include "core/view/trigonometry.hpp"

namespace isowave::core {

namespace {

/// Distances between voxels that may be chosen [pixels]: half an octave apart, and 0.
std::vector<double> half_octaves() {
  std::vector<double> all{0};
  for (int halves = -4; halves <= 4; ++halves) all.push_back(std::exp2(0.5 * halves));
  return all;
}

/// Blocks that a ray with a hit decodes at most. A judgement: one ray a pixel, 160 x 90, decoded 2
/// to 15 blocks a hit in the six volumes of bench/detail.md, with those of rays that hit nothing.
constexpr double kBlocksOfRay = 8;

/// Rays of a pixel along each axis that may be chosen: powers of two, and the most.
std::vector<std::uint32_t> all_samples(std::uint32_t most) {
  std::vector<std::uint32_t> samples;
  for (std::uint32_t each = 1; each < most; each *= 2) samples.push_back(each);
  samples.push_back(most);
  return samples;
}

/// The background at the middle of a tile, for all of it.
Appearance in_tile(Appearance appearance, const Tile &tile, std::uint32_t height) {
  if (appearance.background_top) {
    const float up = 1 - (float(tile.row) + float(tile.height) / 2) / float(height);
    appearance.background = glm::mix(appearance.background, *appearance.background_top, up);
    appearance.background_top.reset();
  }
  return appearance;
}

/// Draws tiles of a picture, and compares them with the reference.
class Tiles {
 public:
  struct Candidate {
    std::uint32_t samples = 1;
    double voxel_pixels = 0;
    double cost = 0;  ///< rays, and blocks as many rays
  };

  /// Draws the references.
  Tiles(Renderer &renderer, const FrameRequest &request, std::span<const Camera> series)
      : renderer_(renderer),
        request_(without_calls(without_light_rays(request))),
        size_(size_of(request, renderer.abilities())),
        levels_(renderer.levels()) {
    const std::vector<Camera> views = views_of(request.camera, series);
    const auto of_view = static_cast<std::uint32_t>((kNumTiles + views.size() - 1) / views.size());
    const TileSample sample = sample_tiles(size_, of_view, kTileSide);
    share_ = sample.share;
    for (const Camera &view : views) {
      for (const Tile &tile : sample.tiles) {
        references_.push_back(
            {view, camera_of(tile, view, size_), tile, in_tile(request.light, tile, size_.height)});
      }
    }
    for (Reference &reference : references_) draw_reference(reference);
    order_.resize(references_.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::mt19937 random;  // with Fisher and Yates: std::shuffle() differs between libraries
    for (std::size_t left = order_.size(); left > 1; --left)
      std::swap(order_[random() % left], order_[left - 1]);
  }

  double share() const { return share_; }  ///< TileSample::share

  /// All of them, the cheapest first.
  std::vector<Candidate> candidates(std::uint32_t most_samples) const {
    std::vector<Candidate> all;
    for (const double voxel_pixels : half_octaves()) {
      if (voxel_pixels > 0 && !has_coarser_levels(voxel_pixels)) continue;
      for (const std::uint32_t samples : all_samples(most_samples))
        all.push_back({samples, voxel_pixels, cost(samples, voxel_pixels)});
    }
    std::ranges::stable_sort(all, {}, &Candidate::cost);
    return all;
  }

  /// The errors of all tiles. If it is soon clear that their mean is above `largest`, the others'
  /// are 0.
  std::vector<double> errors(std::uint32_t samples, double voxel_pixels, double largest) {
    std::vector<double> errors(references_.size(), 0.0);
    double sum = 0;
    for (const std::size_t i : order_) {
      if (sum > largest * double(errors.size())) break;
      const Reference &reference = references_[i];
      draw(reference, samples, voxel_pixels);
      const Image8 image = renderer_.shade(reference.appearance);
      const double error = reference.flip ? reference.flip->error(image) : 0;
      errors[i] = of_first(renderer_.team(), std::vector{error}).front();
      sum += errors[i];
    }
    return errors;
  }

 private:
  struct Reference {
    Camera view, camera;  ///< of the picture, and of the tile
    Tile tile{};
    Appearance appearance{};
    std::vector<float> depth{};  ///< of a ray of each pixel
    std::optional<Flip> flip{};  ///< of a team, at rank 0
  };

  void draw(const Reference &reference, std::uint32_t samples, double voxel_pixels) {
    FrameRequest request = seen_from(reference.camera, request_);
    request.size = {reference.tile.width, reference.tile.height, samples};
    request.voxel_pixels = voxel_pixels;
    renderer_.render(request);
  }

  void draw_reference(Reference &reference) {
    draw(reference, kReferenceSamples, 0);
    if (auto &by = reference.appearance.color_by_field; by && !by->labels) {
      // All candidates have the same colours. Without a hit, there are none.
      const auto range = renderer_.field_range().value_or(std::array{0.0f, 1.0f});
      if (!by->low) by->low = range[0];
      if (!by->high) by->high = range[1] > *by->low ? range[1] : *by->low + 1;
    }
    const Image8 image = renderer_.shade(reference.appearance);
    const std::vector<float> depth = renderer_.depth();
    const std::size_t step = kReferenceSamples, columns = step * reference.tile.width;
    for (std::size_t row = step / 2; row * columns < depth.size(); row += step) {
      for (std::size_t column = step / 2; column < columns; column += step)
        reference.depth.push_back(depth[row * columns + column]);
    }
    if (!image.pixels.empty()) reference.flip.emplace(image);
  }

  /// Whether a coarser level draws anything in one of the views.
  bool has_coarser_levels(double voxel_pixels) const {
    if (!renderer_.abilities().levels) return false;
    return std::ranges::any_of(references_, [&](const Reference &reference) {
      const std::vector<FrameParams> frames =
          make_level_frames(levels_, reference.view, size_, request_.isovalue, voxel_pixels);
      return std::any_of(frames.begin() + 1, frames.end(), draws);
    });
  }

  double cost(std::uint32_t samples, double voxel_pixels) const {
    const double rays = double(samples) * samples;
    double pixels = 0;
    HitBlocks blocks;
    for (const Reference &reference : references_) {
      const std::vector<FrameParams> frames =
          make_level_frames(levels_, reference.view, size_, request_.isovalue, voxel_pixels);
      add_hit_blocks(reference.depth, levels_.front(), frames, reference.view, size_.height,
                     kBlocksOfRay * rays, blocks);
      pixels += double(reference.tile.width) * reference.tile.height;
    }
    const double own = rays * pixels + kBlockCost * blocks.with_levels;
    return of_first(renderer_.team(), std::vector{own}).front();
  }

  Renderer &renderer_;
  FrameRequest request_;
  ImageSize size_;
  std::vector<VolumeInfo> levels_;
  std::vector<Reference> references_;  ///< two by two of neighbouring parts of a view
  double share_ = 1;
  std::vector<std::size_t> order_;  ///< random, so that some show early how all are
};

double mean_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

}  // namespace

TileSample sample_tiles(ImageSize size, std::uint32_t count, std::uint32_t side) {
  // Parts, and tiles within a part. An even number of parts can be taken two by two.
  const double wished = std::sqrt(count * double(size.width) / size.height);
  const auto even = [](double number) {
    return 2 * std::max(1u, static_cast<std::uint32_t>(number / 2));
  };
  std::uint32_t columns = std::min(even(wished + 1), even(double(size.width) / kLeastTileSide));
  if (size.width < 2 * kLeastTileSide) columns = 1;
  std::uint32_t rows =
      std::min((count + columns - 1) / columns, std::max(1u, size.height / kLeastTileSide));
  if (columns == 1 && rows > 1) rows = even(rows);
  const std::uint32_t across = (size.width - 1) / (columns * side) + 1,
                      down = (size.height - 1) / (rows * side) + 1;
  TileSample sample{{}, 1.0 / (across * down)};
  std::mt19937 random;
  const auto border = [](std::uint32_t tile, std::uint32_t num_tiles, std::uint32_t length) {
    return static_cast<std::uint32_t>(std::uint64_t{tile} * length / num_tiles);
  };
  for (std::uint32_t row = 0; row < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const auto x = column * across + static_cast<std::uint32_t>(random() % across),
                 y = row * down + static_cast<std::uint32_t>(random() % down);
      Tile tile{border(x, columns * across, size.width), border(y, rows * down, size.height)};
      tile.width = border(x + 1, columns * across, size.width) - tile.column;
      tile.height = border(y + 1, rows * down, size.height) - tile.row;
      sample.tiles.push_back(tile);
    }
  }
  return sample;
}

Camera camera_of(const Tile &tile, const Camera &camera, ImageSize size) {
  const glm::dvec2 middle(tile.column + 0.5 * tile.width - 0.5 * size.width,
                          0.5 * size.height - tile.row - 0.5 * tile.height);
  const double share = double(tile.height) / size.height;
  if (camera.parallel_height) {
    Camera part = aside(camera, middle, size.height);
    part.parallel_height = *camera.parallel_height * share;
    return part;
  }
  Camera part = camera;
  part.at = point_of_ray(camera, middle, size.height, glm::length(camera.at - camera.eye));
  part.up = axes_of(camera).up;
  part.fovy_deg = glm::degrees(2 * arc_tangent(tangent(glm::radians(camera.fovy_deg) / 2) * share));
  return part;
}

double highest_mean(std::span<const double> errors, double share) {
  if (share == 1) return mean_of(errors);
  double squares = 0;
  for (std::size_t i = 0; i + 1 < errors.size(); i += 2)
    squares += (errors[i] - errors[i + 1]) * (errors[i] - errors[i + 1]);
  // The quantile of the normal distribution, and from it Student's, by Cornish and Fisher.
  const double z = 1.6448536, degrees = double(errors.size()) / 2;
  const double t = z + (std::pow(z, 3) + z) / (4 * degrees) +
                   (5 * std::pow(z, 5) + 16 * std::pow(z, 3) + 3 * z) / (96 * degrees * degrees);
  return mean_of(errors) + t * std::sqrt((1 - share) * squares) / double(errors.size());
}

DetailChoice choose_for_image(Renderer &renderer, const FrameRequest &request,
                              double max_image_error, std::span<const Camera> series) {
  check_max_image_error(max_image_error);
  check(request, renderer.abilities());
  const auto begin = std::chrono::steady_clock::now();
  const std::uint32_t most = size_of(request, renderer.abilities()).samples;
  Tiles tiles(renderer, request, series);
  DetailChoice choice;
  ImageError &image = choice.image.emplace();
  const auto keeps = [&](std::uint32_t samples, double voxel_pixels, double limit) {
    const std::vector<double> errors = tiles.errors(samples, voxel_pixels, limit);
    choice.detail.voxel_pixels = voxel_pixels;
    image.samples = samples;
    image.num_tiles = static_cast<std::uint32_t>(errors.size());
    image.mean = mean_of(errors);
    image.highest = highest_mean(errors, tiles.share());
    image.tries.push_back({samples, voxel_pixels, image.mean});
    return image.highest <= limit;
  };
  choice.reachable = false;
  std::set<double> fine_enough, too_coarse;  // with the most rays; fewer are hardly ever better
  for (const auto &[samples, voxel_pixels, cost] : tiles.candidates(most)) {
    if (too_coarse.contains(voxel_pixels)) continue;
    choice.reachable = keeps(samples, voxel_pixels, max_image_error);
    if (choice.reachable) break;
    if (samples == most || fine_enough.contains(voxel_pixels)) continue;
    const bool is_fine = keeps(most, voxel_pixels, max_image_error);
    (is_fine ? fine_enough : too_coarse).insert(voxel_pixels);
  }
  if (!choice.reachable) {
    keeps(most, 0, 1);
    choice.advice = fmt::format(
        "with {0} x {0} rays a pixel it is {1:.2g}, or up to {2:.2g}; allow more of "
        "them, up to {3} x {3}",
        most, image.mean, image.highest, kReferenceSamples);
  }
  choice.total_ms = ms_since(begin);
  return choice;
}

}  // namespace isowave::core
