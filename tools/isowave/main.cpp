// The program `isowave`: parses the command line and runs one subcommand.

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "tools/isowave/commands.hpp"
#include "tools/isowave/program.hpp"

int main(int argc, char **argv) {
  using namespace isowave::core::tools;
  CLI::App app{
      "Isosurfaces of zfp-compressed volumes, drawn by speculative progressive raycasting on "
      "OpenCL devices."};
  app.name("isowave");
  app.set_version_flag("--version", program_name());
  app.require_subcommand(1);
  add_devices(app);
  add_info(app);
  add_generate(app);
  add_convert(app);
  add_render(app);
  add_extract(app);
  add_compare(app);
#ifdef ISOWAVE_HAS_ORACLES
  add_verify(app);
  add_bench(app);
#endif
  add_man(app);
  add_completion(app);
  std::string statuses = "Exit status:\n";
  for (const auto &[status, meaning] : kExitStatuses)
    statuses += fmt::format("  {:<3} {}\n", status, meaning);
  app.footer(statuses);
  return run_program(app, argc, argv);
}
