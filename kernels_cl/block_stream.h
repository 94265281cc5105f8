/// block_stream.h -- where the bits of a block are on the device (core/device_stream.hpp). OpenCL C 1.2.
///
/// ISO_STREAM_PARTS, by -D: 1 the whole zfp stream is in part_0, block b at bit b * bits_per_block. 2, 3, 4: it is cut into
/// as many buffers of blocks_per_part blocks, each beginning with a whole block at bit 0. 0: part_0 is a window that holds
/// only the blocks of this launch, one after the other, each beginning with a whole word.
#ifndef ISOWAVE_BLOCK_STREAM_H
#define ISOWAVE_BLOCK_STREAM_H

#include "zfp_codec.h"

#ifndef ISO_STREAM_PARTS
#define ISO_STREAM_PARTS 1
#endif

/// Decodes block block_id, which is number `place` in a window. values [64]: x + 4 y + 16 z.
ISO_INLINE void decode_block(global const uint *part_0, global const uint *part_1, global const uint *part_2,
                             global const uint *part_3, uint blocks_per_part, uint bits_per_block,
                             uint block_id, uint place, float *values) {
  const uint part = ISO_STREAM_PARTS > 1 ? block_id / blocks_per_part : 0;
  global const uint *words = part == 0 ? part_0 : part == 1 ? part_1 : part == 2 ? part_2 : part_3;
  const ulong first_bit = ISO_STREAM_PARTS == 0 ? (ulong)place * ((bits_per_block + 31u) & ~31u)
                                                : (ulong)(block_id - part * blocks_per_part) * bits_per_block;
  zfp_decode_block(words, first_bit, bits_per_block, values);
}

#endif
