// TeamRenderer's frames of several and translucent surfaces and of slices. Each brick finds its own
// layers, with the values and gradients of their hits. The layers of the whole are put together one
// after the other: of all bricks' next hits of a ray, the nearest is the layer's, as in
// layers_choose. Then come its light rays, through all bricks, and rank 0 blends it.
//
// Pictures of passes show the layers that bricks have so far. While a layer is lit, those behind it
// show without light rays.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

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
  uint level;     ///< its level of detail
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
    std::vector<RayHit> hits(begin);
    for (const std::vector<RayHit> &layer : layers) {
      for (const RayHit &hit : layer) hits[end_[hit.ray]++] = hit;
    }
    hits_ = std::make_shared<const std::vector<RayHit>>(std::move(hits));
  }
  /// Null: there is none left.
  const RayHit *next(std::size_t ray) const {
    return next_[ray] < end_[ray] ? &(*hits_)[next_[ray]] : nullptr;
  }
  void take(std::size_t ray) { ++next_[ray]; }

 private:
  std::vector<std::uint32_t> next_, end_;            ///< [ray]
  std::shared_ptr<const std::vector<RayHit>> hits_;  ///< copies of this have the same
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

/// While there is one, so_far() puts together what pictures show.
class TeamRenderer::ShowsLayers {
 public:
  ShowsLayers(TeamRenderer &of, std::function<const Layered &()> so_far) : of_(of) {
    of_.layers_so_far_ = std::move(so_far);
  }
  ~ShowsLayers() { of_.layers_so_far_ = {}; }
  ShowsLayers(const ShowsLayers &) = delete;
  ShowsLayers &operator=(const ShowsLayers &) = delete;

 private:
  TeamRenderer &of_;
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

  /// Puts together the layers that are left.
  void operator()(FrameStats &stats) {
    for (; find_nearest() != 0; ++layer_) {
      if (layer_ == ISO_MAX_LAYERS) {
        stats.layers.rays_cut = num_rays_ - count_of(HitOrder::kNone);
        break;
      }
      stats.cancelled |= is_stopped_;
      const std::vector<SentWords> hits = send_hits();
      const OpenCounts open = num_light_rays_ != 0 ? cast_light_rays(hits, stats) : OpenCounts{};
      const std::uint64_t count = blend(hits, open);
      stats.layers.hits += count;
      stats.layers.layers += count != 0 ? 1 : 0;
    }
  }

  Layered take() {
    const auto num_hits = static_cast<std::uint64_t>(std::ranges::count(has_hit_, true));
    return {std::move(seen_), std::move(first_hits_), num_hits, frame_};
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
      hits[ray] =
          std::bit_cast<SentWords>(SentHit{own.hit.grad_x, own.hit.grad_y, own.hit.grad_z,
                                           own.value, placed.x, placed.y, placed.z, placed.cell});
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
      placed[ray].cell = hit.level;
    }
    together(of_.team_,
             [&] { of_.renderer_.begin_ambient(request_, placed, of_.drawn_levels(request_)); });
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
      if (light_rays.bounces && round + 1 == num_light_rays_) filter_bounced(open);
      if (!request_.on_pass || shows_round(hits, open)) continue;
      is_stopped_ = true;  // the rest is as in pictures of passes
      stats.cancelled |= round + 1 < num_light_rays_;
      num_light_rays_ = 0;
    }
    return open;
  }

  void filter_bounced(OpenCounts &open) {
    together(of_.team_, [&] {
      of_.renderer_.set_open(open);
      of_.renderer_.filter_bounced(request_);
      open = of_.renderer_.open();
    });
  }

  /// Returns whether the frame goes on.
  bool shows_round(std::span<const SentWords> hits, const OpenCounts &open) {
    std::optional<Layered> shown;
    const ShowsLayers shows(of_, [&]() -> const Layered & {
      if (shown) return *shown;
      Layering so_far = *this;
      so_far.num_light_rays_ = 0;
      so_far.blend(hits, open);
      ++so_far.layer_;
      FrameStats unused;
      so_far(unused);
      return shown.emplace(so_far.take());
    });
    return of_.show_round(request_);
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
  std::uint32_t layer_ = 0;
  bool is_stopped_ = false;  ///< by on_pass
  std::vector<RayColor> seen_;
  std::vector<std::uint64_t> words_, own_words_;  ///< [ray] of the layer
  std::vector<HitRecord> first_hits_;             ///< [ray] this brick's
  std::vector<bool> has_hit_;                     ///< [ray] one that is seen
};

