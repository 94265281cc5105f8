/// zfp_encode.h -- encodes one zfp block of 4^3 float32 values, bit-exact with libzfp 1.0
/// [Lindstrom 2014].
///
/// Portable: OpenCL C 1.2 and C++. The block's layout is described in zfp_codec.h.
#ifndef ISOWAVE_ZFP_ENCODE_H
#define ISOWAVE_ZFP_ENCODE_H

#include "shared_types.h"
#include "zfp_codec.h"

#ifndef __OPENCL_C_VERSION__
#include <bit>
#endif

ISO_NAMESPACE_BEGIN

#ifndef __OPENCL_C_VERSION__
using std::popcount;
#endif

/// Writes bits to 32-bit little-endian words, lowest bit first.
typedef struct BitWriter {
  ISO_GLOBAL uint *words;  ///< the next word
  ulong buffer;            ///< bits not yet written, the first one lowest; 0 above them
  uint buffered;           ///< how many, 0..31
} BitWriter;

/// `count`, 0..32, bits; value < 2^count.
ISO_INLINE void write_up_to_32_bits(BitWriter *w, uint value, uint count) {
  w->buffer |= (ulong)value << w->buffered;
  w->buffered += count;
  if (w->buffered >= 32u) {
    *w->words++ = (uint)w->buffer;
    w->buffer >>= 32;
    w->buffered -= 32u;
  }
}

/// The lowest `count` bits of `value`, 0..64.
ISO_INLINE void write_bits(BitWriter *w, ulong value, uint count) {
  if (count < 64u) value &= ((ulong)1 << count) - 1u;
  write_up_to_32_bits(w, (uint)value, count < 32u ? count : 32u);
  if (count > 32u) write_up_to_32_bits(w, (uint)(value >> 32), count - 32u);
}

/// Zeros below the lowest one of x; x != 0.
ISO_INLINE uint trailing_zeros_64(ulong x) {
  return (uint)popcount((x & ((ulong)0 - x)) - 1u);
}

/// Forward lifting, in place on v[0], v[stride], ...: inverse_lift() of zfp_codec.h backwards, but
/// for the bits that its shifts drop.
ISO_INLINE void forward_lift(uint *v, int stride) {
  uint x = v[0], y = v[stride], z = v[2 * stride], w = v[3 * stride];
  x += w;
  x = (uint)((int)x >> 1);
  w -= x;
  z += y;
  z = (uint)((int)z >> 1);
  y -= z;
  x += z;
  x = (uint)((int)x >> 1);
  z -= x;
  w += y;
  w = (uint)((int)w >> 1);
  y -= w;
  w += (uint)((int)y >> 1);
  y -= (uint)((int)w >> 1);
  v[0] = x;
  v[stride] = y;
  v[2 * stride] = z;
  v[3 * stride] = w;
}

/// The coordinate from which coordinate i, 0..3, of a partial block with `count` voxels along an
/// axis, 1..4, takes its value.
ISO_INLINE uint padded_coordinate(uint i, uint count) {
  if (i < count) return i;
  return i == 3u ? 0u : count - 1u;
}

ISO_INLINE uint float_bits(float value) {
  union {
    float f;
    uint u;
  } bits;
  bits.f = value;
  return bits.u;
}

/// Writes the bit planes of `coefficients`, in stream order and negabinary, until `bits` bits are
/// used or no plane is left.
ISO_INLINE void write_bit_planes(BitWriter *w, const uint *coefficients, uint bits) {
  uint n = 0; /* coefficients known to be significant: their bits go verbatim */
  uint plane, i;
  for (plane = 32; bits > 0u && plane-- > 0u;) {
    const uint verbatim = n < bits ? n : bits;
    ulong x = 0; /* this plane; from here on without the coefficients that are written */
    for (i = 0; i < 64u; ++i) x |= (ulong)((coefficients[i] >> plane) & 1u) << i;
    write_bits(w, x, verbatim);
    bits -= verbatim;
    x = n < 64u ? x >> n : 0u;
    while (n < 64u && bits > 0u) {
      ulong run = 0; /* group test: no more ones in this plane */
      uint length = 1, zeros = 0;
      if (x != 0u) { /* the test's one, zeros, and a one that goes without saying for the last
                        coefficient */
        zeros = trailing_zeros_64(x);
        run = (ulong)2 << zeros | 1u;
        length = n + zeros < 63u ? zeros + 2u : zeros + 1u;
      }
      if (length > bits) length = bits;
      write_bits(w, run, length);
      bits -= length;
      if (x == 0u) break;
      n += zeros + 1u;
      x = n < 64u ? x >> zeros >> 1 : 0u;
    }
  }
}

/// Encodes values [64], x + 4 y + 16 z, to words [max_bits / 32]; max_bits: 32..2048, a multiple
/// of 32. Every magnitude is 0 or in [2^-97, 2^126).
ISO_INLINE void zfp_encode_block(const float *values, uint max_bits, ISO_GLOBAL uint *words) {
  ISO_GLOBAL uint *const end = words + max_bits / 32u;
  BitWriter w;
  uint coefficients[64], ordered[64];
  uint largest = 0, i;
  w.words = words;
  w.buffer = 0;
  w.buffered = 0;
  for (i = 0; i < 64u; ++i) { /* bits of magnitudes are ordered as magnitudes are */
    const uint magnitude = float_bits(values[i]) & 0x7FFFFFFFu;
    if (magnitude > largest) largest = magnitude;
  }
  if (largest != 0u) {
    const int exponent = (int)(largest >> 23) - 126; /* largest < 2^exponent */
    const float scale = power_of_two(30 - exponent);
    for (i = 0; i < 64u; ++i) coefficients[i] = (uint)(int)(values[i] * scale);
    for (i = 0; i < 16u; ++i) forward_lift(coefficients + 4u * i, 1);
    for (i = 0; i < 16u; ++i) forward_lift(coefficients + (i & 3u) + 16u * (i >> 2), 4);
    for (i = 0; i < 16u; ++i) forward_lift(coefficients + i, 16);
    for (i = 0; i < 64u; ++i)
      ordered[i] = (coefficients[iso_zfp_order[i]] + 0xAAAAAAAAu) ^ 0xAAAAAAAAu;
    write_bits(&w, ((ulong)(uint)(exponent + 127) << 1) | 1u, 9);
    write_bit_planes(&w, ordered, max_bits - 9u);
  }
  if (w.buffered > 0u) *w.words++ = (uint)w.buffer;
  while (w.words < end) *w.words++ = 0u;
}

ISO_NAMESPACE_END

#endif
