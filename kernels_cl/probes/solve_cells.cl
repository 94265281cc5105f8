/// solve_cells.cl -- one solver on many segments by itself: what benchmarks time and tests compare.
/// No pass uses it.
#include "portable/solver.h"

/// roots [count]: the first change of inside of cubics [count], or -1 for none. Grid-stride.
kernel void solve_cells(global const Cubic *cubics, uint count, global float *roots) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    float s = -1.0f;
    if (!first_change(solver, cubics[i], &s)) s = -1.0f;
    roots[i] = s;
  }
}
