#include "core/render/renderer.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/ocl/in_process.hpp"
#include "core/render/stall_guard.hpp"
#include "core/render/surface_camera.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/stated_errors.hpp"
#include "kernels_cl/portable/block_grid.h"
#include "kernels_cl/portable/window.h"

namespace isowave::core {

namespace {

/// Caches of fewer slots may run out of them within one pass, unless they are made for what a frame
/// needs (MemoryPlan::can_grow()), or for all blocks.
constexpr std::uint32_t kSmallCache = 1u << 16;
/// Slots are scarce where fewer than one of so many are free.
constexpr std::uint32_t kScarcePart = 8;

FrameState make_state(ocl::Device &device, const CompressedVolume &volume,
                      const RendererOptions &options, const MemoryPlan &plan) {
  if (volume.info.brick != BrickOf{}) device.draw_bricks();
  if (options.with_bounds && volume.info.brick != BrickOf{} && !volume.no_data.empty())
    throw Error(
        "{} voxels have no data: bounds of a frame's error beside them are found by one process "
        "alone, draw the volume with one",
        volume.no_data.num_voxels());
  const std::vector<const CompressedVolume *> volumes = levels_of(volume, options.with_levels);
  const std::vector<FrameParams> grids = make_level_grids(level_infos(volume, options.with_levels));
  const RendererLimits &limits = plan.limits;
  const bool has_levels = volumes.size() > 1;
  const auto buffers = std::make_shared<MacrocellBuffers>(device, limits.macrocells);
  if (buffers->no_data) buffers->no_data->write(joined_no_data(volumes));
  std::vector<DeviceStream> streams;
  std::vector<Macrocells> macrocells;  // of all levels before any decoder, see plan.setup_bytes
  // Bounds need the range of values (value_offset()), which a file may get wrong.
  const bool checks_range = options.with_bounds && volume.errors_are_stated;
  std::array<float, 2> extremes{};
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    streams.push_back(
        plan.stream == StreamPlace::kHost
            ? DeviceStream(device, *volumes[i], OnHost{plan.window_blocks}, options.with_bounds)
            : DeviceStream(device, *volumes[i], options.largest_stream_part, options.with_bounds));
    macrocells.emplace_back(device, grids[i], streams.back(), buffers,
                            i == 0 ? options.range_thresholds : std::vector<float>(),
                            i == 0 && checks_range ? &extremes : nullptr);
  }
  if (checks_range) check_value_range(volume, extremes);
  std::vector<Level> levels;
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    const CompressedVolume &level = *volumes[i];
    ZfpDecode decode(device, limits.cache.max_requests(), streams[i].defines(), has_levels);
    levels.push_back({level.info, level.precision, LevelError(level, i == 0), std::move(streams[i]),
                      std::move(macrocells[i]), std::move(decode)});
  }
  Wavefront rays(device, limits.rays);
  BlockCache cache(device, limits.cache, options.group_size, has_levels);
  return {device, std::move(levels), std::move(rays), std::move(cache)};
}

/// A frame that freed more slots than these of blocks that it had asked for leaves nothing of use
/// to the next. What is left of a ray's blocks makes it wait once for each that is gone. To a GPU
/// such passes cost more than decoding all anew: H100, 512^3, frames that come again take 1.2 ms
/// with 90,000 slots, 1.4 with 85,000 and 1.9 with 70,000 where blocks are kept, cold ones 1.3.
/// Where blocks take longer, since a CPU decodes them or they must be uploaded first, more are
/// worth keeping: PoCL, 80,000 and 65,536 slots, 123 and 138 ms, cold 154 and 146.
std::uint32_t most_recycled(std::uint32_t num_slots, ocl::DeviceType type, StreamPlace stream) {
  return num_slots / (type == ocl::DeviceType::kCpu || stream == StreamPlace::kHost ? 2 : 8);
}

/// Slots that the frame has freed of blocks that it had asked for itself.
std::uint64_t recycled_blocks(const FrameStats &stats) {
  std::uint64_t sum = stats.normals.recycled_blocks + stats.ambient.recycled_blocks;
  for (const PassStats &pass : stats.passes) sum += pass.counts.recycled_count;
  return sum;
}

