/// ray_lanes.h -- several work-items for each ray if there are few rays. OpenCL C 1.2.
#ifndef ISOWAVE_RAY_LANES_H
#define ISOWAVE_RAY_LANES_H

#include "block_walk.h"

/// Work-items for each ray, all of one work-group: as many as there are, up to one for each block
/// of a round.
ISO_INLINE uint lanes_per_ray(uint num_rays) {
  uint lanes = min(ISO_BLOCKS_AT_ONCE, (uint)ISO_GROUP_SIZE);
  while (lanes > 1 && lanes * num_rays > get_global_size(0)) lanes /= 2;
  return lanes;
}

#endif
