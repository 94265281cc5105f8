#include "core/render/device_renderer.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/ocl/in_process.hpp"
#include "core/render/picture_so_far.hpp"
#include "core/render/stall_guard.hpp"
#include "core/render/surface_camera.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/block_grid.h"
#include "kernels_cl/portable/clip.h"
#include "kernels_cl/portable/window.h"

namespace isowave::core {

namespace {

/// Slots that the frame has freed of blocks that it had requested itself.
///
/// shares_field  blocks for values of a field were among them
std::uint64_t recycled_blocks(const FrameStats &stats, bool shares_field = false) {
  std::uint64_t sum = stats.normals.recycled_blocks + stats.behind.recycled_blocks +
                      stats.slices.recycled_blocks + stats.ambient.recycled_blocks;
  for (const PassStats &pass : stats.passes) sum += pass.counts.recycled_count;
  return shares_field ? sum + stats.field.recycled_blocks : sum;
}

/// Columns of the picture that a list of rays is seen as.
constexpr std::uint32_t kGivenColumns = 1024;

/// Puts the frame that shading reads back when this goes.
struct FrameOfPicture {
  Wavefront &rays;
  FrameParams frame;
  ~FrameOfPicture() { rays.frame = frame; }
};

LaterPasses later_pass(const PassStats &pass) {
  return {1, pass.counts.decoded_count, pass.counts.recycled_count, 0, pass.stage_ms};
}

}  // namespace

FrameStats DeviceRenderer::render(const FrameRequest &request) {
  const auto begin = std::chrono::steady_clock::now();
  const Uploads before = blocks_.uploads();
  const bool is_smooth = request.normals == Normals::kSmooth;
  const LightRays light_rays = light_rays_of(request);
  Frame frame{request.on_pass, light_rays.count() +
                                   (light_rays.bounces ? light_rays.num_ambient : 0) +
                                   (is_smooth ? 1 : 0) + (request.field_values ? 1 : 0)};
  frame.on_progress = request.on_progress;
  frame.num_waves = frame.waves_left + 1;
  begin_frame(request);
  frame.stats.first_level = blocks_.drawing.first;
  frame.stats.last_level = blocks_.drawing.end - 1;
  if (light_rays.count() != 0) {
    const VolumeInfo &info = blocks_.levels[blocks_.drawing.first].info;
    const auto num_surfaces =
        static_cast<std::uint32_t>(std::max<std::size_t>(request.surfaces.size(), 1));
    ambient_->begin(info, blocks_.drawing.first, light_rays, num_surfaces);
    if (light_rays.bounces) bounce_->begin(info, blocks_.drawing.first, light_rays, num_surfaces);
  }
  if (request.surfaces.empty()) {
    draw_surface(request, frame);
  } else {
    draw_layers(request, frame);
  }
  if (has_field_values_) read_field(request, frame);
  FrameStats &stats = frame.stats;
  if (request.surfaces.empty() && light_rays.count() != 0) light_surface(light_rays, frame);
  blocks_.close(recycled_blocks(stats, blocks_.plan.field.shares_blocks), stats.cancelled);
  rays_.frame = blocks_.levels[0].frame;  // for shading
  const Uploads after = blocks_.uploads();
  stats.uploaded_blocks = after.blocks - before.blocks;
  stats.uploaded_bytes = after.bytes - before.bytes;
  stats.complete = !stats.cancelled;
  stats.total_ms = ms_since(begin);
  return std::move(stats);
}

/// Draws the hits of the request's one opaque surface.
void DeviceRenderer::draw_surface(const FrameRequest &request, Frame &frame) {
  const bool is_smooth = request.normals == Normals::kSmooth;
  const std::pair view(request.camera, request.isovalue);
  bool &took_one_pass = took_one_pass_[last_view_ == view];
  last_view_ = view;
  // If one pass was enough for the last such frame, normals begin right behind the first pass.
  blocks_.counts_touched = in_step(request.on_pass);
  run(*camera_rays_, frame, is_smooth && took_one_pass ? &normals_of_camera_ : nullptr);
  blocks_.counts_touched = false;
  took_one_pass = frame.stats.passes.size() == 1;
  if (is_smooth) run(normals_of_camera_, frame);
}

/// Runs the passes of one wave until none of its rays is left, or on_pass says to stop. Does
/// nothing in a frame that was stopped.
///
/// next  the wave that follows, if it may begin behind the first pass without waiting for the host.
///       If this wave needs more passes, the next one has done nothing.
void DeviceRenderer::run(Wave &wave, Frame &frame, Wave *next) {
  if (frame.stats.cancelled) return;
  const auto begin = std::chrono::steady_clock::now();
  const bool in_step = this->in_step(frame.on_pass);
  LaterPasses *sum = wave.sum_in(frame.stats);
  BlockStore &blocks = wave.own_blocks() != nullptr ? *wave.own_blocks() : blocks_;
  if (sum != nullptr) --frame.waves_left;
  StallGuard guard(blocks.levels[0].info.dims);
  passes_.begin(wave);
  if (&wave == camera_rays_.get()) has_picture_ = true;  // the hits of the frame before are gone
  if (next != nullptr && !in_step) passes_.begin_early(*next);
  for (bool finished = false; !finished && !frame.stats.cancelled;) {
    while (passes_.are_read() || (!in_step && passes_.have_room())) passes_.enqueue(wave);
    PassStats pass = stats_of(passes_.pop(), blocks);
    frame.tell(pass.completed_percent);
    finished = pass.counts.next_active_count == 0;
    if (sum != nullptr) {
      *sum += later_pass(pass);
      pass.completed_percent = 100;
    } else {
      if (blocks_.counts_touched) pass.touched_blocks = blocks_.cache.touched_blocks();
      frame.stats.rays_hit += pass.counts.hit_count;
      frame.stats.passes.push_back(pass);
    }
    const bool more_follows = !finished || frame.waves_left != 0;
    frame.stats.cancelled = frame.on_pass && !frame.on_pass(pass) && more_follows;
    guard.check(pass.counts);
    if (!finished) passes_.take_back_early();
    if (finished && !passes_.has_early()) blocks.forget_requests();
  }
  if (sum != nullptr) sum->ms += ms_since(begin);
}

/// Casts the light rays of a surface's hits. Until a round begins, the picture shows the rounds
/// before it.
void DeviceRenderer::light_surface(const LightRays &light_rays, Frame &frame) {
  for (std::uint32_t round = 0; round < light_rays.count(); ++round) {
    cast_round(round, frame);
    if (light_rays.bounces && round < light_rays.num_ambient) bounce_round(round, frame);
  }
  if (frame.stats.cancelled) return;
  count_last_round(light_rays.count(), frame);
  if (!light_rays.bounces) return;
  {
    const auto stage = device_.timer().stage("bounce");
    bounce_->filter(rays_);
  }
  add_stage_times(frame.stats.ambient);
}

/// Counts the rays of the last round that have met nothing.
void DeviceRenderer::count_last_round(std::uint32_t num_rounds, Frame &frame) {
  {
    const auto stage = device_.timer().stage("ambient");
    (*ambient_)(rays_, num_rounds);
  }
  add_stage_times(frame.stats.ambient);
}

/// Adds the times of what was launched behind the last pass.
void DeviceRenderer::add_stage_times(LaterPasses &passes) {
  LaterPasses behind;
  behind.stage_ms = device_.timer().collect();
  passes += behind;
}

/// Casts one light ray of each hit.
///
/// goes_on  the rays have been made already
void DeviceRenderer::cast_round(std::uint32_t round, Frame &frame, bool goes_on) {
  ambient_round_->set_round(round, goes_on);
  run(*ambient_round_, frame);
}

/// Casts a ray towards the light from where each ambient ray of the round has met the surface.
void DeviceRenderer::bounce_round(std::uint32_t round, Frame &frame) {
  if (frame.stats.cancelled) return;
  {
    const auto stage = device_.timer().stage("bounce");
    bounce_->go_to_light(rays_, round, rays_.given_hits);
  }
  cast_round(round, frame, true);
  if (frame.stats.cancelled) return;
  const auto stage = device_.timer().stage("bounce");
  bounce_->add(rays_, round);
}

DeviceRenderer::DeviceRenderer(ocl::Device &device, const CompressedVolume &volume,
                               const RendererOptions &options)
    : device_(device),
      setup_begin_(std::chrono::steady_clock::now()),
      compile_ms_before_(device.compile_ms()),
      options_(checked(options, volume, device)),
      blocks_(device, volume, options_, make_plan(device, volume, options_)),
      rays_(device, blocks_.plan.limits.rays),
      value_range_(volume.value_range),
      size_(options_.size),
      camera_rays_(
          options_.pipeline->make_wave(blocks_, rays_, blocks_.plan.limits.wave, options_)),
      smooth_normals_(device, rays_.num_rays, options_.group_size, blocks_.levels.size() > 1,
                      blocks_.cache.slot_type),
      normals_of_camera_(blocks_, rays_, smooth_normals_, RaySource::kCamera),
      normals_of_given_(blocks_, rays_, smooth_normals_, RaySource::kGiven),
      shade_(device, options_.size.num_rays()),
      hit_map_(make_hit_map(infos_of(blocks_.levels))),
      passes_(device, rays_) {
  const MemoryPlan &plan = blocks_.plan;
  if (plan.limits.kept_rays != 0) kept_.emplace(device, plan.limits.kept_rays);
  if (options_.max_surfaces != 0) {
    layers_.emplace(device, plan.limits.layers, options_.group_size, blocks_.levels.size() > 1);
    behind_.emplace(blocks_, rays_, *layers_, options_.group_size, options_.solver);
    layer_normals_.emplace(blocks_, rays_, smooth_normals_, *layers_);
    slice_values_.emplace(blocks_, rays_, *layers_, options_.group_size);
  }
  if (options_.with_given_rays) {
    given_rays_.emplace(blocks_, rays_, options_.group_size, options_.solver, RaySource::kGiven);
    ambient_.emplace(device, rays_.num_rays, blocks_.levels.size() > 1, is_brick());
    ambient_round_.emplace(blocks_, rays_, *ambient_, *given_rays_);
  }
  if (options_.with_bounce)
    bounce_.emplace(device, rays_.num_rays, blocks_.levels.size() > 1,
                    options_.max_surfaces != 0 ? rays_.num_rays : 0);
  if (options_.field != nullptr) {
    field_.emplace(*options_.field, options_.field == &volume, blocks_, levels(), plan.field,
                   options_.group_size, rays_);
    blocks_.on_reset = [this] { field_->clear(); };
    if (BlockStore *own = field_->own_blocks()) own->on_reset = [this] { blocks_.clear(); };
  }
  options_.cache_slots = plan.cache_slots;
  options_.stream = plan.stream;
  options_.window_blocks = plan.window_blocks;
  compile_kernels();
  device.timer().collect();  // what was launched so far belongs to no frame; waits
  device.finish();
  ocl::give_back_compiler(device.info());
  setup_ms_ = ms_since(setup_begin_) - (device.compile_ms() - compile_ms_before_);
}

/// Launches all kernels that frames will launch. PoCL and Mesa compile a kernel when it is launched
/// first, PoCL for each work-group size, and anew for more than 65,535 work-items. So the passes of
/// a frame of one pixel run here, which meets nothing: they launch what frames launch, and kernels
/// leave by their exits for empty lists. The time does not grow with the volume. One hit is left
/// behind, which every frame clears.
void DeviceRenderer::compile_kernels() {
  const auto compiling = device_.compiling();
  Wavefront &rays = rays_;
  rays.frame = {};
  rays.frame.view.width = rays.frame.view.height = rays.frame.schedule.max_spec_count = 1;
  rays.frame.schedule.cache_slots = blocks_.cache.num_slots;
  // Frames of one level of detail and of several have their own kernels.
  for (std::uint32_t num_levels = 1; num_levels <= std::min<std::size_t>(2, blocks_.levels.size());
       ++num_levels) {
    rays.num_level_frames = num_levels;
    blocks_.drawing = {0, num_levels > 1 ? blocks_.levels.size() : 1};
    for (Level &level : blocks_.levels) level.frame = rays.frame;
    std::vector<Wave *> waves{camera_rays_.get()};
    if (options_.with_shading) waves.push_back(&normals_of_camera_);
    if (behind_) {
      layers_->compile(rays);
      waves.push_back(&*behind_);
    }
    if (field_) waves.push_back(&*field_);
    if (ambient_round_) waves.push_back(&*ambient_round_);
    if (ambient_ && (behind_ || is_brick())) ambient_->block(rays);
    if (ambient_ && behind_) ambient_->enter(rays);
    if (bounce_) {
      bounce_->go_to_light(rays, 0, rays.given_hits);
      bounce_->add(rays, 0);
      if (behind_ && num_levels == 1) {
        bounce_->take_nearest(rays, 0);
        bounce_->add_colored(rays, 0, layers_->params(), 0);
      }
      bounce_->filter(rays);
    }
    for (Wave *wave : waves) {
      wave->begin();
      for (int pass = 0; pass < 2; ++pass) wave->enqueue_pass();  // the first decodes nothing
      blocks_.forget_requests();
      if (field_ && field_->own_blocks()) field_->own_blocks()->forget_requests();
      if (behind_ && wave == &*behind_) layers_->swap_hits(rays, 0);
    }
  }
  if (device_.info().type == ocl::DeviceType::kGpu) {
    blocks_.has_drawn_surface = true;  // such frames begin by another kernel
    camera_rays_->begin();
    camera_rays_->enqueue_pass();
    blocks_.forget_requests();
    blocks_.has_drawn_surface = false;
  }
  blocks_.cache.classify(rays);
  blocks_.cache.count_touched(rays, true);
  for (Level &level : blocks_.levels)
    level.decode.compile(level.stream, rays.counts, blocks_.cache);
  if (options_.with_shading) shade_.compile(rays, layers_ ? &layers_->colors : nullptr);
  if (kept_) kept_->compile(rays);
  rays.reset_counts();
}

Abilities DeviceRenderer::abilities_of(const RendererOptions &options) {
  Abilities abilities;
  abilities.largest = options.size;
  abilities.most_rays = options.size.num_rays();
  abilities.levels = options.with_levels;
  abilities.fewer_planes = true;
  abilities.clipping = options.pipeline->has_clipping();
  abilities.field = options.field != nullptr;
  abilities.field_labels = abilities.field && are_labels(*options.field);
  abilities.bounds = options.with_bounds;
  abilities.most_surfaces = options.max_surfaces;
  abilities.labels = options.with_labels;
  abilities.isosurfaces = !options.with_labels;
  abilities.given_rays = options.with_given_rays || options.with_bounce;
  abilities.bounce = options.with_bounce;
  abilities.kept_picture = options.with_kept_picture;
  abilities.solver = options.solver;
  return abilities;
}

Abilities DeviceRenderer::abilities() const {
  Abilities abilities = abilities_of(options_);
  // A CPU draws several levels about as fast as the finest alone (bench/detail.md): no reason for a
  // coarser picture.
  abilities.levels_pay = abilities.levels && !MarchPackets::suits(device_.info());
  return abilities;
}

std::vector<VolumeInfo> DeviceRenderer::levels() const {
  return infos_of(blocks_.levels);
}

DeviceRenderer::FirstSurface DeviceRenderer::first_surface(const FrameRequest &request) {
  if (request.surfaces.empty()) return {request.isovalue, 0, true};
  const std::uint32_t number = innermost_first(request.surfaces).front();
  const SurfaceStyle &surface = request.surfaces[number];
  return {surface.isovalue_of_field(), number, surface.clipped};
}

void DeviceRenderer::begin_frame(const FrameRequest &request) {
  core::check(request, abilities());
  if (light_rays_of(request).count() != 0 && is_brick())
    throw Error("a brick's ambient and shadow rays go on in other bricks: see TeamRenderer");
  const ImageSize size = size_of(request, abilities());
  const FirstSurface first = first_surface(request);
  std::vector<FrameParams> frames = make_level_frames(infos_of(blocks_.levels), request.camera,
                                                      size, first.isovalue, request.voxel_pixels);
  if (options_.with_labels) choose_labels(request.surfaces);
  frames.front().surface.isovalue_index = first.number;
  const std::vector<DecodedValues> values = decoded_values(request);
  has_picture_ = false;
  has_layers_ = is_in_further_layer_ = false;
  finds_first_of_.reset();
  finds_behind_of_.reset();
  size_ = size;
  rays_.num_ambient = rays_.num_shadow = rays_.num_bounced = 0;
  rays_.set_clip(make_clip_params(blocks_.levels[0].info, frames.front().view, request.camera,
                                  first.clipped ? request.clip : Clip{}));
  open_frame(std::move(frames), values, request.bound, RaySource::kCamera);
  has_field_values_ = request.field_values && request.surfaces.empty();  // layers blend them
  if (field_) field_->begin_frame(request);
}

/// Puts labels into the groups of surfaces. Costs time if they are not those of the last frame.
void DeviceRenderer::choose_labels(const std::vector<SurfaceStyle> &surfaces) {
  LabelTable table = label_table(surfaces);
  if (table == label_table_) return;
  passes_.drain();
  label_table_.clear();  // until the blocks are there
  blocks_.set_groups(table);
  label_table_ = std::move(table);
}

void DeviceRenderer::open_frame(std::vector<FrameParams> frames,
                                const std::vector<DecodedValues> &values, FieldBound bound,
                                RaySource source) {
  passes_.drain();  // passes that the frame before had enqueued beyond its last one
  blocks_.open(rays_, std::move(frames), values, bound, source);
  options_.cache_slots = blocks_.plan.cache_slots;
}

PassStats DeviceRenderer::stats_of(const PassCounts &counts, BlockStore &blocks) {
  const double rays = static_cast<double>(size_.num_rays());
  PassStats stats;
  stats.counts = counts;
  stats.counts.window_count = rays_in_window(counts.window_count, counts.active_count);
  camera_rays_->describe(stats);
  blocks.note(counts);
  stats.completed_percent = 100.0 * (rays - counts.next_active_count) / rays;
  stats.utilization_percent = 100.0 * counts.granted_count / rays;
  stats.stage_ms = device_.timer().collect();
  return stats;
}

/// The values that the request has each level's blocks decoded to. Throws Error if a bound needs an
/// error that is not known.
std::vector<DecodedValues> DeviceRenderer::decoded_values(const FrameRequest &request) const {
  std::vector<DecodedValues> values;
  for (const Level &level : blocks_.levels) {
    const double voxel_error = voxel_error_of(request.voxel_error, values.size());
    const BlockPrecision planes = with_fewer_planes(level.precision, voxel_error);
    const double few_planes = plane_error(level.precision, voxel_error);
    const ValueOffset offset = value_offset(level.error, request.bound, few_planes, value_range_);
    StreamLayout layout = level.stream.layout;
    layout.min_exponent = planes.min_exponent;
    const WholeNumbers whole = whole_numbers_of(level.info.type, planes);
    layout.least = whole.least;
    layout.greatest = whole.greatest;
    layout.value_offset = offset.uniform;
    layout.bound_unit = offset.unit;
    values.push_back({layout, few_planes});
  }
  return values;
}

std::optional<BlockBox> DeviceRenderer::surface_box(std::span<const float> isovalues) {
  if (options_.with_labels) throw Error("{}", kDrawsLabelsAlone);
  Level &finest = blocks_.levels[0];
  finest.macrocells.use(static_cast<std::size_t>(FieldBound::kNone));
  return isowave::core::surface_box(finest.macrocells, finest.info, isovalues);
}

Camera DeviceRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size,
                              const Viewpoint &from) {
  return surface_camera(blocks_.levels[0].info, surface_box(isovalues),
                        size.value_or(options_.size), from);
}

