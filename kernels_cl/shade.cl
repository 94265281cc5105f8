/// shade.cl -- hit buffer -> framebuffer. Never changes which hit was chosen.
#include "shade.h"

/// image [height * width]: RGBA, 8 bits each. Grid-stride.
kernel void shade(const FrameParams frame_params, constant ShadeParams *params, global const HitRecord *hits,
                  global uint *image) {
  const FrameParams *frame = &frame_params;
  for (uint pixel = get_global_id(0); pixel < frame->width * frame->height; pixel += get_global_size(0)) {
    image[pixel] = shade_pixel(frame, params, pixel, hits[pixel].t, hits[pixel].grad_x, hits[pixel].grad_y,
                               hits[pixel].grad_z);
  }
}
