#pragma once
// isowave bench pareto: what each choice costs, in bytes and milliseconds, and how wrong the
// picture is for it.

#include <CLI/CLI.hpp>

namespace isowave::core::tools {

void add_bench_pareto(CLI::App &bench);

}  // namespace isowave::core::tools
