/// shade.cl -- hit buffer -> the arrays that users get: colours, distances, normals. Never changes
/// which hit was chosen.
#include "portable/shade.h"

#define PIXELS 4u /* of a work-item: RGB of four pixels are three words */

/// In      hits [height * width]; open_counts, num_ambient: see shade_pixel()
/// Out     bytes: RGBA [height / samples][width / samples][4] if with_alpha is not 0, else RGB
///         [3]; 8 bits each. Pixels are rounded up to a multiple of four; those beyond the picture
///         are 0.
/// Launch  grid-stride over four pixels
kernel void shade(const FrameParams frame_params, const ShadeParams shade_params, uint samples,
                  global const HitRecord *hits, global const uchar *open_counts, uint num_ambient,
                  uint with_alpha, global void *bytes) {
  global uint *image = (global uint *)bytes;
  const FrameParams *frame = &frame_params;
  const uint columns = frame->view.width / samples, rows = frame->view.height / samples;
  const uint num_pixels = columns * rows, num_items = (num_pixels + PIXELS - 1) / PIXELS;
  for (uint item = get_global_id(0); item < num_items; item += get_global_size(0)) {
    uint rgba[PIXELS];
    for (uint i = 0; i < PIXELS; ++i) {
      const uint pixel = PIXELS * item + i;
      rgba[i] = pixel < num_pixels ? shade_pixel(frame, &shade_params, samples, pixel % columns,
                                                 pixel / columns, hits, open_counts, num_ambient)
                                   : 0;
    }
    if (with_alpha) {
      for (uint i = 0; i < PIXELS; ++i) image[4 * item + i] = rgba[i];
    } else {
      image[3 * item] = (rgba[0] & 0xffffffu) | rgba[1] << 24;
      image[3 * item + 1] = (rgba[1] >> 8 & 0xffffu) | rgba[2] << 16;
      image[3 * item + 2] = (rgba[2] >> 16 & 0xffu) | rgba[3] << 8;
    }
  }
}

/// In      hits [begin + count]
/// Out     bytes: float [count], the distances from the eye of hits `begin` and on
/// Launch  grid-stride over hits
kernel void hit_depths(uint begin, uint count, global const HitRecord *hits, global void *bytes) {
  global float *depths = (global float *)bytes;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) depths[i] = hits[begin + i].t;
}

/// In      hits [begin + count]
/// Out     bytes: float [count][3], see world_normal()
/// Launch  grid-stride over hits
kernel void hit_normals(const ShadeParams shade_params, uint begin, uint count,
                        global const HitRecord *hits, global void *bytes) {
  global float *normals = (global float *)bytes;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const AmbientDirection normal = world_normal(&shade_params, hits[begin + i]);
    normals[3 * i] = normal.x;
    normals[3 * i + 1] = normal.y;
    normals[3 * i + 2] = normal.z;
  }
}
