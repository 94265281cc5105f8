/// kept_picture.cl -- a smaller picture of the same frame stands in for pixels of a larger one
/// without a hit yet.
#include "portable/shared_types.h"

/// Fills a picture with the kept one's hits, each pixel with the nearest of the same place: pixels
/// without a hit, or all. Both pictures have the same vertical field of view.
///
/// In      kept [kept_height * kept_width]
/// Out     hits [height * width]
/// Launch  grid-stride over pixels
kernel void show_kept(const FrameParams frame_params, uint kept_width, uint kept_height,
                      global const HitRecord *kept, uint everywhere, global HitRecord *hits) {
  const FrameParams *frame = &frame_params;
  const int width = (int)frame->view.width, height = (int)frame->view.height;
  const int small_width = (int)kept_width, small_height = (int)kept_height;
  for (uint pixel = get_global_id(0); pixel < frame->view.width * frame->view.height;
       pixel += get_global_size(0)) {
    if (!everywhere && hits[pixel].t < INFINITY) continue;
    const int column = (int)(pixel % frame->view.width), row = (int)(pixel / frame->view.width);
    /* Distances from the middle, in halves of a pixel of the one picture times the other's height.
     */
    const int x = (2 * column + 1 - width) * small_height + small_width * height;
    const int small_column = clamp(x / (2 * height), 0, small_width - 1);
    const int small_row = (2 * row + 1) * small_height / (2 * height);
    hits[pixel] = kept[small_row * small_width + small_column];
  }
}
