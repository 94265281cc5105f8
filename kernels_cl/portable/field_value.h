/// field_value.h -- the value of another volume, the field, at a hit: trilinear between the eight
/// voxels around it; or if the field's values are labels, the label of the nearest of these voxels,
/// by the rules of nearest_label(). Portable: OpenCL C 1.2 and C++.
///
/// Hits outside the field's grid, or in a cell with a corner without data, have no value: NaN.
#ifndef ISOWAVE_FIELD_VALUE_H
#define ISOWAVE_FIELD_VALUE_H

#include "cell_intersect.h"
#include "label_table.h"
#include "no_data.h"
#include "smooth_gradient.h"

ISO_NAMESPACE_BEGIN

#define ISO_FIELD_LEVELS 16u  ///< of detail, of the volume that is drawn
/// Hits so far outside the grid count as at its border [voxels of the field]: the same border may
/// be rounded to one side or the other.
#define ISO_FIELD_REACH 0.00390625f

#define ISO_FIELD_NUMBERS 0u     ///< trilinear
#define ISO_FIELD_LABELS 1u      ///< of the nearest voxel with a label other than 0
#define ISO_FIELD_OWN_LABELS 2u  ///< of the nearest voxel with a label of the hit's surface

/// From a hit's cell to the index space of the field.
typedef struct FieldMap {
  float rows[12];                    ///< row-major 3 x 4, from the finest level's index space
  float field_first[3];              ///< first voxel of the field's brick; 0 if it is not cut
  uint dims[3];                      ///< of the field, or its brick [voxels]
  float first[3][ISO_FIELD_LEVELS];  ///< the same of each level of the volume that is drawn
  uint blocks_x, blocks_y;           ///< blocks of the finest level
  uint num_levels;                   ///< levels that may have hits
  uint caps_alone;                   ///< 0 or 1: hits that are no caps have no value
  uint surfaces;                   ///< bit i: hits of the surface or slice of number i have values
  uint labels;                     ///< ISO_FIELD_*: what the field's values are
  uint begin_z[ISO_FIELD_LEVELS];  ///< see LevelPlace
} FieldMap;
ISO_CHECK_SIZE(FieldMap, 352);

/// The place of a hit in the field, or in its brick.
typedef struct FieldPlace {
  int x, y, z;   ///< cell; -1: outside
  CellPoint at;  ///< in the cell
} FieldPlace;

/// A NaN with the same bits everywhere, unlike NAN.
ISO_INLINE float no_value(void) {
#ifdef __OPENCL_C_VERSION__
  return as_float(0x7FC00000u);
#else
  return std::bit_cast<float>(0x7FC00000u);
#endif
}

/// Bits whose order is that of the values, and back.
ISO_INLINE uint field_key(float value) {
#ifdef __OPENCL_C_VERSION__
  const uint bits = as_uint(value);
#else
  const uint bits = std::bit_cast<uint>(value);
#endif
  return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}
ISO_INLINE float value_of_key(uint key) {
  const uint bits = (key & 0x80000000u) != 0 ? key & 0x7FFFFFFFu : ~key;
#ifdef __OPENCL_C_VERSION__
  return as_float(bits);
#else
  return std::bit_cast<float>(bits);
#endif
}

/// The cell of a grid, or of a brick of it, along an axis; -1: outside.
///
/// p      in the whole grid's index space [voxels]
/// first  of the brick's voxels; 0: the grid is not cut
/// dims   of the brick [voxels]
/// at     Out, the place in the cell, [0,1]
ISO_INLINE int field_cell(float p, float first, uint dims, float *at) {
  const float last = first + (float)(dims - 1u);
  int cell;
  if (!(p >= first - ISO_FIELD_REACH && p <= last + ISO_FIELD_REACH)) return -1;
  p = p > first ? (p < last ? p : last) : first;
  cell = (int)p;
  if (cell > (int)last - 1) cell = (int)last - 1;
  *at = p - (float)cell;
  return cell - (int)first;
}

/// Is it a hit of one of the map's surfaces?
ISO_INLINE int is_of_map(ISO_GLOBAL const FieldMap *m, HitRecord hit) {
  return hit.t != INFINITY && (m->surfaces >> (hit.cell >> ISO_SURFACE_BIT) & 1u) != 0;
}

