#pragma once
// Series of volumes in `render`: which steps are drawn, and by which names.

#include <CLI/CLI.hpp>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "core/base/team.hpp"
#include "core/sources/series.hpp"
#include "tools/isowave/render_options.hpp"

namespace isowave::core::tools {

/// If VOLUME is a series: finds its steps, those of --steps.
///
/// Throws  Error: no file; there are no such steps; options that a series cannot have; a team
void find_series(const CLI::App &command, RenderArgs &options, const Team &team);
/// Opens the series that find_series() has found; none: VOLUME is one volume. Warns of the first
/// step's header.
std::unique_ptr<Series> open_series(const RenderArgs &options);

}  // namespace isowave::core::tools
