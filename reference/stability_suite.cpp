#include "reference/stability_suite.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "core/zfp/zfp_stream.hpp"
#include "reference/random.hpp"
#include "reference/root_oracle.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core {

namespace {

using Vec = std::array<double, 3>;
using Field = std::function<double(double x, double y, double z)>;

Ray make_ray_from(const Vec &origin, const Vec &direction) {
  const auto axis = [&](int i) {
    return make_ray_axis(static_cast<float>(origin[i]), static_cast<float>(direction[i]));
  };
  return make_whole_ray(axis(0), axis(1), axis(2));
}

/// The ray through `point` along `direction`, starting `distance` before it.
Ray ray_through(const Vec &point, const Vec &direction, double distance) {
  return make_ray_from({point[0] - distance * direction[0], point[1] - distance * direction[1],
                        point[2] - distance * direction[2]},
                       direction);
}

Vec upper_corner(const StabilityScene &scene) {
  return {scene.dims[0] - 1.0, scene.dims[1] - 1.0, scene.dims[2] - 1.0};
}

StabilityScene sampled(std::array<std::uint32_t, 3> dims, float isovalue, const Field &field) {
  StabilityScene scene{dims, {}, isovalue, {}};
  for (std::uint32_t z = 0; z < dims[2]; ++z) {
    for (std::uint32_t y = 0; y < dims[1]; ++y) {
      for (std::uint32_t x = 0; x < dims[0]; ++x)
        scene.voxels.push_back(static_cast<float>(field(x, y, z)));
    }
  }
  return scene;
}

StabilityScene cell_of(const std::array<double, 8> &corners, float isovalue) {
  StabilityScene scene{{2, 2, 2}, {}, isovalue, {}};
  for (const double corner : corners) scene.voxels.push_back(static_cast<float>(corner));
  return scene;
}

/// Rays through random points of the domain, from all sides.
void add_random_rays(StabilityScene &scene, Random &random, std::uint32_t count) {
  for (std::uint32_t i = 0; i < count; ++i) {
    scene.rays.push_back(ray_through(random.in_box({0, 0, 0}, upper_corner(scene)),
                                     random.direction(), random.in(5, 50)));
  }
}

double trilinear(const StabilityScene &scene, const Vec &point) {
  const RootOracle oracle(scene.voxels, scene.dims, scene.isovalue);
  return oracle.field(point);
}

/// Smooth noise with plateaus, rounded to integers 0..255 where asked.
StabilityScene noise(std::array<std::uint32_t, 3> dims, Random &random, bool integers) {
  const Vec a = random.direction(), b = random.direction(), c = random.direction();
  return sampled(dims, 128, [=](double x, double y, double z) {
    const double value = 128 + 60 * std::sin(1.3 * (a[0] * x + a[1] * y + a[2] * z)) +
                         40 * std::sin(2.1 * (b[0] * x + b[1] * y + b[2] * z)) +
                         30 * std::sin(0.7 * (c[0] * x + c[1] * y + c[2] * z));
    return integers ? std::floor(std::clamp(value, 0.0, 255.0)) : value;
  });
}

/// Voxels in memory, for compress().
class MemoryVolume : public VolumeReader {
 public:
  explicit MemoryVolume(const StabilityScene &scene) : voxels_(scene.voxels) {
    info_.dims = {scene.dims[0], scene.dims[1], scene.dims[2]};
  }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    const std::size_t layer = std::size_t{info_.dims.x} * info_.dims.y;
    std::copy_n(voxels_.begin() + std::ptrdiff_t(z_begin * layer), num_layers * layer, out.begin());
  }

 private:
  std::span<const float> voxels_;
};

/// The scene as it comes out of a zfp stream.
void compress_and_decode(StabilityScene &scene, const CompressOptions &options) {
  MemoryVolume reader(scene);
  scene.voxels = decode_with_libzfp(compress(reader, options));
}

// The cases.