/// Columns of the picture that a list of rays is seen as.
constexpr std::uint32_t kGivenColumns = 1024;

/// Puts the frame that shading reads back when this goes.
struct FrameOfPicture {
  Wavefront &rays;
  FrameParams frame;
  ~FrameOfPicture() { rays.frame = frame; }
};

std::vector<VolumeInfo> infos_of(const std::vector<Level> &levels) {
  std::vector<VolumeInfo> infos;
  infos.reserve(levels.size());
  for (const Level &level : levels) infos.push_back(level.info);
  return infos;
}

LaterPasses later_pass(const PassStats &pass) {
  return {1, pass.counts.decoded_count, pass.counts.recycled_count, 0, pass.stage_ms};
}

PassStats with_all_hits(PassStats pass) {
  pass.completed_percent = 100;
  return pass;
}

}  // namespace

FrameStats Renderer::render(const FrameRequest &request) {
  const auto begin = std::chrono::steady_clock::now();
  const Uploads uploaded_before = uploads();
  const OnPass &on_pass = request.on_pass;
  const bool is_smooth = request.normals == Normals::kSmooth;
  const bool more_follows = is_smooth || request.ambient_rays != 0;
  FrameStats stats;
  begin_frame(request);
  state_.counts_touched = in_step(on_pass);
  stats.first_level = state_.drawing.first;
  stats.last_level = state_.drawing.end - 1;
  StallGuard guard(state_.levels[0].info.dims);
  const std::pair view(request.camera, request.isovalue);
  bool &took_one_pass = took_one_pass_[last_view_ == view];
  last_view_ = view;
  // Where a single pass was enough for the last such frame, normals begin right behind the first,
  // without waiting for the host. Should this frame need more, they have touched nothing.
  bool has_begun_normals = false,
       may_begin_normals = is_smooth && took_one_pass && !in_step(on_pass);
  for (bool finished = false; !finished && !stats.cancelled;) {
    pipeline_->enqueue_pass();
    has_picture_ = true;  // the hits of the frame before are gone, at the latest now
    readback_.push(state_.rays.counts);
    if (std::exchange(may_begin_normals, false)) {
      enqueue_normals(true);
      has_begun_normals = true;
    } else if (!in_step(on_pass) && readback_.in_flight() < PassReadback::kMaxInFlight) {
      continue;  // read one pass behind: the device never waits for us
    }
    PassStats pass = stats_of(readback_.pop());
    if (state_.counts_touched) pass.touched_blocks = state_.cache.touched_blocks();
    stats.rays_hit += pass.counts.hit_count;
    stats.passes.push_back(pass);
    finished = pass.counts.next_active_count == 0;
    stats.cancelled = on_pass && !on_pass(pass) && (more_follows || !finished);
    guard.check(pass.counts);
    if (has_begun_normals && !finished) {
      readback_.drain();
      state_.rays.unopen_pass();
      has_begun_normals = false;
    }
  }
  state_.counts_touched = false;
  took_one_pass = stats.passes.size() == 1;
  // The hits are complete. A pass that is enqueued beyond the last finds no rays, and nobody waits
  // for it.
  if (stats.passes.back().counts.next_active_count == 0) pipeline_->end_frame();
  if (is_smooth && !stats.cancelled)
    finish_normals(on_pass, has_begun_normals, request.ambient_rays != 0, stats);
  if (request.ambient_rays != 0 && !stats.cancelled) add_ambient(request, stats);
  const std::uint64_t recycled = recycled_blocks(stats);
  if (!stats.cancelled &&
      recycled > most_recycled(state_.cache.num_slots, device_.info().type, options_.stream))
    state_.cache.clear();
  plan_growth(recycled);
  state_.rays.frame = state_.levels[0].frame;  // for shading
  const Uploads uploaded = uploads();
  stats.uploaded_blocks = uploaded.blocks - uploaded_before.blocks;
  stats.uploaded_bytes = uploaded.bytes - uploaded_before.bytes;
  stats.total_ms = ms_since(begin);
  return stats;
}

