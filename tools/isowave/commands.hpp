#pragma once
// One function per subcommand, each in the file of its name. It adds the subcommand and its options
// to `app`; CLI11 calls the action when the command line names it. Actions throw core::Error;
// main prints it.

#include <CLI/CLI.hpp>

namespace isowave::core::tools {

void add_devices(CLI::App &app);
void add_info(CLI::App &app);
void add_generate(CLI::App &app);
void add_convert(CLI::App &app);
void add_render(CLI::App &app);
void add_extract(CLI::App &app);
void add_export(CLI::App &app);
void add_compare(CLI::App &app);
void add_verify(CLI::App &app);
void add_bench(CLI::App &app);
void add_man(CLI::App &app);
void add_completion(CLI::App &app);

}  // namespace isowave::core::tools
