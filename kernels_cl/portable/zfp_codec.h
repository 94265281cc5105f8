/// zfp_codec.h -- decodes one zfp block of 4^3 float32 values, bit-exact with libzfp 1.0 [Lindstrom
/// 2014].
///
/// Portable: OpenCL C 1.2 and C++. Block layout, in bits: 1 "not all zero" | 8 exponent + 127 | bit
/// planes 31, 30, ... of 64 negabinary coefficients, each plane: n bits verbatim, then group-tested
/// runs; cut at max_bits (fixed rate), or after the plane that a bound of the error needs (fixed
/// accuracy).
///
/// Reversible streams lose nothing. Block layout: 1 "not all zero" | 1 "the integers are the bits
/// of the values", or 0 | only after 0: 8 exponent + 127 | 5 number of bit planes - 1 | so many
/// planes, as above, of coefficients of another transform.
#ifndef ISOWAVE_ZFP_CODEC_H
#define ISOWAVE_ZFP_CODEC_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

/// [position in the stream] i + 4 j + 16 k of the coefficient. Coefficients are in order of total
/// sequency i + j + k, then of i^2 + j^2 + k^2.
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

/// Zeros below the lowest one; 32 if there is none.
ISO_INLINE uint trailing_zeros_32(uint bits) {
  return popcount(~bits & (bits - 1u));
}

/// Inverse of zfp's lifted 4-point transform, in place on v[0], v[stride], ... Sums wrap, shifts
/// right keep the sign:
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

/// The float32 of these bits.
ISO_INLINE float float_of_bits(uint bits) {
  union {
    uint u;
    float f;
  } value;
  value.u = bits;
  return value.f;
}

/// 2^e for e in [-149, 127]; 0 below.
ISO_INLINE float power_of_two(int e) {
  return float_of_bits(e >= -126 ? (uint)(e + 127) << 23 : (e >= -149 ? 1u << (e + 149) : 0u));
}

/// Transposes the 8 x 8 bits of bytes 7..4 in *low and 3..0 in *high, lowest byte first: bit j of
/// byte k to bit 7 - k of byte j.
ISO_INLINE void transpose_bits(uint *low, uint *high) {
  uint t = (*low ^ *low >> 7) & 0x00AA00AAu;
  *low ^= t ^ t << 7;
  t = (*high ^ *high >> 7) & 0x00AA00AAu;
  *high ^= t ^ t << 7;
  t = (*low ^ *low >> 14) & 0x0000CCCCu;
  *low ^= t ^ t << 14;
  t = (*high ^ *high >> 14) & 0x0000CCCCu;
  *high ^= t ^ t << 14;
  t = (*low ^ *high << 4) & 0xF0F0F0F0u;
  *low ^= t;
  *high ^= t >> 4;
}

/// Appends eight bit planes, the highest first, to 32 coefficients: bit i of each to
/// coefficients[i].
ISO_INLINE void append_planes(const uint *planes, uint *coefficients) {
  uint byte, i;
  ISO_UNROLL
  for (byte = 0; byte < 4u; ++byte) {
    uint low = 0, high = 0;
    ISO_UNROLL
    for (i = 0; i < 4u; ++i) {
      low |= (planes[7u - i] >> (8u * byte) & 0xFFu) << (8u * i);
      high |= (planes[3u - i] >> (8u * byte) & 0xFFu) << (8u * i);
    }
    transpose_bits(&low, &high);
    ISO_UNROLL
    for (i = 0; i < 4u; ++i) {
      uint *c = coefficients + 8u * byte + i;
      c[0] = c[0] << 8 | (low >> (8u * i) & 0xFFu);
      c[4] = c[4] << 8 | (high >> (8u * i) & 0xFFu);
    }
  }
}

/// All loops over the 64 values are unrolled, so that they stay in registers: a GPU has no fast
/// indexed ones.

