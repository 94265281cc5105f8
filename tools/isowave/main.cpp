// The program `isowave`: parses the command line and runs one subcommand.

#include <CLI/CLI.hpp>

#include "tools/isowave/commands.hpp"
#include "tools/isowave/program.hpp"

int main(int argc, char **argv) {
  CLI::App app{
      "Isosurfaces of zfp-compressed volumes, drawn by speculative progressive raycasting on "
      "OpenCL "
      "devices."};
  app.name("isowave");
  app.set_version_flag("--version", "isowave 0.1.0");
  app.require_subcommand(1);
  using namespace isowave::core::tools;
  add_devices(app);
  add_info(app);
  add_generate(app);
  add_convert(app);
  add_render(app);
  add_compare(app);
  add_verify(app);
  add_bench(app);
  return run_program(app, argc, argv);
}
