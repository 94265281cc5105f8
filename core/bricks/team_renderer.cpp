#include "core/bricks/team_renderer.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <exception>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/bricks/ranks.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/field_values.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/bounce.h"

namespace isowave::core {

namespace {

RendererOptions options_for(const TeamVolume &volume, RendererOptions options) {
  options.with_levels = volume.num_levels > 1;
  options.range_thresholds = volume.range_thresholds;
  return options;
}

/// The place that rays come from; far away for parallel rays.
glm::vec3 eye_of(const View &view) {
  if (view.is_parallel == 0) return {view.eye_x, view.eye_y, view.eye_z};
  return -0x1p100f * glm::sign(glm::vec3(view.fwd_x, view.fwd_y, view.fwd_z));
}

}  // namespace

TeamRenderer::TeamRenderer(ocl::Device &device, const TeamVolume &volume, RendererOptions options,
                           Team &team)
    : TeamRenderer(device, volume.brick, options_for(volume, std::move(options)), volume.cuts,
                   volume.levels, team) {}

TeamRenderer::TeamRenderer(ocl::Device &device, const CompressedVolume &volume,
                           const RendererOptions &options, const Cuts &cuts,
                           std::vector<VolumeInfo> whole, Team &team)
    : renderer_(device, volume, options),
      brick_(volume.info),
      cuts_(cuts),
      whole_levels_(std::move(whole)),
      num_levels_(options.with_levels ? 1 + volume.coarser_levels.size() : 1),
      team_(team) {}

/// Throws Error if one renderer of the whole would draw with levels that bricks do not have.
void TeamRenderer::check_levels(const FrameRequest &request) const {
  if (request.voxel_pixels == 0 || num_levels_ == whole_levels_.size()) return;
  const std::vector<FrameParams> frames =
      make_level_frames(whole_levels_, request.camera, size_of(request, abilities()),
                        request.isovalue, request.voxel_pixels);
  if (num_levels_ > 1 &&
      std::none_of(frames.begin() + std::ptrdiff_t(num_levels_), frames.end(), draws))
    return;
  throw Error(
      "{} bricks can be cut at {} of the {} levels of detail, and with voxels {:.3g} pixels apart "
      "the frame has coarser ones: start fewer processes, or compress it with {} levels",
      team_.size(), num_levels_, whole_levels_.size(), request.voxel_pixels, num_levels_);
}

FrameStats TeamRenderer::render(const FrameRequest &request) {
  check(request, abilities());
  check_levels(request);
  const View view = make_view(whole_levels_.front(), request.camera, size_of(request, abilities()));
  place_ = cuts_.order_from(eye_of(view))[team_.rank()];
  forget_hits();
  num_hits_.reset();
  has_whole_ = false;
  FrameRequest own = without_light_rays(request);
  if (const double num_rounds = light_rays_of(request).count();
      request.on_progress && num_rounds != 0) {
    own.on_progress = [&request, num_rounds](double percent) {
      request.on_progress(percent / (1 + num_rounds));
    };
  }
  FrameStats stats;
  if (!request.surfaces.empty()) {
    draw_layers(request, stats);
  } else {
    stats =
        draw_brick(own, [&](const FrameRequest &of_brick) { return renderer_.render(of_brick); });
    if (light_rays_of(request).count() != 0 && !stats.cancelled) add_ambient(request, stats);
  }
  stats.complete = !stats.cancelled;
  return stats;
}

/// Draws this rank's brick by draw(), with all ranks in step if pictures of passes may be asked
/// for.
FrameStats TeamRenderer::draw_brick(const FrameRequest &request, const DrawBrick &draw) {
  if (request.on_pass) return draw_in_step(request, draw);
  FrameStats stats;
  together(team_, [&] { stats = draw(request); });
  return stats;
}

/// A rank that is through goes on to take part in pictures, until all are. A rank that ends tells
/// the others, which end in their next pass.
FrameStats TeamRenderer::draw_in_step(const FrameRequest &request, const DrawBrick &draw) {
  enum State : char { kAtWork, kThrough, kStops, kFails };
  bool all_through = false, one_ends = false, stops = false;
  PassStats last;
  const auto tell = [&](State state) {
    const std::vector<std::string> states = team_.all_gather(std::string(1, state));
    const auto is = [](State wanted) {
      return [wanted](const std::string &each) { return each.front() == wanted; };
    };
    all_through = std::ranges::all_of(states, is(kThrough));
    one_ends = std::ranges::any_of(states, is(kStops)) || std::ranges::any_of(states, is(kFails));
  };
  const auto take_part = [&](State state) {
    tell(state);
    if (all_through || one_ends) return false;
    forget_hits();
    stops = !request.on_pass(last);
    return !stops;
  };
  FrameStats stats;
  FrameRequest own = request;
  own.on_pass = [&](const PassStats &pass) {
    last = pass;
    return take_part(kAtWork);
  };
  try {
    stats = draw(own);
    while (!stops && !one_ends && take_part(kThrough)) {
    }
    if (stops) tell(kStops);
  } catch (...) {
    if (!one_ends) tell(kFails);
    const auto failure = std::current_exception();
    together(team_, [&] { std::rethrow_exception(failure); });
  }
  together(team_, [] {});
  stats.cancelled = any_of(team_, stats.cancelled);
  return stats;
}

/// Calls on_pass after a round of all bricks. Returns whether the frame goes on.
bool TeamRenderer::show_round(const FrameRequest &request) {
  bool goes_on = true;
  together(team_, [&] {
    PassStats pass;
    pass.completed_percent = 100;
    goes_on = request.on_pass(pass);
  });
  return !any_of(team_, !goes_on);
}

Camera TeamRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size,
                            const Viewpoint &from) {
  std::optional<BlockBox> own;
  together(team_, [&] { own = renderer_.surface_box(isovalues); });
  return surface_camera(whole_levels_.front(), gather_box(team_, brick_, own),
                        size.value_or(abilities().largest), from);
}

