/// shared_types.cl -- tells the host what the device's compiler makes of shared_types.h.
/// Only shared_types_test runs it: sizes and offsets must be the host's.
#include "shared_types.h"

/// sizes[0..3]: sizeof FrameParams, PairHit, HitRecord, PassCounts. One work-item.
kernel void shared_type_sizes(global uint *sizes) {
  sizes[0] = sizeof(FrameParams);
  sizes[1] = sizeof(PairHit);
  sizes[2] = sizeof(HitRecord);
  sizes[3] = sizeof(PassCounts);
}
