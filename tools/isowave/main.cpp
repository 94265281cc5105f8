// The program `isowave`: parses the command line, runs one subcommand, turns every error into one line.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "tools/isowave/commands.hpp"

int main(int argc, char **argv) {
  CLI::App app{
      "Isosurfaces of zfp-compressed volumes, drawn by speculative progressive raycasting on OpenCL "
      "devices."};
  app.name("isowave");
  app.set_version_flag("--version", "isowave 0.1.0");
  app.require_subcommand(1);
  using namespace isowave::tools;
  add_devices(app);
  add_info(app);
  add_generate(app);
  add_convert(app);
  add_render(app);
  add_compare(app);
  add_verify(app);
  add_bench(app);
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::Success &help) {
    return app.exit(help);
  } catch (
      const CLI::RuntimeError &status) {  // a result, already printed, that is not success: compare --exact
    return status.get_exit_code();
  } catch (const std::exception &error) {
    fmt::print(stderr, "isowave: {}\n", error.what());
    return 1;
  }
}
