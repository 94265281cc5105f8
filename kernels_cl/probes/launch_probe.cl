/// launch_probe.cl -- the smallest kernels that use each kind of argument.
/// Only the tests and the benchmark of core/ocl run them.
#include "portable/shared_types.h"

/// Does nothing: what remains is the cost of a launch.
kernel void launch_empty(void) {}

/// output[i] = factor * input[i] for i in [0, count). Grid-stride: any number of work-items.
kernel void scale_values(global const uint *input, uint count, uint factor, global uint *output) {
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) output[i] = factor * input[i];
}

/// Reverses the values of each work-group through local memory. values: one per work-item; scratch:
/// one per work-item of a group.
kernel void reverse_groups(global uint *values, local uint *scratch) {
  const uint lane = get_local_id(0), last = get_local_size(0) - 1;
  scratch[last - lane] = values[get_global_id(0)];
  barrier(CLK_LOCAL_MEM_FENCE);
  values[get_global_id(0)] = scratch[lane];
}

/// Writes a struct that came by value to memory, to show that it arrives whole. One work-item.
kernel void store_pair_hit(PairHit hit, global PairHit *stored) {
  stored[0] = hit;
}

/// seen [3]: work-items of a group, of how many each stands for one, and groups.
kernel void group_sizes(global uint *seen) {
  if (get_global_id(0) == 0) {
    seen[0] = get_local_size(0);
    seen[1] = ISO_GROUP_SHARE;
    seen[2] = get_num_groups(0);
  }
}
