#include "core/bricks/brick_renderer.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"

namespace isowave::core {

namespace {

/// Rays of a slab.
constexpr std::size_t kSlabRays = 1u << 18;

HitRecord nothing() {
  HitRecord hit{};
  hit.t = std::numeric_limits<float>::infinity();
  hit.block_id = hit.cell = ISO_INVALID_ID;
  return hit;
}

}  // namespace

BrickRenderer::BrickRenderer(ocl::Device &device, const CompressedVolume &volume,
                             const RendererOptions &options, const Cuts &cuts,
                             const VolumeInfo &whole, Team &team)
    : renderer_(device, volume, options), cuts_(cuts), whole_(whole), team_(team) {}

FrameStats BrickRenderer::render(const FrameRequest &request) {
  if (request.bound != FieldBound::kNone || request.ambient_rays != 0)
    throw Error("bricks have no bounds and no ambient rays");
  own_hits_.clear();
  FrameStats stats = renderer_.render(request);
  const View view = make_view(whole_, request.camera, renderer_.size());
  place_ = cuts_.order_from({view.eye_x, view.eye_y, view.eye_z})[team_.rank()];
  return stats;
}

std::span<const HitRecord> BrickRenderer::own_hits() {
  if (own_hits_.empty()) own_hits_ = renderer_.hits();
  return own_hits_;
}

void BrickRenderer::compose(const MakeWords &make_words) {
  const auto begin = std::chrono::steady_clock::now();
  words_.resize(renderer_.size().num_rays());
  for (std::size_t first = 0; first < words_.size(); first += kSlabRays) {
    const auto slab = std::span(words_).subspan(first, std::min(kSlabRays, words_.size() - first));
    make_words(first, slab);
    team_.begin_reduce_min(slab);
    ++composition_.reductions;
    composition_.bytes += slab.size_bytes();
  }
  team_.finish_reductions();
  num_hits_ = static_cast<std::uint64_t>(
      std::ranges::count_if(words_, [](std::uint64_t word) { return word >> 32 != kNoPlace; }));
  composition_.ms += ms_since(begin);
}

void BrickRenderer::compose_field(HitField field, std::span<HitRecord> hits) {
  const std::span own = own_hits();
  compose([&](std::size_t begin, std::span<std::uint64_t> words) {
    field_words(own.subspan(begin, words.size()), field, place_, words);
  });
  if (team_.rank() == 0) set_field(words_, field, hits);
}

Image8 BrickRenderer::shade(const Appearance &appearance) {
  const ImageSize size = renderer_.size();
  if (size.samples > 1) {
    // The mean of a pixel's colours is made of more than 8 bits of each.
    std::vector<HitRecord> hits(team_.rank() == 0 ? size.num_rays() : 0, nothing());
    for (const HitField field :
         {HitField::kT, HitField::kGradX, HitField::kGradY, HitField::kGradZ})
      compose_field(field, hits);
    if (team_.rank() != 0) return {};
    renderer_.set_hits(hits);
    return renderer_.shade(appearance);
  }
  const std::vector<std::uint32_t> colors = renderer_.shade_packed(appearance);
  compose([&](std::size_t begin, std::span<std::uint64_t> words) {
    color_words(std::span(colors).subspan(begin, words.size()), place_, words);
  });
  return team_.rank() == 0 ? image_of(words_, size.width, size.height) : Image8{};
}

std::vector<float> BrickRenderer::depth() {
  std::vector<HitRecord> hits(team_.rank() == 0 ? own_hits().size() : 0, nothing());
  compose_field(HitField::kT, hits);
  return depth_of(hits);
}

std::vector<HitRecord> BrickRenderer::hits() {
  std::vector<HitRecord> hits(team_.rank() == 0 ? own_hits().size() : 0, nothing());
  for (const HitField field : kHitFields) compose_field(field, hits);
  return hits;
}

}  // namespace isowave::core
