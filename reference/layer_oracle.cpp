#include "reference/layer_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "core/base/parallel_for.hpp"

namespace isowave::core {

namespace {

/// Distance of a hit from the oracle's, unless the surface is all the way between them [voxels].
constexpr double kSameCrossing = 1e-4;
/// A ray ends where less of what lies behind would be seen, or after so many hits.
constexpr double kLeastTransmittance = 1.0 / 512;
constexpr std::size_t kMostHits = 16;
/// Rounding of a product of up to 16 float32 numbers.
constexpr double kProductRounding = 0x1p-19;
/// Stretches of a ray on which the field is compared with the isovalue: as long as this, in steps.
constexpr double kLongestStretch = 4;  // [voxels]
constexpr int kSteps = 32;

glm::dvec3 point_at(const OracleRay &ray, double t) {
  const auto [x, y, z] = ray.origin;
  const auto [dx, dy, dz] = ray.direction;
  return glm::dvec3(x, y, z) + t * glm::dvec3(dx, dy, dz);
}

/// Is the field the isovalue from a to b, as far as float32 can tell?
bool is_on_surface_between(const LayerOracle &oracle, std::size_t surface, const OracleRay &ray,
                           double a, double b) {
  if (std::abs(b - a) * speed_of(ray) > kLongestStretch) return false;
  const BlockGrid &grid = oracle.frame(surface).grid;
  const glm::dvec3 last_cell = glm::dvec3(grid.dims_x, grid.dims_y, grid.dims_z) - 2.0;
  for (int i = 0; i <= kSteps; ++i) {
    const glm::dvec3 point = point_at(ray, a + (b - a) * i / kSteps);
    const glm::ivec3 cell(glm::clamp(glm::floor(point), glm::dvec3(0), last_cell));
    if (!is_on_surface(oracle.surface(surface), point, cell, oracle.isovalue(surface)))
      return false;
  }
  return true;
}

}  // namespace

LayerOracle::LayerOracle(const VolumeInfo &info, const Camera &camera, ImageSize size,
                         const Clip &clip, std::span<const SurfaceStyle> surfaces,
                         const std::vector<float> &voxels)
    : is_clipped_(!clip.planes.empty()) {
  for (const SurfaceStyle &surface : surfaces) {
    frames_.push_back(make_frame_params(info, camera, size, surface.isovalue));
    opacities_.push_back(surface.opacity);
  }
  for (const FrameParams &frame : frames_)
    clips_.emplace_back(info, camera, clip, std::span(&frame, 1), std::span(&voxels, 1));
}

LayerTruth LayerOracle::crossings(std::size_t surface, const OracleRay &ray) const {
  const double scale = frames_[surface].view.t_scale;
  LayerTruth truth;
  RayPart surely, possibly;  // in the ray's t
  if (is_clipped_) {
    const KeptPart kept = clips_[surface].kept(ray, scale);
    if (kept.possibly.begin > kept.possibly.end) return truth;
    surely = {kept.surely.begin / scale, kept.surely.end / scale};
    possibly = {kept.possibly.begin / scale, kept.possibly.end / scale};
    const ClipTruth first = clips_[surface].first_hit({&ray, 1});
    truth.undecided = first.kind == ClipTruth::kUndecided;
    if (truth.undecided) return truth;
    if (first.kind == ClipTruth::kCap) {
      truth.crossings.push_back({first.begin / scale, first.end / scale, true, false, true, false});
      truth.begun_by = first.begun_by;
    }
  }
  for (const OracleChange &change :
       this->surface(surface).changes(ray, std::max(possibly.begin, 0.0))) {
    if (change.t > possibly.end) break;
    truth.crossings.push_back(
        {change.t, change.t, change.enters, change.behind_gap, false, change.t >= surely.end});
  }
  return truth;
}

namespace {

/// What is wrong with a renderer's ray; the count that it belongs to. None: nothing.
using LayerFault = std::uint64_t LayerAccuracy::*;

/// A hit of a renderer.
struct Seen {
  HitRecord record{};
  std::size_t surface = 0;
  RendererHit hit;
};

/// The hits of one ray before the oracle.
class RayJudge {
 public:
  RayJudge(const LayerOracle &oracle, const OracleRay &ray, std::vector<Seen> seen)
      : oracle_(oracle), ray_(ray), speed_(speed_of(ray)), seen_(std::move(seen)) {}