/// The kept picture may fill own hits, but not those of all bricks.
void TeamRenderer::fill_from_kept() {
  renderer_.fill_from_kept();
  if (!has_whole_) forget_hits();
}

void TeamRenderer::enlarge_kept(const FrameRequest &request) {
  renderer_.enlarge_kept(request);
  if (!has_whole_) forget_hits();
}

Camera TeamRenderer::label_camera(std::span<const std::uint16_t> labels,
                                  std::optional<ImageSize> size, const Viewpoint &from) {
  if (!abilities().labels) return Renderer::label_camera(labels, size, from);
  std::optional<BlockBox> own;
  together(team_, [&] { own = renderer_.label_box(labels); });
  return surface_camera(whole_levels_.front(), gather_box(team_, brick_, own),
                        size.value_or(abilities().largest), from);
}

/// A light ray of each hit goes through the bricks of all ranks. A ray is open if it meets nothing
/// in any; rank 0 counts those.
///
/// placed  the hits of all bricks, at all ranks
void TeamRenderer::cast_round(const FrameRequest &request, std::uint32_t round,
                              std::span<const HitRecord> placed, OpenCounts &open,
                              LaterPasses &stats) {
  std::vector<std::uint64_t> blocked;
  together(team_, [&] { blocked = renderer_.blocked_rays(request, round, stats); });
  const auto [make, take] = in_place(blocked);
  reduce(blocked.size(), Reduction::kOr, Receiver::kRank0, make, take);
  const bool is_shadow = round >= light_rays_of(request).num_ambient;
  ++(is_shadow ? open.num_shadow : open.num_ambient);
  uchar *const counts = open.counts.data() + (is_shadow ? placed.size() : 0);
  for (std::size_t ray = 0; ray < placed.size(); ++ray) {
    const bool is_open = std::isfinite(placed[ray].t) && (blocked[ray / 64] >> ray % 64 & 1) == 0;
    counts[ray] = static_cast<uchar>(counts[ray] + is_open);
  }
}

/// The levels of detail that draw the frame of the whole volume.
LevelRange TeamRenderer::drawn_levels(const FrameRequest &request) const {
  const std::vector<FrameParams> frames =
      make_level_frames(std::span(whole_levels_).first(num_levels_), request.camera,
                        renderer_.size(), request.isovalue, request.voxel_pixels);
  const auto first = std::ranges::find_if(frames, draws);
  const auto end = std::find_if_not(first, frames.end(), draws);
  return {static_cast<std::size_t>(first - frames.begin()),
          static_cast<std::size_t>(end - frames.begin())};
}

