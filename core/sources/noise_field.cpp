#include "core/sources/noise_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace isowave::core {

namespace {

constexpr double kFinestCell = 4;  // voxels: the noise of the finest octave is resolved
/// Ratio of an octave's amplitude to that of the octave below, for velocities with a spectrum of
/// k^(-5/3): 2^(-1/3).
constexpr double kTurbulent = 0.79370;
constexpr std::uint32_t kAsFineAsResolved = std::numeric_limits<std::uint32_t>::max();

/// Octaves, each of twice the frequency of the one before.
struct OctaveGroup {
  double frequency;  ///< noise cells along the edge that the field is measured by
  double amplitude, ratio;
  std::uint32_t num_octaves;
};

/// Appends the group's octaves. edge: in voxels.
void add_group(const OctaveGroup &group, double edge, std::uint64_t seed, NoiseField &field) {
  double frequency = group.frequency, amplitude = group.amplitude;
  for (std::uint32_t i = 0; i < group.num_octaves; ++i) {
    if (group.num_octaves == kAsFineAsResolved && frequency * kFinestCell > edge) break;
    const std::uint64_t hash = noise_hash(seed + i);
    field.octaves.push_back({.cells_per_voxel = frequency / edge,
                             .amplitude = amplitude,
                             .shift = double(hash >> 40) * 0x1p-24,
                             .seed = hash});
    frequency *= 2;
    amplitude *= group.ratio;
  }
}

/// One octave on the rows of a grid.
class OctaveRows {
 public:
  OctaveRows(std::uint32_t nx, const NoiseOctave &octave) : octave_(octave), columns_(nx) {
    for (std::uint32_t x = 0; x < nx; ++x) {
      const double position = x * octave.cells_per_voxel + octave.shift;
      const double cell = std::floor(position);
      columns_[x] = {std::uint32_t(cell), position - cell, noise_fade(position - cell)};
    }
  }

  /// Adds the row (y, z) to `row` [nx]; `lines` is scratch.
  void add(std::uint32_t y, std::uint32_t z, std::span<double> row,
           std::vector<NoiseLine> &lines) const {
    const double position_y = y * octave_.cells_per_voxel + octave_.shift,
                 position_z = z * octave_.cells_per_voxel + octave_.shift;
    const double cell_y = std::floor(position_y), cell_z = std::floor(position_z);
    lines.resize(columns_.back().cell + 2);
    for (std::uint32_t plane = 0; plane < lines.size(); ++plane) {
      lines[plane] = noise_line(octave_.amplitude, octave_.seed, plane, std::uint32_t(cell_y),
                                std::uint32_t(cell_z), position_y - cell_y, position_z - cell_z);
    }
    for (std::size_t x = 0; x < row.size(); ++x) {
      const Column &column = columns_[x];
      row[x] +=
          noise_between(lines[column.cell], lines[column.cell + 1], column.local, column.fade);
    }
  }

 private:
  struct Column {
    std::uint32_t cell;
    double local, fade;
  };

  NoiseOctave octave_;
  std::vector<Column> columns_;
};

class NoiseRows : public FieldRows {
 public:
  NoiseRows(const NoiseField &field, std::uint32_t nx) : shape_(field.shape) {
    octaves_.reserve(field.octaves.size());
    for (const NoiseOctave &octave : field.octaves) octaves_.emplace_back(nx, octave);
  }

  void evaluate(std::uint32_t y, std::uint32_t z, std::span<double> row) const override {
    // Not kept by a thread: glibc ends the process if there is no memory to note their destructors.
    std::vector<NoiseLine> lines;
    std::vector<double> sums(row.size());  // of group b; the row has those of a
    std::ranges::fill(row, noise_begin(shape_, y));
    for (std::size_t i = 0; i < octaves_.size(); ++i)
      octaves_[i].add(y, z, i < shape_.begin_b ? row : std::span(sums), lines);
    for (std::size_t x = 0; x < row.size(); ++x)
      row[x] = noise_value(shape_, std::uint32_t(x), y, z, row[x], sums[x]);
  }

 private:
  NoiseShape shape_;
  std::vector<OctaveRows> octaves_;
};

}  // namespace

std::optional<NoiseField> make_noise_field(Field field, const glm::uvec3 &dims,
                                           std::uint64_t seed) {
  NoiseField made;
  const glm::dvec3 last = glm::dvec3(dims) - 1.0;
  made.shape.last_x = last.x;
  made.shape.last_y = last.y;
  made.shape.last_z = last.z;
  made.shape.seed = noise_hash(64 * seed + 63);
  const double edge = field == Field::kMixingLayer ? last.y : std::min({last.x, last.y, last.z});
  OctaveGroup a{}, b{};
  switch (field) {
    case Field::kMixingLayer:
      made.shape.kind = ISO_NOISE_MIXING_LAYER;
      a = {2.5, 0.3 / ISO_NOISE_THICKNESS, 0.5, 2};
      b = {10, 2.6, kTurbulent, kAsFineAsResolved};
      break;
    case Field::kTurbulence:
      made.shape.kind = ISO_NOISE_TURBULENCE;
      b = {4, 1.2, kTurbulent, kAsFineAsResolved};
      break;
    case Field::kJet:
      made.shape.kind = ISO_NOISE_JET;
      a = {5, 3, 0.6, 2};
      b = {12, 4, kTurbulent, kAsFineAsResolved};
      break;
    case Field::kScan:
    case Field::kNoisyScan:
      made.shape.kind = field == Field::kScan ? ISO_NOISE_SCAN : ISO_NOISE_NOISY_SCAN;
      a = {3, 6, 0.5, 4};
      b = {std::max(4.0, edge / 40), 1, 0.4, 2};  // walls are as thin at any size
      break;
    default:
      return {};
  }
  add_group(a, edge, 64 * seed, made);
  made.shape.begin_b = std::uint32_t(made.octaves.size());
  add_group(b, edge, 64 * seed + 32, made);
  made.shape.end = std::uint32_t(made.octaves.size());
  return made;
}

std::unique_ptr<FieldRows> make_noise_rows(NoiseField field, std::uint32_t nx) {
  return std::make_unique<NoiseRows>(field, nx);
}

}  // namespace isowave::core
