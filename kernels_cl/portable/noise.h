/// noise.h -- synthetic fields of gradient noise [Perlin 1985], in double precision.
///
/// Portable: OpenCL C 1.2 with cl_khr_fp64, and C++. All of it is additions, products, quotients
/// and roots: the same bits on every machine.
///
/// A field sums two groups of octaves at a voxel, and noise_value() makes its value of the sums.
/// Noise along x: with y and z fixed, the two lattice planes around a voxel each contribute a
/// straight line in x, the same for all voxels of a lattice cell. So a row needs four hashes per
/// lattice node, not eight per voxel.
#ifndef ISOWAVE_NOISE_H
#define ISOWAVE_NOISE_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

/// One octave of gradient noise, about -amplitude..amplitude.
typedef struct NoiseOctave {
  double cells_per_voxel;
  double amplitude;
  double shift;  ///< of the lattice, in cells: shared nodes, where noise is 0, would show
  ulong seed;
} NoiseOctave;
ISO_CHECK_SIZE(NoiseOctave, 32);

/// The contribution of one lattice plane x = const to a row: offset + slope * (distance from the
/// plane).
typedef struct NoiseLine {
  double offset, slope;
} NoiseLine;

#define ISO_NOISE_MIXING_LAYER 0u
#define ISO_NOISE_TURBULENCE 1u
#define ISO_NOISE_JET 2u
#define ISO_NOISE_SCAN 3u
#define ISO_NOISE_NOISY_SCAN 4u

/// A field and its grid.
typedef struct NoiseShape {
  double last_x, last_y, last_z;  ///< voxels along each axis, less one
  ulong seed;                     ///< of what is drawn for each voxel
  uint kind;                      ///< ISO_NOISE_...
  uint begin_b;                   ///< the first octave of group b; group a is before it
  uint end;                       ///< behind the last
  uint padding;
} NoiseShape;
ISO_CHECK_SIZE(NoiseShape, 48);

/// Smooth step with zero first and second derivatives at 0 and 1.
ISO_INLINE double noise_fade(double t) {
  return t * t * t * (t * (t * 6 - 15) + 10);
}

/// The finalizer of splitmix64 [Steele et al. 2014].
ISO_INLINE ulong noise_hash(ulong x) {
  x = (x ^ (x >> 30)) * (ulong)0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * (ulong)0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// The line of lattice plane x, in the row that lies at (local_y, local_z) in lattice cell (y, z).
/// Gradients are the 12 edge midpoints of the cube [-1, 1]^3: axis-fair and exact.
ISO_INLINE NoiseLine noise_line(double amplitude, ulong seed, uint x, uint y, uint z,
                                double local_y, double local_z) {
  const double fade_y = noise_fade(local_y), fade_z = noise_fade(local_z);
  NoiseLine line;
  uint corner;
  line.offset = 0;
  line.slope = 0;
  for (corner = 0; corner < 4u; ++corner) {
    const uint dy = corner & 1u, dz = corner >> 1;
    const ulong hash = noise_hash(noise_hash(noise_hash(seed + x) + y + dy) + z + dz);
    const uint edge = (uint)(hash >> 32) % 12u;
    const double a = (edge & 1u) != 0u ? -1 : 1, b = (edge & 2u) != 0u ? -1 : 1;
    const double gradient_x = edge < 8u ? a : 0;
    const double gradient_y = edge < 4u ? b : edge < 8u ? 0 : a;
    const double gradient_z = edge < 4u ? 0 : b;
    const double weight =
        amplitude * (dy != 0u ? fade_y : 1 - fade_y) * (dz != 0u ? fade_z : 1 - fade_z);
    line.offset += weight * (gradient_y * (local_y - dy) + gradient_z * (local_z - dz));
    line.slope += weight * gradient_x;
  }
  return line;
}

/// Noise between two lattice planes, `along` of the way from the left one; fade: noise_fade(along).
ISO_INLINE double noise_between(NoiseLine left, NoiseLine right, double along, double fade) {
  const double from_left = left.offset + left.slope * along;
  const double from_right = right.offset + right.slope * (along - 1);
  return from_left + fade * (from_right - from_left);
}

#define ISO_NOISE_THICKNESS 0.06 /* of the mixing layer's step, in heights of the volume */
#define ISO_NOISE_ENVELOPE 0.14  /* half width of its turbulent zone, in heights */

/// The value that the sum of group a begins with.
ISO_INLINE double noise_begin(const NoiseShape s, uint y) {
  return s.kind == ISO_NOISE_MIXING_LAYER ? (y / s.last_y - 0.5) / ISO_NOISE_THICKNESS : 0;
}

/// 0..1, rising steepest at 0.
ISO_INLINE double noise_step(double x) {
  return 0.5 + 0.5 * (x / sqrt(1 + x * x));
}

/// The distance from the middle of the volume along an axis, in voxels.
ISO_INLINE double noise_from_middle(uint i, double last) {
  return i - 0.5 * last;
}

/// How far inside the jet's mantle, in its thicknesses. The jet goes along x, and widens.
ISO_INLINE double noise_jet(const NoiseShape s, uint x, uint y, uint z, double a, double b) {
  const double side = s.last_y < s.last_z ? s.last_y : s.last_z, along = x / s.last_x;
  const double from_y = noise_from_middle(y, s.last_y) / side;
  const double from_z = noise_from_middle(z, s.last_z) / side;
  const double inside = 0.06 + 0.2 * along - sqrt(from_y * from_y + from_z * from_z);
  const double growth = along / (along + 0.15);
  const double away = inside / (0.05 + 0.1 * along), decay = 1 + away * away;
  return inside / 0.03 + growth * (a + b / (decay * decay));
}

/// A body as scanners see it: an ellipsoid with bumps, soft within except for thin walls at which
/// the noise b is 0.
ISO_INLINE double noise_scan(const NoiseShape s, uint x, uint y, uint z, double a, double b) {
  const double from_x = noise_from_middle(x, s.last_x) / s.last_x;
  const double from_y = noise_from_middle(y, s.last_y) / s.last_y;
  const double from_z = noise_from_middle(z, s.last_z) / s.last_z;
  const double radius = sqrt(from_x * from_x + from_y * from_y + from_z * from_z);
  const double body = noise_step((0.42 - radius) / 0.01 + a), wall = b / 0.08;
  return body * (0.35 + 0.6 / (1 + wall * wall));
}

/// The field, 0..1, at a voxel, from the sums of its groups of octaves there.
ISO_INLINE double noise_value(const NoiseShape s, uint x, uint y, uint z, double a, double b) {
  if (s.kind == ISO_NOISE_MIXING_LAYER) {
    const double distance = a * (ISO_NOISE_THICKNESS / ISO_NOISE_ENVELOPE);
    const double decay = 1 + distance * distance, envelope = 1 / (decay * decay);
    return noise_step(a + envelope * b);
  }
  if (s.kind == ISO_NOISE_TURBULENCE) return noise_step(b);
  if (s.kind == ISO_NOISE_JET) return noise_step(noise_jet(s, x, y, z, a, b));
  {
    const double value = noise_scan(s, x, y, z, a, b);
    if (s.kind == ISO_NOISE_SCAN) return value;
    {
      const ulong hash = noise_hash(noise_hash(noise_hash(s.seed + x) + y) + z);
      const double noisy = value + 0.12 * ((double)(uint)(hash >> 40) * 0x1p-24 - 0.5);
      return noisy < 0 ? 0 : noisy > 1 ? 1 : noisy;
    }
  }
}

ISO_NAMESPACE_END

#endif
