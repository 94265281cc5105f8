#pragma once
// `isowave verify VOLUME --surface`: frames of several and translucent surfaces before their
// oracle.

#include "tools/isowave/verify_frames.hpp"

namespace isowave::core::tools {

/// Draws every view, prints a row for it and adds it to document["frames"]: all layers of the
/// scalar reference, or the first one of another renderer. Returns the rays with a fault. Throws
/// Error in one line, also if that renderer draws no such surfaces.
std::uint64_t verify_layers(const VerifyFramesOptions &options, nlohmann::ordered_json &document);

}  // namespace isowave::core::tools
