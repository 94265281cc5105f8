#pragma once
// isowave bench pareto: speed against accuracy, of each way to draw.

#include <CLI/CLI.hpp>

namespace isowave::core::tools {

void add_bench_pareto(CLI::App &bench);

}  // namespace isowave::core::tools
