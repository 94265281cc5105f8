#pragma once
// Shading of hits: a headlight, Blinn-Phong, and a light above it, on the hits' gradients.

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "core/io/png.hpp"
#include "core/volume/volume.hpp"
#include "kernels_cl/portable/shade.h"

namespace isowave::core {

/// Colours and lights. Colours are display values, [0,1].
struct Appearance {
  glm::vec3 surface{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};
  glm::vec3 background{1.0f, 1.0f, 1.0f};
  float ambient = 0.15f;  ///< light from all around
  float diffuse = 0.5f;   ///< diffuse light of a headlight at the eye
  float specular = 0.2f;  ///< its highlight
  float above = 0.45f;    ///< diffuse light from above the headlight
  /// Pictures are RGBA with straight alpha: the share of a pixel's rays that hit, and the mean
  /// colour of those alone; 0 0 0 0 if none hits. There is no background.
  bool transparent = false;
};

/// The number of ambient rays of each hit that met nothing.
struct OpenCounts {
  std::vector<uchar> counts;      ///< [height * width] by ray
  std::uint32_t num_ambient = 0;  ///< ambient rays of each hit; 0: there are none
};

/// Stores GLM's columns as rows [9], scaled so that the largest entry is 1: only directions count.
void store_rows(const glm::dmat3 &m, float *rows);

ShadeParams make_shade_params(const VolumeInfo &info, const Appearance &appearance);

/// The picture of a frame, made on the host with the bits of a device's (kernels_cl/shade.cl).
///
/// hits     [height * width] hits of the frame's rays
/// samples  rays per pixel along each axis
/// open     open ambient rays of the hits
/// Returns  RGB, or RGBA if transparent
Image8 shade_scalar(const FrameParams &frame, const ShadeParams &params,
                    const std::vector<HitRecord> &hits, std::uint32_t samples = 1,
                    const OpenCounts &open = {});

}  // namespace isowave::core