/// The places of this brick in the orders in which rays go through the bricks.
std::vector<std::uint32_t> TeamRenderer::places_along(std::span<const GivenRay> rays) const {
  // Rays whose directions have the same signs go through the bricks in the same order.
  std::array<std::uint32_t, 8> place_of{};
  const auto octant_of = [](const GivenRay &ray) {
    return std::size_t{ray.d_x < 0} + 2 * std::size_t{ray.d_y < 0} + 4 * std::size_t{ray.d_z < 0};
  };
  for (std::size_t octant = 0; octant < place_of.size(); ++octant) {
    const auto begin = [&](std::size_t bit) { return (octant & bit) != 0 ? 0x1p100f : -0x1p100f; };
    place_of[octant] = cuts_.order_from({begin(1), begin(2), begin(4)})[team_.rank()];
  }
  std::vector<std::uint32_t> places(rays.size());
  std::ranges::transform(rays, places.begin(),
                         [&](const GivenRay &ray) { return place_of[octant_of(ray)]; });
  return places;
}

/// What rays meet in all bricks, at all ranks.
///
/// own   met in this brick
std::vector<HitRecord> TeamRenderer::compose_met(std::span<const HitRecord> own,
                                                 std::span<const GivenRay> rays) {
  const std::vector<std::uint32_t> places = places_along(rays);
  std::vector<HitRecord> met(own.size(), no_hit());
  for (const HitField field : kHitFields) {
    reduce(
        own.size(), Reduction::kMin, Receiver::kAll,
        [&](std::size_t begin, std::span<std::uint64_t> words) {
          field_words(own.subspan(begin, words.size()), field,
                      std::span(places).subspan(begin, words.size()), words);
        },
        [&](std::size_t begin, std::span<const std::uint64_t> words) {
          set_field(words, field, std::span(met).subspan(begin, words.size()));
        });
  }
  return met;
}

/// The nearest of what rays meet of several surfaces, with their numbers. If hits are at one place,
/// it is that of the first surface in light_order(), in the brick that the ray meets first.
std::vector<HitRecord> TeamRenderer::compose_nearest(const FrameRequest &request,
                                                     std::span<const HitRecord> own,
                                                     std::span<const GivenRay> rays) {
  constexpr int kOrderBit = 28;
  static_assert(ISO_MAX_SURFACES <= 1 << (32 - kOrderBit));
  constexpr std::uint64_t kNone = ~std::uint64_t{0};
  constexpr std::size_t kWords = 3;  // of a hit's position and gradient
  const std::vector<std::uint32_t> places = places_along(rays);
  const std::vector<std::uint32_t> innermost = innermost_first(request.surfaces);
  const std::vector<std::size_t> order = light_order(request.surfaces);
  std::vector<std::uint64_t> words(own.size(), kNone);
  std::vector<std::array<float, 2 * kWords>> sent(own.size());
  for (std::size_t ray = 0; ray < own.size(); ++ray) {
    if (!std::isfinite(own[ray].t)) continue;
    const auto at = std::ranges::find(order, surface_of(own[ray]),
                                      [&](std::size_t place) { return innermost[place]; });
    words[ray] = std::uint64_t{field_key(own[ray].t)} << 32 |
                 static_cast<std::uint64_t>(at - order.begin()) << kOrderBit | places[ray];
  }
  const std::vector<std::uint64_t> own_words = words;
  const auto [make, take] = in_place(words);
  reduce(words.size(), Reduction::kMin, Receiver::kAll, make, take);
  std::vector<std::uint64_t> parts(kWords * own.size());
  for (std::size_t ray = 0; ray < own.size(); ++ray) {
    if (words[ray] == kNone || words[ray] != own_words[ray]) continue;
    const HitRecord &hit = own[ray];
    const auto part = std::bit_cast<std::array<std::uint64_t, kWords>>(
        std::array{hit.x, hit.y, hit.z, hit.grad_x, hit.grad_y, hit.grad_z});
    std::ranges::copy(part, parts.begin() + std::ptrdiff_t(kWords * ray));
  }
  const auto [make_parts, take_parts] = in_place(parts);
  reduce(parts.size(), Reduction::kOr, Receiver::kAll, make_parts, take_parts);
  std::vector<HitRecord> met(own.size(), no_hit());
  for (std::size_t ray = 0; ray < own.size(); ++ray) {
    if (words[ray] == kNone) continue;
    HitRecord &hit = met[ray];
    std::array<std::uint64_t, kWords> part{};
    std::copy_n(parts.begin() + std::ptrdiff_t(kWords * ray), kWords, part.begin());
    const auto values = std::bit_cast<std::array<float, 2 * kWords>>(part);
    hit.t = value_of_key(static_cast<std::uint32_t>(words[ray] >> 32));
    hit.cell = level_of_given(rays[ray]);
    hit.x = values[0];
    hit.y = values[1];
    hit.z = values[2];
    hit.grad_x = values[3];
    hit.grad_y = values[4];
    hit.grad_z = values[5];
    hit = with_surface(hit, innermost[order[words[ray] >> kOrderBit & 0xF]]);
  }
  return met;
}