/// Begins with all hits, or goes on with those that wait.
void Renderer::enqueue_normals(bool begins, RaySource of) {
  state_.rays.open_pass();
  if (!begins) state_.provide_blocks(state_.rays.previous_counts, state_.drawing);
  const auto stage = device_.timer().stage("normals");
  smooth_normals_(state_.cache, state_.rays, begins, of);
  readback_.push(state_.rays.counts);
}

/// Enqueues and awaits what is left of the passes for smooth normals. has_begun: the first is
/// enqueued.
void Renderer::finish_normals(const OnPass &on_pass, bool has_begun, bool more_follows,
                              FrameStats &stats, RaySource of) {
  const auto begin = std::chrono::steady_clock::now();
  open_requests_ = state_.drawing;
  if (!has_begun) {
    enqueue_normals(true, of);
    if (readback_.in_flight() == PassReadback::kMaxInFlight)
      readback_.pop();  // of the pass beyond the last
  }
  StallGuard guard(state_.levels[0].info.dims);
  for (bool finished = false; !finished && !stats.cancelled;) {
    if (!in_step(on_pass) && readback_.in_flight() < PassReadback::kMaxInFlight)
      enqueue_normals(false, of);
    const PassStats pass = stats_of(readback_.pop());
    stats.normals += later_pass(pass);
    finished = pass.counts.next_active_count == 0;
    stats.cancelled = on_pass && !on_pass(with_all_hits(pass)) && (more_follows || !finished);
    guard.check(pass.counts);
    if (finished) open_requests_.reset();
    if (!finished && !stats.cancelled && readback_.in_flight() == 0) enqueue_normals(false, of);
  }
  stats.normals.ms = ms_since(begin);
}

/// Round by round: a ray of each hit, through the same passes. Between rounds, the picture shows
/// those that are through.
void Renderer::add_ambient(const FrameRequest &request, FrameStats &stats) {
  const auto begin = std::chrono::steady_clock::now();
  ambient_->begin(state_.levels[state_.drawing.first].info, request.ambient_rays);
  for (std::uint32_t round = 0; round < request.ambient_rays && !stats.cancelled; ++round) {
    {
      const auto stage = device_.timer().stage("ambient");
      (*ambient_)(state_.rays, round);
    }
    stats.cancelled = !trace_given(request.on_pass, stats.ambient);
  }
  if (!stats.cancelled) (*ambient_)(state_.rays, request.ambient_rays);
  stats.ambient.ms = ms_since(begin);
}

/// Traces the rays state_.rays.given. Returns false where on_pass says to stop.
bool Renderer::trace_given(const OnPass &on_pass, LaterPasses &stats) {
  readback_.drain();
  open_requests_ = state_.drawing;
  given_pipeline_->begin_frame();
  StallGuard guard(state_.levels[0].info.dims);
  for (bool finished = false; !finished;) {
    given_pipeline_->enqueue_pass();
    readback_.push(state_.rays.counts);
    if (!in_step(on_pass) && readback_.in_flight() < PassReadback::kMaxInFlight) continue;
    const PassStats pass = stats_of(readback_.pop());
    stats += later_pass(pass);
    finished = pass.counts.next_active_count == 0;
    guard.check(pass.counts);
    if (on_pass && !on_pass(with_all_hits(pass))) return false;
  }
  given_pipeline_->end_frame();
  open_requests_.reset();
  return true;
}

/// Answers what is left of the requests of a frame whose normals or ambient rays were cut short,
/// and forgets its rays. rays.frame: of any frame.
void Renderer::answer_requests() {
  const auto of = std::exchange(open_requests_, std::nullopt);
  if (!of) return;
  state_.rays.forget_rays();
  state_.rays.open_pass();
  state_.provide_blocks(state_.rays.previous_counts, *of);
  smooth_normals_(state_.cache, state_.rays, false);  // of no ray; opens the next pass
  if (given_pipeline_) given_pipeline_->end_frame();
}