  /// first_only: only the first hit is known.
  LayerFault judge(bool first_only);
  bool is_undecided() const { return undecided_; }
  bool is_cut() const { return cut_; }

 private:
  LayerFault fault_of_places() const;
  LayerFault fault_of_order() const;
  LayerFault fault_of_surface(std::size_t surface);
  LayerFault fault_of_match(const LayerTruth &truth, const LayerCrossing &crossing,
                            const Seen &seen) const;
  bool is_between(std::size_t surface, double a, double b) const {
    return is_on_surface_between(oracle_, surface, ray_, a, b);
  }
  bool is_shallow(std::size_t surface, std::span<const LayerCrossing> crossings) const {
    return crossings.size() > 1 && !crossings[0].is_cap &&
           is_between(surface, crossings[0].begin, crossings[1].begin);
  }
  bool is_shallow(std::size_t surface, std::span<const Seen *const> seen) const {
    return seen.size() > 1 && is_between(surface, seen[0]->hit.t, seen[1]->hit.t);
  }
  bool is_same(std::size_t surface, const LayerCrossing &crossing, const Seen &seen) const {
    const double t = seen.hit.t;
    return (std::max(crossing.begin - t, t - crossing.end) * speed_ <= kSameCrossing) ||
           (!crossing.is_cap && is_between(surface, t, crossing.begin));
  }
  bool is_at_border(std::size_t surface, double t) const;
  bool is_touched(const LayerTruth &truth, const Seen &seen) const;
  LayerFault fault_of_mismatch(const LayerCrossing *crossing, const Seen &seen) const;

