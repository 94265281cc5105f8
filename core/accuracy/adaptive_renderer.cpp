#include "core/accuracy/adaptive_renderer.hpp"

#include <algorithm>
#include <chrono>
#include <span>

#include "core/accuracy/pixels_to_refine.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/host/host_loops.hpp"

namespace isowave::core {

namespace {

/// Rays that are cast at a time, about; between them, on_pass may stop the frame.
constexpr std::size_t kRaysAtATime = 1u << 20;
/// Pixels that a thread shades at a time.
constexpr std::size_t kRunPixels = 256;

}  // namespace

FrameStats AdaptiveRenderer::render(const FrameRequest &request) {
  pixels_.clear();
  hits_.clear();
  if (!request.adaptive) return inner().render(request);
  core::check(request, abilities());
  FrameRequest first = request;
  first.adaptive = false;
  first.size = first_rays(request, size_of(request, abilities()));
  bool is_stopped = false;
  if (request.on_pass) {
    first.on_pass = [&](const PassStats &pass) {
      is_stopped = !request.on_pass(pass);
      return !is_stopped;
    };
  }
  FrameStats stats = inner().render(first);
  if (is_stopped) {
    stats.cancelled = true;
    stats.complete = false;
  } else {
    refine(request, stats);
  }
  return stats;
}

void AdaptiveRenderer::refine(const FrameRequest &request, FrameStats &stats) {
  const auto begin = std::chrono::steady_clock::now();
  const ImageSize size = size_of(request, abilities());
  const FrameArrays seen = inner().fetch({.picture = true}, {});
  const std::vector<std::uint32_t> wanted =
      pixels_to_refine(size, {seen.picture.data(), seen.picture.size()});
  frame_ = make_frame_params(levels().front(), request.camera, size, request.isovalue);
  samples_ = size.samples;
  const std::size_t rays_of_pixel = std::size_t{samples_} * samples_;
  const std::size_t most = std::max<std::size_t>(kRaysAtATime / rays_of_pixel, 1);
  hits_.reserve(wanted.size() * rays_of_pixel);
  while (pixels_.size() < wanted.size()) {
    const auto part = std::span(wanted).subspan(pixels_.size());
    const auto next = part.first(std::min(most, part.size()));
    const std::vector<HitRecord> found = inner().cast_pixels(request, next);
    hits_.insert(hits_.end(), found.begin(), found.end());
    pixels_.insert(pixels_.end(), next.begin(), next.end());
    PassStats pass;
    pass.completed_percent = 100;
    if (!request.on_pass || request.on_pass(pass) || pixels_.size() == wanted.size()) continue;
    stats.cancelled = true;
    stats.complete = false;
    break;
  }
  stats.refined_pixels = pixels_.size();
  stats.refined_ms = ms_since(begin);
  stats.total_ms += stats.refined_ms;
}

FrameArrays AdaptiveRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  FrameArrays arrays = inner().fetch(wanted, appearance);
  if (!wanted.picture || pixels_.empty()) return arrays;
  const ShadeParams shading = make_shade_params(levels().front(), appearance);
  const std::size_t rays_of_pixel = std::size_t{samples_} * samples_;
  parallel_for(
      (pixels_.size() + kRunPixels - 1) / kRunPixels, 0, [&](std::uint64_t run, std::uint32_t) {
        const std::size_t begin = run * kRunPixels;
        const auto pixels = std::span<const uint>(pixels_).subspan(
            begin, std::min(kRunPixels, pixels_.size() - begin));
        host_loops().shade_pixels(frame_, shading, samples_, pixels,
                                  hits_.data() + begin * rays_of_pixel, arrays.picture.data());
      });
  return arrays;
}

}  // namespace isowave::core
