/// shared_types_fields.h -- the fields of every struct of shared_types.h, in order, for what must
/// visit them all. ISO_<STRUCT>_FIELDS(X) expands X(field) for each; shared_types_test fails when
/// one is missing.
#ifndef ISOWAVE_SHARED_TYPES_FIELDS_H
#define ISOWAVE_SHARED_TYPES_FIELDS_H
// Lists that read as lists:
// clang-format off

#define ISO_FRAME_PARAMS_FIELDS(X)                                          \
  X(dims_x) X(dims_y) X(dims_z) X(blocks_x) X(blocks_y) X(blocks_z)         \
  X(width) X(height)                                                        \
  X(eye_x) X(eye_y) X(eye_z) X(fwd_x) X(fwd_y) X(fwd_z)                     \
  X(right_x) X(right_y) X(right_z) X(up_x) X(up_y) X(up_z)                  \
  X(pixel_scale) X(t_scale) X(isovalue) X(isovalue_index)                   \
  X(max_spec_count)                                                         \
  X(active_begin_x) X(active_begin_y) X(active_begin_z)                     \
  X(active_end_x) X(active_end_y) X(active_end_z)                           \
  X(screen_begin_x) X(screen_begin_y) X(screen_end_x) X(screen_end_y)       \
  X(per_ray_speculation) X(table_groups)                                    \
  X(id_blocks_x) X(id_blocks_y) X(id_begin_z)                               \
  X(ranges_begin) X(masks_begin) X(begin_t) X(end_t)
#define ISO_PAIR_HIT_FIELDS(X) X(cell) X(s)
#define ISO_BLOCK_RAYS_FIELDS(X) X(begin) X(end)
#define ISO_HIT_RECORD_FIELDS(X) X(t) X(block_id) X(cell) X(x) X(y) X(z) X(grad_x) X(grad_y) X(grad_z)
#define ISO_STREAM_LAYOUT_FIELDS(X) X(bits_per_block) X(words_per_part) X(min_exponent) X(whole_numbers) \
  X(value_offset) X(bound_unit) X(bounds_begin) X(bounds_by_place)
#define ISO_PASS_COUNTS_FIELDS(X)                                           \
  X(ray_count) X(pass) X(frame_pass) X(last_frame_pass) X(active_count) X(spec_count) X(window_count)      \
  X(pair_slot_count) X(pair_count) X(ahead_count)                           \
  X(granted_count) X(visible_count) X(requested_count) X(decoded_count)     \
  X(recycled_count) X(hit_count) X(next_active_count) X(free_count)

// clang-format on
#endif