std::optional<BlockBox> DeviceRenderer::label_box(std::span<const std::uint16_t> labels) {
  choose_labels({{.labels = {labels.begin(), labels.end()}}});
  Level &finest = blocks_.levels[0];
  finest.macrocells.use(0);  // the group's
  return isowave::core::surface_box(finest.macrocells, finest.info, std::array{ISO_LABEL_ISOVALUE});
}

Camera DeviceRenderer::label_camera(std::span<const std::uint16_t> labels,
                                    std::optional<ImageSize> size, const Viewpoint &from) {
  if (!options_.with_labels) return Renderer::label_camera(labels, size, from);
  return surface_camera(blocks_.levels[0].info, label_box(labels), size.value_or(options_.size),
                        from);
}

std::vector<HitRecord> DeviceRenderer::cast_rays(std::span<const WorldRay> world_rays,
                                                 float isovalue, Normals normals) {
  check_has_given();
  if (is_brick()) throw Error("rays of any origin go on in other bricks");
  if (options_.with_labels) throw Error("{}", kDrawsLabelsAlone);
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  const std::vector<IndexRay> rays = make_index_rays(blocks_.levels[0].info, world_rays);
  Wavefront &wavefront = rays_;
  const FrameOfPicture kept{wavefront, wavefront.frame};
  // As many rays as the buffers hold at a time, as a picture.
  const auto columns = static_cast<std::uint32_t>(
      std::min<std::uint64_t>({kGivenColumns, wavefront.num_rays, rays.size()}));
  std::vector<HitRecord> hits, part;
  while (hits.size() < rays.size()) {
    const std::size_t num_left = rays.size() - hits.size(),
                      num_rows = std::min<std::size_t>((num_left + columns - 1) / columns,
                                                       wavefront.num_rays / columns);
    const std::span of_part =
        std::span(rays).subspan(hits.size(), std::min(num_left, num_rows * columns));
    std::vector<GivenRay> given(num_rows * columns);
    std::ranges::transform(of_part, given.begin(), &IndexRay::ray);
    wavefront.given.write(given);
    open_frame(frames_of_rays(columns, static_cast<std::uint32_t>(num_rows), isovalue),
               decoded_values({}), FieldBound::kNone, RaySource::kGiven);
    const OnPass never_stops;
    Frame frame{never_stops, 1};
    run(*given_rays_, frame);
    if (normals == Normals::kSmooth) run(normals_of_given_, frame);
    blocks_.close(recycled_blocks(frame.stats), true);
    part.resize(given.size());
    wavefront.given_hits.read(part);
    for (std::size_t i = 0; i < of_part.size(); ++i) part[i].t *= of_part[i].t_scale;
    hits.insert(hits.end(), part.begin(), part.begin() + std::ptrdiff_t(of_part.size()));
  }
  return hits;
}

