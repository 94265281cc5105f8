#pragma once
// The part of isowave that needs no OpenCL. A library that was built with -DISOWAVE_OPENCL=OFF has
// only this part.
//
//   auto volume = isowave::open_volume("head.nrrd");
//   isowave::Renderer renderer = isowave::make_host_renderer(volume);
//   isowave::Frame frame = renderer.render({.camera = renderer.camera(80), .isovalue = 80});
//   isowave::Mesh mesh = isowave::extract(volume, 80);

#include "isowave/annotations.hpp"
#include "isowave/camera.hpp"
#include "isowave/error.hpp"
#include "isowave/frame.hpp"
#include "isowave/host_renderer.hpp"
#include "isowave/mesh.hpp"
#include "isowave/page.hpp"
#include "isowave/renderer.hpp"
#include "isowave/series.hpp"
#include "isowave/version.hpp"
#include "isowave/views.hpp"
#include "isowave/volume.hpp"
