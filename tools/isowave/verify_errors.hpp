#pragma once
// `isowave verify VOLUME --max-surface-error P`: frames as render --max-surface-error draws them,
// and their bounds against the volume before compression.

#include "tools/isowave/verify_frames.hpp"

namespace isowave::core::tools {

/// Draws every view and isovalue within *options.max_surface_error, prints a row for each and adds
/// it to document["frames"]. Returns the pixels that are farther off than their bounds. Throws
/// Error.
std::uint64_t verify_errors(const VerifyFramesOptions &options, nlohmann::ordered_json &document);

}  // namespace isowave::core::tools
