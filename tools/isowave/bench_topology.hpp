#pragma once
// isowave bench topology: parts of a surface that fewer bits and coarser levels of detail lose.

#include <CLI/CLI.hpp>

namespace isowave::core::tools {

void add_bench_topology(CLI::App &bench);

}  // namespace isowave::core::tools
