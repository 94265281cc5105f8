/// zfp_codec.h -- decodes one zfp block of 4^3 float32 values, bit-exact with libzfp 1.0 [Lindstrom 2014].
///
/// Portable: OpenCL C 1.2 and C++. Block layout, in bits: 1 "not all zero" | 8 exponent + 127 | bit planes
/// 31, 30, ... of 64 negabinary coefficients, each plane: n bits verbatim, then group-tested runs; cut at
/// max_bits.
#ifndef ISOWAVE_ZFP_CODEC_H
#define ISOWAVE_ZFP_CODEC_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

/// Coefficients travel in order of total sequency i + j + k, then i^2 + j^2 + k^2: stream position -> i + 4 j
/// + 16 k.
ISO_CONSTANT static const uchar iso_zfp_order[64] = {
    0,  1,  4,  16, 20, 17, 5,  2,  8,  32, 21, 6,  18, 24, 9,  33, 36, 3,  12, 48, 22, 25,
    37, 40, 34, 10, 7,  19, 28, 13, 49, 52, 41, 38, 26, 23, 29, 53, 11, 35, 44, 14, 50, 56,
    42, 27, 39, 45, 30, 54, 57, 60, 51, 15, 43, 46, 58, 61, 55, 31, 62, 59, 47, 63};

/// Reads bits from 32-bit little-endian words, lowest bit first.
typedef struct BitReader {
  ISO_GLOBAL const uint *words;  ///< the next word
  ulong buffer;                  ///< bits read ahead, the next one lowest; 0 above them
  uint buffered;                 ///< how many, 0..63
} BitReader;

/// Makes at least 32 bits of the buffer valid.
ISO_INLINE void fill_bits(BitReader *r) {
  if (r->buffered < 32u) {
    r->buffer |= (ulong)*r->words++ << r->buffered;
    r->buffered += 32u;
  }
}

ISO_INLINE void skip_bits(BitReader *r, uint count) {
  r->buffer >>= count;
  r->buffered -= count;
}

/// The next `count` bits, 0..32.
ISO_INLINE uint read_bits(BitReader *r, uint count) {
  uint value;
  fill_bits(r);
  value = (uint)(r->buffer & (((ulong)1 << count) - 1u));
  skip_bits(r, count);
  return value;
}

ISO_INLINE BitReader open_bits(ISO_GLOBAL const uint *words, ulong first_bit) {
  BitReader r;
  r.words = words + (first_bit >> 5);
  r.buffer = 0;
  r.buffered = 0;
  read_bits(&r, (uint)(first_bit & 31u));
  return r;
}

/// Skips zeros up to and with the next one, but reads no more than `limit` bits. Returns the number of zeros.
ISO_INLINE uint read_zeros(BitReader *r, uint limit) {
  uint zeros = 0;
  for (;;) {
    uint window, run;
    fill_bits(r);
    window = (uint)r->buffer;
    run = window == 0u ? 32u : popcount((window & (0u - window)) - 1u);
    if (zeros + run >= limit) { /* there is none among them */
      skip_bits(r, limit - zeros);
      return limit;
    }
    zeros += run;
    if (window != 0u) {
      skip_bits(r, run + 1u);
      return zeros;
    }
    skip_bits(r, 32u);
  }
}

/// Inverse of zfp's lifted 4-point transform, in place on v[0], v[stride], ... Sums wrap, shifts right keep
/// the sign:
///   1/4 *  ( 4  6 -4 -1)
///          ( 4  2  4  5)
///          ( 4 -2  4 -5)
///          ( 4 -6 -4  1)
ISO_INLINE void inverse_lift(uint *v, int stride) {
  uint x = v[0], y = v[stride], z = v[2 * stride], w = v[3 * stride];
  y += (uint)((int)w >> 1);
  w -= (uint)((int)y >> 1);
  y += w;
  w <<= 1;
  w -= y;
  z += x;
  x <<= 1;
  x -= z;
  y += z;
  z <<= 1;
  z -= y;
  w += x;
  x <<= 1;
  x -= w;
  v[0] = x;
  v[stride] = y;
  v[2 * stride] = z;
  v[3 * stride] = w;
}

/// 2^e for e in [-149, 127]; 0 below.
ISO_INLINE float power_of_two(int e) {
  union {
    uint u;
    float f;
  } bits;
  bits.u = e >= -126 ? (uint)(e + 127) << 23 : (e >= -149 ? 1u << (e + 149) : 0u);
  return bits.f;
}

/// All loops over the 64 values are unrolled, so that they stay in registers: a GPU has no fast indexed ones.

/// Decodes the block that starts at `first_bit` of `words` and has max_bits bits.
/// values [64]: x + 4 y + 16 z. Reads at most two words past the block's last bit.
ISO_INLINE void zfp_decode_block(ISO_GLOBAL const uint *words, ulong first_bit, uint max_bits,
                                 float *values) {
  BitReader r = open_bits(words, first_bit);
  uint coefficients[64];
  float scale;
  uint bits, plane, n, i;
  ISO_UNROLL
  for (i = 0; i < 64u; ++i) coefficients[i] = 0u;
  if (!read_bits(&r, 1)) {
    ISO_UNROLL
    for (i = 0; i < 64u; ++i) values[i] = 0.0f;
    return;
  }
  scale = power_of_two((int)read_bits(&r, 8) - 127 - 30);
  bits = max_bits - 9u;
  n = 0; /* coefficients known to be significant: their bits come verbatim */
  for (plane = 32; bits > 0u && plane-- > 0u;) {
    const uint verbatim = n < bits ? n : bits;
    uint low = read_bits(&r, verbatim < 32u ? verbatim : 32u);
    uint high = read_bits(&r, verbatim < 32u ? 0u : verbatim - 32u);
    bits -= verbatim;
    while (n < 64u && bits > 0u) {
      uint limit, zeros;
      --bits;
      if (!read_bits(&r, 1)) break; /* group test: no more ones in this plane */
      limit = 63u - n < bits ? 63u - n : bits;
      zeros = read_zeros(&r, limit);
      bits -= zeros < limit ? zeros + 1u : limit;
      n += zeros;
      if (n < 32u) {
        low |= 1u << n;
      } else {
        high |= 1u << (n - 32u);
      }
      ++n;
    }
    ISO_UNROLL
    for (i = 0; i < 32u; ++i) coefficients[iso_zfp_order[i]] |= (low >> i & 1u) << plane;
    if (high != 0u) { /* at low rates, seldom */
      ISO_UNROLL
      for (i = 0; i < 32u; ++i) coefficients[iso_zfp_order[i + 32u]] |= (high >> i & 1u) << plane;
    }
  }
  ISO_UNROLL
  for (i = 0; i < 64u; ++i) coefficients[i] = (coefficients[i] ^ 0xAAAAAAAAu) - 0xAAAAAAAAu; /* negabinary */
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_lift(coefficients + i, 16);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_lift(coefficients + (i & 3u) + 16u * (i >> 2), 4);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_lift(coefficients + 4u * i, 1);
  ISO_UNROLL
  for (i = 0; i < 64u; ++i) values[i] = (float)(int)coefficients[i] * scale;
}

ISO_NAMESPACE_END

#endif
