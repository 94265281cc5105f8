// isowave bench: measurements that put accuracy beside time, and ours beside the paper's rival.
// (Speed alone is what the programs of bench/ measure.)

#include "tools/isowave/bench_paper.hpp"
#include "tools/isowave/bench_pareto.hpp"
#include "tools/isowave/bench_solvers.hpp"
#include "tools/isowave/bench_topology.hpp"
#include "tools/isowave/commands.hpp"

namespace isowave::core::tools {

void add_bench(CLI::App &app) {
  CLI::App *bench =
      app.add_subcommand("bench", "Measure, as JSON for tools/charts and tools/measure");
  bench->require_subcommand(1);
  add_bench_solvers(*bench);
  add_bench_pareto(*bench);
  add_bench_topology(*bench);
  add_bench_paper(*bench);
}

}  // namespace isowave::core::tools