  const LayerOracle &oracle_;
  const OracleRay &ray_;
  double speed_;
  std::vector<Seen> seen_;
  bool ended_ = false;  ///< though there may be more crossings
  bool undecided_ = false, cut_ = false;
};

LayerFault RayJudge::fault_of_places() const {
  for (const Seen &seen : seen_) {
    if (seen.surface >= oracle_.num_surfaces()) return &LayerAccuracy::wrong_surfaces;
    const auto [least, most] = std::minmax({seen.record.x, seen.record.y, seen.record.z});
    if (!(least >= 0 && most <= 1) ||
        !place_fits(oracle_.frame(seen.surface), ray_, seen.record, seen.hit))
      return &LayerAccuracy::wrong_places;
  }
  return nullptr;
}

LayerFault RayJudge::fault_of_order() const {
  for (std::size_t i = 1; i < seen_.size(); ++i) {
    const Seen &before = seen_[i - 1], &now = seen_[i];
    if (before.surface == now.surface) {  // two crossings may round to the same t, or beyond it
      if ((before.hit.t - now.hit.t) * speed_ > kSameCrossing) return &LayerAccuracy::wrong_order;
      continue;
    }
    const bool inner_first = oracle_.isovalue(before.surface) > oracle_.isovalue(now.surface);
    if (before.record.t > now.record.t || (before.record.t == now.record.t && !inner_first))
      return &LayerAccuracy::wrong_order;
  }
  return nullptr;
}

/// Is the surface all the way from t to where the ray's data, or what is kept of them, begin or
/// end?
bool RayJudge::is_at_border(std::size_t surface, double t) const {
  const RootOracle &field = oracle_.surface(surface);
  std::vector<double> borders = field.borders(ray_);
  const double scale = oracle_.frame(surface).view.t_scale;
  const KeptPart kept = oracle_.clip(surface).kept(ray_, scale);
  for (const double plane : {kept.possibly.begin, kept.possibly.end}) {
    if (std::isfinite(plane)) borders.push_back(plane / scale);
  }
  return std::ranges::any_of(borders,
                             [&](double border) { return is_between(surface, t, border); });
}

/// Does the ray nearly touch the surface at a hit, where it has no crossing?
bool RayJudge::is_touched(const LayerTruth &truth, const Seen &seen) const {
  const auto is_crossing = [&](const LayerCrossing &crossing) {
    return is_same(seen.surface, crossing, seen);
  };
  return is_between(seen.surface, seen.hit.t, seen.hit.t) &&
         std::ranges::none_of(truth.crossings, is_crossing);
}

LayerFault RayJudge::fault_of_match(const LayerTruth &truth, const LayerCrossing &crossing,
                                    const Seen &seen) const {
  const bool is_cap = (seen.record.cell & ISO_CAP) != 0;
  if (is_cap != crossing.is_cap) return &LayerAccuracy::wrong_kinds;
  if (!is_cap) return nullptr;
  const double scale = oracle_.frame(seen.surface).view.t_scale;
  if (seen.record.t < crossing.begin * scale || seen.record.t > crossing.end * scale)
    return &LayerAccuracy::wrong_places;
  return is_cap_gradient(oracle_.clip(seen.surface), seen.record, truth.begun_by)
             ? nullptr
             : &LayerAccuracy::wrong_gradients;
}

/// crossing: the next of the hit's surface, or none.
LayerFault RayJudge::fault_of_mismatch(const LayerCrossing *crossing, const Seen &seen) const {
  if (crossing != nullptr) {
    const double behind = (seen.hit.t - crossing->end) * speed_;
    if (std::abs(behind) <= kSameHit) return &LayerAccuracy::wrong_places;
    if (behind > 0) return &LayerAccuracy::missed;
  }
  for (std::size_t other = 0; other < oracle_.num_surfaces(); ++other) {
    for (const LayerCrossing &c : oracle_.crossings(other, ray_).crossings) {
      if (other != seen.surface && is_same(other, c, seen)) return &LayerAccuracy::wrong_surfaces;
    }
  }
  return &LayerAccuracy::false_hits;
}

LayerFault RayJudge::fault_of_surface(std::size_t surface) {
  const LayerTruth truth = oracle_.crossings(surface, ray_);
  if (truth.undecided) {
    undecided_ = true;
    return nullptr;
  }
  std::span<const LayerCrossing> left = truth.crossings;
  std::vector<const Seen *> of_surface;
  for (const Seen &seen : seen_) {
    if (seen.surface == surface) of_surface.push_back(&seen);
  }
  std::optional<bool> inside;  // behind the crossing before
  const auto pass = [&](const LayerCrossing &crossing) {
    const bool alternates =
        crossing.behind_gap || inside.value_or(!crossing.enters) != crossing.enters;
    inside = crossing.enters;
    left = left.subspan(1);
    return alternates;
  };
  const auto pass_pair = [&] {
    undecided_ = true;
    const bool first = pass(left[0]);
    return first && pass(left[0]);
  };
  const auto pass_at_border = [&] {
    undecided_ = true;
    inside = std::nullopt;
    left = left.subspan(1);
  };
  for (std::span<const Seen *const> hits = of_surface; !hits.empty();) {
    const Seen &seen = *hits[0];
    if (!left.empty() && is_same(surface, left[0], seen)) {
      if (left[0].may_be_cut) undecided_ = true;
      if (const LayerFault fault = fault_of_match(truth, left[0], seen)) return fault;
      if (!pass(left[0])) return &LayerAccuracy::wrong_sides;
      hits = hits.subspan(1);
    } else if (is_shallow(surface, left)) {
      if (!pass_pair()) return &LayerAccuracy::wrong_sides;
    } else if (is_shallow(surface, hits)) {
      undecided_ = true;
      hits = hits.subspan(2);
    } else if (ended_ && hits.size() == 1 && is_touched(truth, seen)) {
      undecided_ = true;  // the other one of a pair is not drawn
      hits = {};
    } else if (!left.empty() && !left[0].is_cap && is_at_border(surface, left[0].begin)) {
      pass_at_border();
    } else if (is_at_border(surface, seen.hit.t)) {
      undecided_ = true;
      hits = hits.subspan(1);
    } else {
      return fault_of_mismatch(left.empty() ? nullptr : &left[0], seen);
    }
  }
  while (!left.empty() && (!ended_ || left[0].begin <= seen_.back().hit.t)) {
    if (is_shallow(surface, left)) {
      if (!pass_pair()) return &LayerAccuracy::wrong_sides;
    } else if (!left[0].is_cap && is_at_border(surface, left[0].begin)) {
      pass_at_border();
    } else {
      break;
    }
  }
  if (left.empty()) return nullptr;
  if (left[0].may_be_cut) {
    undecided_ = true;
    return nullptr;
  }
  if (!ended_) return &LayerAccuracy::missed;
  cut_ = true;
  const double last = seen_.back().hit.t;
  const bool is_before = (last - left[0].end) * speed_ > kSameCrossing;
  return is_before && !is_between(surface, left[0].begin, last) ? &LayerAccuracy::missed : nullptr;
}

LayerFault RayJudge::judge(bool first_only) {
  if (const LayerFault fault = fault_of_places()) return fault;
  if (const LayerFault fault = fault_of_order()) return fault;
  double transmittance = 1;
  for (const Seen &seen : seen_) {
    if (transmittance < kLeastTransmittance * (1 - kProductRounding))
      return &LayerAccuracy::false_hits;
    transmittance *= 1 - oracle_.opacity(seen.surface);
  }
  const bool is_full = seen_.size() >= kMostHits;
  ended_ = is_full || transmittance < kLeastTransmittance * (1 + kProductRounding) ||
           (first_only && !seen_.empty());
  for (std::size_t surface = 0; surface < oracle_.num_surfaces(); ++surface) {
    if (const LayerFault fault = fault_of_surface(surface)) return fault;
  }
  cut_ = cut_ && is_full && transmittance >= kLeastTransmittance;
  return nullptr;
}

void judge_ray(const LayerOracle &oracle, std::span<const std::vector<HitRecord>> layers,
               std::uint32_t pixel, bool first_only, LayerAccuracy &tally) {
  const OracleRay ray = exact_ray(make_ray(&oracle.frame(0), pixel));
  std::vector<Seen> seen;
  bool has_hole = false;
  for (std::size_t layer = 0; layer < layers.size(); ++layer) {
    HitRecord record = layers[layer][pixel];
    if (!std::isfinite(record.t)) continue;
    has_hole = has_hole || seen.size() != layer;
    seen.push_back(
        {record, record.cell >> ISO_SURFACE_BIT, renderer_hit(oracle.frame(0), ray, record)});
    ++((record.cell & ISO_CAP) != 0 ? tally.caps : tally.hits);
  }
  ++tally.rays;
  tally.most_hits = std::max<std::uint64_t>(tally.most_hits, seen.size());
  RayJudge judge(oracle, ray, std::move(seen));
  const LayerFault fault = has_hole ? &LayerAccuracy::wrong_order : judge.judge(first_only);
  if (fault == nullptr) {
    tally.undecided += judge.is_undecided();
    tally.cut += judge.is_cut();
    return;
  }
  ++(tally.*fault);
  tally.failed.push_back(pixel);
}

LayerAccuracy judge_all(const LayerOracle &oracle, std::span<const std::vector<HitRecord>> layers,
                        bool first_only) {
  const View &view = oracle.frame(0).view;
  const std::size_t num_rays = std::size_t{view.width} * view.height;
  for (const std::vector<HitRecord> &layer : layers) {
    if (layer.size() != num_rays)
      throw std::invalid_argument("judge_layers: the hits do not fit the frame");
  }
  std::vector<LayerAccuracy> tallies(thread_count(0));
  parallel_for(view.height, 0, [&](std::uint64_t row, std::uint32_t thread) {
    for (std::uint32_t column = 0; column < view.width; ++column) {
      judge_ray(oracle, layers, static_cast<std::uint32_t>(row * view.width + column), first_only,
                tallies[thread]);
    }
  });
  LayerAccuracy sum;
  for (const LayerAccuracy &tally : tallies) merge(sum, tally);
  std::ranges::sort(sum.failed);
  return sum;
}

}  // namespace

void merge(LayerAccuracy &into, const LayerAccuracy &from) {
  for (const auto count :
       {&LayerAccuracy::rays, &LayerAccuracy::hits, &LayerAccuracy::caps, &LayerAccuracy::missed,
        &LayerAccuracy::false_hits, &LayerAccuracy::wrong_order, &LayerAccuracy::wrong_surfaces,
        &LayerAccuracy::wrong_sides, &LayerAccuracy::wrong_kinds, &LayerAccuracy::wrong_places,
        &LayerAccuracy::wrong_gradients, &LayerAccuracy::undecided, &LayerAccuracy::cut})
    into.*count += from.*count;
  into.most_hits = std::max(into.most_hits, from.most_hits);
  into.failed.insert(into.failed.end(), from.failed.begin(), from.failed.end());
}

LayerAccuracy judge_layers(const LayerOracle &oracle,
                           std::span<const std::vector<HitRecord>> layers) {
  return judge_all(oracle, layers, false);
}

LayerAccuracy judge_first_layer(const LayerOracle &oracle, const std::vector<HitRecord> &hits) {
  return judge_all(oracle, {&hits, 1}, true);
}

}  // namespace isowave::core