Renderer::Renderer(ocl::Device &device, const CompressedVolume &volume,
                   const RendererOptions &options)
    : device_(device),
      setup_begin_(std::chrono::steady_clock::now()),
      compile_ms_before_(device.compile_ms()),
      options_(checked(options, volume, device)),
      plan_(make_plan(device, volume, options_)),
      state_(make_state(device, volume, options_, plan_)),
      level_frames_(device),
      value_range_(volume.value_range),
      size_(options_.size),
      pipeline_(make_pipeline(options_.pipeline, state_, plan_.limits.pairs, options_.solver,
                              options_.closest, options_.packets, options_.on_demand)),
      smooth_normals_(device, state_.rays.num_rays, options_.group_size, state_.levels.size() > 1),
      shade_(device, options_.size.num_rays()),
      readback_(device) {
  level_frames_->reserve(state_.levels.size());  // they never move while they are written
  if (plan_.limits.kept_rays != 0) kept_.emplace(device, plan_.limits.kept_rays);
  if (options_.with_given_rays) {
    given_pipeline_ = make_given_pipeline(state_, options_.group_size, options_.solver);
    ambient_.emplace(device, state_.rays.num_rays, state_.levels.size() > 1, is_brick());
  }
  options_.cache_slots = wanted_slots_ = plan_.cache_slots;
  is_small_cache_ = plan_.cache_slots < kSmallCache && !plan_.can_grow() &&
                    plan_.cache_slots < plan_.limits.cache.num_blocks;
  options_.stream = plan_.stream;
  options_.window_blocks = plan_.window_blocks;
  compile_kernels();
  device.timer().collect();  // what was launched so far belongs to no frame; waits
  device.finish();
  ocl::give_back_compiler(device.info());
  setup_ms_ = ms_since(setup_begin_) - (device.compile_ms() - compile_ms_before_);
}

/// Launches whatever frames will launch. PoCL and Mesa compile a kernel when it is launched first,
/// PoCL for each work-group size, and anew for more than 65,535 work-items. So the passes
/// themselves run, of a frame of one pixel that meets nothing: what is launched here cannot differ
/// from what frames launch, and all kernels leave by the exits they have for empty lists. Costs no
/// time that grows with the volume; all that it leaves is one hit, which every frame clears.
void Renderer::compile_kernels() {
  const auto compiling = device_.compiling();
  Wavefront &rays = state_.rays;
  rays.frame = FrameParams{};
  rays.frame.view.width = rays.frame.view.height = rays.frame.schedule.max_spec_count = 1;
  rays.frame.schedule.table_groups = state_.cache.table_groups;
  rays.frame.schedule.scanned_pairs = options_.scanned_pairs;
  // Frames of one level of detail and of several have kernels of their own.
  for (std::uint32_t num_levels = 1; num_levels <= std::min<std::size_t>(2, state_.levels.size());
       ++num_levels) {
    rays.num_level_frames = num_levels;
    pipeline_->begin_frame();
    for (int pass = 0; pass < 2; ++pass)
      pipeline_->enqueue_pass();  // the first has nothing to decode
    pipeline_->end_frame();
    if (options_.with_shading) enqueue_normals(true);
    if (given_pipeline_) {
      (*ambient_)(rays, 0);
      given_pipeline_->begin_frame();
      for (int pass = 0; pass < 2; ++pass) given_pipeline_->enqueue_pass();
      given_pipeline_->end_frame();
    }
    readback_.drain();
  }
  state_.cache.classify(rays);
  state_.cache.count_touched(rays, true);
  for (Level &level : state_.levels) level.decode.compile(level.stream, rays.counts, state_.cache);
  if (options_.with_shading) shade_.compile(rays);
  if (kept_) kept_->compile(rays);
  rays.reset_counts();
}

/// After a frame that has freed so many slots of its own blocks.
void Renderer::plan_growth(std::uint64_t recycled) {
  wanted_slots_ = grown_cache_slots(plan_, recycled);
}

