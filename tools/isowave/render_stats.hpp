#pragma once
// The statistics file of `render`: what was drawn, with what, pass by pass.

#include <nlohmann/json.hpp>
#include <string>

#include "core/render/device_renderer.hpp"
#include "core/view/camera.hpp"

namespace isowave::core::tools {

inline constexpr int kChartsSchema =
    2;  ///< of the JSON of `isowave bench`; tools/charts refuses others

/// A device and what it can do.
nlohmann::ordered_json device_json(const ocl::DeviceInfo &info);

/// One frame: isovalue, view, camera, totals and, unless it is the host's, passes.
nlohmann::ordered_json frame_json(double isovalue, std::size_t view, const Camera &camera,
                                  const FrameStats &stats, bool on_host);

/// Bytes of device memory: current, peak, and by buffer name.
nlohmann::ordered_json memory_json(const ocl::MemoryLedger &ledger);

/// The document as text. Names of files and drivers' strings need not be UTF-8: what is none is
/// replaced by U+FFFD.
std::string json_text(const nlohmann::ordered_json &document);

/// Writes the document whole or not at all. Throws Error.
void write_json(const nlohmann::ordered_json &document, const std::string &path);

}  // namespace isowave::core::tools