/// A round of ambient rays that bring light: all ranks get what the rays meet in any brick, and
/// cast rays from there towards the light. Rank 0 adds the light of those that meet nothing.
void TeamRenderer::bounce_round(const FrameRequest &request, std::uint32_t round,
                                const SentOn &sent_on, OpenCounts &open, LaterPasses &stats) {
  constexpr uint kLevelBits = (1u << ISO_SURFACE_BIT) - 1;  // of a placed_hit()'s cell
  const LightRays light_rays = light_rays_of(request);
  std::vector<HitRecord> own;
  std::vector<GivenRay> rays;
  together(team_, [&] {
    own = renderer_.met_hits(request, round, stats);
    rays = renderer_.light_rays();
  });
  const std::vector<HitRecord> met =
      request.surfaces.empty() ? compose_met(own, rays) : compose_nearest(request, own, rays);
  const VolumeInfo &level = whole_levels_[drawn_levels(request).first];
  const AmbientParams params = make_ambient_params(level, light_rays.num_ambient);
  const FrameParams frame =
      make_frame_params(level, request.camera, renderer_.size(), request.isovalue);
  const std::vector<AmbientDirection> directions = make_light_directions(light_rays);
  const std::size_t row = light_rays.num_ambient + light_row(light_rays.num_shadow, round);
  std::vector<float> brings(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!is_given(rays[i])) continue;
    const bool meets = std::isfinite(met[i].t);
    const uint pattern = ambient_pattern(&frame, static_cast<uint>(i));
    HitRecord placed = met[i];
    placed.cell &= kLevelBits;
    rays[i] = meets ? bounce_ray(&params, rays[i], placed,
                                 directions[row * ISO_AMBIENT_PATTERNS + pattern], &brings[i])
                    : no_ray();
    if (!meets) ++open.counts[i];
  }
  ++open.num_ambient;
  std::vector<std::uint64_t> blocked;
  together(team_, [&] {
    renderer_.set_light_rays(rays);
    blocked = renderer_.blocked_rays(request, round, stats, true);
  });
  const auto [make, take] = in_place(blocked);
  reduce(blocked.size(), Reduction::kOr, Receiver::kRank0, make, take);
  ++open.num_bounced;
  open.bounced.resize((open.by_color ? ISO_LAYER_SUMS : 1) * rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!is_given(rays[i]) || (blocked[i / 64] >> i % 64 & 1) != 0) continue;
    if (!open.by_color) {
      open.bounced[i] += brings[i];
      continue;
    }
    const auto num_rays = static_cast<uint>(rays.size()), ray = static_cast<uint>(i);
    const BouncedLight sum = sum_with(bounced_sum(open.bounced.data(), num_rays, ray), brings[i],
                                      sent_on(surface_of(met[i])));
    open.bounced[i] = sum.own;
    open.bounced[num_rays + i] = sum.r;
    open.bounced[2 * rays.size() + i] = sum.g;
    open.bounced[3 * rays.size() + i] = sum.b;
  }
}

