#pragma once
// isowave bench solvers: what each root finder costs and how often, and how far, it is wrong.

#include <CLI/CLI.hpp>

namespace isowave::core::tools {

void add_bench_solvers(CLI::App &bench);

}  // namespace isowave::core::tools
