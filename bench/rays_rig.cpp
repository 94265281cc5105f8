#include "bench/rays_rig.hpp"

#include "bench/scenes.hpp"

namespace isowave::core::bench {

namespace {
constexpr std::int64_t kEdge = 256;
constexpr std::uint32_t kSpeculation = 64;

FrameSetup setup_of(std::int64_t width, bool with_given) {
  FrameSetup setup = mixing_layer_setup(kEdge, image_of_width(width), kSpeculation);
  setup.with_given = with_given;
  return setup;
}

}  // namespace

RaysRig::RaysRig(ocl::Device &device, std::int64_t width, bool with_given)
    : FrameRig(device, mixing_layer(kEdge), setup_of(width, with_given)),
      start_rays(device, rays.num_rays, kGroupSize),
      march(device, rays.num_rays, kGroupSize, kDefaultSolver),
      request_ahead(device, rays.num_rays, kGroupSize) {
  start_frame();
  num_started = read_counts().next_active_count;
  rays.open_pass();
  march(macrocells, cache, rays);
  check(read_counts().hit_count == 0 && read_counts().next_active_count == num_started,
        "waiting rays");
  request_ahead(macrocells, cache, rays);
  num_requests = read_counts().requested_count;
  check(num_requests > 0, "requests");
  draw();
  check(num_hits > 0, "hits");
}

/// The passes after the first.
void RaysRig::draw() {
  while (read_counts().next_active_count != 0) {
    rays.open_pass();
    blocks.provide(rays.previous_counts, {}, rays);
    march(macrocells, cache, rays);
    request_ahead(macrocells, cache, rays);
    num_hits += read_counts().hit_count;
  }
}

void RaysRig::start_frame() {
  rays.forget_rays();
  start_rays(macrocells, rays);
}

void RaysRig::start_first_pass() {
  start_frame();
  rays.open_pass();
}

void RaysRig::start_waiting() {
  cache.clear();
  cache.requested_bits.fill(0);
  start_first_pass();
  march(macrocells, cache, rays);
}

}  // namespace isowave::core::bench
