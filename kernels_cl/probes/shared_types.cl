/// shared_types.cl -- tells the host what the device's compiler makes of shared_types.h.
/// Only shared_types_test runs it: sizes and offsets must be the host's.
#include "portable/shared_types.h"
#include "portable/shared_types_fields.h"

/// sizes[0..6]: sizeof FrameParams, PairHit, BlockRays, HitRecord, GivenRay, StreamLayout,
/// PassCounts. One work-item.
kernel void shared_type_sizes(global uint *sizes) {
  sizes[0] = sizeof(FrameParams);
  sizes[1] = sizeof(PairHit);
  sizes[2] = sizeof(BlockRays);
  sizes[3] = sizeof(HitRecord);
  sizes[4] = sizeof(GivenRay);
  sizes[5] = sizeof(StreamLayout);
  sizes[6] = sizeof(PassCounts);
}

// OpenCL C has no offsetof.
#define ISO_WRITE_OFFSET(field) \
  *offsets++ = (uint)((const uchar *)&object.field - (const uchar *)&object);

/// offsets[0..]: the byte offset of every field, in the order of the structs above. One work-item.
kernel void shared_type_offsets(global uint *offsets) {
  {
    FrameParams object;
    ISO_FRAME_PARAMS_FIELDS(ISO_WRITE_OFFSET)
  }
  {
    PairHit object;
    ISO_PAIR_HIT_FIELDS(ISO_WRITE_OFFSET)
  }
  {
    BlockRays object;
    ISO_BLOCK_RAYS_FIELDS(ISO_WRITE_OFFSET)
  }
  {
    HitRecord object;
    ISO_HIT_RECORD_FIELDS(ISO_WRITE_OFFSET)
  }
  {
    GivenRay object;
    ISO_GIVEN_RAY_FIELDS(ISO_WRITE_OFFSET)
  }
  {
    StreamLayout object;
    ISO_STREAM_LAYOUT_FIELDS(ISO_WRITE_OFFSET)
  }
  {
    PassCounts object;
    ISO_PASS_COUNTS_FIELDS(ISO_WRITE_OFFSET)
  }
}