/// Constants of all levels for a list of rays, as a picture of columns x rows; the finest level
/// draws them.
std::vector<FrameParams> DeviceRenderer::frames_of_rays(std::uint32_t columns, std::uint32_t rows,
                                                        float isovalue) const {
  std::vector<FrameParams> frames = make_level_grids(infos_of(blocks_.levels));
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

void DeviceRenderer::check_has_given() const {
  if (!given_rays_) throw Error("rays of any origin need a renderer that was made with_rays");
}

void DeviceRenderer::check_has_picture() const {
  if (!has_picture_) throw Error("there is no picture: no frame has been drawn");
}

std::vector<HitRecord> DeviceRenderer::hits() {
  check_has_picture();
  const PictureSoFar shown(*this);
  std::vector<HitRecord> hits(size_.num_rays());
  rays_.hits.read(hits);
  return hits;
}

void DeviceRenderer::set_hits(std::span<const HitRecord> hits) {
  check_has_picture();
  rays_.hits.write(hits);
}

std::optional<std::array<float, 2>> DeviceRenderer::field_range() {
  check_has_picture();
  if (has_layers_ && field_) return field_->volume_range();
  if (!has_field_values_) return {};
  return field_->range(size_.num_rays());
}

std::vector<float> DeviceRenderer::field_values() {
  check_has_picture();
  if (!has_field_values_) throw Error("the last frame has no values of a field");
  std::vector<float> values(size_.num_rays());
  rays_.field_values.read(values);
  return values;
}

FrameArrays DeviceRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  check_has_picture();
  check_arrays(wanted, size_);
  const PictureSoFar shown(*this);
  return shade_(wanted, shading_of(blocks_.levels[0].info, appearance), hit_map_, rays_, colors(),
                size_.samples);
}