/// Bit planes of a block with this largest exponent that a bound of 2^min_exponent on the error
/// needs: zfp's own rule, with 2 (3 + 1) for what the transform adds in three dimensions.
ISO_INLINE uint zfp_num_planes(int exponent, int min_exponent) {
  const int num_planes = exponent - min_exponent + 8;
  return num_planes < 0 ? 0u : (num_planes > 32 ? 32u : (uint)num_planes);
}

/// Reads bit planes, the highest first, until there are max_planes, 0..32, or `bits` bits have been
/// read. Returns how many there are.
///
/// low, high  [32] bits of coefficients 0..31 and 32..63 in stream order, of each plane
/// any_high   not 0 if a bit of `high` is set
ISO_INLINE uint read_planes(BitReader *r, uint bits, uint max_planes, uint *low, uint *high,
                            uint *any_high) {
  uint n = 0; /* coefficients known to be significant: their bits come verbatim */
  uint num_planes = 0;
  *any_high = 0;
  while (bits > 0u && num_planes < max_planes) {
    const uint verbatim = n < bits ? n : bits;
    ulong ones = read_bits(r, verbatim < 32u ? verbatim : 32u);
    if (verbatim > 32u) ones |= (ulong)read_bits(r, verbatim - 32u) << 32;
    bits -= verbatim;
    /* Group tests: 0, no more ones in this plane; or 1, and zeros up to the next. */
    while (n < 64u && bits > 0u) {
      uint limit, zeros, read = 0;
      fill_bits(r);
      --bits;
      if (((uint)r->buffer & 1u) == 0u) {
        skip_bits(r, 1);
        break;
      }
      limit = 63u - n < bits ? 63u - n : bits; /* a one that must come is not written */
      zeros = trailing_zeros_32((uint)r->buffer >> 1);
      if (zeros > 31u && limit > 31u) { /* seldom */
        read = 32u;
        skip_bits(r, read);
        fill_bits(r);
        zeros = 31u + trailing_zeros_32((uint)r->buffer);
      }
      skip_bits(r, 1u + (zeros < limit ? zeros + 1u : limit) - read);
      bits -= zeros < limit ? zeros + 1u : limit;
      n += zeros < limit ? zeros : limit;
      ones |= (ulong)1 << n;
      ++n;
    }
    low[num_planes] = (uint)ones;
    high[num_planes] = (uint)(ones >> 32);
    *any_high |= high[num_planes];
    ++num_planes;
  }
  return num_planes;
}

/// The integers whose planes were read, x + 4 y + 16 z; planes that are missing are 0. Clears
/// places behind the last plane.
ISO_INLINE void planes_to_integers(uint num_planes, uint *low, uint *high, uint any_high,
                                   uint *integers) {
  uint sequence[64];
  uint i, missing;
  for (i = num_planes; (i & 7u) != 0u; ++i) low[i] = high[i] = 0u;
  ISO_UNROLL
  for (i = 0; i < 64u; ++i) sequence[i] = 0u;
  for (i = 0; i < num_planes; i += 8u) append_planes(low + i, sequence);
  for (i = 0; any_high != 0u && i < num_planes; i += 8u) append_planes(high + i, sequence + 32);
  missing = (32u - num_planes) & 24u; /* those of whole bytes, but no 32 */
  ISO_UNROLL
  for (i = 0; i < 64u; ++i) integers[iso_zfp_order[i]] = sequence[i] << missing;
  ISO_UNROLL
  for (i = 0; i < 64u; ++i)
    integers[i] = (integers[i] ^ 0xAAAAAAAAu) - 0xAAAAAAAAu; /* negabinary */
}

