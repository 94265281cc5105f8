/// zfp_decode.cl -- decodes the pass's new blocks into their cache slots (Sec. 3.5).
#include "device/block_stream.h"
#include "device/level_requests.h"
#include "device/slot_values.h"
#include "portable/block_grid.h"
#include "portable/shared_types.h"

#define ISO_STAGED_WORDS 16u  ///< of each slot that go to the cache together: 64 bytes

/// 1 for a voxel that is not inside. value: minus the isovalue, never -0; NaN of one without data.
ISO_INLINE uint is_outside(float value) {
  return ISO_NO_DATA ? (uint) !(value >= 0.0f) : as_uint(value) >> 31;
}

/// Decodes the blocks that got slots. One work-item decodes one block; the work-group stores them
/// together, so that neighbouring work-items write neighbouring values.
///
/// part_0 .. layout  the zfp stream, see block_stream.h; a window holds the blocks from request
///                   `first` on
/// next_words        with levels of detail: the stream of the next level that is drawn, or of this
///                   one again; only requests for blocks of these two levels are served
/// places            with levels of detail in windows: a window has blocks of this level alone, and
///                   request places[i] is its number i
/// In                the block of request i goes to slot slots[i]
/// Out               cache_values [slots * 64], x + 4y + 16z within a slot; inside [slots]: which
///                   of a block's voxels are inside
/// Launch            groups stride over requests [first, end), but not beyond decoded_count
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void zfp_decode(
    const FrameParams frame_params, global const uint *part_0, global const uint *part_1,
    global const uint *part_2, global const uint *part_3, global const uint *index,
    const StreamLayout layout, const FrameParams next_frame, global const uint *next_words,
    global const uint *next_index, const StreamLayout next_layout, uint first, uint end,
    global const PassCounts *counts, global const uint *places, global const uint *block_ids,
    global const uint *slots, global SlotValue *cache_values, global ulong *inside) {
  global uint *cache_words = (global uint *)cache_values;
  local uint staged[ISO_GROUP_SIZE * (ISO_STAGED_WORDS + 1)]; /* + 1: no two items in one bank */
  local uint to_slots[ISO_LEVEL_SLOTS];
  const float isovalue = /* nothing minus this is -0 */
      frame_params.surface.isovalue == 0.0f ? -0.0f : frame_params.surface.isovalue;
  const uint count = min(counts->decoded_count, end), item = get_local_id(0);
  for (uint begin = first + get_group_id(0) * ISO_GROUP_SIZE; begin < count;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint num_blocks = min(count - begin, (uint)ISO_GROUP_SIZE);
    float values[ISO_BLOCK_VOXELS];
    const uint request = item < num_blocks ? place_of(places, begin + item) : 0;
    int is_next;
    const uint block_id =
        served_block(&frame_params, &next_frame,
                     item < num_blocks ? block_ids[request] : ISO_INVALID_ID, &is_next);
    tell_slot(to_slots, item, block_id, slots, request);
    if (block_id != ISO_INVALID_ID) {
      uint outside_low = 0, outside_high = 0;
      decode_block(is_next ? next_words : part_0, is_next ? next_words : part_1,
                   is_next ? next_words : part_2, is_next ? next_words : part_3,
                   is_next ? next_index : index, is_next ? next_layout : layout, block_id,
                   begin + item - first, values);
      ISO_UNROLL
      for (uint v = 32; v-- > 0;) {
        outside_low =
            outside_low << 1 | is_outside(field_of_slot(&frame_params, values[v]) - isovalue);
        outside_high =
            outside_high << 1 | is_outside(field_of_slot(&frame_params, values[v + 32]) - isovalue);
      }
      inside[slots[request]] = ~((ulong)outside_high << 32 | outside_low);
    }
    ISO_UNROLL
    for (uint part = 0; part < ISO_SLOT_WORDS; part += ISO_STAGED_WORDS) {
      barrier(CLK_LOCAL_MEM_FENCE);
      if (block_id != ISO_INVALID_ID) {
        ISO_UNROLL
        for (uint w = 0; w < ISO_STAGED_WORDS; ++w)
          staged[item * (ISO_STAGED_WORDS + 1) + w] = slot_word(values, part + w);
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      for (uint i = item; i < num_blocks * ISO_STAGED_WORDS; i += ISO_GROUP_SIZE) {
        const uint block = i / ISO_STAGED_WORDS, w = i % ISO_STAGED_WORDS;
        const uint slot = told_slot(to_slots, slots, begin, block);
        if (is_served(slot))
          cache_words[slot * ISO_SLOT_WORDS + part + w] =
              staged[block * (ISO_STAGED_WORDS + 1) + w];
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
