/// shade.cl -- hit buffer -> the arrays that users get: colours, distances, normals. Never changes
/// which hit was chosen.
#include "device/store_pixels.h"
#include "portable/shade.h"

/// In      color_map [ISO_MAP_COLORS]; hits [height * width]; open_counts, num_ambient,
///         num_shadow, bounced, num_bounced: see LightOfHits; field_values: see shade_pixel()
/// Out     bytes: RGBA [height / samples][width / samples][4] if with_alpha is not 0, else RGB [3];
///         8 bits each. Pixels are rounded up to a multiple of four, by pixels of 0
/// Launch  grid-stride over four pixels
kernel void shade(const FrameParams frame_params, const ShadeParams shade_params,
                  global const uint *color_map, uint samples, global const HitRecord *hits,
                  global const uchar *open_counts, uint num_ambient, uint num_shadow,
                  global const float *bounced, uint num_bounced, global const float *field_values,
                  uint with_alpha, global void *bytes) {
  global uint *image = (global uint *)bytes;
  const FrameParams *frame = &frame_params;
  const LightOfHits light = {open_counts, num_ambient, num_shadow, bounced, num_bounced, 0};
  const uint columns = frame->view.width / samples, rows = frame->view.height / samples;
  const uint num_pixels = columns * rows,
             num_items = (num_pixels + ISO_PIXELS_OF_ITEM - 1) / ISO_PIXELS_OF_ITEM;
  for (uint item = get_global_id(0); item < num_items; item += get_global_size(0)) {
    uint rgba[ISO_PIXELS_OF_ITEM];
    for (uint i = 0; i < ISO_PIXELS_OF_ITEM; ++i) {
      const uint pixel = ISO_PIXELS_OF_ITEM * item + i;
      rgba[i] = pixel < num_pixels
                    ? shade_pixel(frame, &shade_params, color_map, samples, pixel % columns,
                                  pixel / columns, hits, &light, field_values)
                    : 0;
    }
    store_pixels(rgba, with_alpha, image, item);
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
