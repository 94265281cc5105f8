#pragma once
// An Embree device with one scene, released with it.

#include <embree3/rtcore.h>

#include "reference/hit_oracle.hpp"

namespace isowave::core {

/// The ray, rounded to float32, from t = 0 to infinity; nothing hit yet.
RTCRayHit to_embree(const OracleRay &ray);

/// Device and scene. The scene has the flag ROBUST and, where asked, COMPACT.
class EmbreeScene {
 public:
  /// Throws  Error: Embree cannot be opened
  explicit EmbreeScene(bool compact);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene &) = delete;
  EmbreeScene &operator=(const EmbreeScene &) = delete;

  RTCDevice device() const { return device_; }
  RTCScene scene() const { return scene_; }

  /// Attaches the scene's one geometry, which the scene owns from here on, and builds.
  ///
  /// Throws  Error: memory
  void build(RTCGeometry geometry);

 private:
  void check(const char *what) const;

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

}  // namespace isowave::core