/// Decodes the block that starts at `first_bit` of `words` and has max_bits bits, down to the bit
/// plane of min_exponent (ISO_ALL_PLANES: as far as its bits go). values [64]: x + 4 y + 16 z.
/// Reads at most two words past the block's last bit.
ISO_INLINE void zfp_decode_block(ISO_GLOBAL const uint *words, ulong first_bit, uint max_bits,
                                 int min_exponent, float *values) {
  BitReader r = open_bits(words, first_bit);
  uint low[32], high[32];
  uint integers[64];
  float scale;
  int exponent;
  uint i, num_planes, any_high;
  if (max_bits < 9u || !read_bits(&r, 1)) {
    ISO_UNROLL
    for (i = 0; i < 64u; ++i) values[i] = 0.0f;
    return;
  }
  exponent = (int)read_bits(&r, 8) - 127;
  scale = power_of_two(exponent - 30);
  num_planes =
      read_planes(&r, max_bits - 9u, zfp_num_planes(exponent, min_exponent), low, high, &any_high);
  planes_to_integers(num_planes, low, high, any_high, integers);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_lift(integers + i, 16);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_lift(integers + (i & 3u) + 16u * (i >> 2), 4);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_lift(integers + 4u * i, 1);
  ISO_UNROLL
  for (i = 0; i < 64u; ++i) values[i] = (float)(int)integers[i] * scale;
}

/// Inverse of the reversible transform, in place on v[0], v[stride], ... Sums wrap. It sums up the
/// third, second and first differences of 4 integers:
///   ( 1 0 0 0)
///   ( 1 1 0 0)
///   ( 1 2 1 0)
///   ( 1 3 3 1)
ISO_INLINE void inverse_differences(uint *v, int stride) {
  const uint x = v[0], y = v[stride], z = v[2 * stride], w = v[3 * stride];
  v[stride] = x + y;
  v[2 * stride] = x + 2u * y + z;
  v[3 * stride] = x + 3u * (y + z) + w;
}

/// Decodes a block of a reversible stream, else as zfp_decode_block(). A block that ends before its
/// number of bit planes is zeros.
ISO_INLINE void zfp_decode_reversible_block(ISO_GLOBAL const uint *words, ulong first_bit,
                                            uint max_bits, float *values) {
  BitReader r = open_bits(words, first_bit);
  const uint kind = read_bits(&r, 2); /* lowest bit: "not all zero" */
  const uint head_bits = kind == 1u ? 15u : 7u;
  uint low[32], high[32];
  uint integers[64];
  float scale = 0.0f;
  uint exponent = 1u, i, num_planes, any_high;
  if ((kind & 1u) == 0u || max_bits < head_bits) {
    ISO_UNROLL
    for (i = 0; i < 64u; ++i) values[i] = 0.0f;
    return;
  }
  if (kind == 1u) {
    exponent = read_bits(&r, 8);
    scale = power_of_two((int)exponent - 157);
  }
  num_planes = read_bits(&r, 5) + 1u;
  if (exponent == 0u) num_planes = 0u; /* of zeros, whatever its planes say */
  num_planes = read_planes(&r, max_bits - head_bits, num_planes, low, high, &any_high);
  planes_to_integers(num_planes, low, high, any_high, integers);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_differences(integers + i, 16);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_differences(integers + (i & 3u) + 16u * (i >> 2), 4);
  ISO_UNROLL
  for (i = 0; i < 16u; ++i) inverse_differences(integers + 4u * i, 1);
  if (kind == 1u) {
    ISO_UNROLL
    for (i = 0; i < 64u; ++i) values[i] = (float)(int)integers[i] * scale;
  } else {
    ISO_UNROLL
    for (i = 0; i < 64u; ++i) { /* negative ones count up from the largest magnitude */
      const uint n = integers[i];
      values[i] = float_of_bits(n >> 31 != 0u ? n ^ 0x7FFFFFFFu : n);
    }
  }
}

/// Decodes a block of a stream of any kind; min_exponent: of its layout (StreamLayout). For hosts:
/// kernels are compiled for one kind (block_stream.h).
ISO_INLINE void zfp_decode_any_block(ISO_GLOBAL const uint *words, ulong first_bit, uint max_bits,
                                     int min_exponent, float *values) {
  if (min_exponent == ISO_REVERSIBLE) {
    zfp_decode_reversible_block(words, first_bit, max_bits, values);
  } else {
    zfp_decode_block(words, first_bit, max_bits, min_exponent, values);
  }
}

ISO_NAMESPACE_END

#endif