/// hit: its block's id is that of a frame of any levels of detail.
ISO_INLINE FieldPlace field_place(ISO_GLOBAL const FieldMap *m, HitRecord hit) {
  FieldPlace place = {-1, -1, -1, {0.0f, 0.0f, 0.0f}};
  const uint layer = hit.block_id / m->blocks_x / m->blocks_y;
  uint level = 0;
  float x, y, z, scale;
  if (!is_of_map(m, hit) || (m->caps_alone && (hit.cell & ISO_CAP) == 0)) return place;
  while (level + 1 < m->num_levels && m->begin_z[level + 1] <= layer) ++level;
  /* Voxel k of a level lies where voxel 2k of the finer one does. */
  scale = (float)(1u << level);
  x = scale *
      ((float)(4 * (hit.block_id % m->blocks_x) + (hit.cell & 3u)) + m->first[0][level] + hit.x);
  y = scale * ((float)(4 * (hit.block_id / m->blocks_x % m->blocks_y) + (hit.cell >> 2 & 3u)) +
               m->first[1][level] + hit.y);
  z = scale * ((float)(4 * (layer - m->begin_z[level]) + (hit.cell >> 4 & 3u)) +
               m->first[2][level] + hit.z);
  place.x = field_cell(fma(m->rows[0], x, fma(m->rows[1], y, fma(m->rows[2], z, m->rows[3]))),
                       m->field_first[0], m->dims[0], &place.at.x);
  place.y = field_cell(fma(m->rows[4], x, fma(m->rows[5], y, fma(m->rows[6], z, m->rows[7]))),
                       m->field_first[1], m->dims[1], &place.at.y);
  place.z = field_cell(fma(m->rows[8], x, fma(m->rows[9], y, fma(m->rows[10], z, m->rows[11]))),
                       m->field_first[2], m->dims[2], &place.at.z);
  return place;
}

ISO_INLINE int is_in_field(FieldPlace place) {
  return place.x >= 0 && place.y >= 0 && place.z >= 0;
}

/// The block of the cell's lowest corner, in the field.
ISO_INLINE BlockCoords field_base(FieldPlace place) {
  BlockCoords base;
  base.x = (uint)place.x >> 2;
  base.y = (uint)place.y >> 2;
  base.z = (uint)place.z >> 2;
  return base;
}

/// The blocks of the cell's corners, bits 0..7: corner x + 2y + 4z is field_base() + (x,y,z).
ISO_INLINE uint field_blocks(FieldPlace place) {
  const BlockCoords base = field_base(place);
  return corners_of(blocks_of_voxels(place.x, place.x + 1, base.x),
                    blocks_of_voxels(place.y, place.y + 1, base.y),
                    blocks_of_voxels(place.z, place.z + 1, base.z));
}

/// v [8]: the cell's corners, x + 2y + 4z.
ISO_INLINE float field_value(const float *v, CellPoint at) {
  if (lacks_data(v)) return no_value();
  return without_zero_sign(lerp(at.z, lerp(at.y, lerp(at.x, v[0], v[1]), lerp(at.x, v[2], v[3])),
                                lerp(at.y, lerp(at.x, v[4], v[5]), lerp(at.x, v[6], v[7]))));
}

/// The label at a hit: that of the nearest of the cell's corners, of several the first. Corners of
/// the background, label 0, do not count, unless the hit is on a surface of it.
///
/// v            [8]: the cell's corners, x + 2y + 4z
/// label_table  see groups_of_label(); not read unless m->labels is ISO_FIELD_OWN_LABELS
ISO_INLINE float nearest_label(ISO_GLOBAL const FieldMap *m, ISO_GLOBAL const uint *label_table,
                               HitRecord hit, const float *v, CellPoint at) {
  const uint surface = hit.cell >> ISO_SURFACE_BIT;
  float label = no_value(), least = 4.0f; /* squared distances are 3 at most [voxels] */
  int corner;
  if (lacks_data(v)) return label;
  for (corner = 0; corner < 8; ++corner) {
    const float x = corner & 1 ? 1.0f - at.x : at.x, y = corner & 2 ? 1.0f - at.y : at.y,
                z = corner & 4 ? 1.0f - at.z : at.z;
    const float distance = fma(x, x, fma(y, y, z * z));
    if (distance < least && is_label(v[corner]) &&
        (m->labels == ISO_FIELD_OWN_LABELS
             ? (groups_of_label(label_table, v[corner]) >> surface & 1u) != 0
             : v[corner] != 0.0f)) {
      label = v[corner];
      least = distance;
    }
  }
  return label;
}

/// What a hit shows of the field. Arguments as nearest_label().
ISO_INLINE float value_of_hit(ISO_GLOBAL const FieldMap *m, ISO_GLOBAL const uint *label_table,
                              HitRecord hit, const float *v, CellPoint at) {
  return m->labels == ISO_FIELD_NUMBERS ? field_value(v, at)
                                        : nearest_label(m, label_table, hit, v, at);
}

ISO_NAMESPACE_END

#endif
