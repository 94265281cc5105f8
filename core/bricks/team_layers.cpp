// TeamRenderer's frames of several and translucent surfaces and of slices. Each brick finds its own
// layers, with the values and gradients of their hits. The layers of the whole are put together one
// after the other: of all bricks' next hits of a ray, the nearest is the layer's, as in
// layers_choose. Then come its light rays, through all bricks, and rank 0 blends it.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "core/bricks/team_renderer.hpp"
#include "core/frame/field_values.hpp"
#include "core/frame/surfaces.hpp"

namespace isowave::core {

namespace {

/// What all bricks need to know of a brick's hit.
struct SentHit {
  float grad_x, grad_y, grad_z;
  float value;    ///< RayHit::value
  float x, y, z;  ///< of a placed_hit(); sent if light rays begin there
  float unused;
};
/// SentHit, as far as it is sent.
constexpr std::size_t kBlendedWords = 2, kPlacedWords = 4;
using SentWords = std::array<std::uint64_t, kPlacedWords>;
static_assert(sizeof(SentHit) == sizeof(SentWords));

}  // namespace

/// A brick's hits: those of each ray in the order in which the ray meets them.
class HitsOfRays {
 public:
  HitsOfRays(std::span<const std::vector<RayHit>> layers, std::size_t num_rays)
      : next_(num_rays), end_(num_rays) {
    for (const std::vector<RayHit> &layer : layers) {
      for (const RayHit &hit : layer) ++end_[hit.ray];
    }
    std::uint32_t begin = 0;
    for (std::size_t ray = 0; ray < num_rays; ++ray) {
      next_[ray] = begin;
      begin += end_[ray];
      end_[ray] = next_[ray];
    }
    hits_.resize(begin);
    for (const std::vector<RayHit> &layer : layers) {
      for (const RayHit &hit : layer) hits_[end_[hit.ray]++] = hit;
    }
  }
  /// Null: there is none left.
  const RayHit *next(std::size_t ray) const {
    return next_[ray] < end_[ray] ? &hits_[next_[ray]] : nullptr;
  }
  void take(std::size_t ray) { ++next_[ray]; }

 private:
  std::vector<std::uint32_t> next_, end_;  ///< [ray]
  std::vector<RayHit> hits_;
};

/// Says of a ray's hits which is the nearest: that of the smallest word. The upper half is t. Below
/// it is the order in which layers_choose takes hits at one place: slices by their number, then
/// surfaces, the innermost first. Then come a bit, which is 1 if nothing is seen of the hit, and
/// the place of its brick.
class HitOrder {
 public:
  static constexpr std::uint64_t kNone = ~std::uint64_t{0};

  explicit HitOrder(const LayerParams &params, const std::vector<SurfaceStyle> &surfaces)
      : params_(params), numbers_(innermost_first(surfaces)) {}

  std::uint64_t word(const RayHit &hit, std::uint32_t place) const {
    const std::uint64_t unseen = is_unseen(&params_, hit.hit, hit.value) ? 1 : 0;
    return std::uint64_t{field_key(hit.hit.t)} << 32 | order_of(surface_of(hit.hit)) << kOrderBit |
           unseen << kUnseenBit | place;
  }
  static float t(std::uint64_t word) {
    return value_of_key(static_cast<std::uint32_t>(word >> 32));
  }
  static bool is_seen(std::uint64_t word) { return (word >> kUnseenBit & 1) == 0; }
  /// The number of a hit's surface or slice.
  std::uint32_t surface(std::uint64_t word) const {
    const auto order = static_cast<std::uint32_t>(word >> kOrderBit & 0xF);
    return order < kFirstSurface ? params_.num_surfaces + order : numbers_[order - kFirstSurface];
  }
  bool is_slice(std::uint64_t word) const { return (word >> kOrderBit & 0xF) < kFirstSurface; }

 private:
  static constexpr std::uint32_t kFirstSurface = ISO_MAX_SURFACES;  ///< slices are fewer
  static constexpr int kUnseenBit = 27, kOrderBit = 28;
  static_assert(2 * ISO_MAX_SURFACES <= 1 << (32 - kOrderBit));

  std::uint64_t order_of(std::uint32_t surface) const {
    if (surface >= params_.num_surfaces) return surface - params_.num_surfaces;
    const auto at = std::ranges::find(numbers_, surface) - numbers_.begin();
    return kFirstSurface + static_cast<std::uint64_t>(at);
  }

