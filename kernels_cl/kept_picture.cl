/// kept_picture.cl -- a smaller picture of the same frame stands in for pixels of a larger one
/// without a hit yet.
#include "portable/kept_pixel.h"

/// Fills a picture with the kept one's hits, each pixel with the nearest of the same place: pixels
/// without a hit, or all.
///
/// In      kept [kept_height * kept_width]
/// Out     hits [height * width]
/// Launch  grid-stride over pixels
kernel void show_kept(const FrameParams frame_params, uint kept_width, uint kept_height,
                      global const HitRecord *kept, uint everywhere, global HitRecord *hits) {
  const FrameParams *frame = &frame_params;
  for (uint pixel = get_global_id(0); pixel < frame->view.width * frame->view.height;
       pixel += get_global_size(0)) {
    if (!everywhere && hits[pixel].t < INFINITY) continue;
    hits[pixel] = kept[kept_pixel(&frame->view, kept_width, kept_height, pixel)];
  }
}