/// The layers of bricks that are being drawn.
class TeamRenderer::LayersOfBricks {
 public:
  LayersOfBricks(TeamRenderer &of, const FrameRequest &request) : of_(of), request_(request) {}

  FrameStats draw() {
    const ShowsLayers shows(of_, [this]() -> const Layered & { return so_far(); });
    FrameRequest in_passes = request_;
    if (request_.on_pass) {
      in_passes.on_pass = [this](const PassStats &pass) {
        ++num_passes_;
        return request_.on_pass(pass);
      };
    }
    return of_.draw_brick(in_passes, [this](const FrameRequest &request) {
      return of_.renderer_.render_layers(request, layers_);
    });
  }
  std::span<const std::vector<RayHit>> layers() const { return layers_; }

 private:
  /// Put together anew if any brick shows more than in the pass before: passes behind the first
  /// layer show nothing until the next one is whole.
  const Layered &so_far() {
    const bool is_first = layers_.empty();
    const std::vector<std::string> shown = of_.team_.all_gather(
        is_first ? "pass " + std::to_string(num_passes_) : std::to_string(layers_.size()));
    if (shown == shown_) return so_far_;
    std::vector<std::vector<RayHit>> first;
    together(of_.team_, [&] {
      if (is_first) first.push_back(of_.renderer_.first_layer_so_far(request_));
    });
    Layering layering(of_, request_, is_first ? first : layers_);
    FrameStats unused;
    layering(unused);
    so_far_ = layering.take();
    shown_ = shown;
    return so_far_;
  }

  TeamRenderer &of_;
  const FrameRequest &request_;
  std::vector<std::vector<RayHit>> layers_;
  std::uint64_t num_passes_ = 0;
  std::vector<std::string> shown_;  ///< [rank] what each brick has shown in so_far_
  Layered so_far_;
};

/// On rank 0; empty on others.
HostArray<std::uint8_t> TeamRenderer::picture_so_far(const Appearance &appearance) {
  const Layered &shown = layers_so_far_();
  num_hits_ = shown.num_hits;
  if (team_.rank() != 0) return {};
  const Image8 image =
      shade_layers_scalar(shown.frame, make_shade_params(whole_levels_.front(), appearance),
                          shown.colors, renderer_.size().samples);
  HostArray<std::uint8_t> picture = memory_.array<std::uint8_t>(image.pixels.size());
  std::ranges::copy(image.pixels, picture.data());
  return picture;
}

/// request: with light rays, which go on in other bricks.
void TeamRenderer::draw_layers(const FrameRequest &request, FrameStats &stats) {
  const FrameRequest of_bricks = without_light_rays(request);
  LayersOfBricks bricks(*this, of_bricks);
  stats = bricks.draw();
  stats.layers = {};
  Layering layering(*this, stats.cancelled ? of_bricks : request, bricks.layers());
  layering(stats);
  Layered layered = layering.take();
  if (team_.rank() == 0) renderer_.set_colors(layered.colors);
  own_hits_ = std::move(layered.first_hits);
  num_hits_ = layered.num_hits;
  has_whole_ = true;
  // Light rays have shown the whole in their last round.
  if (request.on_pass && !stats.cancelled && light_rays_of(request).count() == 0)
    show_round(request);
}

}  // namespace isowave::core
