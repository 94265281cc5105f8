#include "reference/watertight_device.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/base/parallel_for.hpp"
#include "core/view/detail.hpp"
#include "reference/closed_surfaces.hpp"
#include "reference/random.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core {

namespace {

using Vec = std::array<double, 3>;

constexpr std::uint32_t kPicture = 128;  ///< pixels along each axis
constexpr int kPointsPerRay = 32;        ///< of a ray from outside, that are looked at
constexpr std::uint32_t kNumLevels = 3;
constexpr std::uint32_t kCacheSlots = 512;  ///< fewer than blocks, so that they come and go

class SurfaceReader : public VolumeReader {
 public:
  explicit SurfaceReader(const ClosedSurface &surface) : voxels_(sample_surface(surface)) {
    info_.dims = glm::uvec3(kSurfaceEdge);
  }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    constexpr std::size_t kLayer = std::size_t{kSurfaceEdge} * kSurfaceEdge;
    std::copy_n(voxels_.begin() + std::ptrdiff_t(z_begin * kLayer), num_layers * kLayer,
                out.begin());
  }

 private:
  std::vector<float> voxels_;
};

/// The decoded voxels of a compressed volume and its levels of detail, as the device has them.
GridLevels decoded_levels(const CompressedVolume &volume, bool with_levels) {
  GridLevels levels;
  for (const CompressedVolume *level : levels_of(volume, with_levels)) {
    levels.frames.push_back(make_grid_params(level->info));
    levels.voxels.push_back(decode_with_libzfp(*level));
  }
  return levels;
}

struct RandomView {
  Camera camera;
  ImageSize size{kPicture, kPicture};
  double voxel_pixels = 0;
  bool from_inside = false;
};

RandomView random_view(const GridLevels &levels, Random &random) {
  const bool lattice = random.below(3) == 0;
  RandomView view;
  view.from_inside = random.below(2) == 0;
  Vec target;
  do {
    target = random.in_box({1, 1, 1}, {kSurfaceEdge - 2, kSurfaceEdge - 2, kSurfaceEdge - 2});
    if (lattice) {
      for (double &x : target) x = std::round(2 * x) / 2;
    }
  } while (!levels.is_inside(target));
  Vec direction = random.direction();
  if (lattice) {
    do {
      for (double &d : direction) d = static_cast<int>(random.below(3)) - 1;
    } while (direction == Vec{});
  }
  const glm::dvec3 at(target[0], target[1], target[2]),
      along(direction[0], direction[1], direction[2]);
  view.camera.eye = view.from_inside ? at : at - 64.0 * along;
  view.camera.at = view.camera.eye + along;
  view.camera.up = std::abs(along.y) < 0.9 && along.y * along.y < 0.9 * glm::dot(along, along)
                       ? glm::dvec3(0, 1, 0)
                       : glm::dvec3(1, 0, 0);
  if (lattice) {
    // u and v are fractions with small divisors, many of them equal; with an odd number of pixels,
    // also 0.
    view.camera.fovy_deg = 90;
    view.size.width = view.size.height = kPicture - random.below(2);
  } else {
    view.camera.fovy_deg = view.from_inside ? random.in(20, 150) : random.in(0.5, 30);
  }
  // The first border lies 2 / (error * pixel) voxels from the eye.
  const double pixel =
      2 * std::tan(view.camera.fovy_deg * 3.141592653589793 / 360) / view.size.height;
  const double eye_distance = glm::length(view.camera.eye - at);
  view.voxel_pixels = 2 / (pixel * random.in(std::max(1.0, eye_distance - 20), eye_distance + 20));
  return view;
}

/// When the ray passes one of a few points of the volume that are inside; INFINITY if none is.
float passes_inside(const GridLevels &levels, const Ray &ray, Random &random) {
  const std::array<RayAxis, 3> axes{ray.x, ray.y, ray.z};
  double begin = 0, end = 1e9;
  for (const RayAxis &axis : axes) {
    const double o = double(axis.o), d = double(axis.d);
    if (d == 0) {
      if (o < 1 || o > kSurfaceEdge - 2) return INFINITY;
      continue;
    }
    const double near = (1 - o) / d, far = (kSurfaceEdge - 2 - o) / d;
    begin = std::max(begin, std::min(near, far));
    end = std::min(end, std::max(near, far));
  }
  for (int i = 0; i < kPointsPerRay && begin < end; ++i) {
    const double t = begin + (end - begin) * (i + random.unit()) / kPointsPerRay;
    Vec p;
    for (std::size_t axis = 0; axis < 3; ++axis)
      p[axis] = double(axes[axis].o) + t * double(axes[axis].d);
    if (levels.is_inside(p)) return static_cast<float>(t);
  }
  return INFINITY;
}

/// Adds a view's rays that had to hit, and those of them that did not.
void judge_view(const GridLevels &levels, const RandomView &view,
                const std::vector<HitRecord> &hits, std::uint64_t seed, WatertightResult &result) {
  VolumeInfo info;
  info.dims = glm::uvec3(kSurfaceEdge);
  const FrameParams frame = make_frame_params(info, view.camera, view.size, 0);
  std::atomic<std::uint64_t> rays{0}, leaks{0};
  parallel_for(view.size.height, 0, [&](std::uint64_t row, std::uint32_t) {
    Random random(seed + row);
    std::uint64_t row_rays = 0, row_leaks = 0;
    for (std::uint32_t column = 0; column < view.size.width; ++column) {
      const auto pixel = static_cast<uint>(row * view.size.width + column);
      float latest = std::numeric_limits<float>::max();
      if (!view.from_inside)
        latest = passes_inside(levels, make_ray(&frame, pixel), random) * frame.view.t_scale;
      if (!std::isfinite(latest)) continue;
      ++row_rays;
      row_leaks += !(hits[pixel].t <= latest);
    }
    rays += row_rays;
    leaks += row_leaks;
  });
  result.rays += rays;
  result.leaks += leaks;
}

}  // namespace

std::vector<WatertightResult> run_watertight_on(ocl::Device &device, const PipelinePtr &pipeline,
                                                std::uint64_t num_rays, std::uint32_t seed,
                                                Solver solver, RayBands bands, RayPackets packets) {
  const bool with_levels = bands == RayBands::kLevels;
  std::vector<WatertightResult> results;
  for (const ClosedSurface &surface : closed_surfaces()) {
    SurfaceReader reader(surface);
    const CompressedVolume volume =
        compress(reader, CompressOptions{.rate = 16, .levels = with_levels ? kNumLevels : 1});
    const GridLevels levels = decoded_levels(volume, with_levels);
    DeviceRenderer renderer(device, volume,
                            {.size = {kPicture, kPicture},
                             .pipeline = pipeline,
                             .cache_slots = kCacheSlots,
                             .solver = solver,
                             .packets = packets,
                             .with_levels = with_levels,
                             .with_shading = false});
    WatertightResult result{surface.name + std::string(with_levels ? ", levels" : "")};
    Random random(seed);
    for (std::uint64_t view_id = 0; result.rays < num_rays; ++view_id) {
      const RandomView view = random_view(levels, random);
      renderer.render({.camera = view.camera,
                       .size = view.size,
                       .voxel_pixels = with_levels ? view.voxel_pixels : 0.0,
                       .normals = Normals::kCell});
      judge_view(levels, view, renderer.hits(), (seed + view_id) * 0x9E3779B97F4A7C15u, result);
    }
    results.push_back(result);
  }
  return results;
}

}  // namespace isowave::core
