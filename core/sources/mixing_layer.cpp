// A turbulent mixing layer: a smooth step across the mid-plane of y,
//
//   s = (y + displacement) / thickness + strength * envelope(y) * turbulence
//   f = (1 + s / sqrt(1 + s^2)) / 2
//
// where displacement is large-scale and turbulence multi-octave gradient noise [Perlin 1985], the
// amplitude of an octave falling with its frequency to the power -1/3 (velocities of a k^(-5/3)
// spectrum). All of it is additions, products, quotients and roots: the same bits on every machine.
//
// Noise along x: with y and z fixed, the two lattice planes around a voxel each contribute a
// straight line in x, the same for all voxels of a lattice cell. So a row needs four hashes per
// lattice node, not eight per voxel.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/sources/field_rows.hpp"

namespace isowave::core {

namespace {

constexpr double kThickness = 0.06;             // of the step, in heights of the volume
constexpr double kDisplacement = 0.3;           // amplitude, in heights
constexpr double kDisplacementFrequency = 2.5;  // noise cells per height
constexpr std::uint32_t kDisplacementOctaves = 2;
constexpr double kStrength = 2.6;            // amplitude of the turbulence, in thicknesses
constexpr double kTurbulenceFrequency = 10;  // of the first octave
constexpr double kEnvelope = 0.14;           // half width of the turbulent zone, in heights
constexpr double kFinestCell = 4;            // voxels: the noise of the finest octave is resolved
constexpr double kAmplitudeRatio = 0.79370;  // of an octave to the one below: 2^(-1/3)

/// Smooth step with zero first and second derivatives at 0 and 1.
double fade(double t) {
  return t * t * t * (t * (t * 6 - 15) + 10);
}

std::uint64_t mix(std::uint64_t x) {  // finalizer of splitmix64 [Steele et al. 2014]
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

/// What one lattice plane x = const contributes to a row: offset + slope * (distance from the
/// plane).
struct Line {
  double offset = 0, slope = 0;
};

/// One octave of gradient noise, about -1..1, on the rows of a grid.
class Octave {
 public:
  Octave(std::uint32_t nx, double cells_per_voxel, double amplitude, std::uint64_t seed)
      : cells_per_voxel_(cells_per_voxel), amplitude_(amplitude), seed_(mix(seed)), columns_(nx) {
    // Octaves that shared lattice nodes, where noise is 0, would show the lattice.
    shift_ = double(seed_ >> 40) * 0x1p-24;
    for (std::uint32_t x = 0; x < nx; ++x) {
      const double position = x * cells_per_voxel + shift_;
      const double cell = std::floor(position);
      columns_[x] = {std::uint32_t(cell), position - cell, fade(position - cell)};
    }
  }

  /// Adds the row (y, z) to `row` [nx]; `lines` is scratch.
  void add(std::uint32_t y, std::uint32_t z, std::span<double> row,
           std::vector<Line> &lines) const {
    const double position_y = y * cells_per_voxel_ + shift_,
                 position_z = z * cells_per_voxel_ + shift_;
    const double cell_y = std::floor(position_y), cell_z = std::floor(position_z);
    lines.resize(columns_.back().cell + 2);
    for (std::uint32_t plane = 0; plane < lines.size(); ++plane) {
      lines[plane] = make_line(plane, std::uint32_t(cell_y), std::uint32_t(cell_z),
                               position_y - cell_y, position_z - cell_z);
    }
    for (std::size_t x = 0; x < row.size(); ++x) {
      const Column &column = columns_[x];
      const Line &left = lines[column.cell], &right = lines[column.cell + 1];
      const double from_left = left.offset + left.slope * column.local;
      const double from_right = right.offset + right.slope * (column.local - 1);
      row[x] += from_left + column.weight * (from_right - from_left);
    }
  }

 private:
  struct Column {
    std::uint32_t cell;
    double local, weight;
  };

  Line make_line(std::uint32_t x, std::uint32_t y, std::uint32_t z, double local_y,
                 double local_z) const {
    const std::array<double, 2> weight_y{1 - fade(local_y), fade(local_y)};
    const std::array<double, 2> weight_z{1 - fade(local_z), fade(local_z)};
    Line line;
    for (std::uint32_t corner = 0; corner < 4; ++corner) {
      const std::uint32_t dy = corner & 1, dz = corner >> 1;
      const std::uint64_t hash = mix(mix(mix(seed_ + x) + y + dy) + z + dz);
      const glm::dvec3 gradient = edge_direction(std::uint32_t(hash >> 32) % 12);
      const double weight = amplitude_ * weight_y[dy] * weight_z[dz];
      line.offset += weight * (gradient.y * (local_y - dy) + gradient.z * (local_z - dz));
      line.slope += weight * gradient.x;
    }
    return line;
  }

  /// The 12 edge midpoints of the cube [-1, 1]^3: axis-fair and exact.
  static glm::dvec3 edge_direction(std::uint32_t index) {
    const double a = index & 1 ? -1 : 1, b = index & 2 ? -1 : 1;
    if (index < 4) return {a, b, 0};
    return index < 8 ? glm::dvec3(a, 0, b) : glm::dvec3(0, a, b);
  }

  double cells_per_voxel_, amplitude_, shift_ = 0;
  std::uint64_t seed_;
  std::vector<Column> columns_;
};

class MixingLayer : public FieldRows {
 public:
  MixingLayer(const glm::uvec3 &dims, std::uint64_t seed) : height_(dims.y - 1.0) {
    double amplitude = kDisplacement / kThickness, frequency = kDisplacementFrequency;
    for (std::uint32_t i = 0; i < kDisplacementOctaves; ++i) {
      displacement_.emplace_back(dims.x, frequency / height_, amplitude, 64 * seed + i);
      frequency *= 2;
      amplitude *= 0.5;
    }
    amplitude = kStrength;
    frequency = kTurbulenceFrequency;
    for (std::uint32_t i = 0; frequency * kFinestCell <= height_; ++i) {
      turbulence_.emplace_back(dims.x, frequency / height_, amplitude, 64 * seed + 32 + i);
      frequency *= 2;
      amplitude *= kAmplitudeRatio;
    }
  }

  void evaluate(std::uint32_t y, std::uint32_t z, std::span<double> row) const override {
    thread_local std::vector<Line> lines;
    thread_local std::vector<double> turbulence;
    const double from_middle = y / height_ - 0.5;
    turbulence.assign(row.size(), 0.0);
    for (const Octave &octave : turbulence_) octave.add(y, z, turbulence, lines);
    std::fill(row.begin(), row.end(), from_middle / kThickness);
    for (const Octave &octave : displacement_) octave.add(y, z, row, lines);
    for (std::size_t x = 0; x < row.size(); ++x) {
      const double distance = row[x] * (kThickness / kEnvelope);
      const double decay = 1 + distance * distance, envelope = 1 / (decay * decay);
      const double step = row[x] + envelope * turbulence[x];
      row[x] = 0.5 + 0.5 * (step / std::sqrt(1 + step * step));
    }
  }

 private:
  double height_;  ///< of the volume, in voxels
  std::vector<Octave> displacement_, turbulence_;
};

}  // namespace

std::unique_ptr<FieldRows> make_mixing_layer(const glm::uvec3 &dims, std::uint64_t seed) {
  return std::make_unique<MixingLayer>(dims, seed);
}

}  // namespace isowave::core
