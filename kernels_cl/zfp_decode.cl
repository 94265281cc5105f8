/// zfp_decode.cl -- decodes the pass's new blocks into their cache slots (Sec. 3.5).
#include "zfp_codec.h"

#define ISO_STAGED_VALUES 16u  ///< of each block that go to the cache together: 64 bytes

/// One work-item decodes one block; the work-group stores them together, so that neighbouring work-items write neighbouring
/// values. The block of request i goes to slot slots[i]: cache_values [slots * 64], x + 4y + 16z within a slot.
/// words: the payload of the zfp stream; block b starts at bit b * bits_per_block. Groups stride over decoded_count.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void zfp_decode(
    global const uint *words, uint bits_per_block, global const PassCounts *counts, global const uint *block_ids,
    global const uint *slots, global float *cache_values) {
  local float staged[ISO_GROUP_SIZE * (ISO_STAGED_VALUES + 1)]; /* + 1: no two work-items in one bank */
  const uint count = counts->decoded_count, item = get_local_id(0);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < count;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint num_blocks = min(count - begin, ISO_GROUP_SIZE);
    float values[ISO_BLOCK_VOXELS];
    if (item < num_blocks) {
      zfp_decode_block(words, (ulong)block_ids[begin + item] * bits_per_block, bits_per_block, values);
    }
    ISO_UNROLL
    for (uint first = 0; first < ISO_BLOCK_VOXELS; first += ISO_STAGED_VALUES) {
      barrier(CLK_LOCAL_MEM_FENCE);
      ISO_UNROLL
      for (uint v = 0; v < ISO_STAGED_VALUES; ++v) staged[item * (ISO_STAGED_VALUES + 1) + v] = values[first + v];
      barrier(CLK_LOCAL_MEM_FENCE);
      for (uint i = item; i < num_blocks * ISO_STAGED_VALUES; i += ISO_GROUP_SIZE) {
        const uint block = i / ISO_STAGED_VALUES, v = i % ISO_STAGED_VALUES;
        cache_values[slots[begin + block] * ISO_BLOCK_VOXELS + first + v] =
            staged[block * (ISO_STAGED_VALUES + 1) + v];
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