HostArray<std::uint32_t> DeviceRenderer::shade_packed(const Appearance &appearance) {
  check_has_picture();
  const PictureSoFar shown(*this);
  return shade_.packed(shading_of(blocks_.levels[0].info, appearance), rays_, colors(),
                       size_.samples);
}

OpenCounts DeviceRenderer::open() const {
  check_has_picture();
  OpenCounts open{{}, rays_.num_ambient, rays_.num_shadow};
  if (open.num_ambient == 0 && open.num_shadow == 0) return open;
  open.counts.resize((open.num_shadow != 0 ? 2 : 1) * size_.num_rays());
  rays_.open_counts.read(open.counts);
  if (rays_.num_bounced == 0) return open;
  open.num_bounced = rays_.num_bounced;
  open.by_color = has_layers_;
  open.bounced.resize((open.by_color ? ISO_LAYER_SUMS : 1) * size_.num_rays());
  rays_.bounced.read(open.bounced);
  return open;
}

KeptPicture &DeviceRenderer::kept() {
  if (!kept_) throw Error("no picture can be kept: the renderer was made without one");
  return *kept_;
}

void DeviceRenderer::keep_picture() {
  KeptPicture &into = kept();
  check_has_picture();
  into.keep(rays_, size_);
}

void DeviceRenderer::fill_from_kept() {
  kept().show(rays_, false);
  device_.finish();
}

void DeviceRenderer::enlarge_kept(const FrameRequest &request) {
  core::check(request, abilities());
  const ImageSize size = size_of(request, abilities());
  rays_.frame = make_frame_params(blocks_.levels[0].info, request.camera, size, request.isovalue);
  size_ = size;
  rays_.num_ambient = rays_.num_shadow = rays_.num_bounced = 0;
  kept().show(rays_, true);
  device_.finish();
}

void DeviceRenderer::clear_cache() {
  blocks_.clear();
  if (field_) field_->clear();
  device_.finish();
}

}  // namespace isowave::core