/// All ranks get the hits that are seen, and each casts their rays through its brick.
void TeamRenderer::add_ambient(const FrameRequest &request, FrameStats &stats) {
  std::vector<HitRecord> own;
  together(team_, [&] {
    own_hits();
    own = renderer_.placed_hits();
  });
  const std::vector<HitRecord> placed = compose_hits(own, kHitFields, Receiver::kAll);
  const LightRays light_rays = light_rays_of(request);
  const std::vector<float> values = has_field_values() ? compose_values() : std::vector<float>();
  together(team_, [&] {
    renderer_.begin_ambient(request, placed, drawn_levels(request));
    if (!values.empty()) renderer_.set_field_values(values);
  });
  has_whole_ = true;
  OpenCounts open = no_counts(light_rays, placed.size());
  for (std::uint32_t round = 0; round < light_rays.count() && !stats.cancelled; ++round) {
    if (light_rays.bounces && round < light_rays.num_ambient) {
      bounce_round(request, round, {}, open, stats.ambient);
    } else {
      cast_round(request, round, placed, open, stats.ambient);
    }
    if (request.on_progress) request.on_progress(100.0 * (round + 2) / (light_rays.count() + 1));
    const bool is_last = round + 1 == light_rays.count();
    if (!is_last && !request.on_pass) continue;
    together(team_, [&] { renderer_.set_open(open); });
    if (request.on_pass) stats.cancelled = !show_round(request) && !is_last;
  }
  if (light_rays.bounces && !stats.cancelled)
    together(team_, [&] { renderer_.filter_bounced(request); });
}

const std::vector<float> &TeamRenderer::compose_values() {
  if (values_) return *values_;
  const std::vector<float> own = renderer_.field_values();
  const std::span<const HitRecord> hits = own_hits();
  std::vector<float> &values = values_.emplace(team_.rank() == 0 ? own.size() : 0, no_value());
  compose(
      Receiver::kRank0,
      [&](std::size_t begin, std::span<std::uint64_t> words) {
        number_words(hits.subspan(begin, words.size()), std::span(own).subspan(begin), place_,
                     words);
      },
      [&](std::size_t begin, std::span<const std::uint64_t> words) {
        set_numbers(words, std::span(values).subspan(begin));
      });
  return values;
}

/// In frames of layers, the range of the field.
std::optional<std::array<float, 2>> TeamRenderer::field_range() {
  if (!has_field_values()) return renderer_.field_range();
  std::vector<float> range;
  if (const auto found = range_of_values(compose_values()))
    range.assign(found->begin(), found->end());
  range = of_first(team_, range);
  if (range.empty()) return {};
  return {{range[0], range[1]}};
}

/// The next pass, or frame, has others.
void TeamRenderer::forget_hits() {
  own_hits_.clear();
  values_.reset();
}

std::span<const HitRecord> TeamRenderer::own_hits() {
  if (layers_so_far_) return layers_so_far_().first_hits;
  if (own_hits_.empty()) own_hits_ = renderer_.hits();
  return own_hits_;
}

void TeamRenderer::reduce(std::size_t count, Reduction how, Receiver who, const MakeWords &make,
                          const TakeWords &take) {
  const auto begin = std::chrono::steady_clock::now();
  team_.reduce(count, how, who, make, take);
  composition_.ms += ms_since(begin);
  ++composition_.reductions;
  composition_.bytes += count * sizeof(std::uint64_t);
}

void TeamRenderer::compose_colors(std::span<const std::uint32_t> colors, std::size_t channels,
                                  std::span<std::uint8_t> picture) {
  const bool in_halves = team_.size() <= kMostHalfWordBricks;
  const std::size_t per_word = in_halves ? 2 : 1;
  std::atomic<std::uint64_t> num_hits = 0;
  reduce((colors.size() + per_word - 1) / per_word,
         in_halves ? Reduction::kMinOfHalves : Reduction::kMin, Receiver::kRank0,
         [&](std::size_t begin, std::span<std::uint64_t> words) {
           const std::size_t first = per_word * begin;
           const auto own =
               colors.subspan(first, std::min(per_word * words.size(), colors.size() - first));
           (in_halves ? color_halves : color_words)(own, place_, words);
         },
         [&](std::size_t begin, std::span<const std::uint64_t> words) {
           num_hits += (in_halves ? set_half_colors : set_colors)(words, per_word * begin, channels,
                                                                  picture);
         });
  num_hits_ = num_hits;
}

