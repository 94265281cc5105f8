#include "core/frame/soon_renderer.hpp"

#include <utility>

#include "core/base/error.hpp"
#include "core/base/fork.hpp"
#include "core/base/wait_while.hpp"

namespace isowave::core {

SoonRenderer::SoonRenderer(SoonParts parts)
    : parts_(std::move(parts)), maker_([this](const std::stop_token &stop) { make(stop); }) {}

void SoonRenderer::make(const std::stop_token &stop) {
  try {
    made_ = parts_.make(stop);
    memory_bytes_ = made_->memory_bytes();
  } catch (...) {
    failure_ = std::current_exception();
  }
  set_and_wake(is_ready_, true);
}

bool SoonRenderer::ready_for(const FrameRequest &request) const {
  if (is_ready_) return true;
  try {
    check(request, parts_.meanwhile_abilities);
    return true;
  } catch (const Error &) {
    return false;
  }
}

void SoonRenderer::wait() const {
  check_not_forked();
  wait_while(is_ready_, false);
  if (failure_) std::rethrow_exception(failure_);
}

void SoonRenderer::note_memory() {
  if (is_ready_ && made_) memory_bytes_ = made_->memory_bytes();
}

Renderer &SoonRenderer::wait_for_ready() {
  wait();
  parts_.before_use();
  return *made_;
}

/// The renderer meanwhile; null if the other one is ready, or this one could not be made.
Renderer *SoonRenderer::find_meanwhile() {
  if (is_ready_) return nullptr;
  if (!meanwhile_ && has_meanwhile_) {
    try {
      meanwhile_ = parts_.make_meanwhile();
    } catch (...) {  // not enough memory; or a file, of which the other renderer will tell
      has_meanwhile_ = false;
    }
  }
  return meanwhile_.get();
}

Renderer &SoonRenderer::find_any() {
  Renderer *const meanwhile = find_meanwhile();
  return meanwhile != nullptr ? *meanwhile : wait_for_ready();
}

FrameStats SoonRenderer::render(const FrameRequest &request) {
  check(request, parts_.abilities);
  FrameRequest wanted = request;
  wanted.size = size_of(request, parts_.abilities);
  bool is_overtaken = false;
  if (Renderer *const meanwhile = ready_for(wanted) ? find_meanwhile() : nullptr) {
    wanted.on_pass = [&](const PassStats &pass) {
      is_overtaken = is_ready_;
      return !is_overtaken && (!request.on_pass || request.on_pass(pass));
    };
    drawn_by_ = meanwhile;
    FrameStats stats = meanwhile->render(wanted);
    if (!is_overtaken) return stats;
    wanted.on_pass = request.on_pass;
    if (request.on_pass) {
      wanted.on_pass = [&](PassStats pass) {
        pass.begins_anew = std::exchange(is_overtaken, false);
        return request.on_pass(pass);
      };
    }
  }
  Renderer &ready = wait_for_ready();
  drawn_by_ = &ready;
  meanwhile_.reset();
  FrameStats stats = ready.render(wanted);
  note_memory();
  return stats;
}

std::vector<HitRecord> SoonRenderer::cast_rays(std::span<const WorldRay> rays, float isovalue,
                                               Normals normals) {
  std::vector<HitRecord> hits = find_any().cast_rays(rays, isovalue, normals);
  note_memory();
  return hits;
}

Camera SoonRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size,
                            const Viewpoint &from) {
  return find_any().camera(isovalues, size.value_or(parts_.abilities.largest), from);
}

Camera SoonRenderer::label_camera(std::span<const std::uint16_t> labels,
                                  std::optional<ImageSize> size, const Viewpoint &from) {
  return find_any().label_camera(labels, size.value_or(parts_.abilities.largest), from);
}

void SoonRenderer::clear_cache() {
  if (meanwhile_) meanwhile_->clear_cache();
  if (is_ready_) wait_for_ready().clear_cache();
}

std::vector<VolumeInfo> SoonRenderer::levels() const {
  if (drawn_by_ == nullptr) wait();
  std::vector<VolumeInfo> levels = (drawn_by_ != nullptr ? drawn_by_ : made_.get())->levels();
  if (!parts_.abilities.levels) levels.erase(levels.begin() + 1, levels.end());
  return levels;
}

Renderer &SoonRenderer::inner() const {
  if (drawn_by_ == nullptr) throw Error("there is no picture: no frame has been drawn");
  return *drawn_by_;
}

}  // namespace isowave::core
