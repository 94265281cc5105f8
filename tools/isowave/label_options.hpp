#pragma once
// The option --labels: surfaces of groups of a segmentation's labels.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "isowave/frame.hpp"

namespace isowave::core::tools {

/// texts: LABELS[,COLOR[,OPACITY[,whole]]] each, as typed; read_labels() checks them.
void add_labels_option(CLI::App &command, std::vector<std::string> &texts);

/// Surfaces without a colour get surface_color().
///
/// Throws  Error in one line: what the options cannot mean, for any volume
std::vector<isowave::Surface> read_labels(const std::vector<std::string> &texts);

/// Whether surfaces are those of labels.
inline bool has_labels(const std::vector<isowave::Surface> &surfaces) {
  return !surfaces.empty() && !surfaces.front().labels.empty();
}

}  // namespace isowave::core::tools
