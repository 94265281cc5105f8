#pragma once
// A solver by itself on many ray-cell segments, for benchmarks and tests; intersection uses the
// same headers.

#include "core/frame/solvers.hpp"
#include "kernels/solve_cells.hpp"

namespace isowave::core {

class SolveCells {
 public:
  SolveCells(ocl::Device &device, Solver solver);

  /// cubics  [n]
  /// roots   [n] the first s in [0,1] at which inside changes along each cubic, or -1
  /// Throws  std::invalid_argument: the sizes differ
  /// Waits   no
  void operator()(const ocl::Buffer<Cubic> &cubics, ocl::Buffer<float> &roots);

 private:
  ocl::Device *device_;
  ocl::Kernel<kernels::solve_cells> kernel_;
};

}  // namespace isowave::core
