/// block_stream.h -- the bits of a block on the device (core/stream/device_stream.hpp). OpenCL C
/// 1.2.
///
/// ISO_STREAM_PARTS, by -D: 1: the whole zfp stream is in part_0. 4: the stream is cut into up to
/// four buffers of layout.words_per_part words. Each goes on behind its end, so that a block which
/// begins in it is whole. 0: part_0 is a window that holds only the blocks of this launch, one
/// after the other, each beginning with a whole word.
///
/// ISO_STREAM_INDEXED: 0: all blocks are layout.bits_per_block long. 1: `index` says where they
/// begin (block_index.h). A window begins with an entry (window_entry()) for each of its blocks,
/// and for the end of the last. A block ends at its length, even if the length is wrong: the bits
/// up to there are decoded as at a fixed rate.
///
/// ISO_STREAM_REVERSIBLE: 1: the stream is a reversible one (zfp_codec.h).
#ifndef ISOWAVE_BLOCK_STREAM_H
#define ISOWAVE_BLOCK_STREAM_H

#include "portable/block_bound.h"
#include "portable/block_index.h"
#include "portable/label_table.h"
#include "portable/no_data.h"
#include "portable/whole_number.h"
#include "portable/zfp_codec.h"

#ifndef ISO_STREAM_PARTS
#define ISO_STREAM_PARTS 1
#endif
#ifndef ISO_STREAM_INDEXED
#define ISO_STREAM_INDEXED 0
#endif
#ifndef ISO_STREAM_REVERSIBLE
#define ISO_STREAM_REVERSIBLE 0
#endif

/// Decodes block block_id, which is number `place` in a window. values [64]: x + 4 y + 16 z; NaN of
/// voxels without data; with ISO_LABELS, bit masks of the groups of voxels.
ISO_LONG void decode_block(global const uint *part_0, global const uint *part_1,
                           global const uint *part_2, global const uint *part_3,
                           global const uint *index, StreamLayout layout, uint block_id, uint place,
                           float *values) {
  global const uint *words = part_0;
  uint bits = layout.bits_per_block;
  ulong first_bit = (ulong)block_id * bits;
  if (ISO_STREAM_PARTS == 0 && ISO_STREAM_INDEXED) {
    first_bit = entry_bit(part_0[place]);
    bits = entry_bits(part_0[place], part_0[place + 1u]);
  } else if (ISO_STREAM_PARTS == 0) {
    first_bit = (ulong)place * ((bits + 31u) & ~31u);
  } else if (ISO_STREAM_INDEXED) {
    first_bit = block_begin(index, block_id);
    bits = (uint)(block_begin(index, block_id + 1u) - first_bit);
  }
  if (ISO_STREAM_PARTS > 1) {
    const ulong part_bits = (ulong)layout.words_per_part * 32u;
    const uint part =
        (first_bit >= part_bits) + (first_bit >= 2u * part_bits) + (first_bit >= 3u * part_bits);
    words = part == 0 ? part_0 : part == 1 ? part_1 : part == 2 ? part_2 : part_3;
    first_bit -= part * part_bits;
  }
  if (ISO_STREAM_REVERSIBLE) {
    zfp_decode_reversible_block(words, first_bit, bits, values);
  } else {
    zfp_decode_block(words, first_bit, bits, layout.min_exponent, values);
  }
  if (layout.least <= layout.greatest) {
    ISO_UNROLL
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
      values[v] = whole_number(values[v], layout.least, layout.greatest);
  }
  if (ISO_LABELS) {
    ISO_UNROLL
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
      values[v] = (float)groups_of_label(index + layout.bounds_begin, values[v]);
  }
  if (layout.value_offset != 0.0f || layout.bound_unit != 0.0f) {
    float bound = 0.0f;
    if (layout.bound_unit != 0.0f)
      bound =
          layout.bound_unit * block_bound(packed_bound_code(index + layout.bounds_begin, block_id));
    ISO_UNROLL
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) {
      const float share = layout.bounds_by_place != 0u ? bound_share(bound_place(v)) : 1.0f;
      values[v] += layout.value_offset + bound * share;
    }
  }
  if (ISO_NO_DATA && layout.no_data_begin != ISO_INVALID_ID) {
    const ulong missing = no_data_mask(index + layout.no_data_begin, block_id);
    if (missing != 0) {
      ISO_UNROLL
      for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
        values[v] = (missing >> v & 1u) != 0 ? as_float(0x7FC00000u) : values[v];
    }
  }
}

#endif
