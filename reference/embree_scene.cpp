#include "reference/embree_scene.hpp"

#include <limits>

#include "core/base/error.hpp"

namespace isowave::core {

RTCRayHit to_embree(const OracleRay &ray) {
  RTCRayHit result{};
  result.ray.org_x = static_cast<float>(ray.origin[0]);
  result.ray.org_y = static_cast<float>(ray.origin[1]);
  result.ray.org_z = static_cast<float>(ray.origin[2]);
  result.ray.dir_x = static_cast<float>(ray.direction[0]);
  result.ray.dir_y = static_cast<float>(ray.direction[1]);
  result.ray.dir_z = static_cast<float>(ray.direction[2]);
  result.ray.tfar = std::numeric_limits<float>::infinity();
  result.ray.mask = ~0u;
  result.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  result.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return result;
}

EmbreeScene::EmbreeScene(bool compact) : device_(rtcNewDevice(nullptr)) {
  check("open");
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(
      scene_, compact ? RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT : RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_MEDIUM);
}

EmbreeScene::~EmbreeScene() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void EmbreeScene::build(RTCGeometry geometry) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);  // the scene keeps it
  rtcCommitScene(scene_);
  check("build its tree");
}

void EmbreeScene::check(const char *what) const {
  const RTCError code = rtcGetDeviceError(device_);
  if (code == RTC_ERROR_NONE && device_ != nullptr) return;
  throw Error("Embree could not {} (error {}{})", what, static_cast<int>(code),
              code == RTC_ERROR_OUT_OF_MEMORY ? ", out of memory" : "");
}

}  // namespace isowave::core