/// Between frames: a cache of wanted_slots_, without a block. What there was is freed first, so
/// that the plan is kept. Where the device has not so much memory after all, the cache stays as
/// large as it was, or becomes smaller, and never grows again; pictures do not depend on it.
void Renderer::grow_cache() {
  if (wanted_slots_ == plan_.cache_slots) return;
  const std::uint32_t before = plan_.cache_slots;
  for (std::uint32_t slots = wanted_slots_;;) {
    try {
      MemoryPlan plan = resized(plan_, slots);
      state_.resize_cache(plan.limits.cache);
      pipeline_->resize_cache(slots);
      plan_ = std::move(plan);
      break;
    } catch (const Error &) {
      if (slots == kMinCacheSlots) throw;
      slots = slots > before ? before : std::max(slots / 2, kMinCacheSlots);
    }
  }
  if (plan_.cache_slots != wanted_slots_) {
    plan_.most_slots = plan_.cache_slots;
    is_small_cache_ |= plan_.cache_slots < std::min(before, kSmallCache);
  }
  options_.cache_slots = wanted_slots_ = plan_.cache_slots;
  cached_isovalue_.reset();
  open_requests_.reset();
  pipeline_->end_frame();
  if (given_pipeline_) given_pipeline_->end_frame();
}

/// Throws Error before anything has changed.
void Renderer::check(const FrameRequest &request) const {
  const ImageSize size = size_of(request);
  check_image_size(size);
  if (size.num_rays() > state_.rays.num_rays) {
    throw Error("{}x{} pixels have more than the {} rays that the renderer was made for",
                size.width, size.height, state_.rays.num_rays);
  }
  check_voxel_pixels(request.voxel_pixels);
  if (request.voxel_pixels > 0 && !options_.with_levels) {
    throw Error("a renderer of the finest level alone cannot draw with {} pixels between voxels",
                request.voxel_pixels);
  }
  if (request.bound != FieldBound::kNone && !options_.with_bounds)
    throw Error("a renderer that was made without bounds cannot draw one");
  check_ambient_rays(request.ambient_rays);
  if (request.ambient_rays != 0) check_has_given();
}

void Renderer::begin_frame(const FrameRequest &request) {
  check(request);
  if (request.ambient_rays != 0 && is_brick())
    throw Error("a brick's ambient rays go on in other bricks: see BrickRenderer");
  const ImageSize size = size_of(request);
  std::vector<FrameParams> frames = make_level_frames(infos_of(state_.levels), request.camera, size,
                                                      request.isovalue, request.voxel_pixels);
  const std::vector<DecodedValues> values = decoded_values(request);
  has_picture_ = false;
  size_ = size;
  state_.rays.num_ambient = 0;
  open_frame(std::move(frames), values, request.bound, RaySource::kCamera);
  pipeline_->begin_frame();
}

/// Makes the levels, the cache and the rays' constants those of the frame, that its rays can begin.
void Renderer::open_frame(std::vector<FrameParams> frames, const std::vector<DecodedValues> &values,
                          FieldBound bound, RaySource source) {
  const float isovalue = frames.front().surface.isovalue;
  readback_.drain();  // of what the frame before had enqueued beyond its last pass
  grow_cache();
  decode_as(values, bound);
  const auto first = std::ranges::find_if(frames, draws);
  const auto end = std::find_if_not(first, frames.end(), draws);
  state_.drawing = {static_cast<std::size_t>(first - frames.begin()),
                    static_cast<std::size_t>(end - frames.begin())};
  const bool has_bands = end - first > 1;
  const Schedule schedule{.max_spec_count = options_.max_speculation,
                          .per_ray_speculation = options_.per_ray_speculation,
                          .table_groups = state_.cache.table_groups,
                          .scanned_pairs = options_.scanned_pairs};
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Level &level = state_.levels[i];
    FrameParams &frame = frames[i];
    frame.schedule = schedule;
    if (draws(frame)) {
      const auto stage = device_.timer().stage("macrocells");
      level.macrocells.select(frame, level.range_error, &level.stream);
      frame.surface = level.macrocells.surface(frame);
      // Where there are several bands, a ray stands at a border wherever it crosses that.
      if (!has_bands && source == RaySource::kCamera) frame.screen = make_screen_box(frame);
    }
    level.frame = frame;
  }
  level_frames_->assign(first, end);
  state_.rays.frame = level_frames_->front();
  state_.rays.num_level_frames = static_cast<std::uint32_t>(level_frames_->size());
  if (state_.levels.size() > 1) state_.rays.level_frames.write_async(*level_frames_);
  if (cached_isovalue_.value_or(isovalue) != isovalue) {
    const auto stage = device_.timer().stage("macrocells");
    state_.cache.classify(state_.rays);
  }
  cached_isovalue_ = isovalue;
  answer_requests();
}

