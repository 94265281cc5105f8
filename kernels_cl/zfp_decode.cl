/// zfp_decode.cl -- decodes the pass's new blocks into their cache slots (Sec. 3.5).
#include "zfp_codec.h"

/// One work-item per block. The block of request i goes to slot slots[i]: cache_values [slots * 64], x + 4y +
/// 16z within a slot. words: the payload of the zfp stream; block b starts at bit b * bits_per_block.
/// Grid-stride over decoded_count.
kernel void zfp_decode(global const uint *words, uint bits_per_block, global const PassCounts *counts,
                       global const uint *block_ids, global const uint *slots, global float *cache_values) {
  const uint count = counts->decoded_count;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    float values[ISO_BLOCK_VOXELS];
    zfp_decode_block(words, (ulong)block_ids[i] * bits_per_block, bits_per_block, values);
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) cache_values[slots[i] * ISO_BLOCK_VOXELS + v] = values[v];
  }
}
