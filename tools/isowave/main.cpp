// The program `isowave`: parses the command line and runs one subcommand.

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "core/base/error.hpp"
#include "core/platform/process.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/program.hpp"

namespace {

/// All processes would do the same, and write the same files.
[[noreturn]] void refuse_team(const CLI::App &command) {
  throw isowave::core::Error(
      "mpirun has started {} processes, and {} is for one: only render and convert are shared",
      isowave::core::tools::MpiJob::team()->size(), command.get_name());
}

int run(int argc, char **argv) {
  using namespace isowave::core::tools;
  MpiJob job(&argc, &argv);
  CLI::App app{
      "Isosurfaces of zfp-compressed volumes, drawn by speculative progressive raycasting on "
      "OpenCL devices."};
  app.name("isowave");
  app.allow_windows_style_options(false);  // "/volume.nrrd" is a file
  app.set_version_flag("--version", program_name());
  app.require_subcommand(1);
  add_devices(app);
  add_info(app);
  add_generate(app);
  add_convert(app);
  add_render(app);
  add_extract(app);
  add_export(app);
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
  if (MpiJob::team() != nullptr) {
    for (CLI::App *command : app.get_subcommands({})) {
      if (command->get_name() == "render" || command->get_name() == "convert") continue;
      command->preparse_callback([command](std::size_t) { refuse_team(*command); });
    }
  }
  return job.finish(run_program(app, argc, argv));
}

}  // namespace

int main(int argc, char **argv) {
  return isowave::core::tools::run_main([&] {
    isowave::core::platform::make_utf8(argc, argv);
    return run(argc, argv);
  });
}
