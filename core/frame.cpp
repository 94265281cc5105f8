#include "core/frame.hpp"

#include <algorithm>
#include <cmath>

#include "core/error.hpp"

namespace isowave {

namespace {

/// Denormals and near-denormals of an eye next to a voxel plane would make devices disagree; they are 0.
float flush_tiny(double x) {
  return std::abs(x) < 0x1p-60 ? 0.0f : static_cast<float>(x);
}

double largest_component(const glm::dvec3 &v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

}  // namespace

void check_image_size(ImageSize size) {
  constexpr std::uint64_t kMaxPixels = 1u << 28;
  if (size.num_pixels() == 0 || size.num_pixels() > kMaxPixels) {
    throw Error("an image of {} x {} pixels cannot be drawn: 1 to {} pixels can", size.width, size.height,
                kMaxPixels);
  }
}

FrameParams make_frame_params(const VolumeInfo &info, const Camera &camera, ImageSize size, float isovalue) {
  check_volume_info(info, "the volume");
  check_camera(camera, "the camera");
  check_image_size(size);
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number in the volume's value range");

  const glm::dmat3 world_to_index = glm::inverse(info.index_to_world());
  const glm::dvec3 eye = world_to_index * (camera.eye - info.origin);
  const glm::dvec3 world_fwd = glm::normalize(camera.at - camera.eye);
  const glm::dvec3 world_right = glm::normalize(glm::cross(world_fwd, camera.up));
  const glm::dvec3 world_up = glm::cross(world_right, world_fwd);
  glm::dvec3 fwd = world_to_index * world_fwd;
  glm::dvec3 right = world_to_index * world_right;
  glm::dvec3 up = world_to_index * world_up;
  if (!std::isfinite(largest_component(eye)) || largest_component(eye) > 1e7) {
    throw Error(
        "the camera's eye is {:.3g} voxels from the volume's origin: up to 1e7 can be drawn in float32",
        largest_component(eye));
  }

  // A power of two takes the voxel size out of t, so that neither tiny nor huge spacings reach float32's
  // ends.
  const double largest = std::max({largest_component(fwd), largest_component(right), largest_component(up)});
  const double t_scale = std::exp2(-std::floor(std::log2(largest)));
  fwd *= t_scale;
  right *= t_scale;
  up *= t_scale;

  FrameParams frame{};
  frame.dims_x = info.dims.x;
  frame.dims_y = info.dims.y;
  frame.dims_z = info.dims.z;
  frame.blocks_x = (info.dims.x + 3) / 4;
  frame.blocks_y = (info.dims.y + 3) / 4;
  frame.blocks_z = (info.dims.z + 3) / 4;
  frame.active_end_x = static_cast<int>(num_owning_blocks(info.dims.x));
  frame.active_end_y = static_cast<int>(num_owning_blocks(info.dims.y));
  frame.active_end_z = static_cast<int>(num_owning_blocks(info.dims.z));
  frame.width = size.width;
  frame.height = size.height;
  frame.eye_x = flush_tiny(eye.x);
  frame.eye_y = flush_tiny(eye.y);
  frame.eye_z = flush_tiny(eye.z);
  frame.fwd_x = flush_tiny(fwd.x);
  frame.fwd_y = flush_tiny(fwd.y);
  frame.fwd_z = flush_tiny(fwd.z);
  frame.right_x = flush_tiny(right.x);
  frame.right_y = flush_tiny(right.y);
  frame.right_z = flush_tiny(right.z);
  frame.up_x = flush_tiny(up.x);
  frame.up_y = flush_tiny(up.y);
  frame.up_z = flush_tiny(up.z);
  frame.pixel_scale = static_cast<float>(std::tan(glm::radians(camera.fovy_deg) / 2) / size.height);
  frame.t_scale = static_cast<float>(t_scale);
  frame.isovalue = isovalue;
  frame.max_spec_count = 1;
  return frame;
}

std::vector<float> depth_of(const std::vector<HitRecord> &hits) {
  std::vector<float> depth(hits.size());
  std::transform(hits.begin(), hits.end(), depth.begin(), [](const HitRecord &hit) { return hit.t; });
  return depth;
}

}  // namespace isowave
