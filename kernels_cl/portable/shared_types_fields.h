/// shared_types_fields.h -- the fields of every struct of shared_types.h, in order, for what must
/// visit them all. ISO_<STRUCT>_FIELDS(X) expands X(field) for each; shared_types_test fails when
/// one is missing.
#ifndef ISOWAVE_SHARED_TYPES_FIELDS_H
#define ISOWAVE_SHARED_TYPES_FIELDS_H
// Lists that read as lists:
// clang-format off

#define ISO_FRAME_PARAMS_FIELDS(X)                                                             \
  X(grid.dims_x) X(grid.dims_y) X(grid.dims_z)                                                 \
  X(grid.blocks_x) X(grid.blocks_y) X(grid.blocks_z)                                           \
  X(place.blocks_x) X(place.blocks_y) X(place.begin_z)                                         \
  X(place.ranges_begin) X(place.masks_begin)                                                   \
  X(brick.origin_x) X(brick.origin_y) X(brick.origin_z)                                        \
  X(brick.before_x) X(brick.before_y) X(brick.before_z)                                        \
  X(brick.behind_x) X(brick.behind_y) X(brick.behind_z)                                        \
  X(view.width) X(view.height)                                                                 \
  X(view.eye_x) X(view.eye_y) X(view.eye_z) X(view.fwd_x) X(view.fwd_y) X(view.fwd_z)          \
  X(view.right_x) X(view.right_y) X(view.right_z) X(view.up_x) X(view.up_y) X(view.up_z)       \
  X(view.pixel_scale) X(view.t_scale) X(view.is_parallel) X(view.stride)                       \
  X(band.begin_t) X(band.end_t)                                                                \
  X(surface.isovalue) X(surface.isovalue_index)                                                \
  X(surface.active_begin_x) X(surface.active_begin_y) X(surface.active_begin_z)                \
  X(surface.active_end_x) X(surface.active_end_y) X(surface.active_end_z)                      \
  X(screen.begin_x) X(screen.begin_y) X(screen.end_x) X(screen.end_y)                          \
  X(schedule.max_spec_count) X(schedule.per_ray_speculation) X(schedule.cache_slots)          \
  X(schedule.scanned_pairs)
#define ISO_PAIR_HIT_FIELDS(X) X(cell) X(s)
#define ISO_BLOCK_RAYS_FIELDS(X) X(begin) X(end)
#define ISO_HIT_RECORD_FIELDS(X) \
  X(t) X(block_id) X(cell) X(x) X(y) X(z) X(grad_x) X(grad_y) X(grad_z)
#define ISO_GIVEN_RAY_FIELDS(X) X(o_x) X(o_y) X(o_z) X(d_x) X(d_y) X(d_z) X(level)
#define ISO_STREAM_LAYOUT_FIELDS(X) X(bits_per_block) X(words_per_part) X(min_exponent) \
  X(least) X(greatest) X(value_offset) X(bound_unit) X(bounds_begin) X(bounds_by_place) \
  X(no_data_begin)
#define ISO_PASS_COUNTS_FIELDS(X)                                           \
  X(ray_count) X(pass) X(frame_pass) X(last_frame_pass) X(active_count) X(spec_count)      \
  X(window_count) X(pair_slot_count) X(pair_count) X(ahead_count)                           \
  X(granted_count) X(visible_count) X(requested_count) X(decoded_count)     \
  X(recycled_count) X(hit_count) X(next_active_count) X(free_count)

// clang-format on
#endif
