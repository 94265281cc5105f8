// The program `isowave`: parses the command line and runs one subcommand.

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
  add_compare(app);
  add_verify(app);
  add_bench(app);
  return run_program(app, argc, argv);
}
