#pragma once
// isowave: isosurfaces of volumes too large for the OpenCL device that draws them.
//
//   auto volume = isowave::open_volume("head.nrrd");
//   isowave::Renderer renderer = isowave::make_renderer(volume);
//   isowave::Frame frame = renderer.render({.camera = renderer.camera(80), .isovalue = 80});
//   isowave::save_png(frame, "head.png");
//
// Functions throw isowave::Error. Several threads may use devices, volumes and renderers; see each.

#include "isowave/bricks.hpp"
#include "isowave/device.hpp"
#include "isowave/extract.hpp"
#include "isowave/host.hpp"
#include "isowave/make_renderer.hpp"
#include "isowave/quick_renderer.hpp"
#include "isowave/renderer.hpp"
#include "isowave/scene.hpp"