Renderer::Uploads Renderer::uploads() const {
  Uploads sum;
  for (const Level &level : state_.levels) {
    if (const StreamWindow *window = level.stream.window.get()) {
      sum.blocks += window->uploaded_blocks();
      sum.bytes += window->uploaded_bytes();
    }
  }
  return sum;
}

PassStats Renderer::stats_of(const PassCounts &counts) {
  const double rays = static_cast<double>(size_.num_rays());
  PassStats stats;
  stats.counts = counts;
  stats.counts.window_count = rays_in_window(counts.window_count, counts.active_count);
  const bool is_blocks = options_.pipeline == PipelineKind::kBlocks;
  // Pipeline `rays` looks ahead at the end of a pass, for the rays that are left.
  const uint rays_looking = rays_in_window(
      counts.window_count, is_blocks ? counts.active_count : counts.next_active_count);
  if (rays_looking != 0) stats.n_spec = static_cast<double>(counts.ahead_count) / rays_looking;
  if (is_blocks) stats.visible_blocks = counts.visible_count;
  // A launch that is not needed costs more than a pass that finds slots missing now and then. The
  // counts are a pass old: its requests have taken slots since, and the pass after it may have
  // asked for as many.
  const std::uint64_t spoken_for = 2 * std::uint64_t{counts.requested_count};
  const std::uint32_t num_slots = state_.cache.num_slots;
  state_.slots_are_scarce =
      is_small_cache_ ||
      counts.free_count < std::max<std::uint64_t>(num_slots / kScarcePart, spoken_for);
  stats.completed_percent = 100.0 * (rays - counts.next_active_count) / rays;
  stats.utilization_percent = 100.0 * counts.granted_count / rays;
  stats.stage_ms = device_.timer().collect();
  return stats;
}

/// What the request makes of each level's blocks. Throws Error where the error is not known that a
/// bound needs.
std::vector<Renderer::DecodedValues> Renderer::decoded_values(const FrameRequest &request) const {
  std::vector<DecodedValues> values;
  for (const Level &level : state_.levels) {
    const double voxel_error = voxel_error_of(request.voxel_error, values.size());
    const BlockPrecision planes = with_fewer_planes(level.precision, voxel_error);
    const double few_planes = plane_error(level.precision, voxel_error);
    const ValueOffset offset = value_offset(level.error, request.bound, few_planes, value_range_);
    StreamLayout layout = level.stream.layout;
    layout.min_exponent = planes.min_exponent;
    layout.whole_numbers = planes.whole_numbers ? 1 : 0;
    layout.value_offset = offset.uniform;
    layout.bound_unit = offset.unit;
    values.push_back({layout, few_planes});
  }
  return values;
}

/// Has blocks decoded to these values, and forgets those of others.
void Renderer::decode_as(const std::vector<DecodedValues> &values, FieldBound bound) {
  if (options_.with_bounds) state_.levels[0].macrocells.use(static_cast<std::size_t>(bound));
  bool changes = false;
  for (std::size_t i = 0; i < state_.levels.size(); ++i) {
    Level &level = state_.levels[i];
    if (std::memcmp(&values[i].layout, &level.stream.layout, sizeof(StreamLayout)) == 0) continue;
    changes = true;
    level.stream.layout = values[i].layout;
    level.range_error = values[i].range_error;
  }
  if (changes) clear_cache();
}

std::optional<BlockBox> Renderer::surface_box(std::span<const float> isovalues) {
  Level &finest = state_.levels[0];
  finest.macrocells.use(static_cast<std::size_t>(FieldBound::kNone));
  return isowave::core::surface_box(finest.macrocells, finest.info, isovalues);
}

