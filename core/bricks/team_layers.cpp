// TeamRenderer's frames of several and translucent surfaces. A ray goes through the bricks in their
// order from the eye, so its layers are those of the first brick, then those of the second, and so
// on. A brick counts its hits up to one more than can be drawn, and a ray that has ended in a brick
// ends there in the whole, too.

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/bricks/team_renderer.hpp"
#include "core/frame/surfaces.hpp"

namespace isowave::core {

namespace {

constexpr std::uint32_t kCountBits = 5;  // of a brick's hits of a ray: at most ISO_MAX_LAYERS + 1
constexpr std::uint32_t kBricksOfWord = 64 / kCountBits;
static_assert(ISO_MAX_LAYERS + 1 < 1 << kCountBits);

/// What blend_hit() needs.
constexpr HitField kBlended[] = {HitField::kT, HitField::kCell, HitField::kGradX, HitField::kGradY,
                                 HitField::kGradZ};

/// What rank 0 blends.
struct Blending {
  Blending(const VolumeInfo &whole, const FrameRequest &request, const ImageSize &size)
      : frame(make_frame_params(whole, request.camera, size, request.isovalue)),
        light(make_shading(whole, request.light)),
        surfaces(make_layer_params(request.surfaces, {}, whole, frame.view, request.camera)),
        colors(size.num_rays(), clear_ray()) {}

  /// Returns the number of rays that have a hit.
  std::uint64_t blend(std::span<const HitRecord> hits) {
    std::uint64_t count = 0;
    for (std::size_t ray = 0; ray < hits.size(); ++ray) {
      if (!std::isfinite(hits[ray].t) || !goes_on(colors[ray])) continue;
      colors[ray] = blend_hit(&frame, &light.params, light.color_map.data(), &surfaces,
                              static_cast<uint>(ray), hits[ray], 0, 1, 1, colors[ray]);
      ++count;
    }
    return count;
  }

  FrameParams frame;
  Shading light;
  LayerParams surfaces;
  std::vector<RayColor> colors;
};

}  // namespace

void TeamRenderer::draw_layers(const FrameRequest &request, FrameStats &stats) {
  std::vector<std::vector<RayHit>> layers;
  together(team_, [&] { stats = renderer_.render_layers(request, layers); });
  stats.layers = compose_layers(request, layers);
  has_whole_ = true;
}

/// The hits of all bricks, counted by all ranks.
HitCounts TeamRenderer::count_hits(std::span<const std::vector<RayHit>> layers) {
  const std::size_t num_rays = renderer_.size().num_rays();
  HitCounts counts{std::vector<std::uint16_t>(num_rays), std::vector<std::uint16_t>(num_rays)};
  std::vector<std::uint64_t> own(num_rays);
  for (const std::vector<RayHit> &layer : layers) {
    for (const RayHit &hit : layer) ++own[hit.ray];
  }
  for (std::uint32_t first = 0; first < team_.size(); first += kBricksOfWord) {
    std::vector<std::uint64_t> words(num_rays);
    if (place_ >= first && place_ < first + kBricksOfWord) {
      for (std::size_t ray = 0; ray < num_rays; ++ray)
        words[ray] = own[ray] << kCountBits * (place_ - first);
    }
    const auto [make, take] = in_place(words);
    reduce(num_rays, Reduction::kOr, Receiver::kAll, make, take);
    for (std::size_t ray = 0; ray < num_rays; ++ray) {
      for (std::uint32_t place = first; words[ray] != 0; ++place, words[ray] >>= kCountBits) {
        const auto hits = static_cast<std::uint16_t>(words[ray] & ((1 << kCountBits) - 1));
        counts.all[ray] = static_cast<std::uint16_t>(counts.all[ray] + hits);
        if (place < place_)
          counts.before[ray] = static_cast<std::uint16_t>(counts.before[ray] + hits);
      }
    }
  }
  return counts;
}

/// Puts the layers together, one after the other, and blends them on rank 0.
LayerStats TeamRenderer::compose_layers(const FrameRequest &request,
                                        std::span<const std::vector<RayHit>> layers) {
  const HitCounts counts = count_hits(layers);
  const bool blends = team_.rank() == 0;
  std::optional<Blending> blending;
  if (blends) blending.emplace(whole_levels_.front(), request, renderer_.size());
  const std::size_t most = counts.all.empty() ? 0 : std::ranges::max(counts.all);
  std::optional<std::uint64_t> num_first_hits = 0;
  LayerStats stats;
  for (std::size_t layer = 0; layer < std::min<std::size_t>(most, ISO_MAX_LAYERS); ++layer) {
    std::vector<HitRecord> own(counts.all.size(), no_hit());
    for (std::size_t i = 0; i < layers.size(); ++i) {
      for (const RayHit &hit : layers[i]) {
        if (counts.before[hit.ray] + i == layer) own[hit.ray] = hit.hit;
      }
    }
    const std::vector<HitRecord> hits = compose_hits(own, kBlended);
    if (layer == 0) num_first_hits = num_hits_;
    if (!blends) continue;
    const std::uint64_t count = blending->blend(hits);
    stats.hits += count;
    stats.layers += count != 0 ? 1 : 0;
  }
  num_hits_ = num_first_hits;
  if (blends) {
    for (std::size_t ray = 0; ray < counts.all.size(); ++ray)
      stats.rays_cut += counts.all[ray] > ISO_MAX_LAYERS && goes_on(blending->colors[ray]) ? 1 : 0;
    renderer_.set_colors(blending->colors);
  }
  return of_first(team_, std::vector{stats}).front();
}

}  // namespace isowave::core
