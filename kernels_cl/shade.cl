/// shade.cl -- hit buffer -> framebuffer. Never changes which hit was chosen.
#include "portable/shade.h"

/// In      hits [height * width]; open_counts, num_ambient: see shade_pixel()
/// Out     image [(height / samples) * (width / samples)]: RGBA, 8 bits each
/// Launch  grid-stride over pixels
kernel void shade(const FrameParams frame_params, constant ShadeParams *params, uint samples,
                  global const HitRecord *hits, global const uchar *open_counts, uint num_ambient,
                  global uint *image) {
  const FrameParams *frame = &frame_params;
  const uint columns = frame->view.width / samples, rows = frame->view.height / samples;
  for (uint pixel = get_global_id(0); pixel < columns * rows; pixel += get_global_size(0))
    image[pixel] = shade_pixel(frame, params, samples, pixel % columns, pixel / columns, hits,
                               open_counts, num_ambient);
}