  const LayerParams &params_;
  std::vector<std::uint32_t> numbers_;
};

/// Puts the layers of all bricks together. Only rank 0 knows colours; all ranks know where rays
/// end.
class TeamRenderer::Layering {
 public:
  Layering(TeamRenderer &renderer, const FrameRequest &request,
           std::span<const std::vector<RayHit>> layers)
      : of_(renderer),
        request_(request),
        num_rays_(renderer.renderer_.size().num_rays()),
        num_light_rays_(light_rays_of(request).count()),
        frame_(make_frame_params(renderer.whole_levels_.front(), request.camera,
                                 renderer.renderer_.size(), request.isovalue)),
        shading_(make_layer_shading(
            renderer.whole_levels_.front(), request,
            request.field_values ? renderer.renderer_.field_range() : std::nullopt)),
        params_(make_layer_params(request.surfaces, request.slices, renderer.whole_levels_.front(),
                                  frame_.view, request.camera)),
        order_(params_, request.surfaces),
        own_(layers, num_rays_),
        seen_(num_rays_, clear_ray()),
        words_(num_rays_),
        first_hits_(num_rays_, no_hit()),
        has_hit_(num_rays_) {}

  void operator()(FrameStats &stats) {
    for (std::uint32_t layer = 0; find_nearest() != 0; ++layer) {
      if (layer == ISO_MAX_LAYERS) {
        stats.layers.rays_cut = num_rays_ - count_of(HitOrder::kNone);
        break;
      }
      const std::vector<SentWords> hits = send_hits();
      const OpenCounts open = num_light_rays_ != 0 ? cast_light_rays(hits, stats) : OpenCounts{};
      const std::uint64_t count = blend(hits, open);
      stats.layers.hits += count;
      stats.layers.layers += count != 0 ? 1 : 0;
    }
  }

  const std::vector<RayColor> &colors() const { return seen_; }  ///< at rank 0
  std::vector<HitRecord> take_first_hits() { return std::move(first_hits_); }
  std::uint64_t num_first_hits() const {
    return static_cast<std::uint64_t>(std::ranges::count(has_hit_, true));
  }

 private:
  std::size_t count_of(std::uint64_t word) const {
    return static_cast<std::size_t>(std::ranges::count(words_, word));
  }

  /// Makes words_ those of the nearest hits. Returns the number of rays that have one.
  std::size_t find_nearest() {
    for (std::size_t ray = 0; ray < num_rays_; ++ray) {
      const RayHit *hit = goes_on(seen_[ray]) ? own_.next(ray) : nullptr;
      words_[ray] = hit == nullptr ? HitOrder::kNone : order_.word(*hit, of_.place_);
    }
    own_words_ = words_;
    const auto [make, take] = in_place(words_);
    of_.reduce(num_rays_, Reduction::kMin, Receiver::kAll, make, take);
    return num_rays_ - count_of(HitOrder::kNone);
  }

  /// Takes this brick's hits of the layer, and sends them. Returns all bricks' to the receiver.
  std::vector<SentWords> send_hits() {
    std::vector<SentWords> hits(num_rays_);
    for (std::size_t ray = 0; ray < num_rays_; ++ray) {
      if (words_[ray] == HitOrder::kNone || words_[ray] != own_words_[ray]) continue;
      const RayHit &own = *own_.next(ray);
      const HitRecord placed = of_.renderer_.placed(own.hit);
      hits[ray] = std::bit_cast<SentWords>(SentHit{own.hit.grad_x, own.hit.grad_y, own.hit.grad_z,
                                                   own.value, placed.x, placed.y, placed.z, 0});
      if (HitOrder::is_seen(words_[ray]) && !has_hit_[ray]) first_hits_[ray] = own.hit;
      own_.take(ray);
    }
    for (std::size_t ray = 0; ray < num_rays_; ++ray)
      has_hit_[ray] =
          has_hit_[ray] || (words_[ray] != HitOrder::kNone && HitOrder::is_seen(words_[ray]));
    const bool is_lit = num_light_rays_ != 0;
    const std::size_t num_words = is_lit ? kPlacedWords : kBlendedWords;
    of_.reduce(
        num_words * num_rays_, Reduction::kOr, is_lit ? Receiver::kAll : Receiver::kRank0,
        [&](std::size_t begin, std::span<std::uint64_t> words) {
          for (std::size_t i = 0; i < words.size(); ++i)
            words[i] = hits[(begin + i) / num_words][(begin + i) % num_words];
        },
        [&](std::size_t begin, std::span<const std::uint64_t> words) {
          for (std::size_t i = 0; i < words.size(); ++i)
            hits[(begin + i) / num_words][(begin + i) % num_words] = words[i];
        });
    return hits;
  }