Camera Renderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size) {
  return surface_camera(state_.levels[0].info, surface_box(isovalues),
                        size.value_or(options_.size));
}

std::vector<HitRecord> Renderer::cast_rays(std::span<const WorldRay> world_rays, float isovalue,
                                           Normals normals) {
  check_has_given();
  if (is_brick()) throw Error("rays of any origin go on in other bricks");
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  const std::vector<IndexRay> rays = make_index_rays(state_.levels[0].info, world_rays);
  Wavefront &wavefront = state_.rays;
  const FrameOfPicture kept{wavefront, wavefront.frame};
  // As many as the buffers hold at a time, seen as a picture.
  const auto columns = static_cast<std::uint32_t>(
      std::min<std::uint64_t>({kGivenColumns, wavefront.num_rays, rays.size()}));
  std::vector<HitRecord> hits, part;
  while (hits.size() < rays.size()) {
    const std::size_t num_left = rays.size() - hits.size(),
                      num_rows = std::min((num_left + columns - 1) / columns,
                                          wavefront.num_rays / columns);
    const std::span of_part =
        std::span(rays).subspan(hits.size(), std::min(num_left, num_rows * columns));
    std::vector<GivenRay> given(num_rows * columns);
    std::ranges::transform(of_part, given.begin(), &IndexRay::ray);
    wavefront.given.write(given);
    open_frame(frames_of_rays(columns, static_cast<std::uint32_t>(num_rows), isovalue),
               decoded_values({}), FieldBound::kNone, RaySource::kGiven);
    FrameStats stats;
    trace_given({}, stats.ambient);
    if (normals == Normals::kSmooth) finish_normals({}, false, false, stats, RaySource::kGiven);
    plan_growth(recycled_blocks(stats));
    part.resize(given.size());
    wavefront.given_hits.read(part);
    for (std::size_t i = 0; i < of_part.size(); ++i) part[i].t *= of_part[i].t_scale;
    hits.insert(hits.end(), part.begin(), part.begin() + std::ptrdiff_t(of_part.size()));
  }
  return hits;
}

/// Of all levels: the finest draws given rays, seen as a picture of so many.
std::vector<FrameParams> Renderer::frames_of_rays(std::uint32_t columns, std::uint32_t rows,
                                                  float isovalue) const {
  std::vector<FrameParams> frames = make_level_grids(infos_of(state_.levels));
  for (FrameParams &frame : frames) {
    frame.view.width = columns;
    frame.view.height = rows;
    frame.view.t_scale = 1;
    frame.band = {};
    frame.surface.isovalue = isovalue;
    frame.screen = {0, 0, columns, rows};
  }
  frames.front().band.end_t = std::numeric_limits<float>::infinity();
  return frames;
}

void Renderer::check_has_given() const {
  if (!given_pipeline_)
    throw Error("a renderer that was made without given rays has no ambient ones, and casts none");
}

void Renderer::check_has_picture() const {
  if (!has_picture_) throw Error("there is no picture: no frame has been drawn");
}

std::vector<HitRecord> Renderer::hits() const {
  check_has_picture();
  std::vector<HitRecord> hits(size_.num_rays());
  state_.rays.hits.read(hits);
  return hits;
}

void Renderer::set_hits(std::span<const HitRecord> hits) {
  check_has_picture();
  state_.rays.hits.write(hits);
}

Image8 Renderer::shade(const Appearance &appearance) {
  check_has_picture();
  return shade_(make_shade_params(state_.levels[0].info, appearance), state_.rays, size_.samples);
}

std::vector<std::uint32_t> Renderer::shade_packed(const Appearance &appearance) {
  check_has_picture();
  return shade_.packed(make_shade_params(state_.levels[0].info, appearance), state_.rays,
                       size_.samples);
}

OpenCounts Renderer::open() const {
  check_has_picture();
  OpenCounts open{{}, state_.rays.num_ambient};
  if (open.num_ambient == 0) return open;
  open.counts.resize(size_.num_rays());
  state_.rays.open_counts.read(open.counts);
  return open;
}

