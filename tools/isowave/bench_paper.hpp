#pragma once
// isowave bench paper: the evaluation of Usher, Dyken and Kumar (LDAV 2023), of our pipelines and
// of Block-Compressed Marching Cubes, in one run on one device.

#include <CLI/CLI.hpp>

namespace isowave::core::tools {

void add_bench_paper(CLI::App &bench);

}  // namespace isowave::core::tools
