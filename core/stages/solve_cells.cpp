#include "core/stages/solve_cells.hpp"

#include <stdexcept>

#include "core/stages/solver_defines.hpp"

namespace isowave::core {

SolveCells::SolveCells(ocl::Device &device, Solver solver)
    : device_(&device), kernel_(device, solver_defines(solver)) {}

void SolveCells::operator()(const ocl::Buffer<Cubic> &cubics, ocl::Buffer<float> &roots) {
  if (roots.size() != cubics.size())
    throw std::invalid_argument("SolveCells: as many roots as cubics");
  kernel_(ocl::Range::strided(cubics.size(), ocl::kGroupSize, *device_), cubics,
          static_cast<uint>(cubics.size()), roots);
}

}  // namespace isowave::core