  OpenCounts cast_light_rays(std::span<const SentWords> hits, FrameStats &stats) {
    std::vector<HitRecord> placed(num_rays_, no_hit());
    for (std::size_t ray = 0; ray < num_rays_; ++ray) {
      if (words_[ray] == HitOrder::kNone || order_.is_slice(words_[ray])) continue;
      const auto hit = std::bit_cast<SentHit>(hits[ray]);
      placed[ray] = hit_of(words_[ray], hit);
      placed[ray].x = hit.x;
      placed[ray].y = hit.y;
      placed[ray].z = hit.z;
      placed[ray].cell = 0;  // the finest level of detail
    }
    together(of_.team_, [&] { of_.renderer_.begin_ambient(request_, placed, {0, 1}); });
    const LightRays light_rays = light_rays_of(request_);
    const SentOn sent_on = [this](std::uint32_t surface) {
      return isowave::core::sent_on(shading_.params.has_map, &params_, surface);
    };
    OpenCounts open = no_counts(light_rays, num_rays_);
    open.by_color = true;
    for (std::uint32_t round = 0; round < num_light_rays_; ++round) {
      if (light_rays.bounces && round < light_rays.num_ambient) {
        of_.bounce_round(request_, round, sent_on, open, stats.ambient);
      } else {
        of_.cast_round(request_, round, placed, open, stats.ambient);
      }
    }
    if (light_rays.bounces) {
      together(of_.team_, [&] {
        of_.renderer_.set_open(open);
        of_.renderer_.filter_bounced(request_);
        open = of_.renderer_.open();
      });
    }
    return open;
  }

  /// Returns the number of hits that are seen.
  std::uint64_t blend(std::span<const SentWords> hits, const OpenCounts &open) {
    const bool blends = of_.team_.rank() == 0;
    const LightOfHits light = open.of_hits();
    std::uint64_t count = 0;
    for (std::size_t ray = 0; ray < num_rays_; ++ray) {
      const std::uint64_t word = words_[ray];
      if (word == HitOrder::kNone || !HitOrder::is_seen(word)) continue;
      ++count;
      if (!blends) {  // such a rank knows no more than where rays end
        seen_[ray].transmittance *= 1.0f - params_.surfaces[order_.surface(word)].opacity;
        continue;
      }
      const auto hit = std::bit_cast<SentHit>(hits[ray]);
      const auto place = static_cast<uint>(ray);
      seen_[ray] = blend_hit(&frame_, &shading_.params, shading_.color_map.data(), &params_, place,
                             hit_of(word, hit), hit.value,
                             light_of_hit(&light, static_cast<uint>(num_rays_), place), seen_[ray]);
    }
    return count;
  }

  HitRecord hit_of(std::uint64_t word, const SentHit &sent) const {
    HitRecord hit = no_hit();
    hit.t = HitOrder::t(word);
    hit.block_id = 0;  // blocks are a brick's own
    hit.cell = order_.surface(word) << ISO_SURFACE_BIT;
    hit.grad_x = sent.grad_x;
    hit.grad_y = sent.grad_y;
    hit.grad_z = sent.grad_z;
    return hit;
  }

  TeamRenderer &of_;
  const FrameRequest &request_;
  std::size_t num_rays_;
  std::uint32_t num_light_rays_;
  FrameParams frame_;
  Shading shading_;
  LayerParams params_;
  HitOrder order_;
  HitsOfRays own_;
  std::vector<RayColor> seen_;
  std::vector<std::uint64_t> words_, own_words_;  ///< [ray] of the layer
  std::vector<HitRecord> first_hits_;             ///< [ray] this brick's
  std::vector<bool> has_hit_;                     ///< [ray] one that is seen
};

/// request: with light rays, which go on in other bricks.
void TeamRenderer::draw_layers(const FrameRequest &request, FrameStats &stats) {
  std::vector<std::vector<RayHit>> layers;
  together(team_, [&] { stats = renderer_.render_layers(without_light_rays(request), layers); });
  stats.layers = {};
  Layering layering(*this, request, layers);
  layering(stats);
  if (team_.rank() == 0) renderer_.set_colors(layering.colors());
  own_hits_ = layering.take_first_hits();
  num_hits_ = layering.num_first_hits();
  has_whole_ = true;
}

}  // namespace isowave::core