void TeamRenderer::compose(Receiver who, const MakeWords &make, const TakeWords &take) {
  std::atomic<std::uint64_t> num_hits = 0;
  reduce(renderer_.size().num_rays(), Reduction::kMin, who, make,
         [&](std::size_t begin, std::span<const std::uint64_t> words) {
           take(begin, words);
           num_hits += static_cast<std::uint64_t>(std::ranges::count_if(
               words, [](std::uint64_t word) { return word >> 32 != kNoPlace; }));
         });
  num_hits_ = num_hits;
}

std::vector<HitRecord> TeamRenderer::compose_hits(std::span<const HitRecord> own,
                                                  std::span<const HitField> fields, Receiver who) {
  const bool receives = who == Receiver::kAll || team_.rank() == 0;
  std::vector<HitRecord> hits(receives ? own.size() : 0, no_hit());
  for (const HitField field : fields) {
    compose(
        who,
        [&](std::size_t begin, std::span<std::uint64_t> words) {
          field_words(own.subspan(begin, words.size()), field, place_, words);
        },
        [&](std::size_t begin, std::span<const std::uint64_t> words) {
          set_field(words, field, std::span(hits).subspan(begin, words.size()));
        });
  }
  return hits;
}

FrameArrays TeamRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  check_arrays(wanted, size());
  if (wanted.picture) check_field_colors(appearance);
  if (is_alone()) return renderer_.fetch(wanted, appearance);
  const bool receives = team_.rank() == 0;
  FrameArrays arrays;
  if (wanted.picture) arrays.picture = compose_picture(appearance);
  if (wanted.field_values) {
    const std::vector<float> &values = compose_values();
    if (receives) {
      arrays.field_values = memory_.array<float>(values.size());
      std::ranges::copy(values, arrays.field_values.data());
    }
  }
  std::vector<HitRecord> hits;
  if (wanted.normals || wanted.hits) {
    hits = this->hits();
  } else if (wanted.depth) {
    constexpr HitField kDepth[] = {HitField::kT};
    hits = compose_hits(own_hits(), kDepth);
  }
  if (receives)
    add_hit_arrays(wanted, hits, make_shade_params(brick_, appearance), nullptr, memory_, arrays);
  return arrays;
}

/// On rank 0; empty on others.
HostArray<std::uint8_t> TeamRenderer::compose_picture(const Appearance &appearance) {
  const bool receives = team_.rank() == 0;
  constexpr WantedArrays kPicture{.picture = true};
  if (layers_so_far_) return picture_so_far(appearance);
  if (has_whole_)
    return receives ? renderer_.fetch(kPicture, appearance).picture : HostArray<std::uint8_t>{};
  const bool has_values = appearance.color_by_field.has_value();
  if (renderer_.size().samples > 1 || has_values) {
    // The mean of a pixel's colours is made of more than 8 bits of each, and the colours of a field
    // may begin and end at values that all bricks' hits have.
    constexpr HitField kShaded[] = {HitField::kT, HitField::kGradX, HitField::kGradY,
                                    HitField::kGradZ};
    const std::vector<HitRecord> hits = compose_hits(own_hits(), kShaded);
    const std::vector<float> values = has_values ? compose_values() : std::vector<float>();
    if (!receives) return {};
    const std::vector<float> own_values =
        has_values ? renderer_.field_values() : std::vector<float>();
    renderer_.set_hits(hits);
    if (has_values) renderer_.set_field_values(values);
    HostArray<std::uint8_t> picture = renderer_.fetch(kPicture, appearance).picture;
    renderer_.set_hits(own_hits());  // passes may follow
    if (has_values) renderer_.set_field_values(own_values);
    return picture;
  }
  const HostArray<std::uint32_t> colors = renderer_.shade_packed(appearance);
  const std::size_t channels = appearance.transparent ? 4 : 3;
  HostArray<std::uint8_t> picture;
  if (receives) picture = memory_.array<std::uint8_t>(channels * colors.size());
  compose_colors({colors.data(), colors.size()}, channels, {picture.data(), picture.size()});
  return picture;
}

std::uint64_t TeamRenderer::num_hits(const FrameStats &stats) {
  if (!num_hits_ && is_alone()) num_hits_ = renderer_.num_hits(stats);
  if (!num_hits_) depth();
  return num_hits_.value();
}

std::vector<HitRecord> TeamRenderer::hits() {
  return compose_hits(own_hits(), kHitFields);
}

}  // namespace isowave::core
