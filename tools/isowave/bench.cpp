// isowave bench: measurements that put accuracy beside time. (Speed alone is what the programs of
// bench/ measure.)

#include "tools/isowave/bench_pareto.hpp"
#include "tools/isowave/bench_solvers.hpp"
#include "tools/isowave/commands.hpp"

namespace isowave::core::tools {

void add_bench(CLI::App &app) {
  CLI::App *bench =
      app.add_subcommand("bench", "Measure time beside accuracy, as JSON for tools/charts");
  bench->require_subcommand(1);
  add_bench_solvers(*bench);
  add_bench_pareto(*bench);
}

}  // namespace isowave::core::tools