std::vector<HitRecord> Renderer::placed_hits() const {
  std::vector<HitRecord> hits = this->hits();
  const bool has_level_ids = level_frames_->size() > 1 || level_frames_->front().place.begin_z != 0;
  for (HitRecord &hit : hits) {
    if (hit.t == std::numeric_limits<float>::infinity()) continue;
    std::size_t level = 0;
    while (has_level_ids &&
           level_block_of(&(*level_frames_)[level], hit.block_id) == ISO_INVALID_ID)
      ++level;
    const FrameParams &frame = (*level_frames_)[level];
    if (has_level_ids) hit.block_id = level_block_of(&frame, hit.block_id);
    hit = placed_hit(&frame, static_cast<uint>(state_.drawing.first + level), hit);
  }
  return hits;
}

void Renderer::begin_ambient(const FrameRequest &request, std::vector<HitRecord> placed,
                             LevelRange levels) {
  check_has_picture();
  check_has_given();
  if (!is_brick()) throw Error("only a brick's frames leave their ambient rays to others");
  for (HitRecord &hit : placed) hit.cell -= static_cast<uint>(levels.first);
  set_hits(placed);
  // A ray stays in the level that has its hit, which this brick need not have drawn.
  std::vector<FrameParams> frames =
      make_level_frames(infos_of(state_.levels), request.camera, size_, request.isovalue, 0);
  for (std::size_t level = 0; level < frames.size(); ++level) {
    const bool may_have_rays = level >= levels.first && level < levels.end;
    const View &view = frames[level].view;
    frames[level].screen = {0, 0, view.width, view.height};  // hits are other bricks', too
    frames[level].band = {.begin_t = 0,
                          .end_t = may_have_rays ? std::numeric_limits<float>::infinity() : 0};
  }
  open_frame(std::move(frames), decoded_values(request), FieldBound::kNone, RaySource::kGiven);
}

std::vector<std::uint64_t> Renderer::blocked_rays(std::uint32_t round, std::uint32_t num_rounds,
                                                  LaterPasses &stats) {
  const auto begin = std::chrono::steady_clock::now();
  state_.rays.frame = level_frames_->front();
  ambient_->begin(state_.levels[state_.drawing.first].info, num_rounds);
  LaterPasses passes;
  {
    const auto stage = device_.timer().stage("ambient");
    (*ambient_)(state_.rays, round);
  }
  trace_given({}, passes);
  state_.rays.frame = state_.levels[0].frame;  // for shading
  std::vector<HitRecord> met(size_.num_rays());
  state_.rays.given_hits.read(met);
  std::vector<std::uint64_t> blocked((met.size() + 63) / 64);
  for (std::size_t ray = 0; ray < met.size(); ++ray) {
    const bool meets = met[ray].t != std::numeric_limits<float>::infinity();
    blocked[ray / 64] |= std::uint64_t{meets} << ray % 64;
  }
  wanted_slots_ = std::max(wanted_slots_, grown_cache_slots(plan_, passes.recycled_blocks));
  passes.ms = ms_since(begin);
  stats += passes;
  return blocked;
}

void Renderer::set_open(const OpenCounts &open) {
  check_has_picture();
  check_has_given();
  state_.rays.open_counts.write(open.counts);
  state_.rays.num_ambient = open.num_ambient;
}

KeptPicture &Renderer::kept() {
  if (!kept_) throw Error("no picture can be kept: the renderer was made without one");
  return *kept_;
}

void Renderer::keep_picture() {
  KeptPicture &into = kept();
  check_has_picture();
  into.keep(state_.rays, size_);
}

void Renderer::fill_from_kept() {
  kept().show(state_.rays, false);
  device_.finish();
}

void Renderer::enlarge_kept(const FrameRequest &request) {
  check(request);
  const ImageSize size = size_of(request);
  state_.rays.frame =
      make_frame_params(state_.levels[0].info, request.camera, size, request.isovalue);
  size_ = size;
  state_.rays.num_ambient = 0;
  kept().show(state_.rays, true);
  device_.finish();
}

void Renderer::clear_cache() {
  state_.cache.clear();
  device_.finish();
  cached_isovalue_.reset();
}

}  // namespace isowave::core
