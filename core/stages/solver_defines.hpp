#pragma once
// A kernel that includes solver.h is built for one solver, so that the others cost it nothing.

#include <string>

#include "core/ocl/device.hpp"
#include "kernels_cl/portable/solver.h"

namespace isowave::core {

/// The macros such a kernel is built with.
inline ocl::Defines solver_defines(Solver solver) {
  return {{"ISO_SOLVER", std::to_string(solver.kind)},
          {"ISO_ROOT_STEPS", std::to_string(solver.max_steps)}};
}

}  // namespace isowave::core