StabilityCase sign_cases(std::uint32_t rays, Random &random) {
  StabilityCase result{"256 sign cases",
                       "every pattern of corners inside and outside, ambiguous faces included",
                       {}};
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    std::array<double, 8> corners;
    for (unsigned i = 0; i < 8; ++i) corners[i] = (pattern >> i & 1u ? 1 : -1) * random.in(0.05, 1);
    result.scenes.push_back(cell_of(corners, 0));
    add_random_rays(result.scenes.back(), random, std::max(1u, rays / 256));
  }
  return result;
}

/// Isovalues at, and a few ulps around, an extremum of the field along the ray.
StabilityCase double_roots(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "double roots", "the isovalue is the extremum of the field along the ray, +- a few ulps", {}};
  while (result.scenes.size() < rays) {
    std::array<double, 8> corners;
    for (double &corner : corners) corner = random.in(-1, 1);
    StabilityScene scene = cell_of(corners, 0);
    const Vec through = random.in_box({0.3, 0.3, 0.3}, {0.7, 0.7, 0.7}),
              direction = random.direction();
    const auto value = [&](double s) {
      return trilinear(scene, {through[0] + s * direction[0], through[1] + s * direction[1],
                               through[2] + s * direction[2]});
    };
    double low = -0.25, high = 0.25;                                        // within the cell
    if ((value(0) - value(low)) * (value(0) - value(high)) <= 0) continue;  // no extremum between
    const double sign = value(0) > value(low) ? 1 : -1;
    for (int i = 0; i < 200; ++i) {
      const double third = (high - low) / 3;
      if (sign * value(low + third) < sign * value(high - third))
        low += third;
      else
        high -= third;
    }
    scene.isovalue = static_cast<float>(value(0.5 * (low + high)));
    for (int ulps = static_cast<int>(random.below(9)) - 4; ulps != 0; ulps += ulps > 0 ? -1 : 1) {
      scene.isovalue = std::nextafter(scene.isovalue, ulps > 0 ? 2.0f : -2.0f);
    }
    scene.rays.push_back(ray_through(through, direction, random.in(1, 20)));
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase triple_roots(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "triple roots", "(x-a)(y-b)(z-c) along the diagonal through its saddle point", {}};
  for (std::uint32_t i = 0; i < rays; ++i) {
    const Vec at = random.in_box({0.2, 0.2, 0.2}, {0.8, 0.8, 0.8});
    StabilityScene scene = sampled({2, 2, 2}, 0, [&](double x, double y, double z) {
      return (x - at[0]) * (y - at[1]) * (z - at[2]);
    });
    const double r = std::sqrt(1.0 / 3.0);
    const Vec direction{random.below(2) ? r : -r, random.below(2) ? r : -r,
                        random.below(2) ? r : -r};
    scene.rays.push_back(ray_through(at, direction, random.in(1, 20)));
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

/// The same saddles, missed by 1e-5 to 0.3 voxels: one crossing or three, close together.
StabilityCase near_roots(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "three near roots", "(x-a)(y-b)(z-c) along diagonals that pass its saddle point closely", {}};
  while (result.scenes.size() < rays) {
    const Vec at = random.in_box({0.3, 0.3, 0.3}, {0.7, 0.7, 0.7}), aside = random.direction();
    StabilityScene scene = sampled({2, 2, 2}, 0, [&](double x, double y, double z) {
      return (x - at[0]) * (y - at[1]) * (z - at[2]);
    });
    const double r = std::sqrt(1.0 / 3.0), offset = std::pow(10.0, random.in(-5, -0.5));
    const Vec direction{random.below(2) ? r : -r, random.below(2) ? r : -r,
                        random.below(2) ? r : -r};
    const Vec through{at[0] + offset * aside[0], at[1] + offset * aside[1],
                      at[2] + offset * aside[2]};
    scene.rays.push_back(ray_through(through, direction, random.in(1, 20)));
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase tangents(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "tangents", "rays that graze a sphere of radius 5 within a tenth of a voxel", {}};
  StabilityScene scene = sampled({16, 16, 16}, 5, [](double x, double y, double z) {
    return std::sqrt((x - 7.4) * (x - 7.4) + (y - 7.6) * (y - 7.6) + (z - 7.3) * (z - 7.3));
  });
  for (std::uint32_t i = 0; i < rays; ++i) {
    const Vec n = random.direction(), d = random.direction();
    const double along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
    Vec t{d[0] - along * n[0], d[1] - along * n[1], d[2] - along * n[2]};
    const double length = std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
    for (double &x : t) x /= length;
    const double radius = 5 + random.in(-0.1, 0.1);
    scene.rays.push_back(
        ray_through({7.4 + radius * n[0], 7.6 + radius * n[1], 7.3 + radius * n[2]}, t, 30));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase vanishing_leading_coefficient(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "leading coefficient -> 0", "nearly linear and nearly quadratic fields along the ray", {}};
  for (std::uint32_t i = 0; i < rays; ++i) {
    const Vec g = random.direction();
    const double quadratic = random.below(2) ? random.in(-1, 1) : 0;
    const double cubic = std::pow(10.0, random.in(-12, 0)) * (random.below(2) ? 1 : -1);
    StabilityScene scene = sampled({2, 2, 2}, static_cast<float>(random.in(-0.5, 0.5)),
                                   [&](double x, double y, double z) {
                                     return g[0] * (x - 0.5) + g[1] * (y - 0.5) + g[2] * (z - 0.5) +
                                            quadratic * x * y + cubic * x * y * z;
                                   });
    add_random_rays(scene, random, 1);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase constant_cells(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "constant field", "isovalue below, equal to and above a constant: never a hit", {}};
  for (const float isovalue : {6.0f, 7.0f, 8.0f, std::nextafter(7.0f, 8.0f)}) {
    StabilityScene scene = sampled({6, 5, 7}, isovalue, [](double, double, double) { return 7.0; });
    add_random_rays(scene, random, rays / 4);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase saddle_cells(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "saddle cells", "isovalue at, and close to, the value of a face's or the cell's saddle", {}};
  for (std::uint32_t i = 0; i < rays; ++i) {
    const double offset = random.below(3) ? std::pow(10.0, random.in(-8, -1)) : 0;
    StabilityScene scene =
        sampled({3, 3, 3}, static_cast<float>(offset), [&](double x, double y, double z) {
          return (x - 0.5) * (y - 0.5) + (i % 2 ? 0.25 * (z - 1) * (x - 1) : 0.0);
        });
    add_random_rays(scene, random, 1);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase isovalue_on_values(std::uint32_t rays, Random &random) {
  StabilityCase result{"isovalue on voxels",
                       "integer voxels and isovalue: vertices, edges and faces lie on the surface",
                       {}};
  for (int i = 0; i < 8; ++i) {
    StabilityScene scene = noise({13, 11, 9}, random, true);
    scene.isovalue =
        i == 0   ? *std::min_element(scene.voxels.begin(), scene.voxels.end())
        : i == 1 ? *std::max_element(scene.voxels.begin(), scene.voxels.end())
                 : scene.voxels[random.below(static_cast<std::uint32_t>(scene.voxels.size()))];
    add_random_rays(scene, random, rays / 8);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase plateaus(std::uint32_t rays, Random &random) {
  StabilityCase result{"plateaus", "two-valued voxels with the isovalue equal to one of them", {}};
  for (const float isovalue : {10.0f, 20.0f}) {
    StabilityScene scene = sampled({12, 12, 12}, isovalue, [&](double, double, double) {
      return random.below(3) ? 10.0 : 20.0;
    });
    add_random_rays(scene, random, rays / 2);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase axis_parallel(std::uint32_t rays, Random &random) {
  StabilityCase result{"zero direction components",
                       "one or two components 0, -0 or denormal; positions anywhere",
                       {}};
  StabilityScene scene = noise({18, 17, 19}, random, false);
  const double zeros[] = {0.0, -0.0, 1e-42, -1e-42, 1e-30};
  for (std::uint32_t i = 0; i < rays; ++i) {
    Vec direction = random.direction();
    const std::uint32_t axis = random.below(3);
    direction[axis] = zeros[random.below(5)];
    if (random.below(2)) direction[(axis + 1) % 3] = zeros[random.below(5)];
    scene.rays.push_back(ray_through(random.in_box({0, 0, 0}, upper_corner(scene)), direction, 40));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

/// Single voxels that reach the isovalue exactly: a ray meets them only through the very vertex.
StabilityCase single_vertices(std::uint32_t rays, Random &random) {
  StabilityCase result{"single vertices", "rays through lone voxels that equal the isovalue", {}};
  StabilityScene scene = sampled({20, 20, 20}, 0, [](double x, double y, double z) {
    return std::fmod(x, 3) == 1 && std::fmod(y, 3) == 1 && std::fmod(z, 3) == 1 ? 0.0 : -1.0;
  });
  for (std::uint32_t i = 0; i < rays; ++i) {
    Vec vertex, direction{};
    for (double &x : vertex) x = 3.0 * random.below(7) + 1;
    while (direction == Vec{}) {
      for (double &d : direction) d = static_cast<int>(random.below(5)) - 2;
    }
    scene.rays.push_back(ray_through(vertex, direction, random.below(40)));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

/// Rays through exact lattice features.
StabilityCase lattice_rays(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "rays on the lattice", "in cell planes, along edges, through vertices, along diagonals", {}};
  for (const bool integers : {false, true}) {
    StabilityScene scene = noise({18, 17, 19}, random, integers);
    for (std::uint32_t i = 0; i < rays / 2; ++i) {
      Vec point{double(random.below(18)), double(random.below(17)), double(random.below(19))};
      const int steps[] = {-2, -1, 0, 1, 2};
      Vec direction{};
      while (direction == Vec{}) {
        for (double &d : direction) d = steps[random.below(5)];
      }
      if (random.below(2)) point[random.below(3)] += 0.5;
      // Integer direction and start: every position on the way is exact in float32.
      scene.rays.push_back(ray_through(point, direction, 32));
    }
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

StabilityCase eyes_inside(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "eye inside",
      "the eye in a cell, on cell planes and on vertices; starting inside is no hit",
      {}};
  StabilityScene scene = noise({18, 17, 19}, random, true);
  for (std::uint32_t i = 0; i < rays; ++i) {
    Vec eye = random.in_box({0, 0, 0}, upper_corner(scene));
    for (double &x : eye) {
      if (random.below(2)) x = std::round(x);
    }
    scene.rays.push_back(make_ray_from(eye, random.direction()));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase eyes_on_surface(std::uint32_t rays, Random &random) {
  StabilityCase result{"eye on the surface", "the ray starts within an ulp of the isosurface", {}};
  StabilityScene scene = sampled({17, 17, 17}, 5, [](double x, double y, double z) {
    return std::sqrt((x - 8) * (x - 8) + (y - 8) * (y - 8) + (z - 8) * (z - 8));
  });
  for (std::uint32_t i = 0; i < rays; ++i) {
    const Vec d = random.direction();
    double low = 0, high = 8;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      (trilinear(scene, {8 + middle * d[0], 8 + middle * d[1], 8 + middle * d[2]}) < 5 ? low
                                                                                       : high) =
          middle;
    }
    scene.rays.push_back(
        make_ray_from({8 + low * d[0], 8 + low * d[1], 8 + low * d[2]}, random.direction()));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase far_eyes(std::uint32_t rays, Random &random, double distance) {
  StabilityCase result{"eye at " + std::to_string(static_cast<int>(distance)) + " voxels",
                       "float32 t is coarser than a cell; positions must not be",
                       {}};
  StabilityScene scene = noise({33, 31, 29}, random, false);
  for (std::uint32_t i = 0; i < rays; ++i) {
    Vec point = random.in_box({0, 0, 0}, upper_corner(scene));
    if (random.below(2)) {  // past an edge, closer than float32 tells crossings apart
      const std::uint32_t along = random.below(3);
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        if (axis != along) point[axis] = std::round(point[axis]);
      }
    }
    scene.rays.push_back(ray_through(point, random.direction(), distance));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase anisotropic(std::uint32_t rays, Random &random) {
  StabilityCase result{"spacing 1:1:1000",
                       "directions of a world whose voxels are a thousand times deeper than wide",
                       {}};
  StabilityScene scene = noise({25, 23, 9}, random, false);
  for (std::uint32_t i = 0; i < rays; ++i) {
    Vec direction = random.direction();
    direction[2] /= 1000;
    scene.rays.push_back(ray_through(random.in_box({0, 0, 0}, upper_corner(scene)), direction, 40));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase borders(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "partial blocks", "dims one to three past a multiple of four, two voxels thick", {}};
  const std::array<std::uint32_t, 3> dims[] = {{5, 6, 7}, {2, 9, 13},  {4, 4, 4},
                                               {8, 2, 5}, {17, 21, 3}, {2, 2, 2}};
  for (const auto &d : dims) {
    StabilityScene scene = noise(d, random, false);
    add_random_rays(scene, random, rays / 6);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

/// Surfaces in the planes between blocks and macrocells.
StabilityCase seams(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "block seams", "surfaces exactly in, and an ulp beside, block and macrocell borders", {}};
  for (const double plane : {4.0, 8.0, 16.0, 32.0}) {
    for (const int ulps : {-1, 0, 1}) {
      float isovalue = static_cast<float>(plane);
      if (ulps != 0) isovalue = std::nextafter(isovalue, ulps > 0 ? 1e9f : -1e9f);
      const std::uint32_t axis = random.below(3);
      StabilityScene scene = sampled({37, 37, 37}, isovalue, [&](double x, double y, double z) {
        return axis == 0 ? x : (axis == 1 ? y : z);
      });
      add_random_rays(scene, random, rays / 12);
      result.scenes.push_back(std::move(scene));
    }
  }
  return result;
}

StabilityCase extreme_values(std::uint32_t rays, Random &random, double scale, const char *name) {
  StabilityCase result{name, "squares and products of such values leave float32", {}};
  StabilityScene scene = noise({18, 17, 19}, random, false);
  for (float &v : scene.voxels) v = static_cast<float>((v - 128) * scale);
  scene.isovalue = static_cast<float>(3.7 * scale);
  add_random_rays(scene, random, rays);
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase steps(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "steps", "0 and 255 beside each other: the steepest cubics uint8 data makes", {}};
  StabilityScene scene = sampled(
      {18, 17, 19}, 128, [&](double, double, double) { return random.below(2) ? 255.0 : 0.0; });
  add_random_rays(scene, random, rays / 2);
  result.scenes.push_back(scene);
  scene.rays.clear();
  scene.isovalue = 254.9999f;
  add_random_rays(scene, random, rays / 2);
  result.scenes.push_back(std::move(scene));
  return result;
}

StabilityCase low_rates(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "uint8 at low rates",
      "plateaus and steps after zfp at 1, 2 and 4 bits per voxel, which over- and undershoots",
      {}};
  for (const std::uint32_t rate : {1u, 2u, 4u}) {
    StabilityScene scene = noise({18, 17, 19}, random, true);
    for (float &v : scene.voxels) v = v < 90 ? 0 : (v < 170 ? 128 : 255);
    compress_and_decode(scene, {.rate = rate, .input = {.num_threads = 1}});
    for (const float isovalue : {0.0f, 128.0f, 127.5f}) {
      scene.isovalue = isovalue;
      scene.rays.clear();
      add_random_rays(scene, random, rays / 9);
      result.scenes.push_back(scene);
    }
  }
  return result;
}

StabilityCase mapped_nan(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "NaN with mapping", "a fifth of the voxels NaN or infinite, mapped to a number", {}};
  for (const float replacement : {0.0f, 128.0f, -1e6f}) {
    StabilityScene scene = noise({18, 17, 19}, random, false);
    for (float &v : scene.voxels) {
      const std::uint32_t kind = random.below(15);
      if (kind == 0) v = std::numeric_limits<float>::quiet_NaN();
      if (kind == 1) v = std::numeric_limits<float>::infinity();
      if (kind == 2) v = -std::numeric_limits<float>::infinity();
    }
    compress_and_decode(scene, {.rate = 16, .input = {.map_nan = replacement, .num_threads = 1}});
    add_random_rays(scene, random, rays / 3);
    result.scenes.push_back(std::move(scene));
  }
  return result;
}

/// Rays through corners and edges of blocks and macrocells: where walks are broken off and resumed.
StabilityCase speculation_borders(std::uint32_t rays, Random &random) {
  StabilityCase result{
      "speculation borders", "rays through corners and edges of 4^3 and 16^3 blocks", {}};
  StabilityScene scene = noise({38, 37, 35}, random, false);
  for (std::uint32_t i = 0; i < rays; ++i) {
    const double size = random.below(2) ? 4 : 16;
    Vec point;
    for (double &x : point) x = size * random.below(static_cast<std::uint32_t>(34 / size) + 1);
    if (random.below(2)) point[random.below(3)] = random.in(0, 34);
    scene.rays.push_back(ray_through(point, random.direction(), random.in(0, 60)));
  }
  result.scenes.push_back(std::move(scene));
  return result;
}

}  // namespace

std::vector<StabilityCase> stability_cases(std::uint32_t rays_per_case, std::uint32_t seed) {
  Random random(seed);
  const std::uint32_t n = std::max(12u, rays_per_case);
  std::vector<StabilityCase> cases;
  cases.push_back(sign_cases(n, random));
  cases.push_back(double_roots(n, random));
  cases.push_back(triple_roots(n, random));
  cases.push_back(near_roots(n, random));
  cases.push_back(tangents(n, random));
  cases.push_back(vanishing_leading_coefficient(n, random));
  cases.push_back(constant_cells(n, random));
  cases.push_back(saddle_cells(n, random));
  cases.push_back(isovalue_on_values(n, random));
  cases.push_back(plateaus(n, random));
  cases.push_back(steps(n, random));
  cases.push_back(axis_parallel(n, random));
  cases.push_back(lattice_rays(n, random));
  cases.push_back(single_vertices(n, random));
  cases.push_back(eyes_inside(n, random));
  cases.push_back(eyes_on_surface(n, random));
  for (const double distance : {1e3, 1e4, 1e5, 1e6}) cases.push_back(far_eyes(n, random, distance));
  cases.push_back(anisotropic(n, random));
  cases.push_back(borders(n, random));
  cases.push_back(seams(n, random));
  cases.push_back(speculation_borders(n, random));
  cases.push_back(low_rates(n, random));
  cases.push_back(mapped_nan(n, random));
  cases.push_back(extreme_values(n, random, 1e-30, "values of 1e-30"));
  cases.push_back(extreme_values(n, random, 1e30, "values of 1e30"));
  return cases;
}

CaseResult run_case(const StabilityCase &stability_case, Solver solver) {
  CaseResult result;
  for (const StabilityScene &scene : stability_case.scenes) {
    const RootOracle oracle(scene.voxels, scene.dims, scene.isovalue);
    FrameParams frame{};
    frame.grid.dims_x = scene.dims[0];
    frame.grid.dims_y = scene.dims[1];
    frame.grid.dims_z = scene.dims[2];
    frame.grid.blocks_x = (scene.dims[0] + 3) / 4;
    frame.grid.blocks_y = (scene.dims[1] + 3) / 4;
    frame.grid.blocks_z = (scene.dims[2] + 3) / 4;
    frame.surface.isovalue = scene.isovalue;
    frame.view.t_scale = 1;
    for (const Ray &ray : scene.rays) {
      const HitRecord hit = trace_scalar(frame, scene.voxels, solver, ray);
      const HitRecord resumed = trace_scalar_by_blocks(frame, scene.voxels, solver, ray);
      judge(oracle, frame, ray, hit, result.accuracy);
      result.resumed_differently += std::memcmp(&hit, &resumed, sizeof hit) != 0;
    }
  }
  return result;
}

bool passes(const CaseResult &result) {
  return result.failures() == 0 && quantiles(result.accuracy.residual).p99 <= kResidualLimit;
}

}  // namespace isowave::core
